//! Results of a reading that no asset, or hardly any, shows. The caller is asked about them, both for a period and
//! for a year.

use super::moments::{middle, moments, spread, sure_mean};
use super::words::{percent, percent_a_year};
use crate::control::request::annualised::compounded;

/// A standard deviation a period and a year, and a mean a year beyond chance. A reading above any of them needs a
/// person's confirmation.
const DOUBTFUL_DEVIATION: f64 = 0.3;
const DOUBTFUL_YEARLY_DEVIATION: f64 = 1.5;
const DOUBTFUL_YEARLY_MEAN: f64 = 1.0;
/// The least size of a log-return that may be a split or a slip: absolute, and in deviations of the others.
const JUMP: f64 = 0.5;
const JUMP_DEVIATIONS: f64 = 8.0;
/// A jump that loses half of its size within this many periods, but not in the first, is a real crash or rise and no
/// error.
const SOON: usize = 24;
/// Each number is near the one before if the steps deviate by less than this share of the numbers' deviation; for
/// returns the ratio is about 1.4.
const NEAR: f64 = 0.45;
const FEWEST_FOR_NEAR: usize = 12;
/// The range of numbers around 1, which may be the value that 1 grows to in a period.
const AROUND_ONE: std::ops::RangeInclusive<f64> = 0.5..=2.0;
const MIDDLE_AROUND_ONE: std::ops::RangeInclusive<f64> = 0.9..=1.1;

/// Returns the unusual mean and deviation, in words.
pub fn unusual_moments(simple: &[f64], periods: f64) -> Option<String> {
    let (mean, deviation) = moments(simple);
    let deviation_per_year = deviation * periods.sqrt();
    let mut found = Vec::new();
    if deviation > DOUBTFUL_DEVIATION {
        found.push(format!("a standard deviation of {} a period", percent(deviation)));
    } else if deviation_per_year > DOUBTFUL_YEARLY_DEVIATION {
        found.push(format!("a standard deviation of {} a year", percent(deviation_per_year)));
    }
    // Few numbers may prove nothing, not even a positive mean.
    if compounded(sure_mean(simple).max(0.0), periods) > DOUBTFUL_YEARLY_MEAN {
        found.push(format!("a mean of {} a year", percent_a_year(mean, periods)));
    }
    (!found.is_empty()).then(|| found.join(" and "))
}

/// Returns the first log-return that is far beyond the others and either changes the level for good or is undone by the
/// next one.
pub fn jump(logarithmic: &[f64]) -> Option<usize> {
    let least = JUMP.max(JUMP_DEVIATIONS * spread(logarithmic, middle(logarithmic)));
    let regains = |index: usize| {
        let mut level = 0.0;
        let mut later = logarithmic[index + 1..].iter().take(SOON).map(|value| {
            level -= value * logarithmic[index].signum();
            level
        });
        later.position(|level| level >= logarithmic[index].abs() / 2.0).is_some_and(|periods| periods > 0)
    };
    (0..logarithmic.len()).find(|&index| logarithmic[index].abs() > least && !regains(index))
}

/// Returns true if each number is near the one before, as in levels, cumulated gains and rates, but not in returns.
pub fn is_slow(values: &[f64]) -> bool {
    let steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let around = spread(values, middle(values));
    values.len() >= FEWEST_FOR_NEAR && around > 0.0 && spread(&steps, 0.0) < NEAR * around
}

/// Returns true if the numbers are around 1, as 1 + r is.
pub fn is_around_one(bulk: &[f64]) -> bool {
    bulk.iter().all(|value| AROUND_ONE.contains(value)) && MIDDLE_AROUND_ONE.contains(&middle(bulk))
}
