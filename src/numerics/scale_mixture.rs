//! Quantiles of a scale mixture: of R h, where R has a chi law and is independent of h, from draws of h alone.
//!
//!   P(R h <= q) = E[ F(q / h) ],   F the distribution function of R
//!
//! The scale is integrated out, not drawn: the estimate varies less than one from draws of R h, and moves smoothly with
//! the draws, which order statistics do not. Source: conditional Monte Carlo, Asmussen and Glynn (2007), Stochastic
//! Simulation, section V.4.

use std::f64::consts::PI;

use statrs::function::gamma::checked_gamma_lr;

use super::dispatch::dispatched;
use super::matern::{dot, sum};

/// Coefficients of the polynomial that stands for F, and half the width of its interval. A chi law has a standard
/// deviation below 0.71: outside lies at most 7e-5 of it, inside the polynomial is off by at most 3e-5. The share of 2000
/// draws is off by about 0.01, of 100,000 by 0.001.
const COEFFICIENTS: usize = 18;
const HALF_WIDTH: f64 = 3.0;
/// Shares staged on the stack between the two passes of a sum.
const BLOCK: usize = 256;
/// Quantiles so far from where a search starts, as a share, are searched among the same draws.
const REACH: f64 = 0.06;
/// Draws are parted where one in this many is decided at least: parting takes as long as two or three sums over all.
const PAYS: usize = 4;
/// What a search may leave in ln q. After a step that is the step times the relative error of its slope, and a slope
/// measured over the step before is off by about the length of that.
const TOLERANCE: f64 = 1e-7;
/// The same for one of many sets of draws.
const NEXT_TOLERANCE: f64 = 5e-6;
const LONGEST_STEP: f64 = 0.5;
const STEP_LIMIT: usize = 60;
/// The slope of the share in ln q is at least this.
const LEAST_SLOPE: f64 = 1e-6;
/// Relative error of the slope of a lognormal law in the place of the mixture, and of that of draws that are alike.
const LOGNORMAL_SLOPE_ERROR: f64 = 0.1;
const LAST_SLOPE_ERROR: f64 = 0.01;

/// The law of R: chi, the length of a standard normal vector.
#[derive(Debug, Clone, PartialEq)]
pub struct ScaleMixture {
    /// F(x) is the polynomial with these coefficients, constant first, at `rate * x + offset` held in [-1, 1].
    coefficients: [f64; COEFFICIENTS],
    rate: f64,
    offset: f64,
    typical: f64,
}

/// What one quantile leaves for the next of similar draws: where a search starts.
#[derive(Debug, Clone, Default)]
pub struct LastQuantile {
    found: Option<Found>,
    among: Undecided,
}

#[derive(Debug, Clone, Copy)]
struct Found {
    /// Of the draws, along the line that they lie on.
    at: f64,
    /// The quantile over the mean of the draws, and how it changes along the line.
    ratio: f64,
    rate: f64,
    slope: f64,
}

/// The draws whose shares depend on where the quantile lies in a range. The polynomial stands still outside its interval, and
/// where a chi law has many degrees of freedom, that decides most draws.
#[derive(Debug, Clone, Default)]
struct Undecided {
    /// The range, as quantiles.
    low: f64,
    high: f64,
    /// Of the draws.
    reciprocals: Vec<f64>,
    /// Draws of which F is at the lower and at the upper end of its interval.
    ends: [f64; 2],
}

/// Where a search starts: a quantile, the slope of the share in ln q there, and the relative error of that slope.
struct Start {
    quantile: f64,
    slope: f64,
    slope_error: f64,
}

impl ScaleMixture {
    /// R of `freedom` >= 1 dimensions. Cost O(freedom + 1000).
    pub fn chi(freedom: usize) -> Self {
        let typical = (freedom as f64).sqrt();
        let (low, high) = ((typical - HALF_WIDTH).max(0.0), typical + HALF_WIDTH);
        let (rate, offset) = (2.0 / (high - low), -(high + low) / (high - low));
        let share = |position: f64| chi_cdf((position - offset) / rate, freedom);
        ScaleMixture { coefficients: polynomial(share), rate, offset, typical }
    }

    /// The `share`-quantile of R h from draws of h, none negative; `share` in [0.001, 0.999], where the polynomial
    /// stands for F. Cost O(draws), here and below.
    pub fn quantile(&self, share: f64, draws: &[f64]) -> f64 {
        self.quantile_within(TOLERANCE, share, draws, 0.0, &mut LastQuantile::default())
    }

    /// The same, to 5e-6 of itself, for one of many sets of draws that are alike: where they change along a line, `at` is where
    /// on it they lie, and else always the same.
    pub fn quantile_next(&self, share: f64, draws: &[f64], at: f64, last: &mut LastQuantile) -> f64 {
        self.quantile_within(NEXT_TOLERANCE, share, draws, at, last)
    }

    /// The quantile with its standard error: the deviation of F(q / h), over the density at q.
    pub fn quantile_with_error(&self, share: f64, draws: &[f64]) -> (f64, f64) {
        let mut last = LastQuantile::default();
        let quantile = self.quantile_within(TOLERANCE, share, draws, 0.0, &mut last);
        let Some(Found { slope, .. }) = last.found else { return (0.0, 0.0) };
        let square = self.mean(quantile, draws, &mut last.among, |share| share * share);
        let variance = (square - share * share).max(0.0);
        (quantile, (variance / draws.len() as f64).sqrt() * quantile / slope)
    }

    fn quantile_within(&self, tolerance: f64, share: f64, draws: &[f64], at: f64, last: &mut LastQuantile) -> f64 {
        let mean = sum(draws) / draws.len() as f64;
        if mean <= 0.0 {
            last.found = None;
            return 0.0;
        }
        let LastQuantile { found, among } = last;
        let start = match found {
            Some(last) => Start {
                quantile: mean * (last.ratio + last.rate * (at - last.at)).max(0.5 * last.ratio),
                slope: last.slope,
                slope_error: LAST_SLOPE_ERROR,
            },
            None => self.lognormal(share, mean, draws),
        };
        // Of other draws.
        among.high = 0.0;
        let (quantile, slope) =
            search(tolerance, share, start, |quantile| self.mean(quantile, draws, among, |share| share));
        let ratio = quantile / mean;
        let rate = found.filter(|before| before.at != at).map(|before| (ratio - before.ratio) / (at - before.at));
        *found = Some(Found { at, ratio, rate: rate.unwrap_or_default(), slope });
        quantile
    }

    /// The quantile and its slope were R h lognormal with the mean and the variance it has, nearly: ln R has a variance of
    /// about 1/(2 m). Within 2 % from m = 20 on, which saves half of a search.
    fn lognormal(&self, share: f64, mean: f64, draws: &[f64]) -> Start {
        let square = dot(draws, draws) / draws.len() as f64;
        let spread = (square / (mean * mean)).ln().max(0.0);
        let deviation = (spread + 0.5 / (self.typical * self.typical)).sqrt();
        let normal = normal_quantile(share);
        Start {
            quantile: mean * self.typical * (normal * deviation - 0.5 * spread).exp(),
            slope: (-0.5 * normal * normal).exp() / ((2.0 * PI).sqrt() * deviation),
            slope_error: LOGNORMAL_SLOPE_ERROR,
        }
    }

    /// The mean of a function of F(q / h) over the draws. What is fused is written so, and the sum has fixed accumulators: the
    /// bits do not depend on the processor.
    #[inline(always)]
    fn mean(&self, quantile: f64, draws: &[f64], among: &mut Undecided, function: impl Fn(f64) -> f64) -> f64 {
        if !(among.low..=among.high).contains(&quantile) {
            self.part(quantile, draws, among);
        }
        let [lowest, highest] = [-1.0, 1.0].map(|position| function(self.polynomial(position)));
        let mut total = among.ends[0] * lowest + among.ends[1] * highest;
        let mut staged = [0.0; BLOCK];
        for block in among.reciprocals.chunks(BLOCK) {
            let staged = &mut staged[..block.len()];
            // Dispatched apart: in one function with the sum, LLVM leaves the loop over the polynomial scalar.
            dispatched!({
                for (value, reciprocal) in staged.iter_mut().zip(block) {
                    *value = function(self.share_of(quantile * reciprocal));
                }
            });
            total += sum(staged);
        }
        total / draws.len() as f64
    }

    /// Parts the draws into those whose F is the same wherever within reach of `quantile` the quantile lies, and the others.
    fn part(&self, quantile: f64, draws: &[f64], among: &mut Undecided) {
        (among.low, among.high) = (quantile * (1.0 - REACH), quantile * (1.0 + REACH));
        // F stands still below the first and above the second.
        let [low, high] = [-1.0, 1.0].map(|position| (position - self.offset) / self.rate);
        let (least, most) = (among.low / high, if low > 0.0 { among.high / low } else { f64::INFINITY });
        among.reciprocals.clear();
        among.reciprocals.reserve(draws.len());
        let decided = dispatched!(draws.iter().filter(|draw| (**draw <= least) | (**draw >= most)).count());
        let mut beyond = 0;
        if PAYS * decided < draws.len() {
            (among.low, among.high) = (0.0, f64::INFINITY);
            among.reciprocals.extend_from_slice(draws);
        } else {
            let mut staged = [0.0; BLOCK];
            for block in draws.chunks(BLOCK) {
                // Without a branch, which nobody could foretell.
                let mut count = 0;
                for &draw in block {
                    staged[count] = draw;
                    count += usize::from((draw > least) & (draw < most));
                }
                among.reciprocals.extend_from_slice(&staged[..count]);
            }
            beyond = dispatched!(draws.iter().filter(|draw| **draw >= most).count());
        }
        let undecided = &mut among.reciprocals;
        among.ends = [beyond as f64, (draws.len() - undecided.len() - beyond) as f64];
        dispatched!(undecided.iter_mut().for_each(|draw| *draw = 1.0 / *draw));
    }

    /// F(x).
    #[inline(always)]
    fn share_of(&self, x: f64) -> f64 {
        let position = x.mul_add(self.rate, self.offset);
        let position = if position < -1.0 { -1.0 } else { position };
        self.polynomial(if position > 1.0 { 1.0 } else { position })
    }

    #[inline(always)]
    fn polynomial(&self, position: f64) -> f64 {
        let [lower @ .., highest] = &self.coefficients;
        lower.iter().rev().fold(*highest, |sum, coefficient| sum.mul_add(position, *coefficient))
    }
}

/// The q at which `share_below`, the mean of F(q / h), is `share`, and the slope there in ln q: secants from a start, and
/// halves of the bracket where they leave it, until no more than the tolerance is left.
fn search(tolerance: f64, share: f64, start: Start, mut share_below: impl FnMut(f64) -> f64) -> (f64, f64) {
    let Start { mut quantile, mut slope, mut slope_error } = start;
    let (mut low, mut high) = (0.0, f64::INFINITY);
    let mut before: Option<(f64, f64)> = None;
    for _ in 0..STEP_LIMIT {
        let missing = share - share_below(quantile);
        if let Some((missed, step)) = before {
            slope = ((missed - missing) / step).max(LEAST_SLOPE);
            slope_error = step.abs();
        }
        if missing > 0.0 {
            low = quantile
        } else {
            high = quantile
        }
        let mut step = (missing / slope).clamp(-LONGEST_STEP, LONGEST_STEP);
        let beyond = quantile * step.exp();
        if beyond < low || beyond > high {
            step = 0.5 * (low.max(quantile * (-LONGEST_STEP).exp()) * high.min(quantile * LONGEST_STEP.exp())).ln()
                - quantile.ln();
        }
        quantile *= step.exp();
        if step.abs() * slope_error < tolerance {
            break;
        }
        before = Some((missing, step));
    }
    (quantile, slope)
}

/// Of the standard normal law, to 0.003 for shares in [0.001, 0.999]. Source: Shore (1982), Simple approximations for the
/// inverse cumulative function, Applied Statistics 31.
fn normal_quantile(share: f64) -> f64 {
    let beyond = share.min(1.0 - share);
    let size = 5.5556 * (1.0 - (beyond / (1.0 - beyond)).powf(0.1186));
    if share < 0.5 { -size } else { size }
}

/// The coefficients, constant first, of the polynomial through `value` at the Chebyshev points of [-1, 1].
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

/// P(R <= x): the regularised incomplete gamma function P(m/2, x^2/2), which the library has above 0 alone.
fn chi_cdf(x: f64, freedom: usize) -> f64 {
    checked_gamma_lr(0.5 * freedom as f64, 0.5 * x * x).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let found = ScaleMixture::chi(freedom).share_of(x);
            // The error named where the polynomial is.
            assert!((found - expected).abs() < 3e-5, "{freedom} {x}: {found} against {expected}");
        }
    }

    #[test]
    fn a_constant_draw_has_the_quantiles_of_its_chi_law() {
        // scipy.stats.chi.ppf(p, m). The density is 0.2 at least, so that 6e-5 of share are 3e-4 of quantile.
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
                let mean = draws.iter().map(|draw| mixture.share_of(alone / draw)).sum::<f64>() / 403.0;
                assert!((mean - share).abs() < 1e-7, "{scale} {share}: {mean}");
                let next = mixture.quantile_next(share, &draws, at as f64, &mut last);
                // Twenty times the tolerance: slopes of draws as different as these are off by as much more.
                assert!((next / alone - 1.0).abs() < 1e-4, "{scale} {share}: {next} against {alone}");
            }
        }
    }
}
