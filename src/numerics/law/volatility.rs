//! Returns rescaled to the current volatility.

use crate::numerics::statistics::moving_mean::moving_means;

/// Lower bound of the volatility as a share of its first value; without it a return after a long calm would be
/// magnified without bound.
const SMALLEST_SHARE: f64 = 0.01;

/// Returns the volatility that is expected before each value of a record, and before the next: s_t as in [`rescaled`]. Cost
/// O(n).
pub fn expected(record: &[f64], half_life: f64) -> Vec<f64> {
    let squares: Vec<f64> = record.iter().map(|z| z * z).collect();
    let expected = moving_means(&squares, half_life);
    let least = SMALLEST_SHARE * SMALLEST_SHARE * expected[0];
    expected.into_iter().map(|square| square.max(least).sqrt()).collect()
}

/// Rescales a record, oldest first, as if each return had occurred at the volatility that is expected for the next one:
///
///   y_t = z_t s_(n+1) / s_t,   s_(t+1)^2 = d s_t^2 + (1 - d) z_t^2,   d = 2^(-1 / half_life),
///
/// s_1^2 is the mean square of the record. The volatility expected for a period follows from the returns before it,
/// except at the start. A record of zeros is returned as it is. Cost O(n). Source: RiskMetrics (1996), section 5.2.
pub fn rescaled(record: &[f64], half_life: f64) -> Vec<f64> {
    let expected = expected(record, half_life);
    let now = expected[record.len()];
    if now <= 0.0 {
        return record.to_vec();
    }
    record.iter().zip(&expected).map(|(log_return, before)| log_return / before * now).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECORD: [f64; 6] = [0.03, -0.11, 0.07, 0.02, -0.05, 0.16];

    #[test]
    fn three_returns_agree_with_pencil_and_paper() {
        // Squares 1, 4 and 25 e-4: mean 10. Halved each time: 10, 5.5, 4.75, 14.875.
        let found = rescaled(&[0.01, -0.02, 0.05], 1.0);
        for (found, (value, before)) in found.iter().zip([(0.01, 10.0), (-0.02, 5.5), (0.05, 4.75)]) {
            assert!((found - value * f64::sqrt(14.875 / before)).abs() < 1e-15, "{found}");
        }
    }

    #[test]
    fn a_record_of_one_size_or_of_an_endless_half_life_stays_as_it_is() {
        let even = [0.02, -0.02, -0.02, 0.02];
        for (record, half_life) in [(&even[..], 3.0), (&RECORD, 1e15), (&[0.0, 0.0], 3.0)] {
            for (found, value) in rescaled(record, half_life).iter().zip(record) {
                assert!((found - value).abs() < 1e-14, "{found} {value}");
            }
        }
    }

    #[test]
    fn twice_the_returns_are_twice_as_large_and_only_their_order_says_what_is_now() {
        let (plain, doubled) = (rescaled(&RECORD, 2.0), rescaled(&RECORD.map(|z| 2.0 * z), 2.0));
        for (one, other) in plain.iter().zip(&doubled) {
            assert!((2.0 * one - other).abs() < 1e-15, "{one} {other}");
        }
        let mut reversed = RECORD;
        reversed.reverse();
        let spread = |record: &[f64]| record.iter().map(|z| z * z).sum::<f64>();
        assert!(spread(&plain) > 1.5 * spread(&rescaled(&reversed, 2.0)), "the largest return came last");
    }

    #[test]
    fn the_calm_before_a_storm_counts_as_a_storm() {
        // Each half is long enough for the start to be forgotten; the first returns of the storm stand out as they did.
        let size = |t: usize| if t < 300 { 0.01 } else { 0.03 };
        let record: Vec<f64> = (0..600).map(|t| if t % 2 == 0 { size(t) } else { -size(t) }).collect();
        let found = rescaled(&record, 12.0);
        for t in (250..300).chain(550..600) {
            assert!((found[t].abs() - 0.03).abs() < 1e-5, "{t}: {}", found[t]);
        }
        assert!((found[300] - 0.09).abs() < 1e-4, "{}", found[300]);
    }
}
