//! Whether returns still come as they came: a bet against their being exchangeable.
//!
//! Each new return gets a conformal p-value, which is uniform and independent of all before it where the order of the returns
//! means nothing. A capital that bets on small p-values, `M = integral over e in [0, 1] of prod_i e p_i^(e-1)`, is then a
//! martingale that starts at 1, so the chance that it ever reaches c is at most 1/c (Ville).
//! Sources: Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World (2005), sections 2 and 7; the mixture is that of
//! Vovk, Nouretdinov and Gammerman, Testing exchangeability on-line (2003).
//! Checked by: `tests/solver/exchangeability.rs`.

use super::empirical::EmpiricalDistribution;

/// The p-value of `value`, one of the atoms of `law`: how many atoms lie as far from the median as it does, of all of them.
///
/// Those exactly as far count by the share `tie` of (0, 1], a uniform number of the value's own: the p-value is then uniform
/// and not only bounded. Small where the value is extreme in the law. Cost O(log n).
pub fn p_value(law: &EmpiricalDistribution, value: f64, tie: f64) -> f64 {
    let atoms = law.atoms();
    let size = atoms.len();
    let median = 0.5 * (atoms[(size - 1) / 2] + atoms[size / 2]);
    let distance = (value - median).abs();
    // The distance grows both ways from the median, so what is nearer is a run of atoms, and what is as far at most another.
    let from = |is_out: &dyn Fn(f64) -> bool| atoms.partition_point(|&atom| atom < median && is_out(median - atom));
    let to = |is_in: &dyn Fn(f64) -> bool| atoms.partition_point(|&atom| atom < median || is_in(atom - median));
    let nearer = to(&|far| far < distance) - from(&|far| far >= distance);
    let no_further = to(&|far| far <= distance) - from(&|far| far > distance);
    let (further, as_far) = (size - no_further, no_further - nearer);
    (further as f64 + tie * as_far as f64) / size as f64
}

/// The capital after a number of bets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capital {
    bets: usize,
    /// L = -sum ln p_i.
    surprise: f64,
    /// ln of the largest capital that there ever was.
    highest: f64,
}

impl Default for Capital {
    /// 1, before the first bet.
    fn default() -> Self {
        Capital { bets: 0, surprise: 0.0, highest: 0.0 }
    }
}

impl Capital {
    /// After one more p-value. Cost: as [`Capital::log`].
    #[must_use]
    pub fn after(self, p_value: f64) -> Self {
        let next = Capital { bets: self.bets + 1, surprise: self.surprise - p_value.ln(), ..self };
        Capital { highest: self.highest.max(next.log()), ..next }
    }

    /// ln of the largest capital that there ever was.
    pub fn log_highest(self) -> f64 {
        self.highest
    }

    /// ln M. With n bets and L = -sum ln p,
    ///
    ///   M = integral over e of e^n exp((1 - e) L) = sum over k >= 0 of L^k / ((n+1) (n+2) ... (n+1+k)),
    ///
    /// the series of the lower incomplete gamma function; all its terms are positive. Cost O(L + sqrt n). Infinite after a p-value of 0, which no atom
    /// of its law has.
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
