//! Uncertainty sets: the radius of the Wasserstein ball around an empirical law, or of the confidence region of a normal
//! law's estimates, rule by rule.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::specification::{Framework, RadiusRule, Specification};
use crate::numerics::bridge::{AbsoluteBridges, Quantile};
use crate::numerics::confidence_region;
use crate::numerics::empirical::EmpiricalDistribution;

/// Bridge matrices kept at once; live sessions of one policy pass through a horizon's worth of sample sizes.
const KEPT_MATRICES: usize = 24;

/// The radius rule of a specification, with its common random numbers.
pub struct UncertaintySets {
    rule: RadiusRule,
    seed: u64,
    /// False where the framework has no uncertainty (known law, plug-in).
    uncertain: bool,
    bridges: Mutex<HashMap<usize, Arc<AbsoluteBridges>>>,
}

impl UncertaintySets {
    pub fn new(specification: &Specification) -> Self {
        let uncertain = !matches!(specification.problem.framework, Framework::KnownLaw | Framework::PlugIn);
        let rule = specification.problem.radius_rule();
        UncertaintySets { rule, seed: specification.seed, uncertain, bridges: Mutex::new(HashMap::new()) }
    }

    /// True where laws of one sample size have different radii.
    pub fn varies(&self) -> bool {
        self.uncertain && matches!(self.rule, RadiusRule::Bridge { scale, .. } if scale > 0.0)
    }

    /// The bridges of sample size n, simulated on first use.
    fn bridges(&self, sample_size: usize, paths: usize) -> Arc<AbsoluteBridges> {
        let mut kept = self.bridges.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = kept.get(&sample_size) {
            return Arc::clone(found);
        }
        if kept.len() >= KEPT_MATRICES {
            // The smallest sample size is the one sessions leave behind.
            if let Some(smallest) = kept.keys().min().copied() {
                kept.remove(&smallest);
            }
        }
        let made = Arc::new(AbsoluteBridges::simulate(sample_size, paths, self.seed));
        kept.insert(sample_size, Arc::clone(&made));
        made
    }

    /// The bridge quantile of a law; `None` under other rules and frameworks.
    pub fn quantile(&self, law: &EmpiricalDistribution) -> Option<Quantile> {
        match self.rule {
            RadiusRule::Bridge { alpha, paths, .. } if self.uncertain => {
                Some(self.bridges(law.sample_size(), paths).quantile(law, alpha))
            }
            _ => None,
        }
    }

    /// Radius of the ball around `law`, in log-return; of the confidence region, in standard deviations of `law`.
    pub fn radius(&self, law: &EmpiricalDistribution) -> f64 {
        match self.rule {
            RadiusRule::Bridge { scale, .. } if self.uncertain => {
                scale * self.quantile(law).map_or(0.0, |found| found.value) / (law.sample_size() as f64).sqrt()
            }
            _ => self.radius_of_size(law.sample_size()),
        }
    }

    /// Radii of `law` with one more value, for every value in ascending `values`.
    pub fn radii_with(&self, law: &EmpiricalDistribution, values: &[f64]) -> Vec<f64> {
        let size = law.sample_size() + 1;
        match self.rule {
            RadiusRule::Bridge { alpha, paths, scale } if self.uncertain => {
                let quantiles = self.bridges(size, paths).quantiles_with(law.atoms(), values, alpha);
                quantiles.into_iter().map(|quantile| scale * quantile / (size as f64).sqrt()).collect()
            }
            _ => vec![self.radius_of_size(size); values.len()],
        }
    }

    /// The radius under the rules that look at the sample size alone.
    fn radius_of_size(&self, sample_size: usize) -> f64 {
        let size = sample_size as f64;
        match self.rule {
            RadiusRule::Bridge { .. } => 0.0,
            _ if !self.uncertain => 0.0,
            RadiusRule::Concentration { alpha, numerator, rate } => ((numerator / alpha).ln() / (rate * size)).sqrt(),
            RadiusRule::RootN { kappa } => kappa / size.sqrt(),
            RadiusRule::Fixed { radius } => radius,
            RadiusRule::ChiSquare { alpha } => confidence_region::radius(alpha, sample_size),
        }
    }
}
