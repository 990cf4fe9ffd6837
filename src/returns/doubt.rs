//! What a reading implies that no asset, or hardly any, has: whoever reads so is asked, in days as in years.

use super::moments::{middle, moments, spread, sure_mean};
use super::words::{percent, percent_a_year};
use crate::control::request::annualised::compounded;

/// A standard deviation a period and a year, and a mean a year beyond chance, above which a reading holds only where a person
/// confirms it.
const DOUBTFUL_DEVIATION: f64 = 0.3;
const DOUBTFUL_YEARLY_DEVIATION: f64 = 1.5;
const DOUBTFUL_YEARLY_MEAN: f64 = 1.0;
/// A log-return that may be a split or a slip: so large, and so many deviations of the others.
const JUMP: f64 = 0.5;
const JUMP_DEVIATIONS: f64 = 8.0;
/// Periods within which a crash that is none regains half of what it lost, from the second on.
const SOON: usize = 24;
/// Numbers of which each lies near the one before: returns differ by some 1.4 deviations.
const NEAR: f64 = 0.45;
const FEWEST_FOR_NEAR: usize = 12;
/// Numbers around 1, which may be what 1 becomes in a period.
const AROUND_ONE: std::ops::RangeInclusive<f64> = 0.5..=2.0;
const MIDDLE_AROUND_ONE: std::ops::RangeInclusive<f64> = 0.9..=1.1;

/// The mean and the deviation that are unusual, in words.
pub fn unusual_moments(simple: &[f64], periods: f64) -> Option<String> {
    let (mean, deviation) = moments(simple);
    let deviation_per_year = deviation * periods.sqrt();
    let mut found = Vec::new();
    if deviation > DOUBTFUL_DEVIATION {
        found.push(format!("a standard deviation of {} a period", percent(deviation)));
    } else if deviation_per_year > DOUBTFUL_YEARLY_DEVIATION {
        found.push(format!("a standard deviation of {} a year", percent(deviation_per_year)));
    }
    // Few numbers may be sure of nothing, not even of a positive mean.
    if compounded(sure_mean(simple).max(0.0), periods) > DOUBTFUL_YEARLY_MEAN {
        found.push(format!("a mean of {} a year", percent_a_year(mean, periods)));
    }
    (!found.is_empty()).then(|| found.join(" and "))
}

/// The first log-return that is far beyond the others and changes the level for good, or is undone by the next one.
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

/// Tells whether each number lies near the one before, as levels, cumulated gains and rates do and returns do not.
pub fn is_slow(values: &[f64]) -> bool {
    let steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let around = spread(values, middle(values));
    values.len() >= FEWEST_FOR_NEAR && around > 0.0 && spread(&steps, 0.0) < NEAR * around
}

/// Tells whether numbers lie around 1, as 1 + r does.
pub fn is_around_one(bulk: &[f64]) -> bool {
    bulk.iter().all(|value| AROUND_ONE.contains(value)) && MIDDLE_AROUND_ONE.contains(&middle(bulk))
}
