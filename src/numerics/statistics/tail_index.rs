//! Hill's estimator of the tail index: how fast the probability of large values falls.
//!
//! If P(Z > z) falls like z^-a, moments of order a and above do not exist. With z_(1) >= z_(2) >= ... the values in
//! descending order, and k of them in the tail,
//!
//!   1/a = (1/k) sum over i = 1..k of ln(z_(i) / z_(k+1)),   standard error a / sqrt(k).
//!
//! Source: Hill (1975), A simple general approach to inference about the tail of a distribution, Annals of Statistics 3.

use crate::numerics::statistics::summary::quantile;

/// Share of the values in each tail.
const SHARE: f64 = 0.1;
/// Fewest values in a tail.
const FEWEST: usize = 6;

/// An estimated tail index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TailIndex {
    /// Hill's estimate a: moments of order a and above may not exist.
    pub index: f64,
    /// Its standard error, `index / sqrt(count)`.
    pub standard_error: f64,
    /// Number of values in the tail.
    pub count: usize,
}

/// Returns the indices of the lower and the upper tail, each of a tenth of the values, measured from the median. A tail
/// has none if it has fewer than six values or if they are all equal. Cost O(n ln n).
///
/// Checked by: `the_index_of_power_laws_is_their_power`, and by
/// `src/control/request/warnings.rs::heavy_tails_are_warned_of_and_light_ones_rarely`.
pub fn tail_indices(values: &[f64]) -> [Option<TailIndex>; 2] {
    let middle = quantile(values, 0.5);
    let of_side = |sign: f64| {
        let mut far: Vec<f64> = values.iter().map(|value| sign * (value - middle)).collect();
        far.sort_by(|left, right| right.total_cmp(left));
        hill(&far, (SHARE * values.len() as f64) as usize)
    };
    [of_side(-1.0), of_side(1.0)]
}

/// Returns the index of the `count` first of values in descending order.
fn hill(descending: &[f64], count: usize) -> Option<TailIndex> {
    let threshold = *descending.get(count).filter(|threshold| count >= FEWEST && **threshold > 0.0)?;
    let mean = descending[..count].iter().map(|value| (value / threshold).ln()).sum::<f64>() / count as f64;
    let index = mean.recip();
    (mean > 0.0).then(|| TailIndex { index, standard_error: index / (count as f64).sqrt(), count })
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::numerics::machine::streams::stream;

    #[test]
    fn the_index_of_power_laws_is_their_power() {
        // Half of the values are 0, the median. The others are z or -z by the inverse of P(Z > z) = z^-a from 1 on.
        let mut generator = stream(1, "tails", 0, 0);
        for power in [1.5, 3.0] {
            let mut draw = || {
                let [part, share]: [f64; 2] = [generator.random(), generator.random()];
                let side = if part < 0.25 { -1.0 } else { f64::from(u8::from(part < 0.5)) };
                side * (1.0 - share).powf(-1.0 / power)
            };
            let values: Vec<f64> = (0..20_000).map(|_| draw()).collect();
            for found in tail_indices(&values).map(Option::unwrap) {
                assert_eq!(found.count, 2000);
                assert!((found.standard_error - found.index / 2000.0_f64.sqrt()).abs() < 1e-12);
                assert!((found.index - power).abs() < 4.0 * found.standard_error, "{power}: {found:?}");
            }
        }
    }

    #[test]
    fn a_tail_of_few_or_of_equal_values_has_no_index() {
        let rising: Vec<f64> = (0..59).map(f64::from).collect();
        assert_eq!(tail_indices(&rising), [None, None]);
        assert_eq!(tail_indices(&[0.3; 100]), [None, None]);
    }
}
