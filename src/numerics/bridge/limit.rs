//! The law of the bridge statistic to five digits, without simulation.
//!
//!   H = sum_i c_i |B(t_i)|
//!
//! `X_i = B(t_i) / sqrt(t_i (1 - t_i))` is a stationary Gaussian chain; successive values correlate by
//! `r = sqrt(t_i (1 - t_(i+1)) / (t_(i+1) (1 - t_i)))`. Its transform `E e^(i w H)` is therefore a product of integrals
//! over one variable each, from the last time to the first, and each function is even:
//!
//!   u_i(x) = E[ e^(i w a_(i+1) |X|) u_(i+1)(X) | X_i = x ],   a_i = c_i sqrt(t_i (1 - t_i))
//!
//! with X, given x, normal (r x, 1 - r^2).
//!
//! The integrals use evenly spaced points of half the line, at most the deviation of a step apart. They use the
//! trapezoidal rule with its first correction for the kink of |x| at 0, which sums a normal density to 1e-8 at this
//! spacing. The distribution function is the cosine series of Fang and Oosterlee (2008), A novel pricing method for
//! European options based on Fourier-cosine series expansions, SIAM Journal on Scientific Computing 31(2), over [0,
//! mean + 6 deviations]. This leaves out less than 2e-8 (Borell's inequality, because no choice of signs gives
//! `sum +- c_i B(t_i)` more variance than all plus).

use crate::numerics::bridge::paths::{AbsoluteBridges, Times};
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::machine::dispatch::dispatched;

/// Number of terms of the series. Twice as many change a quantile at 0.9 by less than 1e-4 of itself for laws of three
/// values, and by 1e-5 for laws of many.
const TERMS: usize = 64;
/// The range of the points, in deviations of X.
const REACH: f64 = 6.5;
/// The largest distance between points; it is also at most the deviation of the shortest step.
const WIDEST: f64 = 0.1;
/// The range of a step, in deviations; the mass beyond it, 2e-11, is ignored.
const FARTHEST: f64 = 6.7;
/// End of the series, in deviations of H beyond its mean.
const TAIL: f64 = 6.0;
/// Number of halvings of a quantile's interval.
const HALVINGS: usize = 50;

/// Complex numbers, one for each term.
#[derive(Clone)]
struct ComplexTerms {
    real: [f64; TERMS],
    imaginary: [f64; TERMS],
}

/// The law of a bridge statistic.
pub struct BridgeLaw {
    /// End of the interval of the series.
    end: f64,
    /// The real part of the transform at `k pi / end`.
    transform: [f64; TERMS],
}

impl AbsoluteBridges {
    /// Returns the law of the statistic of `law`, at the times of these bridges. Cost O(times^1.5): 25 ms at 240
    /// values, 55 ms from 1,025 on.
    ///
    /// Checked by: `the_law_has_the_quantiles_that_are_known`,
    /// `quantiles_of_laws_drawn_at_random_are_those_of_many_paths`, and against a million paths
    /// `tests/solver/control.rs`.
    pub fn exact(&self, law: &EmpiricalDistribution) -> BridgeLaw {
        let time = |index: usize| match &self.times {
            Times::Sample(size) => (index + 1) as f64 / *size as f64,
            Times::Graded { times, .. } => times[index + 1],
        };
        let nodes = self.nodes(law).into_iter().enumerate().filter(|(_, weight)| *weight > 0.0);
        BridgeLaw::of(&nodes.map(|(index, weight)| (time(index), weight)).collect::<Vec<_>>())
    }
}

impl BridgeLaw {
    /// Computes the law of `sum c_i |B(t_i)|` for pairs of t, ascending between 0 and 1, and c > 0.
    fn of(nodes: &[(f64, f64)]) -> Self {
        let scaled: Vec<f64> = nodes.iter().map(|(time, weight)| weight * (time * (1.0 - time)).sqrt()).collect();
        let mean = (2.0 / std::f64::consts::PI).sqrt() * scaled.iter().sum::<f64>();
        let end = mean + TAIL * variance_of_sum(nodes).sqrt();
        if end <= 0.0 {
            return BridgeLaw { end: 0.0, transform: [0.0; TERMS] };
        }
        let correlations: Vec<f64> = nodes.windows(2).map(|pair| correlation(pair[0].0, pair[1].0)).collect();
        let spread = |correlation: &f64| (1.0 - correlation * correlation).sqrt();
        let distance = correlations.iter().map(spread).fold(WIDEST, f64::min);
        let points = (REACH / distance).ceil() as usize + 1;
        let mut values = vec![ComplexTerms { real: [1.0; TERMS], imaginary: [0.0; TERMS] }; points];
        let mut stepped = values.clone();
        let mut steps = correlations.iter().rev();
        for scaled in scaled.iter().rev() {
            turn(&mut values, std::f64::consts::PI / end * scaled, distance);
            let Some(&correlation) = steps.next() else { break };
            dispatched!(step(&values, &mut stepped, correlation, distance));
            std::mem::swap(&mut values, &mut stepped);
        }
        let mut transform = [0.0; TERMS];
        for (point, terms) in values.iter().enumerate() {
            let density = 2.0 * normal_density(point as f64 * distance);
            transform.iter_mut().zip(terms.real).for_each(|(sum, value)| *sum += density * value);
        }
        BridgeLaw { end, transform }
    }

    /// Returns the `share`-quantile, `share` in [0.001, 0.999]; 0 for a law of one value.
    pub fn quantile(&self, share: f64) -> f64 {
        let (mut low, mut high) = (0.0, self.end);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            *(if self.share_below(middle) < share { &mut low } else { &mut high }) = middle;
        }
        0.5 * (low + high)
    }

    fn share_below(&self, value: f64) -> f64 {
        let angle = std::f64::consts::PI / self.end * value;
        let term = |term: usize| self.transform[term] * (term as f64 * angle).sin() / term as f64;
        (angle + 2.0 * (1..TERMS).map(term).sum::<f64>()) / std::f64::consts::PI
    }
}

fn normal_density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

/// Returns the correlation of a bridge divided by its deviation, at two times.
fn correlation(first: f64, second: f64) -> f64 {
    (first * (1.0 - second) / (second * (1.0 - first))).sqrt()
}

/// Returns the variance of `sum c_i B(t_i)`: the covariance of B at s < t is s (1 - t).
fn variance_of_sum(nodes: &[(f64, f64)]) -> f64 {
    let (mut before, mut variance) = (0.0, 0.0);
    for (time, weight) in nodes {
        variance += weight * (1.0 - time) * (2.0 * before + weight * time);
        before += weight * time;
    }
    variance
}

/// Multiplies the values at each point j by `e^(i k rate j distance)` and by the weight of the trapezoidal rule.
fn turn(values: &mut [ComplexTerms], rate: f64, distance: f64) {
    let once: [(f64, f64); TERMS] = std::array::from_fn(|term| (term as f64 * rate * distance).sin_cos());
    let (mut cosines, mut sines) = ([distance; TERMS], [0.0; TERMS]);
    for ComplexTerms { real, imaginary } in values.iter_mut() {
        for term in 0..TERMS {
            let (cosine, sine) = (cosines[term], sines[term]);
            (real[term], imaginary[term]) =
                (real[term] * cosine - imaginary[term] * sine, real[term] * sine + imaginary[term] * cosine);
            let (turn_sine, turn_cosine) = once[term];
            cosines[term] = cosine * turn_cosine - sine * turn_sine;
            sines[term] = cosine * turn_sine + sine * turn_cosine;
        }
    }
    // The integrand is even, with the slope i k rate at 0.
    let ComplexTerms { real, imaginary } = &mut values[0];
    for term in 0..TERMS {
        let slope = distance * term as f64 * rate / 12.0;
        (real[term], imaginary[term]) =
            (0.5 * real[term] - slope * imaginary[term], 0.5 * imaginary[term] + slope * real[term]);
    }
}

/// Computes the mean of `values`, which are even, one step before.
#[inline(always)]
fn step(values: &[ComplexTerms], before: &mut [ComplexTerms], correlation: f64, distance: f64) {
    let spread = (1.0 - correlation * correlation).sqrt();
    let last = values.len() as f64 - 1.0;
    for (point, before) in before.iter_mut().enumerate() {
        let (mut real, mut imaginary) = ([0.0; TERMS], [0.0; TERMS]);
        let centre = correlation * point as f64;
        let reach = FARTHEST * spread / distance;
        let (first, end) = ((centre - reach).max(0.0).ceil() as usize, (centre + reach).min(last) as usize);
        for (to, terms) in values.iter().enumerate().take(end + 1).skip(first) {
            let [same, other] =
                [to as f64 - centre, to as f64 + centre].map(|apart| normal_density(apart * distance / spread));
            let density = (same + other) / spread;
            for term in 0..TERMS {
                real[term] = density.mul_add(terms.real[term], real[term]);
                imaginary[term] = density.mul_add(terms.imaginary[term], imaginary[term]);
            }
        }
        *before = ComplexTerms { real, imaginary };
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, RngExt};
    use rand_distr::StandardNormal;

    use super::*;
    use crate::numerics::machine::streams::stream;

    #[test]
    fn the_law_has_the_quantiles_that_are_known() {
        // Two values give |B(1/2)| with standard deviation 1/2. The law of one time has the least smooth series.
        let law = AbsoluteBridges::simulate(2, 1, 1).exact(&EmpiricalDistribution::new(&[0.0, 2.0]));
        for (share, normal) in [(0.1, 0.125_661), (0.5, 0.674_490), (0.9, 1.644_854), (0.99, 2.575_829)] {
            assert!((law.quantile(share) - normal).abs() < 3e-5, "{share}: {}", law.quantile(share));
        }
        // The integral of |B| over [0, 1]: Johnson and Killeen (1983), An explicit formula for the c.d.f. of the L1
        // norm of the Brownian bridge, Annals of Probability 11(3), table 1, as 1/n goes to 0. Sums over i/n err by
        // about 1/(6 n^1.5).
        let even: Vec<f64> = (0..1024).map(|k| f64::from(k) / 1023.0).collect();
        let law = AbsoluteBridges::simulate(1024, 1, 1).exact(&EmpiricalDistribution::new(&even));
        for (share, known) in [(0.9, 0.4993), (0.95, 0.5821), (0.99, 0.7518)] {
            assert!((law.quantile(share) * 1023.0 / 1024.0 - known).abs() < 1e-4, "{share}: {}", law.quantile(share));
        }
        assert_eq!(AbsoluteBridges::simulate(3, 1, 1).exact(&EmpiricalDistribution::new(&[0.1; 3])).quantile(0.9), 0.0);
    }

    /// Returns a record of `count` values with a random scale and shape.
    fn record(count: usize, generator: &mut impl Rng) -> Vec<f64> {
        let scale = 10.0_f64.powf(generator.random_range(-4.0..0.0));
        let (power, skew) = (generator.random_range(0.5..3.0), generator.random_range(0.1..1.0));
        let value = |_| {
            let normal: f64 = generator.sample(StandardNormal);
            scale * normal.abs().powf(power) * if normal > 0.0 { 1.0 } else { -skew }
        };
        (0..count).map(value).collect()
    }

    #[test]
    fn quantiles_of_laws_drawn_at_random_are_those_of_many_paths() {
        let mut generator = stream(9, "laws", 0, 0);
        for (index, retention) in [1.0, 1.0, 1.0, 0.95, 0.99, 1.0, 1.0, 1.0].into_iter().enumerate() {
            let count = [3, 7, 20, 40, 60, 120, 240, 1100][index];
            let law = EmpiricalDistribution::decaying(&record(count, &mut generator), retention);
            let bridges = match (retention, count) {
                (1.0, ..1025) => AbsoluteBridges::simulate(count, 16_384, 3),
                _ => AbsoluteBridges::graded(16_384, 3),
            };
            let exact = bridges.exact(&law);
            for alpha in [0.01, 0.1, 0.5, 0.9] {
                let simulated = bridges.bridge_quantile_with_error(&law, alpha);
                let apart = (exact.quantile(1.0 - alpha) - simulated.value).abs();
                assert!(apart < 4.0 * simulated.standard_error, "{count} {alpha}: {apart} {simulated:?}");
            }
        }
    }
}
