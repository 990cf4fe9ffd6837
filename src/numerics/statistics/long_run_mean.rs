//! Means of a short series with dependence between nearby values, with intervals for one mean or for several at once.

use std::f64::consts::PI;

use rand::RngExt;
use rand_distr::StandardNormal;

use crate::numerics::law::student::student_two_sided;
use crate::numerics::machine::streams::stream;
use crate::numerics::statistics::summary::quantile;

/// The most cosines: more hardly shorten an interval.
const MOST_COSINES: usize = 50;
/// Number of draws of the largest ratio, which give a spread within half a percent of itself.
pub const DRAWS: usize = 20_000;

/// A mean, its standard error, and the cosine terms from which the error is estimated:
///
///   L_k = sqrt(2 / n) sum_t cos(pi k (t - 1/2) / n) y_t,   k = 1 .. K,   error^2 = (1/n) (1/K) sum_k L_k^2.
///
/// The mean less the truth, divided by its error, has Student's law with K degrees of freedom. K = n - 1 gives the
/// ratio for independent values. K = n / m allows for dependence among m consecutive values.
/// Source: Lazarus, Lewis, Stock and Watson (2018), HAR inference: recommendations for practice, J. Bus. Econ. Statist.
/// 36.
/// Checked by: `intervals_hold_in_few_years_also_for_several_means_at_once`.
#[derive(Debug, Clone)]
pub struct LongRunMean {
    value: f64,
    error: f64,
    cosines: Vec<f64>,
}

impl LongRunMean {
    /// Creates the mean `value`, which `parts` add up to, up to a constant; up to `block` consecutive parts depend on
    /// each other. A single part gives no error.
    pub fn new(value: f64, parts: &[f64], block: usize) -> Self {
        let size = parts.len() as f64;
        let mean = parts.iter().sum::<f64>() / size;
        let cosine = |k: usize| {
            let term = |(t, part): (usize, &f64)| (PI * k as f64 * (t as f64 + 0.5) / size).cos() * (part - mean);
            (2.0 / size).sqrt() * parts.iter().enumerate().map(term).sum::<f64>()
        };
        let most = parts.len().saturating_sub(1);
        let count = (parts.len() / block.max(1)).min(most).clamp(1, MOST_COSINES);
        let cosines: Vec<f64> = (1..=count).map(cosine).collect();
        let error = (cosines.iter().map(|l| l * l).sum::<f64>() / count as f64 / size).sqrt();
        LongRunMean { value, error, cosines }
    }

    /// Returns the interval at `level` for this mean alone.
    pub fn interval(&self, level: f64) -> [f64; 2] {
        self.within(student_two_sided(level, self.cosines.len() as f64))
    }

    /// Returns the ends that are `spread` standard errors away.
    pub fn within(&self, spread: f64) -> [f64; 2] {
        [self.value - spread * self.error, self.value + spread * self.error]
    }

    /// Returns the mean.
    pub fn value(&self) -> f64 {
        self.value
    }
}

/// Returns the number of standard errors that covers all the means at once with probability `level`: the quantile of
/// the largest |T_j| among ratios that depend on each other as the means do. The numerator of each ratio and the
/// cosines in its denominator are drawn as random combinations of the L_k. Means without an error do not count. All
/// have the same number of parts. Stream: (seed, "simultaneous", 0, 0). Cost O(draws K^2 J).
pub fn simultaneous_spread(means: &[LongRunMean], level: f64, draws: usize, seed: u64) -> f64 {
    let vary: Vec<&LongRunMean> = means.iter().filter(|mean| mean.error > 0.0).collect();
    let count = vary.iter().map(|mean| mean.cosines.len()).min().unwrap_or(1);
    if vary.len() < 2 {
        return student_two_sided(level, count as f64);
    }
    let mut generator = stream(seed, "simultaneous", 0, 0);
    let mut weights = vec![0.0; count];
    let mut combine = || {
        weights.iter_mut().for_each(|weight| *weight = generator.sample(StandardNormal));
        let of = |mean: &&LongRunMean| weights.iter().zip(&mean.cosines).map(|(w, l)| w * l).sum::<f64>();
        vary.iter().map(of).collect::<Vec<f64>>()
    };
    let mut largest = || {
        let numerators = combine();
        let mut squares = vec![0.0; vary.len()];
        for _ in 0..count {
            squares.iter_mut().zip(combine()).for_each(|(sum, l)| *sum += l * l);
        }
        let ratios = numerators.iter().zip(&squares).map(|(top, sum)| top.abs() / (sum / count as f64).sqrt());
        ratios.fold(0.0, f64::max)
    };
    quantile(&(0..draws).map(|_| largest()).collect::<Vec<f64>>(), level)
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn with_all_cosines_it_is_the_ratio_of_independent_values() {
        let values = [0.3, -1.2, 2.5, 0.9, 0.1, -0.4, 1.7];
        let mean = values.iter().sum::<f64>() / 7.0;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 6.0;
        let all = LongRunMean::new(mean, &values, 1);
        assert!((all.error.powi(2) * 7.0 - variance).abs() < 1e-12, "{all:?}");
        let two = LongRunMean::new(0.0, &[1.0, 3.0], 2);
        assert!((two.error - 1.0).abs() < 1e-12 && (two.interval(0.9)[1] - 6.313_751_514_675_0).abs() < 1e-9);
    }

    #[test]
    fn one_mean_has_the_spread_of_student_and_two_that_are_one_have_it_too() {
        let means: Vec<LongRunMean> = (0..2)
            .map(|scale| {
                let parts: Vec<f64> = (0..30).map(|year| f64::from(1 + scale) * f64::from((7 * year) % 11)).collect();
                LongRunMean::new(1.0, &parts, 3)
            })
            .collect();
        let student = student_two_sided(0.9, 10.0);
        assert_eq!(simultaneous_spread(&means[..1], 0.9, DRAWS, 1), student);
        assert!((simultaneous_spread(&means, 0.9, DRAWS, 1) / student - 1.0).abs() < 0.015);
    }

    /// Returns years of differences with mean zero: `shares` of one market each, and noise of their own.
    fn differences(years: usize, crashes: bool, generator: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
        let market: Vec<f64> = (0..years)
            .map(|_| {
                let crash = crashes && generator.random::<f64>() < 0.1;
                0.15 * generator.sample::<f64, _>(StandardNormal)
                    + if crash { -0.36 } else { f64::from(crashes) * 0.04 }
            })
            .collect();
        let own = |share: f64, market: &f64, generator: &mut ChaCha8Rng| {
            share * market + 0.02 * generator.sample::<f64, _>(StandardNormal)
        };
        [-0.3, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0]
            .map(|share| market.iter().map(|market| own(share, market, generator)).collect())
            .into()
    }

    /// Returns how often any of seven means counts as better, and as worse, at 90 % jointly, and how often one interval
    /// misses.
    fn false_verdicts(years: usize, crashes: bool) -> [f64; 3] {
        let mut generator = stream(3, "test", years, usize::from(crashes));
        let (trials, mut counts) = (600_u32, [0.0; 3]);
        for trial in 0..trials {
            let parts = differences(years, crashes, &mut generator);
            let mean = |parts: &Vec<f64>| LongRunMean::new(parts.iter().sum::<f64>() / years as f64, parts, 3);
            let means: Vec<LongRunMean> = parts.iter().map(mean).collect();
            let spread = simultaneous_spread(&means, 0.9, 300, trial.into());
            let ends: Vec<[f64; 2]> = means.iter().map(|mean| mean.within(spread)).collect();
            counts[0] += f64::from(u8::from(ends.iter().any(|[low, _]| *low > 0.0)));
            counts[1] += f64::from(u8::from(ends.iter().any(|[_, high]| *high < 0.0)));
            let [low, high] = means[6].interval(0.9);
            counts[2] += f64::from(u8::from(low > 0.0 || high < 0.0));
        }
        counts.map(|count| count / f64::from(trials))
    }

    /// Checks for five percent a side. Three standard errors of 600 trials are 0.027, and few years make the spread
    /// slightly too short.
    #[test]
    fn intervals_hold_in_few_years_also_for_several_means_at_once() {
        for (years, crashes) in [(10, false), (20, false), (72, false), (20, true), (72, true)] {
            let [better, worse, missed] = false_verdicts(years, crashes);
            assert!(better < 0.09 && worse < 0.09 && missed < 0.145, "{years} {crashes}: {better} {worse} {missed}");
            assert!(better + worse > 0.04 && missed > 0.05, "{years} {crashes}: {better} {worse} {missed}");
        }
    }
}
