//! The normal law and Student's t: distribution functions and quantiles.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use statrs::function::beta::checked_beta_reg;

/// Returns P(N <= x) for a standard normal N.
pub fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * FRAC_1_SQRT_2)
}

/// Returns the density of a standard normal.
pub fn normal_density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (2.0 * PI).sqrt()
}

/// Returns the density of Student's t with `freedom` > 0 degrees of freedom.
pub fn student_density(x: f64, freedom: f64) -> f64 {
    let norm = libm::lgamma(0.5 * (freedom + 1.0)) - libm::lgamma(0.5 * freedom) - 0.5 * (freedom * PI).ln();
    (norm - 0.5 * (freedom + 1.0) * (x * x / freedom).ln_1p()).exp()
}

/// Returns P(T <= x). Half the regularised incomplete beta function I_y(freedom/2, 1/2) at y = freedom / (freedom +
/// x^2) is the mass beyond |x|. Near 0, where 1 - y would lose its digits, half of I_(1-y)(1/2, freedom/2) is the mass
/// within. NaN if x is.
pub fn student_cdf(x: f64, freedom: f64) -> f64 {
    let square = x * x;
    let beyond = match square < freedom {
        true => checked_beta_reg(0.5, 0.5 * freedom, square / (freedom + square)).map(|within| 0.5 - 0.5 * within),
        false => checked_beta_reg(0.5 * freedom, 0.5, freedom / (freedom + square)).map(|beyond| 0.5 * beyond),
    };
    let beyond = beyond.unwrap_or(f64::NAN);
    if x > 0.0 { 1.0 - beyond } else { beyond }
}

/// Returns the x >= 0 with P(|T| <= x) = `level`, by bisection; `level` must be in (0, 1).
pub fn student_two_sided(level: f64, freedom: f64) -> f64 {
    let share = |x: f64| 1.0 - 2.0 * student_cdf(-x, freedom);
    let (mut low, mut high) = (0.0, 1.0);
    while share(high) < level && high < 1e12 {
        high *= 2.0;
    }
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if share(middle) < level { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distribution_functions_have_their_closed_forms() {
        for x in [-7.0_f64, -1.3, -0.01, 0.0, 0.4, 2.5, 30.0] {
            // The closed forms of t with 1 and 2 degrees of freedom.
            assert!((student_cdf(x, 1.0) - (0.5 + x.atan() / PI)).abs() < 1e-14);
            assert!((student_cdf(x, 2.0) - (0.5 + 0.5 * x / (2.0 + x * x).sqrt())).abs() < 1e-14);
            assert!((student_density(x, 1.0) * PI * (1.0 + x * x) - 1.0).abs() < 1e-13);
            // A million degrees of freedom: the correction to the normal is (x^3 + x) phi(x) / 4e6.
            assert!((student_cdf(x, 1e6) - normal_cdf(x)).abs() < 2e-7);
        }
    }

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // scipy.stats.t.ppf(0.975, nu), and norm.ppf(0.975) in the limit.
        for (freedom, expected) in [
            (1.0, 12.706204736174694),
            (2.0, 4.302652729749464),
            (5.0, 2.5705818356363146),
            (39.0, 2.0226909200367595),
            (199.0, 1.971956544249395),
        ] {
            assert!((student_two_sided(0.95, freedom) / expected - 1.0).abs() < 1e-10, "{freedom}");
        }
        assert!((student_two_sided(0.95, 1e7) - 1.959963984540054).abs() < 1e-6);
    }
}
