//! The normal law and Student's t: distribution functions and quantiles.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Terms after which the continued fraction is given up: it needs about the square root of the degrees of freedom.
const MOST_TERMS: usize = 100_000;

/// P(N <= x) for a standard normal N.
pub fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * FRAC_1_SQRT_2)
}

/// Density of a standard normal.
pub fn normal_density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (2.0 * PI).sqrt()
}

/// Density of Student's t with `freedom` > 0 degrees of freedom.
pub fn student_density(x: f64, freedom: f64) -> f64 {
    let norm = libm::lgamma(0.5 * (freedom + 1.0)) - libm::lgamma(0.5 * freedom) - 0.5 * (freedom * PI).ln();
    (norm - 0.5 * (freedom + 1.0) * (x * x / freedom).ln_1p()).exp()
}

/// P(T <= x): half the regularised incomplete beta function I_y(freedom/2, 1/2) at y = freedom / (freedom + x^2) lies
/// beyond |x|.
pub fn student_cdf(x: f64, freedom: f64) -> f64 {
    let square = x * x;
    let beyond = 0.5 * incomplete_beta(0.5 * freedom, 0.5, freedom / (freedom + square), square / (freedom + square));
    if x > 0.0 { 1.0 - beyond } else { beyond }
}

/// The x >= 0 with P(|T| <= x) = `level`, by bisection. `level` in (0, 1).
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

/// I_x(a, b) with `complement` = 1 - x, by the continued fraction on the side where it converges.
/// Source: Press et al., Numerical Recipes, section 6.4.
fn incomplete_beta(a: f64, b: f64, x: f64, complement: f64) -> f64 {
    if x <= 0.0 || complement <= 0.0 {
        return if x <= 0.0 { 0.0 } else { 1.0 };
    }
    let log_front = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b) + a * x.ln() + b * complement.ln();
    let front = log_front.exp();
    if x < (a + 1.0) / (a + b + 2.0) {
        front * continued_fraction(a, b, x) / a
    } else {
        1.0 - front * continued_fraction(b, a, complement) / b
    }
}

/// Lentz's evaluation.
fn continued_fraction(a: f64, b: f64, x: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let guarded = |value: f64| if value.abs() < TINY { TINY } else { value };
    let mut c = 1.0;
    let mut d = 1.0 / guarded(1.0 - (a + b) * x / (a + 1.0));
    let mut fraction = d;
    for term in 1..MOST_TERMS {
        let m = term as f64;
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut last = 1.0;
        for coefficient in [even, odd] {
            d = 1.0 / guarded(1.0 + coefficient * d);
            c = guarded(1.0 + coefficient / c);
            last = c * d;
            fraction *= last;
        }
        if (last - 1.0).abs() < 1e-15 {
            break;
        }
    }
    fraction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distribution_functions_have_their_closed_forms() {
        for x in [-7.0_f64, -1.3, -0.01, 0.0, 0.4, 2.5, 30.0] {
            // t with 1 and 2 degrees of freedom.
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
