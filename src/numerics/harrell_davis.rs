//! A smooth estimate of a quantile: a mean of the order statistics around it.

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

    /// The estimate from `sample`, which it reorders. Cost O(n), and a sort of the order statistics that count.
    pub fn estimate(&self, sample: &mut [f64]) -> f64 {
        let [estimate] = HarrellDavis::estimates([self], sample);
        estimate
    }

    /// Several estimates from one `sample`: the order statistics that count for any of them are sorted once.
    pub fn estimates<const N: usize>(estimators: [&HarrellDavis; N], sample: &mut [f64]) -> [f64; N] {
        assert!(estimators.iter().all(|estimator| estimator.size == sample.len()));
        let first = estimators.iter().map(|estimator| estimator.first).min().unwrap_or(0);
        let end = estimators.iter().map(|estimator| estimator.first + estimator.weights.len()).max().unwrap_or(first);
        let (_, _, _) = sample.select_nth_unstable_by(first, f64::total_cmp);
        let upper = &mut sample[first..];
        let (_, _, _) = upper.select_nth_unstable_by(end - first - 1, f64::total_cmp);
        let around = &mut upper[..end - first];
        around.sort_unstable_by(f64::total_cmp);
        estimators.map(|estimator| {
            let counted = around[estimator.first - first..].iter().zip(&estimator.weights);
            counted.map(|(value, weight)| value * weight).sum()
        })
    }
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
            let found = HarrellDavis::new(200, share).estimate(&mut sample.clone());
            assert!((found - expected).abs() < 2.0, "{share}: {found} against {expected}");
        }
    }

    #[test]
    fn estimates_together_are_those_alone() {
        let sample: Vec<f64> = (0..500).map(|k| f64::from(k * 7919 % 500).sqrt()).collect();
        let estimators = [0.3, 0.9, 0.91].map(|share| HarrellDavis::new(500, share));
        let together = HarrellDavis::estimates(estimators.each_ref(), &mut sample.clone());
        assert_eq!(together, estimators.map(|estimator| estimator.estimate(&mut sample.clone())));
    }

    #[test]
    fn it_is_exact_for_a_constant_and_moves_with_the_sample() {
        for share in [1e-6, 0.1, 0.5, 0.999_999] {
            let estimator = HarrellDavis::new(37, share);
            assert!((estimator.estimate(&mut [3.0; 37]) - 3.0).abs() < 1e-14);
            let mut shifted: Vec<f64> = (0..37).map(|k| 1.0 + f64::from(k)).collect();
            let mut sample: Vec<f64> = (0..37).map(f64::from).collect();
            assert!((estimator.estimate(&mut shifted) - estimator.estimate(&mut sample) - 1.0).abs() < 1e-12);
        }
        assert_eq!(HarrellDavis::new(1, 0.9).estimate(&mut [0.3]), 0.3);
    }
}
