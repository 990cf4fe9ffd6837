//! The log-returns that the adversary may use.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::law::moments::CentralMoments;
use crate::numerics::statistics::summary::range;

/// Number of standard deviations on either side of the mean that `worst_seen` always includes, however calm the
/// extremes seen.
pub const LEAST_DEVIATIONS: f64 = 5.0;
/// Largest absolute log-return in a given support, and in any that follows from a record.
pub const LIMIT: f64 = 20.0;
/// Allowed multiples of the worst return seen.
pub const FACTOR: (f64, f64) = (1.0, 10.0);

/// A closed interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// The lower end.
    pub min: f64,
    /// The upper end.
    pub max: f64,
}

/// The log-returns that the laws in a ball may give mass to. They depend on the law, as its radius does: under
/// `worst_seen` they follow the returns seen so far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "rule", rename_all = "snake_case", deny_unknown_fields)]
pub enum Support {
    /// From `min(factor z_min, m - 5 s)` to `max(factor z_max, m + 5 s)`, with z_min and z_max the worst and the best
    /// log-return of the ball's centre, and m and s its mean and standard deviation. Never narrower than from z_min to
    /// z_max.
    WorstSeen {
        /// Multiple of the worst and the best log-return, 1 to 10. Default 2.
        #[serde(default = "default_factor")]
        factor: f64,
    },
    /// All log-returns, as in the paper.
    None {},
    /// The log-returns between two bounds, whatever returns are seen.
    Between {
        /// The lowest log-return, at least -20.
        min: f64,
        /// The highest log-return, at most 20.
        max: f64,
    },
}

impl Default for Support {
    fn default() -> Self {
        Support::WorstSeen { factor: default_factor() }
    }
}

/// The statistics of a law from which a support is computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawExtent {
    /// The lowest and the highest log-return.
    pub ends: [f64; 2],
    /// Mean of the log-returns, weighted by their masses.
    pub mean: f64,
    /// Variance of the log-returns, weighted by their masses.
    pub variance: f64,
}

impl LawExtent {
    /// Computes the extent of log-returns of equal mass.
    pub fn of(log_returns: impl Iterator<Item = f64> + Clone) -> Self {
        let count = log_returns.clone().count().max(1) as f64;
        let mean = log_returns.clone().sum::<f64>() / count;
        let variance = log_returns.clone().map(|z| (z - mean).powi(2)).sum::<f64>() / count;
        LawExtent { ends: range(log_returns), mean, variance }
    }

    /// Computes the extent of a law.
    pub fn of_law(law: &EmpiricalDistribution) -> Self {
        let moments = CentralMoments::of(law);
        let ends = [law.atoms().first(), law.atoms().last()].map(|end| end.copied().unwrap_or_default());
        LawExtent { ends, mean: moments.mean(), variance: moments.variance() }
    }
}

impl Support {
    /// Returns the interval around a law of this extent; `None` if every return is allowed. The extent is computed only
    /// if it is needed.
    /// Checked by: `tests::twice_the_worst_or_five_deviations`.
    pub fn around(self, law: impl FnOnce() -> LawExtent) -> Option<Interval> {
        match self {
            Support::WorstSeen { factor } => {
                let law = law();
                let [lowest, highest] = law.ends;
                let reach = LEAST_DEVIATIONS * law.variance.max(0.0).sqrt();
                let min = (factor * lowest).min(law.mean - reach).min(lowest).max(-LIMIT);
                let max = (factor * highest).max(law.mean + reach).max(highest).min(LIMIT);
                Some(Interval { min, max })
            }
            Support::None {} => None,
            Support::Between { min, max } => Some(Interval { min, max }),
        }
    }

    /// Returns the bounds that do not depend on the returns seen, if the support has them.
    pub fn given(self) -> Option<Interval> {
        match self {
            Support::Between { min, max } => Some(Interval { min, max }),
            Support::WorstSeen { .. } | Support::None {} => None,
        }
    }
}

fn default_factor() -> f64 {
    2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: the mean of -0.1, 0.02 and 0.05 is -0.01 and the variance is 0.0042.
    #[test]
    fn twice_the_worst_or_five_deviations() {
        let law = LawExtent::of([-0.1, 0.02, 0.05].into_iter());
        assert!((law.mean + 0.01).abs() < 1e-15 && (law.variance - 0.0042).abs() < 1e-15);
        let reach = 5.0 * 0.0042_f64.sqrt();
        let ends = |support: Support| support.around(|| law).map(|Interval { min, max }| [min, max]).unwrap();
        let [min, max] = ends(Support::default());
        assert!((min + 0.01 + reach).abs() < 1e-12 && (max + 0.01 - reach).abs() < 1e-12);
        let [min, max] = ends(Support::WorstSeen { factor: 8.0 });
        assert!((min + 0.8).abs() < 1e-12 && (max - 0.4).abs() < 1e-12);
        // A record that never fell, and one whose worst return is further from the mean than five deviations.
        let rose = Support::default().around(|| LawExtent::of([0.3, 0.30001].into_iter())).unwrap();
        assert!(rose.min < 0.3 && rose.min > 0.2999 && rose.max > 0.6);
        let crash = [-0.5].into_iter().chain((0..99).map(|k| if k % 2 == 0 { 0.01 } else { -0.01 }));
        assert!((Support::default().around(|| LawExtent::of(crash)).unwrap().min + 1.0).abs() < 1e-12);
        assert_eq!(Support::None {}.around(|| law), None);
        assert_eq!(ends(Support::Between { min: -0.3, max: 0.2 }), [-0.3, 0.2]);
    }
}
