//! Radii of balls around empirical laws that hold every law on the interval [0, 1] at least as often as stated, at every
//! sample size. On an interval of length D they are D times as large.
//!
//! In both, W1(F_n, F) is the integral of |F_n - F| over the interval, and returns are independent.

/// Returns the radius. A value weighs `retention` times as much as the next later one. If weights are equal, the radius
/// is the smaller of the bounds of Massart and McDiarmid; otherwise it is the bound of McDiarmid.
///
/// Checked by: `no_law_leaves_its_ball_more_often_than_stated`.
pub fn radius(alpha: f64, effective_size: f64, retention: f64) -> f64 {
    let weighted = weighted_radius(alpha, effective_size);
    if retention < 1.0 { weighted } else { weighted.min(uniform_radius(alpha, effective_size)) }
}

/// Returns `sqrt(ln(2 / alpha) / (2 n))`: W1 is at most sup |F_n - F|, which exceeds x with probability at most
/// `2 exp(-2 n x^2)`. For a law of the two ends this is Hoeffding's inequality, so only a sharper bound for such laws
/// would improve it. Values have equal weights. Source: Massart (1990), The tight constant in the
/// Dvoretzky-Kiefer-Wolfowitz inequality, Annals of Probability 18.
fn uniform_radius(alpha: f64, size: f64) -> f64 {
    ((2.0 / alpha).ln() / (2.0 * size)).sqrt()
}

/// Returns `(1/2 + sqrt(ln(1 / alpha) / 2)) / sqrt(n)`, with n the effective size, one over the sum of the squared
/// masses w. The mean of W1 is at most the integral of `sqrt(F (1 - F) / n)`. One value moves W1 by at most its mass, so
/// W1 exceeds its mean by x with probability at most `exp(-2 n x^2)`. Values may have any weights. It is below
/// [`uniform_radius`] only for alpha above 0.98. Source: McDiarmid (1989), On the method of bounded differences, Surveys
/// in Combinatorics.
fn weighted_radius(alpha: f64, effective_size: f64) -> f64 {
    (0.5 + (0.5 * alpha.recip().ln()).sqrt()) / effective_size.sqrt()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, RngExt};

    use super::*;
    use crate::numerics::law::empirical::weights;
    use crate::numerics::machine::streams::stream;

    /// Returns the distance from weighted draws of a law on `atoms`, ascending, to the law itself.
    fn distance(atoms: &[f64], masses: &[f64], weights: &[f64], generator: &mut impl Rng) -> f64 {
        let mut apart: Vec<f64> = masses.iter().map(|mass| -mass).collect();
        let total: f64 = weights.iter().sum();
        for weight in weights {
            let mut left: f64 = generator.random();
            let beyond = masses.iter().take_while(|mass| {
                left -= **mass;
                left > 0.0
            });
            apart[beyond.count().min(atoms.len() - 1)] += weight / total;
        }
        let mut above = 0.0_f64;
        let gap = |(pair, apart): (&[f64], &f64)| {
            above += apart;
            above.abs() * (pair[1] - pair[0])
        };
        atoms.windows(2).zip(&apart).map(gap).sum()
    }

    #[test]
    fn no_law_leaves_its_ball_more_often_than_stated() {
        let mut generator = stream(2, "bounded", 0, 0);
        let records = 1000;
        for law in 0..24 {
            // The first laws are of the two ends, the widest there are; the others are of random atoms.
            let count = if law < 4 { 0 } else { 1 + law % 6 };
            let inner: Vec<f64> = (0..count).map(|_| generator.random()).collect();
            let mut atoms = [vec![0.0, 1.0], inner].concat();
            atoms.sort_by(f64::total_cmp);
            let shares: Vec<f64> = atoms.iter().map(|_| if law < 4 { 1.0 } else { generator.random() }).collect();
            let masses: Vec<f64> = shares.iter().map(|share| share / shares.iter().sum::<f64>()).collect();
            for (size, retention, alpha) in [(6, 1.0, 0.1), (50, 1.0, 0.5), (50, 1.0, 0.99), (30, 0.9, 0.3)] {
                let weights = weights(size, retention);
                let effective = weights.iter().sum::<f64>().powi(2) / weights.iter().map(|w| w * w).sum::<f64>();
                let radius = radius(alpha, effective, retention);
                let draws = (0..records).map(|_| distance(&atoms, &masses, &weights, &mut generator));
                let left = draws.filter(|distance| *distance > radius).count() as f64 / records as f64;
                // Four standard errors of a share of 1,000 records, if it were alpha.
                let tolerance = 4.0 * (alpha * (1.0 - alpha) / records as f64).sqrt();
                assert!(left < alpha + tolerance, "{law} {size} {alpha}: {left}");
            }
        }
    }

    #[test]
    fn the_bound_of_all_weights_is_the_smaller_one_only_near_one() {
        // By hand: with l = ln(1 / alpha), (l + ln 2) / 2 = (1/2 + sqrt(l / 2))^2 at alpha = 0.9815.
        assert!(uniform_radius(0.98, 7.0) < weighted_radius(0.98, 7.0));
        assert!(uniform_radius(0.983, 7.0) > weighted_radius(0.983, 7.0));
        // By hand: sqrt(ln 20 / 14) and (1/2 + sqrt(ln 10 / 2)) / sqrt(7).
        assert!((radius(0.1, 7.0, 1.0) - 0.462_580_7).abs() < 1e-7, "{}", radius(0.1, 7.0, 1.0));
        assert!((radius(0.1, 7.0, 0.9) - 0.594_531_7).abs() < 1e-7, "{}", radius(0.1, 7.0, 0.9));
    }
}
