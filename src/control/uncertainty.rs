//! Uncertainty sets: the radius of the Wasserstein ball around an empirical law, or of the confidence region of a normal
//! law's estimates, rule by rule.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::specification::{Framework, RadiusRule, Specification};
use crate::numerics::bridge::{AbsoluteBridges, Quantile, UpperQuantile};
use crate::numerics::confidence_region;
use crate::numerics::empirical::EmpiricalDistribution;

/// Sample sizes whose bridges are kept at once; live sessions of one policy pass through a horizon's worth of them.
const KEPT_SIZES: usize = 24;
/// Values in the bridges kept, where that many sizes have more: 256 MB, but two sizes in any case.
const KEPT_VALUES: usize = 1 << 25;

/// The radius rule of a specification, with its common random numbers.
pub struct UncertaintySets {
    rule: RadiusRule,
    seed: u64,
    /// False where the framework has no uncertainty (known law, plug-in).
    uncertain: bool,
    /// Sample size at the last step.
    last_size: usize,
    /// The quantile under the bridge rule.
    estimator: UpperQuantile,
    bridges: Mutex<HashMap<usize, Arc<Bridges>>>,
}

/// The common random numbers of one sample size.
struct Bridges {
    now: AbsoluteBridges,
    /// Of the mean statistic one return later; `None` where no step comes after.
    ahead: Option<AbsoluteBridges>,
}

/// The radius of a law and what it tends to be one return later.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Radii {
    pub radius: f64,
    /// Of the mean statistic over the laws with one value of this law twice; the radius itself where no step comes after.
    pub radius_ahead: f64,
}

impl UncertaintySets {
    pub fn new(specification: &Specification) -> Self {
        let uncertain = !matches!(specification.problem.framework, Framework::KnownLaw | Framework::PlugIn);
        let rule = specification.problem.radius_rule();
        let estimator = match rule {
            RadiusRule::Bridge { alpha, paths, .. } => UpperQuantile::new(paths, alpha),
            _ => UpperQuantile::new(1, 0.5),
        };
        let last_size = specification.problem.history.len() + specification.problem.horizon - 1;
        let bridges = Mutex::new(HashMap::new());
        UncertaintySets { rule, seed: specification.seed, uncertain, last_size, estimator, bridges }
    }

    /// True where laws of one sample size have different radii.
    pub fn varies(&self) -> bool {
        self.uncertain && matches!(self.rule, RadiusRule::Bridge { scale, .. } if scale > 0.0)
    }

    /// The bridges of sample size n, simulated on first use.
    fn bridges(&self, sample_size: usize, paths: usize) -> Arc<Bridges> {
        let mut kept = self.bridges.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = kept.get(&sample_size) {
            return Arc::clone(found);
        }
        let room = (KEPT_VALUES / (2 * sample_size * paths)).clamp(2, KEPT_SIZES);
        while kept.len() >= room {
            // The smallest sample size is the one sessions leave behind.
            let Some(smallest) = kept.keys().min().copied() else { break };
            kept.remove(&smallest);
        }
        let simulate = |size| AbsoluteBridges::simulate(size, paths, self.seed);
        let ahead = (sample_size < self.last_size).then(|| simulate(sample_size + 1).one_ahead());
        let made = Arc::new(Bridges { now: simulate(sample_size), ahead });
        kept.insert(sample_size, Arc::clone(&made));
        made
    }

    /// The bridge quantile of a law; `None` under other rules and frameworks.
    pub fn quantile(&self, law: &EmpiricalDistribution) -> Option<Quantile> {
        match self.rule {
            RadiusRule::Bridge { paths, .. } if self.uncertain => {
                Some(self.bridges(law.sample_size(), paths).now.quantile_with_error(law, &self.estimator))
            }
            _ => None,
        }
    }

    /// Radius of the ball around `law`, in log-return; of the confidence region, in standard deviations of `law`.
    pub fn radius(&self, law: &EmpiricalDistribution) -> f64 {
        match self.rule {
            RadiusRule::Bridge { paths, scale, .. } if self.uncertain => {
                let bridges = self.bridges(law.sample_size(), paths);
                radius(scale, bridges.now.quantile(law, &self.estimator), law.sample_size())
            }
            _ => self.radius_of_size(law.sample_size()),
        }
    }

    /// The radius of `law`, and what it tends to be one return later.
    pub fn radii(&self, law: &EmpiricalDistribution) -> Radii {
        let size = law.sample_size();
        match self.rule {
            RadiusRule::Bridge { paths, scale, .. } if self.uncertain => {
                let bridges = self.bridges(size, paths);
                let radius_now = radius(scale, bridges.now.quantile(law, &self.estimator), size);
                let ahead = bridges.ahead.as_ref().map(|ahead| ahead.quantile(law, &self.estimator));
                let radius_ahead = ahead.map_or(radius_now, |quantile| radius(scale, quantile, size + 1));
                Radii { radius: radius_now, radius_ahead }
            }
            _ => Radii { radius: self.radius_of_size(size), radius_ahead: self.radius_of_size(size) },
        }
    }

    /// The same for `law` with one more value, for every value in ascending `values`.
    pub fn radii_with(&self, law: &EmpiricalDistribution, values: &[f64]) -> Vec<Radii> {
        let size = law.sample_size() + 1;
        match self.rule {
            RadiusRule::Bridge { paths, scale, .. } if self.uncertain => {
                let bridges = self.bridges(size, paths);
                let quantiles = |bridges: &AbsoluteBridges, size: usize| -> Vec<f64> {
                    let found = bridges.quantiles_with(law.atoms(), values, &self.estimator);
                    found.into_iter().map(|quantile| radius(scale, quantile, size)).collect()
                };
                let now = quantiles(&bridges.now, size);
                let ahead = bridges.ahead.as_ref().map_or_else(|| now.clone(), |ahead| quantiles(ahead, size + 1));
                now.into_iter().zip(ahead).map(|(radius, radius_ahead)| Radii { radius, radius_ahead }).collect()
            }
            _ => {
                let radius = self.radius_of_size(size);
                vec![Radii { radius, radius_ahead: radius }; values.len()]
            }
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

fn radius(scale: f64, quantile: f64, sample_size: usize) -> f64 {
    scale * quantile / (sample_size as f64).sqrt()
}
