//! A smooth estimate of a quantile: a mean of the order statistics around it.

use std::ops::Range;

/// Weights below this share of the largest are dropped.
const LEAST_WEIGHT: f64 = 1e-4;

/// The Harrell-Davis estimate of one quantile of samples of one size.
///
///   Q(p) = sum_k w_k x_(k),   w_k ~ x^((n+1)p - 1) (1 - x)^((n+1)(1-p) - 1) at x = (k - 1/2) / n
///
/// the beta density of the p-th sample quantile, by its midpoints, with sum 1. About 8 sqrt(n p (1-p)) order statistics
/// count, so the estimate moves smoothly where a sample does, and as a single order statistic would not.
/// Source: Harrell and Davis (1982), Biometrika 69, 635-640.
#[derive(Debug, Clone, PartialEq)]
pub struct HarrellDavis {
    size: usize,
    /// Rank, from 0, of the first order statistic that counts.
    first: usize,
    weights: Vec<f64>,
}

impl HarrellDavis {
    /// The p-quantile of samples of `size`, at least 1; `share` is p, inside (0, 1). Cost O(size).
    pub fn new(size: usize, share: f64) -> Self {
        let n = size as f64;
        let (left, right) = ((n + 1.0) * share - 1.0, (n + 1.0) * (1.0 - share) - 1.0);
        let place = |rank: usize| (rank as f64 + 0.5) / n;
        let log_density = |rank: usize| left * place(rank).ln() + right * (1.0 - place(rank)).ln();
        let logs: Vec<f64> = (0..size).map(log_density).collect();
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let counts = |log: &f64| *log >= largest + LEAST_WEIGHT.ln();
        let first = logs.iter().position(counts).unwrap_or(0);
        let last = logs.iter().rposition(counts).unwrap_or(0);
        let mut weights: Vec<f64> = logs[first..=last].iter().map(|log| (log - largest).exp()).collect();
        let total: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= total);
        HarrellDavis { size, first, weights }
    }

    /// The estimate from `sample`. Cost O(n), and a sort of the order statistics that count.
    pub fn estimate(&self, sample: &[f64]) -> f64 {
        let [estimate] = HarrellDavis::estimates([self], sample);
        estimate
    }

    /// Several estimates from one `sample`: the order statistics that count for any of them are sorted once.
    pub fn estimates<const N: usize>(estimators: [&HarrellDavis; N], sample: &[f64]) -> [f64; N] {
        assert!(estimators.iter().all(|estimator| estimator.size == sample.len()));
        let first = estimators.iter().map(|estimator| estimator.first).min().unwrap_or(0);
        let end = estimators.iter().map(|estimator| estimator.first + estimator.weights.len()).max().unwrap_or(first);
        let mut keys: Vec<i64> = sample.iter().map(|&value| key(value)).collect();
        let counted = ordered(&mut keys, first..end);
        estimators.map(|estimator| estimator.weigh(&counted[estimator.first - first..]))
    }

    /// As [`HarrellDavis::estimate`], to the bit, for one of many samples that are alike: what lies below the order
    /// statistics that counted last time is passed over in one sweep.
    pub fn estimate_next(&self, sample: &[f64], last: &mut LastEstimate) -> f64 {
        assert_eq!(self.size, sample.len(), "a sample of the size the estimator is made for");
        let LastEstimate { low, keys } = last;
        keys.resize(sample.len(), 0);
        let mut found = 0;
        for &value in sample {
            keys[found] = key(value);
            found += usize::from(value >= *low);
        }
        let needed = self.size - self.first;
        if found < needed {
            keys.iter_mut().zip(sample).for_each(|(kept, &value)| *kept = key(value));
            found = self.size;
        }
        let first = found - needed;
        let counted = ordered(&mut keys[..found], first..first + self.weights.len());
        let (least, greatest) = (value_of(counted[0]), value_of(counted[counted.len() - 1]));
        *low = least - MARGIN * (greatest - least);
        self.weigh(counted)
    }

    /// The estimate from the order statistics that count, and any after them.
    fn weigh(&self, counted: &[i64]) -> f64 {
        self.weights.iter().zip(counted).map(|(weight, &key)| value_of(key) * weight).sum()
    }
}

/// What an estimate leaves for the next of a similar sample.
#[derive(Debug, Clone)]
pub struct LastEstimate {
    low: f64,
    keys: Vec<i64>,
}

impl Default for LastEstimate {
    fn default() -> Self {
        LastEstimate { low: f64::NEG_INFINITY, keys: Vec::new() }
    }
}

/// How far under the order statistics that counted those of the next sample are looked for, in units of their spread.
const MARGIN: f64 = 0.5;

/// An integer in the order of `f64::total_cmp`: integers sort faster.
fn key(value: f64) -> i64 {
    let bits = value.to_bits() as i64;
    bits ^ (((bits >> 63) as u64) >> 1) as i64
}

/// The value behind a key.
fn value_of(key: i64) -> f64 {
    f64::from_bits((key ^ (((key >> 63) as u64) >> 1) as i64) as u64)
}

/// The keys of these ranks, ascending.
fn ordered(keys: &mut [i64], ranks: Range<usize>) -> &[i64] {
    keys.select_nth_unstable(ranks.start);
    let upper = &mut keys[ranks.start..];
    upper.select_nth_unstable(ranks.len() - 1);
    let counted = &mut upper[..ranks.len()];
    counted.sort_unstable();
    counted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_agrees_with_the_published_estimator() {
        // scipy.stats.mstats.hdquantiles of the squares of 0, 1, ..., 199, which integrates the density exactly; the
        // midpoints and the dropped weights are worth 1e-4 of the spread of the order statistics that count.
        let sample: Vec<f64> = (0..200).rev().map(|k| f64::from(k * k)).collect();
        for (share, expected) in [(0.05, 99.73927), (0.1, 398.15512), (0.5, 9949.83828), (0.9, 32238.15512)] {
            let found = HarrellDavis::new(200, share).estimate(&sample);
            assert!((found - expected).abs() < 2.0, "{share}: {found} against {expected}");
        }
    }

    #[test]
    fn estimates_together_are_those_alone() {
        let sample: Vec<f64> = (0..500).map(|k| f64::from(k * 7919 % 500).sqrt()).collect();
        let estimators = [0.3, 0.9, 0.91].map(|share| HarrellDavis::new(500, share));
        let together = HarrellDavis::estimates(estimators.each_ref(), &sample);
        assert_eq!(together, estimators.map(|estimator| estimator.estimate(&sample)));
    }

    #[test]
    fn it_is_exact_for_a_constant_and_moves_with_the_sample() {
        for share in [1e-6, 0.1, 0.5, 0.999_999] {
            let estimator = HarrellDavis::new(37, share);
            assert!((estimator.estimate(&[3.0; 37]) - 3.0).abs() < 1e-14);
            let shifted: Vec<f64> = (0..37).map(|k| 1.0 + f64::from(k)).collect();
            let sample: Vec<f64> = (0..37).map(f64::from).collect();
            assert!((estimator.estimate(&shifted) - estimator.estimate(&sample) - 1.0).abs() < 1e-12);
        }
        assert_eq!(HarrellDavis::new(1, 0.9).estimate(&[0.3]), 0.3);
    }

    #[test]
    fn one_estimate_after_another_is_as_exact_as_each_alone() {
        let estimator = HarrellDavis::new(400, 0.9);
        let mut last = LastEstimate::default();
        // Down, up by a little and by much: the sweep passes over too little, enough and too much.
        for shift in [0.0, -0.01, 0.02, 5.0, -7.0, -7.0, 0.3] {
            let sample: Vec<f64> = (0..400).map(|k| (f64::from(k * 7919 % 400) / 400.0).powi(2) + shift).collect();
            assert_eq!(estimator.estimate_next(&sample, &mut last), estimator.estimate(&sample), "{shift}");
        }
    }
}
