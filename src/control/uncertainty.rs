//! Uncertainty sets: the radius of the Wasserstein ball around an empirical law, or of the confidence region of a normal
//! law's estimates, rule by rule.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use super::framework::Framework;
use super::specification::{RadiusRule, Specification};
use crate::numerics::bridge::{Quantile, Statistic};
use crate::numerics::bridge_paths::{AbsoluteBridges, GRADED_FROM};
use crate::numerics::confidence_region;
use crate::numerics::empirical::EmpiricalDistribution;

/// Sample sizes whose bridges are kept at once; live sessions of one policy pass through a horizon's worth of them.
const KEPT_SIZES: usize = 128;
/// Values in the bridges kept, where that many sizes have more: 256 MB, but [`FEWEST_SIZES`] in any case.
const KEPT_VALUES: usize = 1 << 25;
/// A robust step looks at its own sample size and the next.
const FEWEST_SIZES: usize = 2;

/// The radius rule of a specification, with its common random numbers.
pub struct UncertaintySets {
    rule: RadiusRule,
    seed: u64,
    /// False where the framework has no uncertainty (known law, plug-in).
    uncertain: bool,
    /// Sample size at the last step.
    last_size: usize,
    /// The common random numbers by sample size; all large ones share those of [`GRADED_FROM`].
    bridges: Mutex<HashMap<usize, Arc<Bridges>>>,
}

/// Common random numbers, simulated on first use.
type Bridges = OnceLock<Arc<AbsoluteBridges>>;

/// The uncertainty set of a law: its radius, and the quantile behind it under the bridge rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measure {
    pub radius: f64,
    pub quantile: Option<Quantile>,
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
        let last_size = specification.problem.history.len() + specification.problem.horizon - 1;
        let bridges = Mutex::new(HashMap::new());
        let seed = specification.seed;
        UncertaintySets { rule, seed, uncertain, last_size, bridges }
    }

    /// True where laws of one sample size have different radii.
    pub fn varies(&self) -> bool {
        self.uncertain && matches!(self.rule, RadiusRule::Bridge { scale, .. } if scale > 0.0)
    }

    /// The bridges of sample size n. None is simulated under the lock: who asks for one size does not wait for another.
    fn bridges(&self, sample_size: usize, paths: usize) -> Arc<AbsoluteBridges> {
        let key = sample_size.min(GRADED_FROM);
        let found = {
            let mut kept = self.kept();
            while kept.len() >= room(key, paths) && !kept.contains_key(&key) {
                // Sessions go up and trainings go down, a size at a time.
                let Some(farthest) = kept.keys().max_by_key(|size| size.abs_diff(key)).copied() else { break };
                kept.remove(&farthest);
            }
            Arc::clone(kept.entry(key).or_default())
        };
        let simulate = || match key {
            GRADED_FROM => AbsoluteBridges::graded(paths, self.seed),
            _ => AbsoluteBridges::simulate(sample_size, paths, self.seed),
        };
        Arc::clone(found.get_or_init(|| Arc::new(simulate())))
    }

    fn kept(&self) -> MutexGuard<'_, HashMap<usize, Arc<Bridges>>> {
        self.bridges.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What measuring laws of `sample_size` reads: its bridges, and those of the next where a step comes after.
    fn sizes(&self, sample_size: usize) -> impl Iterator<Item = usize> {
        [sample_size, sample_size + 1].into_iter().take(if sample_size < self.last_size { 2 } else { 1 })
    }

    /// Numbers read to measure a law of this size, or `None` where its bridges are yet to be simulated.
    pub fn cost(&self, sample_size: usize) -> Option<usize> {
        match self.rule {
            RadiusRule::Bridge { paths, .. } if self.uncertain => {
                let kept = self.kept();
                let ready = |size: usize| kept.get(&size.min(GRADED_FROM)).is_some_and(|found| found.get().is_some());
                self.sizes(sample_size).all(ready).then_some(2 * sample_size.min(GRADED_FROM) * paths)
            }
            _ => Some(sample_size),
        }
    }

    /// Simulates what measuring laws of this size takes, where that is yet to be done.
    pub fn prepare(&self, sample_size: usize) {
        if let RadiusRule::Bridge { paths, .. } = self.rule
            && self.uncertain
        {
            self.sizes(sample_size).for_each(|size| drop(self.bridges(size, paths)));
        }
    }

    /// The bridge quantile of a law; `None` under other rules and frameworks.
    pub fn quantile(&self, law: &EmpiricalDistribution) -> Option<Quantile> {
        self.measure(law).quantile
    }

    /// Radius of the ball around `law`, in log-return; of the confidence region, in standard deviations of `law`.
    pub fn radius(&self, law: &EmpiricalDistribution) -> f64 {
        let size = law.sample_size();
        match self.rule {
            RadiusRule::Bridge { alpha, paths, scale } if self.uncertain => {
                let bridges = self.bridges(size, paths);
                radius(scale, bridges.bridge_quantile(law, Statistic::Now, alpha), size)
            }
            _ => self.radius_of_size(size),
        }
    }

    /// The radius of `law` and what it is made of.
    pub fn measure(&self, law: &EmpiricalDistribution) -> Measure {
        let size = law.sample_size();
        match self.rule {
            RadiusRule::Bridge { alpha, paths, scale } if self.uncertain => {
                let quantile = self.bridges(size, paths).bridge_quantile_with_error(law, alpha);
                Measure { radius: radius(scale, quantile.value, size), quantile: Some(quantile) }
            }
            _ => Measure { radius: self.radius_of_size(size), quantile: None },
        }
    }

    /// The radius of `law`, which is known, and what it tends to be one return later.
    pub fn radii(&self, law: &EmpiricalDistribution, known: f64) -> Radii {
        let size = law.sample_size();
        let radius_ahead = match self.rule {
            RadiusRule::Bridge { .. } if self.uncertain && size >= self.last_size => known,
            RadiusRule::Bridge { alpha, paths, scale } if self.uncertain => {
                let bridges = self.bridges(size + 1, paths);
                radius(scale, bridges.bridge_quantile(law, Statistic::OneLater, alpha), size + 1)
            }
            _ => self.radius_of_size(size),
        };
        Radii { radius: known, radius_ahead }
    }

    /// The same for `law` with one more value, for every value in ascending `values`.
    pub fn radii_with(&self, law: &EmpiricalDistribution, values: &[f64]) -> Vec<Radii> {
        let size = law.sample_size() + 1;
        match self.rule {
            RadiusRule::Bridge { alpha, paths, scale } if self.uncertain => {
                let quantiles = |which, size| {
                    let found = self.bridges(size, paths).bridge_quantiles_with(law.atoms(), values, which, alpha);
                    found.into_iter().map(|quantile| radius(scale, quantile, size)).collect::<Vec<f64>>()
                };
                let now = quantiles(Statistic::Now, size);
                let later = if size < self.last_size { quantiles(Statistic::OneLater, size + 1) } else { now.clone() };
                now.into_iter().zip(later).map(|(radius, radius_ahead)| Radii { radius, radius_ahead }).collect()
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

/// Sample sizes kept where one of them is `sample_size`.
fn room(sample_size: usize, paths: usize) -> usize {
    (KEPT_VALUES / (sample_size * paths)).clamp(FEWEST_SIZES, KEPT_SIZES)
}

fn radius(scale: f64, quantile: f64, sample_size: usize) -> f64 {
    scale * quantile / (sample_size as f64).sqrt()
}
