//! Mean, deviation and their robust forms: a column is judged by the bulk of its numbers, and one odd cell among them does not
//! move the judgement.

use crate::numerics::student::student_two_sided;

/// The standard deviation of a normal law, in median distances from its middle.
const DEVIATIONS: f64 = 1.4826;
/// A mean lies so often within its error.
const CONFIDENCE: f64 = 0.95;
/// One number of so many may be odd.
const ODD_SHARE: usize = 20;
/// Of fewer numbers each counts.
const FEWEST: usize = 4;

/// Mean and sample standard deviation.
pub fn moments(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0).max(1.0)).sqrt())
}

/// Size of the mean beyond what chance gives so few numbers: its size less half its interval by Student's law. Of one number
/// chance gives any; of numbers that do not vary, nothing.
pub fn sure_mean(values: &[f64]) -> f64 {
    let (mean, deviation) = moments(values);
    let count = values.len() as f64;
    if count < 2.0 {
        return 0.0;
    }
    mean.abs() - student_two_sided(CONFIDENCE, count - 1.0) * deviation / count.sqrt()
}

/// The median; 0 of no numbers.
pub fn middle(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

/// A standard deviation around `centre` by the median distance, which half of the numbers do not move.
pub fn spread(values: &[f64], centre: f64) -> f64 {
    DEVIATIONS * middle(&values.iter().map(|value| (value - centre).abs()).collect::<Vec<f64>>())
}

/// The most numbers that may be odd among `count`.
pub fn odd(count: usize) -> usize {
    if count < FEWEST { 0 } else { 1 + count / ODD_SHARE }
}

/// The numbers without those that may be odd: the farthest from the middle.
pub fn bulk(values: &[f64]) -> Vec<f64> {
    let centre = middle(values);
    let mut kept = values.to_vec();
    kept.sort_by(|one, other| (one - centre).abs().total_cmp(&(other - centre).abs()));
    kept.truncate(values.len() - odd(values.len()));
    kept
}
