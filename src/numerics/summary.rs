//! Order statistics, and estimates with their intervals from clustered samples.

use serde::{Deserialize, Serialize};

use super::student::student_two_sided;

/// The order statistic below which a share of `values` lies; not a number where there is none. Cost O(n ln n).
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let index = (share * sorted.len() as f64) as usize;
    sorted.get(index.min(sorted.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}

/// The quantile by linear interpolation of order statistics (Hyndman and Fan, type 7) of ascending, non-empty `sorted`.
pub fn interpolated_quantile(sorted: &[f64], share: f64) -> f64 {
    let position = (sorted.len() - 1) as f64 * share.clamp(0.0, 1.0);
    let index = (position as usize).min(sorted.len() - 1);
    let next = sorted[(index + 1).min(sorted.len() - 1)];
    sorted[index] + (position - index as f64) * (next - sorted[index])
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
    /// Both ends and the value through an increasing function.
    pub fn mapped(self, increasing: impl Fn(f64) -> f64) -> Estimate {
        Estimate { value: increasing(self.value), low: increasing(self.low), high: increasing(self.high) }
    }
}

/// How a sample was drawn: `values` come in groups, one after another, of `group` values each. The groups are independent;
/// the values within one are not, unless it is the only one, and then they speak of that group alone.
#[derive(Debug, Clone, Copy)]
pub struct Clustered {
    group: usize,
    /// Half-width of an interval over standard error.
    spread: f64,
    level: f64,
    /// Values in a unit of sampling.
    unit: usize,
}

impl Clustered {
    /// `count` groups of `group` values; intervals at `level`. At least two units of sampling.
    pub fn new(count: usize, group: usize, level: f64) -> Self {
        let (units, unit) = if count > 1 { (count, group) } else { (group, 1) };
        Clustered { group, spread: student_two_sided(level, units as f64 - 1.0), level, unit }
    }

    /// The mean m of the unit means m_k, within t sqrt(sum_k (m_k - m)^2 / (K (K - 1))) of it.
    pub fn mean(&self, values: &[f64]) -> Estimate {
        let mean_of = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let means: Vec<f64> = values.chunks(self.unit).map(mean_of).collect();
        let (value, units) = (mean_of(&means), means.len() as f64);
        let squares: f64 = means.iter().map(|mean| (mean - value).powi(2)).sum();
        let reach = self.spread * (squares / (units * (units - 1.0))).sqrt();
        Estimate { value, low: value - reach, high: value + reach }
    }

    /// The share of values for which `holds`.
    pub fn share<T>(&self, values: &[T], holds: impl Fn(&T) -> bool) -> Estimate {
        let shares: Vec<f64> = values.iter().map(|value| if holds(value) { 1.0 } else { 0.0 }).collect();
        let found = self.mean(&shares);
        Estimate { low: found.low.max(0.0), high: found.high.min(1.0), ..found }
    }

    /// The mean squared deviation of all values from their mean.
    pub fn variance(&self, values: &[f64]) -> Estimate {
        let mean = self.mean(values).value;
        let squares: Vec<f64> = values.iter().map(|value| (value - mean).powi(2)).collect();
        let found = self.mean(&squares);
        Estimate { low: found.low.max(0.0), ..found }
    }

    /// The quantile at `share`, between those at `share` -+ the reach of the share of values below it. `sorted` holds
    /// `values` in ascending order. Source: Woodruff (1952), J. Amer. Statist. Assoc. 47.
    pub fn quantile(&self, values: &[f64], sorted: &[f64], share: f64) -> Estimate {
        let value = interpolated_quantile(sorted, share);
        let below: Vec<f64> = values.iter().map(|&other| if other <= value { 1.0 } else { 0.0 }).collect();
        let found = self.mean(&below);
        let (down, up) = (found.value - found.low, found.high - found.value);
        let at = |share| interpolated_quantile(sorted, share);
        Estimate { value, low: at(share - down), high: at(share + up) }
    }

    /// The mean of the lowest share of all values; of the value at its edge as much counts as makes the share whole:
    ///
    ///   mean of q - (q - x)^+ / share,   q the quantile at the share.
    ///
    /// Source: Rockafellar and Uryasev (2000), J. Risk 2.
    pub fn lowest(&self, values: &[f64], share: f64) -> Estimate {
        let edge = quantile(values, share);
        self.mean(&values.iter().map(|value| edge - (edge - value).max(0.0) / share).collect::<Vec<f64>>())
    }

    /// The largest value of a group, averaged over groups, and the central interval of its exact bootstrap law: a group
    /// at random, as many values of it drawn with replacement, so P(largest <= x) is the mean over groups of F(x)^group.
    pub fn largest(&self, values: &[f64]) -> Estimate {
        let size = self.group as f64;
        let mut atoms: Vec<(f64, f64)> = Vec::new();
        let mut sum = 0.0;
        for group in values.chunks(self.group) {
            let mut sorted = group.to_vec();
            sorted.sort_by(|left, right| right.total_cmp(left));
            sum += sorted[0];
            for (rank, &value) in sorted.iter().enumerate() {
                let (at_most, below) = ((size - rank as f64) / size, (size - rank as f64 - 1.0) / size);
                let mass = at_most.powf(size) - below.powf(size);
                if at_most.powf(size) < f64::EPSILON {
                    break;
                }
                atoms.push((value, mass));
            }
        }
        atoms.sort_by(|left, right| left.0.total_cmp(&right.0));
        let groups = values.len() as f64 / size;
        let at = |share: f64| {
            let mut cumulative = 0.0;
            let reached = atoms.iter().find(|(_, mass)| {
                cumulative += mass / groups;
                cumulative >= share
            });
            reached.or(atoms.last()).map_or(f64::NAN, |atom| atom.0)
        };
        let tail = 0.5 * (1.0 - self.level);
        Estimate { value: sum / groups, low: at(tail), high: at(1.0 - tail) }
    }

    /// As [`Self::largest`], of the smallest.
    pub fn smallest(&self, values: &[f64]) -> Estimate {
        let mirrored: Vec<f64> = values.iter().map(|value| -value).collect();
        let found = self.largest(&mirrored);
        Estimate { value: -found.value, low: -found.high, high: -found.low }
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

    /// Expected values by numpy and scipy.
    #[test]
    fn clustered_estimates_are_those_of_numpy() {
        let sample = Clustered::new(4, 5, 0.95);
        assert_estimate(sample.mean(&VALUES), [0.98, 0.4392962226601318, 1.5207037773398682]);
        assert_estimate(sample.variance(&VALUES), [0.3906, 0.1398822021839391, 0.641317797816061]);
        // Shares 1, 0.4, 0.8, 0.8 of the groups reach past 1 by t.
        assert_estimate(sample.share(&VALUES, |value| *value <= 1.6), [0.75, 0.3495509549328149, 1.0]);
        let mut sorted = VALUES;
        sorted.sort_by(f64::total_cmp);
        assert_estimate(sample.quantile(&VALUES, &sorted, 0.9), [1.9, 1.2383380049902388, 2.2]);
        assert_estimate(sample.quantile(&VALUES, &sorted, 0.2), [0.38, 0.0, 0.9]);
    }

    /// The three lowest of thirty are 0 to 2, and an eighth of twenty is the two lowest and half of the third.
    #[test]
    fn the_lowest_share_is_averaged_and_its_edge_counted_in_part() {
        let values: Vec<f64> = (0..30).map(|index| f64::from((7 * index) % 30)).collect();
        assert!((Clustered::new(1, 30, 0.9).lowest(&values, 0.1).value - 1.0).abs() < 1e-12);
        let sample = Clustered::new(4, 5, 0.95);
        let found = sample.lowest(&VALUES, 0.125);
        assert!((found.value - 0.5 * 0.3 / 2.5).abs() < 1e-12 && found.low < found.value, "{found:?}");
        assert!((sample.lowest(&VALUES, 1.0).value - sample.mean(&VALUES).value).abs() < 1e-12);
    }

    #[test]
    fn a_single_group_is_a_sample_of_its_values() {
        let found = Clustered::new(1, 20, 0.8).mean(&VALUES);
        assert_estimate(found, [0.98, 0.98 - 0.19036999627677625, 0.98 + 0.19036999627677625]);
    }

    #[test]
    fn the_largest_has_its_bootstrap_law() {
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        // P(largest of 100 draws <= k) = (k / 100)^100: 0.0169 at 96, 0.0476 at 97, 0.366 at 99.
        assert_estimate(Clustered::new(1, 100, 0.95).largest(&values), [100.0, 97.0, 100.0]);
        assert_estimate(Clustered::new(1, 100, 0.95).smallest(&values), [1.0, 1.0, 4.0]);
        // Two groups, one a thousand higher: the mean of two such laws, so 0.0238 at 97.
        let both: Vec<f64> = values.iter().copied().chain(values.iter().map(|value| value + 1000.0)).collect();
        assert_estimate(Clustered::new(2, 100, 0.95).largest(&both), [600.0, 98.0, 1100.0]);
    }

    #[test]
    fn intervals_hold_the_truth_as_often_as_they_say() {
        use rand::RngExt;
        // Groups of 20 uniforms around a group's own shift: mean 1, the 0.9 quantile by simulation below.
        let mut generator = crate::numerics::streams::stream(1, "test", 0, 0);
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
