//! The mean, the deviation and their robust forms. A column is judged by the bulk of its numbers, so one odd cell does
//! not change the judgement.

use crate::numerics::law::student::student_two_sided;

/// The standard deviation of a normal law, in units of its median distance from the median.
const DEVIATIONS: f64 = 1.4826;
/// The probability with which the true mean lies within its error.
const CONFIDENCE: f64 = 0.95;
/// One number in this many may be odd.
const ODD_SHARE: usize = 20;
/// Below this count, no number may be odd.
const FEWEST: usize = 4;

/// Returns the mean and the sample standard deviation.
pub fn moments(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0).max(1.0)).sqrt())
}

/// Returns the size of the mean beyond what chance alone gives: its size less half its confidence interval by Student's
/// law. With one number chance explains any mean, so the result is 0; if the numbers do not vary, nothing is
/// subtracted.
pub fn sure_mean(values: &[f64]) -> f64 {
    let (mean, deviation) = moments(values);
    let count = values.len() as f64;
    if count < 2.0 {
        return 0.0;
    }
    mean.abs() - student_two_sided(CONFIDENCE, count - 1.0) * deviation / count.sqrt()
}

/// Returns the median, or 0 if there are no numbers.
pub fn middle(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

/// Returns a standard deviation around `centre` from the median distance, which up to half of the numbers cannot move.
pub fn spread(values: &[f64], centre: f64) -> f64 {
    DEVIATIONS * middle(&values.iter().map(|value| (value - centre).abs()).collect::<Vec<f64>>())
}

/// Returns how many of `count` numbers may be odd at most.
pub fn odd(count: usize) -> usize {
    if count < FEWEST { 0 } else { 1 + count / ODD_SHARE }
}

/// Returns the numbers without those that may be odd, which are the ones farthest from the median.
pub fn bulk(values: &[f64]) -> Vec<f64> {
    let centre = middle(values);
    let mut kept = values.to_vec();
    kept.sort_by(|one, other| (one - centre).abs().total_cmp(&(other - centre).abs()));
    kept.truncate(values.len() - odd(values.len()));
    kept
}
