//! Quantiles of a scale mixture R h, where R has a chi law and is independent of h, from draws of h alone.
//!
//!   P(R h <= q) = E[ F(q / h) ],   F the distribution function of R
//!
//! The scale is integrated out and not drawn. The estimate therefore varies less than one from draws of R h, and moves
//! smoothly with the draws, unlike order statistics. Source: conditional Monte Carlo, Asmussen and Glynn (2007),
//! Stochastic Simulation, section V.4.

use std::f64::consts::PI;

use statrs::function::gamma::checked_gamma_lr;

use crate::numerics::gp::matern::{dot, sum};
use crate::numerics::machine::dispatch::dispatched;

/// Number of coefficients of the polynomial that approximates F, and half the width of its interval. A chi law has a
/// standard deviation below 0.71, so at most 7e-5 of it lies outside. Inside, the polynomial is off by at most 3e-5,
/// and by 4e-6 more in single precision. For comparison, the share from 2000 draws is off by about 0.01, and from
/// 100,000 by 0.001.
const COEFFICIENTS: usize = 18;
const HALF_WIDTH: f64 = 3.0;
/// Shares staged on the stack between the two passes of a sum.
const BLOCK: usize = 256;
/// Accumulators of a sum: one 512-bit vector of sixteen, or two of eight.
const LANES: usize = 16;
/// The error that a search may leave in ln q. After a step the error is the step times the relative error of its slope.
/// A slope measured over the previous step has a relative error of about that step's length.
const TOLERANCE: f64 = 1e-7;
/// The tolerance for one of many similar sets of draws.
const NEXT_TOLERANCE: f64 = 5e-6;
const LONGEST_STEP: f64 = 0.5;
const STEP_LIMIT: usize = 60;
/// A lower bound on the slope of the share in ln q.
const LEAST_SLOPE: f64 = 1e-6;
/// Relative error of the slope if a lognormal law approximates the mixture, and if it comes from similar draws.
const LOGNORMAL_SLOPE_ERROR: f64 = 0.1;
const LAST_SLOPE_ERROR: f64 = 0.01;

/// The law of R: chi, the length of a standard normal vector.
#[derive(Debug, Clone, PartialEq)]
pub struct ScaleMixture {
    /// Coefficients of the polynomial for F(x), constant first, in `rate * x + offset` clamped to [-1, 1].
    coefficients: [f32; COEFFICIENTS],
    rate: f64,
    offset: f64,
    typical: f64,
}

/// Warm start for the next quantile of similar draws.
#[derive(Debug, Clone, Default)]
pub struct LastQuantile {
    found: Option<MixtureFit>,
    /// The mean of the draws divided by each of them.
    over: Vec<f32>,
}

#[derive(Debug, Clone, Copy)]
struct MixtureFit {
    /// Position of the draws along their line.
    at: f64,
    /// The quantile divided by the mean of the draws, and its rate of change along the line.
    ratio: f64,
    rate: f64,
    slope: f64,
}

/// Start of a search: a quantile divided by the mean of the draws, the slope of the share in ln q there, and the
/// relative error of that slope.
struct SearchStart {
    ratio: f64,
    slope: f64,
    slope_error: f64,
}

impl ScaleMixture {
    /// Creates the chi law of R with `freedom` >= 1 dimensions. Cost O(freedom + 1000).
    pub fn chi(freedom: usize) -> Self {
        let typical = (freedom as f64).sqrt();
        let (low, high) = ((typical - HALF_WIDTH).max(0.0), typical + HALF_WIDTH);
        let (rate, offset) = (2.0 / (high - low), -(high + low) / (high - low));
        let share = |position: f64| chi_cdf((position - offset) / rate, freedom);
        ScaleMixture { coefficients: polynomial(share).map(|coefficient| coefficient as f32), rate, offset, typical }
    }

    /// Returns the `share`-quantile of R h from draws of h, none of them negative. `share` must be in [0.001, 0.999],
    /// where the polynomial approximates F. Cost O(draws).
    pub fn quantile(&self, share: f64, draws: &[f64]) -> f64 {
        self.quantile_within(TOLERANCE, share, draws, 0.0, &mut LastQuantile::default())
    }

    /// Returns the quantile with a relative error of at most 5e-6, for one of many sets of similar draws. If the draws
    /// change along a line, `at` is their position on it; otherwise it is always the same number. `share` is as in
    /// [`Self::quantile`]. Cost O(draws).
    pub fn quantile_next(&self, share: f64, draws: &[f64], at: f64, last: &mut LastQuantile) -> f64 {
        self.quantile_within(NEXT_TOLERANCE, share, draws, at, last)
    }

    /// Returns the quantile with its standard error: the standard error of the mean of F(q / h), over the density at q.
    /// `share` is as in [`Self::quantile`]. Cost O(draws).
    pub fn quantile_with_error(&self, share: f64, draws: &[f64]) -> (f64, f64) {
        let mut last = LastQuantile::default();
        let quantile = self.quantile_within(TOLERANCE, share, draws, 0.0, &mut last);
        let Some(MixtureFit { ratio, slope, .. }) = last.found else { return (0.0, 0.0) };
        // Moved, as a dispatched closure must be.
        let share = share as f32;
        let variance = self.mean(ratio, &last.over, move |below| (below - share) * (below - share));
        (quantile, (variance / draws.len() as f64).sqrt() * quantile / slope)
    }

    fn quantile_within(&self, tolerance: f64, share: f64, draws: &[f64], at: f64, last: &mut LastQuantile) -> f64 {
        let mean = sum(draws) / draws.len() as f64;
        if mean < f64::MIN_POSITIVE {
            last.found = None;
            return 0.0;
        }
        let LastQuantile { found, over } = last;
        let start = match found {
            Some(last) => SearchStart {
                ratio: (last.ratio + last.rate * (at - last.at)).max(0.5 * last.ratio),
                slope: last.slope,
                slope_error: LAST_SLOPE_ERROR,
            },
            None => self.lognormal(share, mean, draws),
        };
        over.clear();
        over.reserve(draws.len());
        let inverse = 1.0 / mean;
        dispatched!(over.extend(draws.iter().map(|draw| 1.0 / (draw * inverse) as f32)));
        let (ratio, slope) = search(tolerance, share, start, |ratio| self.mean(ratio, over, |below| below));
        let rate = found.filter(|before| before.at != at).map(|before| (ratio - before.ratio) / (at - before.at));
        *found = Some(MixtureFit { at, ratio, rate: rate.unwrap_or_default(), slope });
        ratio * mean
    }

    /// Returns the quantile and its slope as if R h were lognormal with approximately its mean and variance; ln R has a
    /// variance of about 1/(2 m). Within 2 % from m = 20 on, which saves half of a search.
    fn lognormal(&self, share: f64, mean: f64, draws: &[f64]) -> SearchStart {
        let square = dot(draws, draws) / draws.len() as f64;
        let spread = (square / (mean * mean)).ln().max(0.0);
        let deviation = (spread + 0.5 / (self.typical * self.typical)).sqrt();
        let normal = normal_quantile(share);
        SearchStart {
            ratio: self.typical * (normal * deviation - 0.5 * spread).exp(),
            slope: (-0.5 * normal * normal).exp() / ((2.0 * PI).sqrt() * deviation),
            slope_error: LOGNORMAL_SLOPE_ERROR,
        }
    }

    /// Returns the mean of a function of F(q / h) over the draws. `over` holds the mean of the draws divided by each of
    /// them, and `ratio` is q divided by that mean. Fused operations are written as such and the sum has fixed
    /// accumulators, so the bits do not depend on the processor.
    #[inline(always)]
    fn mean(&self, ratio: f64, over: &[f32], function: impl Fn(f32) -> f32) -> f64 {
        let (rate, offset) = ((ratio * self.rate) as f32, self.offset as f32);
        let mut total = 0.0;
        let mut staged = [0.0; BLOCK];
        for block in over.chunks(BLOCK) {
            let staged = &mut staged[..block.len()];
            // Dispatched separately, because in one function with the sum LLVM does not vectorise the loop over the
            // polynomial.
            dispatched!({
                for (value, over) in staged.iter_mut().zip(block) {
                    *value = function(self.share_at(over.mul_add(rate, offset)));
                }
            });
            total += sum_of(staged);
        }
        total / over.len() as f64
    }

    /// Returns F, by its polynomial at `position`.
    #[inline(always)]
    fn share_at(&self, position: f32) -> f32 {
        let position = if position < -1.0 { -1.0 } else { position };
        let position = if position > 1.0 { 1.0 } else { position };
        let [lower @ .., highest] = &self.coefficients;
        lower.iter().rev().fold(*highest, |sum, coefficient| sum.mul_add(position, *coefficient))
    }
}

/// Returns the sum of up to [`BLOCK`] values, none of which is large.
fn sum_of(values: &[f32]) -> f64 {
    dispatched!({
        let mut lanes = [0.0; LANES];
        let (blocks, tail) = values.as_chunks::<LANES>();
        for block in blocks {
            for lane in 0..LANES {
                lanes[lane] += block[lane];
            }
        }
        lanes.iter_mut().zip(tail).for_each(|(lane, value)| *lane += value);
        lanes.iter().map(|lane| f64::from(*lane)).sum()
    })
}

/// Finds q over the mean of h at which `share_below`, the mean of F(q / h), is `share`; also returns the slope there in
/// ln q. Takes secant steps from the start, or halves the bracket if a step leaves it, until the error is below the
/// tolerance.
fn search(tolerance: f64, share: f64, start: SearchStart, mut share_below: impl FnMut(f64) -> f64) -> (f64, f64) {
    let SearchStart { mut ratio, mut slope, mut slope_error } = start;
    let (mut low, mut high) = (0.0, f64::INFINITY);
    let mut before: Option<(f64, f64)> = None;
    for _ in 0..STEP_LIMIT {
        let missing = share - share_below(ratio);
        if let Some((missed, step)) = before {
            slope = ((missed - missing) / step).max(LEAST_SLOPE);
            slope_error = step.abs();
        }
        if missing > 0.0 {
            low = ratio
        } else {
            high = ratio
        }
        let mut step = (missing / slope).clamp(-LONGEST_STEP, LONGEST_STEP);
        let beyond = ratio * step.exp();
        if beyond < low || beyond > high {
            step =
                0.5 * (low.max(ratio * (-LONGEST_STEP).exp()) * high.min(ratio * LONGEST_STEP.exp())).ln() - ratio.ln();
        }
        ratio *= step.exp();
        if step.abs() * slope_error < tolerance {
            break;
        }
        before = Some((missing, step));
    }
    (ratio, slope)
}

/// Returns a quantile of the standard normal law, to 0.003 for shares in [0.001, 0.999]. Source: Shore (1982), Simple
/// approximations for the inverse cumulative function, Applied Statistics 31.
fn normal_quantile(share: f64) -> f64 {
    let beyond = share.min(1.0 - share);
    let size = 5.5556 * (1.0 - (beyond / (1.0 - beyond)).powf(0.1186));
    if share < 0.5 { -size } else { size }
}

/// Returns the coefficients, constant first, of the polynomial through `value` at the Chebyshev points of [-1, 1].
fn polynomial(value: impl Fn(f64) -> f64) -> [f64; COEFFICIENTS] {
    let angles: [f64; COEFFICIENTS] = std::array::from_fn(|k| (k as f64 + 0.5) * PI / COEFFICIENTS as f64);
    let values = angles.map(|angle| value(angle.cos()));
    let mut sum = [0.0; COEFFICIENTS];
    // T_0 and T_1, then T_(k+1) = 2 x T_k - T_(k-1).
    let (mut chebyshev, mut next) = ([0.0; COEFFICIENTS], [0.0; COEFFICIENTS]);
    (chebyshev[0], next[1]) = (1.0, 1.0);
    for order in 0..COEFFICIENTS {
        let projected = angles.iter().zip(values).map(|(angle, value)| value * (order as f64 * angle).cos());
        let weight = projected.sum::<f64>() * if order == 0 { 1.0 } else { 2.0 } / COEFFICIENTS as f64;
        sum.iter_mut().zip(chebyshev).for_each(|(sum, coefficient)| *sum += weight * coefficient);
        let after = std::array::from_fn(|power| {
            let raised = if power == 0 { 0.0 } else { 2.0 * next[power - 1] };
            raised - chebyshev[power]
        });
        (chebyshev, next) = (next, after);
    }
    sum
}

/// Returns P(R <= x): the regularised incomplete gamma function P(m/2, x^2/2), which the library defines only above 0.
fn chi_cdf(x: f64, freedom: usize) -> f64 {
    checked_gamma_lr(0.5 * freedom as f64, 0.5 * x * x).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share_of(mixture: &ScaleMixture, x: f64) -> f64 {
        f64::from(mixture.share_at((x * mixture.rate + mixture.offset) as f32))
    }

    #[test]
    fn the_polynomial_is_the_chi_law() {
        // scipy.stats.chi.cdf(x, m).
        let published = [
            (1, 0.5, 0.38292492254802624),
            (1, 2.0, 0.9544997361036416),
            (2, 1.5, 0.6753475326416503),
            (5, 1.0, 0.03743422675270362),
            (19, 4.0, 0.3427220017993561),
            (29, 5.5, 0.5983979759014061),
            (29, 6.5, 0.9466821628725659),
            (1023, 31.0, 0.08308945864583012),
            (1023, 32.5, 0.770947410226983),
        ];
        for (freedom, x, expected) in published {
            assert!((chi_cdf(x, freedom) - expected).abs() < 1e-11, "{freedom} {x}: {}", chi_cdf(x, freedom));
            let found = share_of(&ScaleMixture::chi(freedom), x);
            // The error bound is stated at `COEFFICIENTS`.
            assert!((found - expected).abs() < 3e-5, "{freedom} {x}: {found} against {expected}");
        }
    }

    #[test]
    fn a_constant_draw_has_the_quantiles_of_its_chi_law() {
        // scipy.stats.chi.ppf(p, m). The density is at least 0.2, so 6e-5 of share are 3e-4 of quantile.
        for (freedom, share, expected) in
            [(1, 0.9, 1.6448536270), (2, 0.5, 1.1774100225), (29, 0.9, 6.2519972625), (29, 0.5, 5.3231688745)]
        {
            let (found, error) = ScaleMixture::chi(freedom).quantile_with_error(share, &[2.0; 37]);
            assert!((found - 2.0 * expected).abs() < 6e-4, "{freedom} {share}: {found} against {}", 2.0 * expected);
            assert!(error < 1e-4, "nothing is simulated: {error}");
        }
        assert_eq!(ScaleMixture::chi(3).quantile_with_error(0.9, &[0.0; 9]), (0.0, 0.0));
    }

    #[test]
    fn a_quantile_hardly_depends_on_where_the_search_starts() {
        let mixture = ScaleMixture::chi(19);
        for share in [0.001, 0.5, 0.9, 0.9999] {
            let mut last = LastQuantile::default();
            for (at, (scale, least)) in
                [(1.0, 0.2), (1.01, 0.2), (1.01, 0.22), (3.0, 0.3), (1e-6, 0.9), (1e-6, 0.01)].into_iter().enumerate()
            {
                let draws: Vec<f64> = (0..403).map(|k| scale * (least + f64::from(k * 7919 % 403) / 403.0)).collect();
                let alone = mixture.quantile(share, &draws);
                let mean = draws.iter().map(|draw| share_of(&mixture, alone / draw)).sum::<f64>() / 403.0;
                // Single precision rounds each share differently.
                assert!((mean - share).abs() < 1e-6, "{scale} {share}: {mean}");
                let next = mixture.quantile_next(share, &draws, at as f64, &mut last);
                // Twenty times the tolerance, because slopes of draws as different as these are off by that much more.
                assert!((next / alone - 1.0).abs() < 1e-4, "{scale} {share}: {next} against {alone}");
            }
        }
    }
}
