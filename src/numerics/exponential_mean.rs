//! The worst mean of e^Z over a Wasserstein-1 ball around an empirical law.
//!
//!   min { E_F[e^Z] : W1(F, F^) <= radius } = (1/n) sum_j e^min(z_j, c),   (1/n) sum_j (z_j - c)^+ = radius
//!
//! e^z is increasing and convex, so the cheapest loss per unit of distance lies at the top: the worst law cuts the
//! largest values off at a cap c. A lower bound of the support bounds the cap.

use super::empirical::EmpiricalDistribution;

/// A law prepared for the worst mean with and without one more value.
pub struct ExponentialMean<'a> {
    /// Ascending.
    atoms: &'a [f64],
    /// `sums[j]`: sums of e^z and of (e^z - 1)^2 over the first j atoms.
    sums: Vec<[f64; 2]>,
    lowest: f64,
}

/// Mean and variance of e^Z under the law with the worst mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorstExponential {
    /// Of e^Z.
    pub mean: f64,
    /// Of e^Z.
    pub variance: f64,
}

impl<'a> ExponentialMean<'a> {
    /// `lowest` bounds the support from below; minus infinity where nothing does. Cost O(n).
    pub fn of(law: &'a EmpiricalDistribution, lowest: f64) -> Self {
        let mut sums = vec![[0.0; 2]];
        let mut total = [0.0; 2];
        for atom in law.atoms() {
            total = added(total, *atom, 1.0);
            sums.push(total);
        }
        ExponentialMean { atoms: law.atoms(), sums, lowest }
    }

    /// Over the ball of the law itself. Cost O(values above the cap).
    pub fn worst(&self, radius: f64) -> WorstExponential {
        self.capped(None, radius)
    }

    /// Over the ball of the law with `value` added. Cost O(values above the cap).
    pub fn worst_with(&self, value: f64, radius: f64) -> WorstExponential {
        self.capped(Some(value), radius)
    }

    fn capped(&self, extra: Option<f64>, radius: f64) -> WorstExponential {
        let size = (self.atoms.len() + usize::from(extra.is_some())) as f64;
        // Atoms left below the cap, and whether the extra value is among them.
        let (mut left, mut extra_left) = (self.atoms.len(), extra);
        let (mut above, mut cap, mut budget) = (0.0, f64::INFINITY, radius * size);
        loop {
            let top = self.atoms[..left].last().copied();
            let next = match (top, extra_left) {
                (Some(top), Some(extra)) => top.max(extra),
                (Some(only), None) | (None, Some(only)) => only,
                (None, None) => break,
            };
            let cost = if above > 0.0 { above * (cap - next) } else { 0.0 };
            if cost > budget {
                break;
            }
            (budget, cap, above) = (budget - cost, next, above + 1.0);
            if extra_left.is_some_and(|extra| extra == next) {
                extra_left = None;
            } else {
                left -= 1;
            }
        }
        let cap = (cap - budget / above).max(self.lowest.min(cap));
        let below = extra_left.map_or(self.sums[left], |extra| added(self.sums[left], extra, 1.0));
        let [mean, square] = added(below, cap, above).map(|sum| sum / size);
        WorstExponential { mean, variance: (square - (mean - 1.0).powi(2)).max(0.0) }
    }
}

/// The sums with `count` more of one log-return.
fn added([sum, squares]: [f64; 2], log_return: f64, count: f64) -> [f64; 2] {
    [sum + count * log_return.exp(), squares + count * log_return.exp_m1().powi(2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::wasserstein::WassersteinBall;

    #[test]
    fn the_cap_is_the_exact_worst_law() {
        let law = EmpiricalDistribution::new(&[0.02, -0.05, 0.11, 0.04, 0.04]);
        let mean = ExponentialMean::of(&law, f64::NEG_INFINITY);
        for radius in [0.0, 0.001, 0.02, 0.3] {
            for extra in [None, Some(-0.2), Some(0.04), Some(0.11), Some(0.5)] {
                let mut with = law.clone();
                extra.into_iter().for_each(|value| with.push(value));
                let mut support: Vec<f64> = (-15_000..=6_000).map(|k| f64::from(k) * 1e-4).collect();
                support.extend(with.atoms());
                support.sort_by(f64::total_cmp);
                support.dedup();
                let mass =
                    |z: &f64| with.atoms().iter().filter(|atom| *atom == z).count() as f64 / with.sample_size() as f64;
                let masses: Vec<f64> = support.iter().map(mass).collect();
                let payoff: Vec<f64> = support.iter().map(|z| z.exp()).collect();
                let ball = WassersteinBall { support: &support, masses: &masses, radius };
                let expected = ball.worst_expectation(&payoff).0;
                let found = extra.map_or_else(|| mean.worst(radius), |value| mean.worst_with(value, radius));
                // The grid misses the cap by at most its spacing, of which the chord of e^z is second order.
                assert!((found.mean - expected).abs() < 2e-9, "{radius} {extra:?}: {found:?} against {expected}");
                let moves = ball.worst_law(&payoff).moves;
                let square: f64 = moves.iter().map(|moved| moved.mass * payoff[moved.to].powi(2)).sum();
                let variance = square - expected * expected;
                // Likewise, but the square may put the cap's mass on either neighbour.
                assert!((found.variance - variance).abs() < 1e-6, "{radius} {extra:?}: {found:?} against {variance}");
            }
        }
    }

    #[test]
    fn the_support_bounds_the_cap() {
        let law = EmpiricalDistribution::new(&[0.1, 0.3]);
        let mean = ExponentialMean::of(&law, 0.05);
        assert_eq!(mean.worst(10.0).mean, 0.05_f64.exp());
        assert_eq!(mean.worst(0.0).mean, (0.1_f64.exp() + 0.3_f64.exp()) / 2.0);
    }
}
