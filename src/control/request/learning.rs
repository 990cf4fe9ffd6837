//! Weights of older returns in the learned law.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds};
use crate::numerics::law::empirical::{EmpiricalDistribution, weights};

/// Allowed half-lives: the number of periods in which a return's weight halves. Below 1 the newest return would
/// outweigh all others together, however many there are: at 1 the effective sample size is at most 3. Above the
/// largest, weights are equal up to rounding.
pub const HALF_LIFE: (f64, f64) = (1.0, 1e15);

/// Smallest standard deviation of a record. Two observations closer than this count as one value.
pub const SMALLEST_DEVIATION: f64 = 1e-7;

/// Weight of a return in the learned law, for the history and for later returns alike. Default: `equal`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Learning {
    /// All returns have the same weight.
    Equal {},
    /// A return has half the weight of one that is `half_life` periods newer: the law forgets the distant past.
    Decay {
        /// Half-life, in periods, 1 to 1e15.
        half_life: f64,
    },
}

impl Bounded for Learning {
    const BOUNDS: &'static [FieldBounds] = &[("half_life", ValueBounds::number(HALF_LIFE))];
}

impl Default for Learning {
    fn default() -> Self {
        Learning::Equal {}
    }
}

impl Learning {
    /// Checks that a record, named `field` in messages, varies.
    ///
    /// # Errors
    /// Its standard deviation, with the weights of learning, is too small.
    pub fn check_deviation(self, field: &str, record: &[f64]) -> Result<(), FieldError> {
        if self.deviation(record) >= SMALLEST_DEVIATION {
            return Ok(());
        }
        let rule = format!(
            "must vary: with the weights of learning, its standard deviation must be at least {SMALLEST_DEVIATION:e}"
        );
        Err(FieldError::new(
            field,
            format!("{} values near {}", record.len(), record.first().copied().unwrap_or_default()),
            rule,
        ))
    }

    /// Checks the half-life.
    ///
    /// # Errors
    /// It is outside [`HALF_LIFE`].
    pub fn check(self) -> Result<(), FieldError> {
        let (least, most) = HALF_LIFE;
        match self {
            Learning::Decay { half_life } if !(least..=most).contains(&half_life) => {
                let rule = format!("must be a number in [{least}, {most}]");
                Err(FieldError::new("problem.learning.half_life", half_life, rule))
            }
            _ => Ok(()),
        }
    }

    /// Returns true if older returns weigh less.
    pub fn decays(self) -> bool {
        self != Learning::Equal {}
    }

    /// Returns d, the fraction of a return's weight that is left one return later: `2^(-1 / half_life)`.
    pub fn retention(self) -> f64 {
        match self {
            Learning::Equal {} => 1.0,
            Learning::Decay { half_life } => 0.5_f64.powf(half_life.recip()),
        }
    }

    /// Returns the law learned from `record`, oldest first.
    pub fn law(self, record: &[f64]) -> EmpiricalDistribution {
        EmpiricalDistribution::decaying(record, self.retention())
    }

    /// Returns the weights of a record of `count` values, oldest first; the newest weighs 1.
    pub fn weights(self, count: usize) -> Vec<f64> {
        weights(count, self.retention())
    }

    /// Returns the weighted mean of `value` over a record, oldest first.
    pub fn mean(self, record: &[f64], value: impl Fn(f64) -> f64) -> f64 {
        let weights = self.weights(record.len());
        let sum = record.iter().zip(&weights).map(|(&log_return, weight)| weight * value(log_return)).sum::<f64>();
        sum / weights.iter().sum::<f64>()
    }

    /// Returns the weighted standard deviation of a record, oldest first.
    pub fn deviation(self, record: &[f64]) -> f64 {
        let mean = self.mean(record, |log_return| log_return);
        self.mean(record, |log_return| (log_return - mean).powi(2)).sqrt()
    }

    /// Returns the [`EmpiricalDistribution::effective_size`] of the law of `count` returns:
    ///
    ///   tanh(n b / 2) / tanh(b / 2),   b = ln(2) / half_life.
    pub fn effective_size(self, count: usize) -> f64 {
        self.largest_effective_size().map_or(count as f64, |largest| largest * self.settled(count))
    }

    /// Returns the limit of the effective sample size as returns accumulate, `1 / tanh(b / 2) = (1 + d) / (1 - d)`;
    /// `None` if it grows for ever.
    pub fn largest_effective_size(self) -> Option<f64> {
        match self {
            Learning::Equal {} => None,
            Learning::Decay { half_life } => Some((0.5 * std::f64::consts::LN_2 / half_life).tanh().recip()),
        }
    }

    /// Returns the effective sample size of `count` returns over its limit: `tanh(n b / 2)`; 0 if it grows for ever.
    fn settled(self, count: usize) -> f64 {
        match self {
            Learning::Equal {} => 0.0,
            Learning::Decay { half_life } => (0.5 * std::f64::consts::LN_2 / half_life * count as f64).tanh(),
        }
    }

    /// Returns the number of returns from which the effective sample size is at least `share` of its limit; `None` if
    /// it grows for ever.
    pub fn settled_from(self, share: f64) -> Option<usize> {
        match self {
            Learning::Equal {} => None,
            Learning::Decay { half_life } => {
                Some((2.0 * half_life * share.atanh() / std::f64::consts::LN_2).ceil() as usize)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_effective_size_has_its_closed_form() {
        for half_life in [1.0, 3.0, 24.0, 500.0, 1e9] {
            let learning = Learning::Decay { half_life };
            for count in [2, 30, 240] {
                let record: Vec<f64> = (0..count).map(|k| f64::from(k * 7 % 11)).collect();
                let (found, expected) = (learning.law(&record).effective_size(), learning.effective_size(record.len()));
                // Two sums of as many terms, each rounded.
                assert!((found / expected - 1.0).abs() < 1e-13, "{half_life} {count}: {found} against {expected}");
            }
            let d = learning.retention();
            let largest = learning.largest_effective_size().unwrap();
            // 1 - d loses as many digits as the half-life has.
            assert!(((1.0 + d) / (1.0 - d) / largest - 1.0).abs() < 1e-15 * half_life.max(10.0));
        }
        assert_eq!(Learning::Equal {}.effective_size(17), 17.0);
    }

    #[test]
    fn a_return_weighs_half_of_one_that_is_a_half_life_newer() {
        let weights = Learning::Decay { half_life: 4.0 }.weights(9);
        // Eight roundings.
        assert!((weights[0] - 0.25).abs() < 1e-15 && (weights[4] - 0.5).abs() < 1e-15 && weights[8] == 1.0);
        // By hand: (1/4 x 1 + 1/2 x 2 + 1 x 4) / (7/4).
        let mean = Learning::Decay { half_life: 1.0 }.mean(&[1.0, 2.0, 4.0], |value| value);
        assert!((mean - 3.0).abs() < 1e-15, "{mean}");
        assert_eq!(Learning::Equal {}.mean(&[1.0, 2.0, 6.0], |value| value), 3.0);
    }
}
