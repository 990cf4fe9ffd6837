//! The worst mean of e^Z over a Wasserstein-1 ball around an empirical law.
//!
//!   min { E_F[e^Z] : W1(F, F^) <= radius } = sum_j w_j e^min(z_j, c),   sum_j w_j (z_j - c)^+ = radius,   w the masses
//!
//! e^z is increasing and convex, so a loss is cheapest per unit of distance at the top: the worst law caps the largest
//! values at c. A lower bound of the support bounds the cap.

use crate::numerics::law::empirical::EmpiricalDistribution;

/// A law prepared for the worst mean with and without one more value.
pub struct ExponentialMean<'a> {
    law: &'a EmpiricalDistribution,
    /// `sums[j]`: sums of w e^z and of w (e^z - 1)^2 over the first j atoms, w their weights.
    sums: Vec<[f64; 2]>,
}

/// Mean and variance of e^Z under the law with the worst mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorstExponential {
    /// Mean of e^Z.
    pub mean: f64,
    /// Variance of e^Z.
    pub variance: f64,
}

impl<'a> ExponentialMean<'a> {
    /// Prepares a law. Cost O(n).
    pub fn of(law: &'a EmpiricalDistribution) -> Self {
        let mut sums = vec![[0.0; 2]];
        let mut total = [0.0; 2];
        for (atom, weight) in law.atoms().iter().zip(law.weights()) {
            total = added(total, *atom, *weight);
            sums.push(total);
        }
        ExponentialMean { law, sums }
    }

    /// Returns the worst mean over the ball of the law. `lowest` bounds the support from below; it is minus infinity if
    /// nothing does. Cost O(values above the cap).
    pub fn worst(&self, radius: f64, lowest: f64) -> WorstExponential {
        self.capped(None, radius, lowest)
    }

    /// Returns the worst mean over the ball of the law with `value` added. Cost O(values above the cap).
    pub fn worst_with(&self, value: f64, radius: f64, lowest: f64) -> WorstExponential {
        self.capped(Some(value), radius, lowest)
    }

    fn capped(&self, extra: Option<f64>, radius: f64, lowest: f64) -> WorstExponential {
        let (atoms, weights) = (self.law.atoms(), self.law.weights());
        // Factors for the weights of the law, and the weight of the extra value.
        let (kept, more) = if extra.is_some() { (self.law.retention(), 1.0) } else { (1.0, 0.0) };
        let size = self.law.total_weight() * kept + more;
        // Atoms that remain below the cap, and the extra value if it is among them.
        let (mut left, mut extra_left) = (atoms.len(), extra);
        let (mut above, mut cap, mut budget) = (0.0, f64::INFINITY, radius * size);
        loop {
            let top = atoms[..left].last().copied();
            let next = match (top, extra_left) {
                (Some(top), Some(extra)) => top.max(extra),
                (Some(only), None) | (None, Some(only)) => only,
                (None, None) => break,
            };
            let cost = if above > 0.0 { above * (cap - next) } else { 0.0 };
            if cost > budget {
                break;
            }
            (budget, cap) = (budget - cost, next);
            if extra_left.is_some_and(|extra| extra == next) {
                extra_left = None;
                above += more;
            } else {
                left -= 1;
                above += kept * weights[left];
            }
        }
        let cap = (cap - budget / above).max(lowest.min(cap));
        let below = self.sums[left].map(|sum| kept * sum);
        let below = extra_left.map_or(below, |extra| added(below, extra, more));
        let [mean, square] = added(below, cap, above).map(|sum| sum / size);
        WorstExponential { mean, variance: (square - (mean - 1.0).powi(2)).max(0.0) }
    }
}

/// Returns the sums with `weight` more of one log-return.
fn added([sum, squares]: [f64; 2], log_return: f64, weight: f64) -> [f64; 2] {
    [sum + weight * log_return.exp(), squares + weight * log_return.exp_m1().powi(2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::transport::wasserstein::WassersteinBall;

    #[test]
    fn the_cap_is_the_exact_worst_law() {
        for retention in [1.0, 0.7] {
            let law = EmpiricalDistribution::decaying(&[0.02, -0.05, 0.11, 0.04, 0.04], retention);
            for radius in [0.0, 0.001, 0.02, 0.3] {
                for extra in [None, Some(-0.2), Some(0.04), Some(0.11), Some(0.5)] {
                    is_the_exact_worst_law(&law, radius, extra);
                }
            }
        }
    }

    fn is_the_exact_worst_law(law: &EmpiricalDistribution, radius: f64, extra: Option<f64>) {
        let mean = ExponentialMean::of(law);
        let mut with = law.clone();
        extra.into_iter().for_each(|value| with.push(value));
        let mut support: Vec<f64> = (-15_000..=6_000).map(|k| f64::from(k) * 1e-4).collect();
        support.extend(with.atoms());
        support.sort_by(f64::total_cmp);
        support.dedup();
        let weighted = || with.atoms().iter().zip(with.weights());
        let mass =
            |z: &f64| weighted().filter(|(atom, _)| *atom == z).map(|(_, w)| w).sum::<f64>() / with.total_weight();
        let masses: Vec<f64> = support.iter().map(mass).collect();
        let payoff: Vec<f64> = support.iter().map(|z| z.exp()).collect();
        let ball = WassersteinBall { support: &support, masses: &masses, radius };
        let expected = ball.worst_expectation(&payoff).0;
        let lowest = f64::NEG_INFINITY;
        let found = extra.map_or_else(|| mean.worst(radius, lowest), |value| mean.worst_with(value, radius, lowest));
        // The grid misses the cap by at most its spacing; the chord of e^z is second order in it.
        assert!((found.mean - expected).abs() < 2e-9, "{radius} {extra:?}: {found:?} against {expected}");
        let moves = ball.worst_law(&payoff).moves;
        let square: f64 = moves.iter().map(|moved| moved.mass * payoff[moved.to].powi(2)).sum();
        let variance = square - expected * expected;
        // The same holds here, but the square may put the cap's mass on either adjacent point.
        assert!((found.variance - variance).abs() < 1e-6, "{radius} {extra:?}: {found:?} against {variance}");
    }

    #[test]
    fn the_support_bounds_the_cap() {
        let law = EmpiricalDistribution::new(&[0.1, 0.3]);
        let mean = ExponentialMean::of(&law);
        assert_eq!(mean.worst(10.0, 0.05).mean, 0.05_f64.exp());
        assert_eq!(mean.worst(0.0, 0.05).mean, (0.1_f64.exp() + 0.3_f64.exp()) / 2.0);
    }
}
