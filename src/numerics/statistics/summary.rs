//! Order statistics, and estimates with their intervals from clustered samples.

use serde::{Deserialize, Serialize};
use statrs::function::beta::checked_beta_reg;

use crate::numerics::law::student::student_two_sided;

/// Returns the order statistic below which a share of `values` lies; NaN if there are no values. Cost O(n ln n).
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let index = (share * sorted.len() as f64) as usize;
    sorted.get(index.min(sorted.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}

/// Returns the least and the largest value; infinities in the wrong order if there is none.
pub fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

/// Returns the quantile of ascending, non-empty `sorted` by linear interpolation of order statistics (Hyndman and Fan,
/// type 7).
pub fn interpolated_quantile(sorted: &[f64], share: f64) -> f64 {
    let position = (sorted.len() - 1) as f64 * share.clamp(0.0, 1.0);
    let index = (position as usize).min(sorted.len() - 1);
    let next = sorted[(index + 1).min(sorted.len() - 1)];
    sorted[index] + (position - index as f64) * (next - sorted[index])
}

/// Returns the interval at `level` for a probability whose event occurred in a share of `count` independent trials.
/// The counts need not be whole.
///
///   [B(tail; share count, count - share count + 1), B(1 - tail; share count + 1, count - share count)],
///   tail = (1 - level) / 2.
///
/// B(p; a, b) is the quantile of the beta law. Coverage is at least `level`. The interval does not shrink to a point if
/// the share is 0 or 1. Source: Clopper and Pearson (1934), Biometrika 26; for counts that are not whole Korn and
/// Graubard (1998), Surv. Methodol. 24.
pub fn share_interval(share: f64, count: f64, level: f64) -> [f64; 2] {
    let (seen, missed, tail) = (share * count, (1.0 - share) * count, 0.5 * (1.0 - level));
    let low = if seen > 0.0 { beta_quantile(tail, seen, missed + 1.0) } else { 0.0 };
    let high = if missed > 0.0 { beta_quantile(1.0 - tail, seen + 1.0, missed) } else { 1.0 };
    [low, high]
}

/// Returns the quantile of the beta law, by bisection.
fn beta_quantile(probability: f64, a: f64, b: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if checked_beta_reg(a, b, middle).is_ok_and(|below| below < probability) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// A figure and the interval around it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The estimate itself.
    pub value: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end of its interval.
    pub high: f64,
}

impl Estimate {
    /// Applies an increasing function to the value and both ends.
    pub fn mapped(self, increasing: impl Fn(f64) -> f64) -> Estimate {
        Estimate { value: increasing(self.value), low: increasing(self.low), high: increasing(self.high) }
    }
}

/// The structure of a sample: `values` come in groups of `group` values, one after another. The groups are independent,
/// but values within a group are not. A single group is the exception: its values are independent, and results apply to
/// that group alone.
#[derive(Debug, Clone, Copy)]
pub struct Clustered {
    group: usize,
    /// Half-width of an interval divided by the standard error.
    spread: f64,
    level: f64,
    /// Values in each sampling unit.
    unit: usize,
}

impl Clustered {
    /// Describes `count` groups of `group` values, with intervals at `level`. Needs at least two sampling units.
    pub fn new(count: usize, group: usize, level: f64) -> Self {
        let (units, unit) = if count > 1 { (count, group) } else { (group, 1) };
        Clustered { group, spread: student_two_sided(level, units as f64 - 1.0), level, unit }
    }

    /// Returns the mean m of the unit means m_k, with half-width t sqrt(sum_k (m_k - m)^2 / (K (K - 1))).
    pub fn mean(&self, values: &[f64]) -> Estimate {
        let mean_of = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let means: Vec<f64> = values.chunks(self.unit).map(mean_of).collect();
        let (value, units) = (mean_of(&means), means.len() as f64);
        let squares: f64 = means.iter().map(|mean| (mean - value).powi(2)).sum();
        let reach = self.spread * (squares / (units * (units - 1.0))).sqrt();
        Estimate { value, low: value - reach, high: value + reach }
    }

    /// Returns the share of values for which `holds`, with the interval of an equally informative number of independent
    /// trials. That number is p (1 - p) over the squared standard error of the share, at most n, and n if all or none
    /// hold; times (t_(n-1) / t_(K-1))^2.
    /// Source: Korn and Graubard (1998), Confidence intervals for proportions with small expected number of positive
    /// counts estimated from survey data, Surv. Methodol. 24.
    pub fn share<T>(&self, values: &[T], holds: impl Fn(&T) -> bool) -> Estimate {
        let shares: Vec<f64> = values.iter().map(|value| if holds(value) { 1.0 } else { 0.0 }).collect();
        let found = self.mean(&shares);
        let (size, share) = (shares.len() as f64, found.value);
        let error = (found.high - share) / self.spread;
        let independent = if error > 0.0 { (share * (1.0 - share) / (error * error)).min(size) } else { size };
        let fewer = (student_two_sided(self.level, size - 1.0) / self.spread).powi(2);
        let [low, high] = share_interval(share, independent * fewer, self.level);
        Estimate { value: share, low, high }
    }

    /// Returns the mean squared deviation of all values from their mean.
    pub fn variance(&self, values: &[f64]) -> Estimate {
        let mean = self.mean(values).value;
        let squares: Vec<f64> = values.iter().map(|value| (value - mean).powi(2)).collect();
        let found = self.mean(&squares);
        Estimate { low: found.low.max(0.0), ..found }
    }

    /// Returns the quantile at `share`. Its interval reaches to the quantiles at `share` minus and plus the half-widths
    /// for the share of values below it. `sorted` holds `values` in ascending order. Source: Woodruff (1952), J. Amer.
    /// Statist. Assoc. 47.
    pub fn quantile(&self, values: &[f64], sorted: &[f64], share: f64) -> Estimate {
        let value = interpolated_quantile(sorted, share);
        let below: Vec<f64> = values.iter().map(|&other| if other <= value { 1.0 } else { 0.0 }).collect();
        let found = self.mean(&below);
        let (down, up) = (found.value - found.low, found.high - found.value);
        let at = |share| interpolated_quantile(sorted, share);
        Estimate { value, low: at(share - down), high: at(share + up) }
    }

    /// Returns the mean of the lowest share of all values; the value at the edge counts in part, to make the share
    /// exact:
    ///
    ///   mean of q - (q - x)^+ / share,   q the quantile at the share.
    ///
    /// Source: Rockafellar and Uryasev (2000), J. Risk 2.
    pub fn lowest(&self, values: &[f64], share: f64) -> Estimate {
        let edge = quantile(values, share);
        self.mean(&values.iter().map(|value| edge - (edge - value).max(0.0) / share).collect::<Vec<f64>>())
    }

    /// Returns the largest value of a group, averaged over groups. It has no interval, because a sample says almost
    /// nothing about values beyond it.
    pub fn largest(&self, values: &[f64]) -> f64 {
        let of_group = |group: &[f64]| group.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        values.chunks(self.group).map(of_group).sum::<f64>() / (values.len() as f64 / self.group as f64)
    }

    /// Returns the smallest value of a group, averaged over groups; see [`Self::largest`].
    pub fn smallest(&self, values: &[f64]) -> f64 {
        -self.largest(&values.iter().map(|value| -value).collect::<Vec<f64>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four groups of five.
    const VALUES: [f64; 20] =
        [0.0, 1.0, 1.1, 0.3, 0.9, 0.6, 1.7, 1.9, 1.2, 1.9, 1.7, 0.6, 0.9, 0.3, 1.1, 1.0, 0.0, 0.4, 2.2, 0.8];

    fn assert_estimate(found: Estimate, expected: [f64; 3]) {
        for (found, expected) in [found.value, found.low, found.high].into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{found} against {expected}");
        }
    }

    /// Expected values are from numpy and scipy.
    #[test]
    fn clustered_estimates_are_those_of_numpy() {
        let sample = Clustered::new(4, 5, 0.95);
        assert_estimate(sample.mean(&VALUES), [0.98, 0.4392962226601318, 1.5207037773398682]);
        assert_estimate(sample.variance(&VALUES), [0.3906, 0.1398822021839391, 0.641317797816061]);
        let mut sorted = VALUES;
        sorted.sort_by(f64::total_cmp);
        assert_estimate(sample.quantile(&VALUES, &sorted, 0.9), [1.9, 1.2383380049902388, 2.2]);
        assert_estimate(sample.quantile(&VALUES, &sorted, 0.2), [0.38, 0.0, 0.9]);
    }

    /// The three lowest of thirty are 0 to 2. An eighth of twenty is the two lowest and half of the third.
    #[test]
    fn the_lowest_share_is_averaged_and_its_edge_counted_in_part() {
        let values: Vec<f64> = (0..30).map(|index| f64::from((7 * index) % 30)).collect();
        assert!((Clustered::new(1, 30, 0.9).lowest(&values, 0.1).value - 1.0).abs() < 1e-12);
        let sample = Clustered::new(4, 5, 0.95);
        let found = sample.lowest(&VALUES, 0.125);
        assert!((found.value - 0.5 * 0.3 / 2.5).abs() < 1e-12 && found.low < found.value, "{found:?}");
        assert!((sample.lowest(&VALUES, 1.0).value - sample.mean(&VALUES).value).abs() < 1e-12);
    }

    /// R: binom.test(3, 20, conf.level = 0.9), and the rule of three.
    #[test]
    fn shares_have_the_interval_of_clopper_and_pearson() {
        let [low, high] = share_interval(0.15, 20.0, 0.9);
        assert!((low - 0.042_169).abs() < 1e-5 && (high - 0.343_664).abs() < 1e-5, "{low} {high}");
        assert_eq!(share_interval(0.0, 100.0, 0.9)[0], 0.0);
        assert!((share_interval(0.0, 100.0, 0.9)[1] - (1.0 - 0.05_f64.powf(0.01))).abs() < 1e-12);
        assert_eq!(share_interval(1.0, 100.0, 0.9)[1], 1.0);
    }

    #[test]
    fn a_single_group_is_a_sample_of_its_values() {
        let found = Clustered::new(1, 20, 0.8).mean(&VALUES);
        assert_estimate(found, [0.98, 0.98 - 0.19036999627677625, 0.98 + 0.19036999627677625]);
    }

    #[test]
    fn the_largest_is_that_of_a_group_averaged() {
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(
            [Clustered::new(1, 100, 0.95).largest(&values), Clustered::new(1, 100, 0.95).smallest(&values)],
            [100.0, 1.0]
        );
        assert_eq!(Clustered::new(2, 50, 0.95).largest(&values), 75.0);
    }

    /// The shares are 0.3 % of 100 values, which most samples do not show at all; 30 %; and 3 % in whole groups, where
    /// one group in ten has a share of 30 %.
    #[test]
    fn intervals_of_shares_hold_the_truth_at_least_as_often_as_they_say() {
        use rand::RngExt;
        let mut generator = crate::numerics::machine::streams::stream(2, "test", 0, 0);
        let cases = [(1, 100, 0.003, 1.0), (1, 100, 0.3, 1.0), (30, 20, 0.3, 0.1)];
        for (groups, group, chance, among) in cases {
            let sample = Clustered::new(groups, group, 0.9);
            let mut held = 0;
            for _ in 0..500 {
                let mut values = Vec::new();
                for _ in 0..groups {
                    let chance = if generator.random::<f64>() < among { chance } else { 0.0 };
                    values.extend((0..group).map(|_| generator.random::<f64>() < chance));
                }
                let found = sample.share(&values, |hit| *hit);
                held += i32::from(found.low <= chance * among && chance * among <= found.high);
            }
            assert!(held >= 435, "{groups} {chance}: {held} of 500");
        }
    }

    #[test]
    fn intervals_hold_the_truth_as_often_as_they_say() {
        use rand::RngExt;
        // Groups of 20 uniforms around a group's own shift: mean 1, the 0.9 quantile by simulation below.
        let mut generator = crate::numerics::machine::streams::stream(1, "test", 0, 0);
        let sample = Clustered::new(30, 20, 0.9);
        let mut held = [0; 2];
        for _ in 0..1000 {
            let group = |_| {
                let shift: f64 = generator.random();
                (0..20).map(|_| shift + generator.random::<f64>()).collect::<Vec<f64>>()
            };
            let values: Vec<f64> = (0..30).flat_map(group).collect();
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            // The sum of two uniforms exceeds 2 - sqrt(0.2) with probability 0.1.
            let truths = [1.0, 2.0 - 0.2_f64.sqrt()];
            let found = [sample.mean(&values), sample.quantile(&values, &sorted, 0.9)];
            for ((held, found), truth) in held.iter_mut().zip(found).zip(truths) {
                *held += i32::from(found.low <= truth && truth <= found.high);
            }
        }
        // Four standard errors of 1000 trials are 0.038; quantile intervals err a little on the wide side.
        assert!(held.iter().all(|&held| (860..=960).contains(&held)), "{held:?}");
    }
}
