//! A test martingale against the exchangeability of returns: it grows if new returns differ from earlier ones.
//!
//! Each new return gets a conformal p-value. If the order of the returns carries no information, the p-values are
//! uniform and independent. The wealth of a bettor on small p-values, `M = integral over e in [0, 1] of prod_i e
//! p_i^(e-1)`, is then a test martingale that starts at 1. By Ville's inequality the chance that it ever reaches c is
//! at most 1/c.
//! Sources: Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World (2005), sections 2 and 7. The mixture is
//! that of Vovk, Nouretdinov and Gammerman, Testing exchangeability on-line (2003).
//! Checked by: `tests/solver/exchangeability.rs`.

use crate::numerics::law::empirical::EmpiricalDistribution;

/// Returns the p-value of `value`, an atom of `law`: the share of atoms that are at least as far from the median.
///
/// Atoms at exactly the same distance count by the share `tie` in (0, 1], a uniform number drawn for this value. This
/// makes the p-value uniform and not only bounded. It is small if the value is extreme in the law. Cost O(log n).
pub fn p_value(law: &EmpiricalDistribution, value: f64, tie: f64) -> f64 {
    let atoms = law.atoms();
    let size = atoms.len();
    let median = 0.5 * (atoms[(size - 1) / 2] + atoms[size / 2]);
    let distance = (value - median).abs();
    // The distance grows in both directions from the median. So the nearer atoms are one run, and those no further are
    // another.
    let from = |is_out: &dyn Fn(f64) -> bool| atoms.partition_point(|&atom| atom < median && is_out(median - atom));
    let to = |is_in: &dyn Fn(f64) -> bool| atoms.partition_point(|&atom| atom < median || is_in(atom - median));
    let nearer = to(&|far| far < distance) - from(&|far| far >= distance);
    let no_further = to(&|far| far <= distance) - from(&|far| far > distance);
    let (further, as_far) = (size - no_further, no_further - nearer);
    (further as f64 + tie * as_far as f64) / size as f64
}

/// The wealth of the test martingale after a number of bets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TestMartingale {
    bets: usize,
    /// L = -sum ln p_i.
    surprise: f64,
    /// ln of the largest wealth reached so far.
    highest: f64,
}

impl Default for TestMartingale {
    /// Returns wealth 1, before the first bet.
    fn default() -> Self {
        TestMartingale { bets: 0, surprise: 0.0, highest: 0.0 }
    }
}

impl TestMartingale {
    /// Returns the wealth after one more p-value. Cost: as [`TestMartingale::log`].
    #[must_use]
    pub fn after(self, p_value: f64) -> Self {
        let next = TestMartingale { bets: self.bets + 1, surprise: self.surprise - p_value.ln(), ..self };
        TestMartingale { highest: self.highest.max(next.log()), ..next }
    }

    /// Returns ln of the largest wealth reached so far.
    pub fn log_highest(self) -> f64 {
        self.highest
    }

    /// Returns ln M. With n bets and L = -sum ln p,
    ///
    ///   M = integral over e of e^n exp((1 - e) L) = sum over k >= 0 of L^k / ((n+1) (n+2) ... (n+1+k)),
    ///
    /// the series of the lower incomplete gamma function; all its terms are positive. Cost O(L + sqrt n). Infinite
    /// after a p-value of 0, which no atom of its law has.
    pub fn log(self) -> f64 {
        if self.surprise.is_infinite() {
            return f64::INFINITY;
        }
        let mut divisor = self.bets as f64 + 1.0;
        let (mut term, mut sum, mut scale) = (1.0 / divisor, 1.0 / divisor, 0.0);
        while term > f64::EPSILON * sum || divisor < self.surprise {
            divisor += 1.0;
            term *= self.surprise / divisor;
            sum += term;
            if sum > 1e280 {
                (term, sum, scale) = (term * 1e-280, sum * 1e-280, scale + 280.0 * std::f64::consts::LN_10);
            }
        }
        sum.ln() + scale
    }
}
