//! Annual rates and returns.

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::request::specification::ProblemSpecification;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::law::moments::CentralMoments;

/// Annual rate and returns of a problem, with p periods in a year. All are fractions, capped at the largest double.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Annualised {
    /// Annual return of the bank, compounded: `(1 + r)^p - 1`.
    pub rate: f64,
    /// Annual return of the asset, compounded: `m^p - 1`, with m the mean of `e^z` over the log-returns z of the
    /// history.
    pub mean_return: f64,
    /// Annual standard deviation of the history's simple returns, for independent periods: `sqrt(p)` times the sample
    /// standard deviation of one period.
    pub deviation: f64,
}

impl ProblemSpecification {
    /// Returns the annual figures if the number of periods in a year is given. Cost O(n ln n) for n returns.
    ///
    /// Checked by: `a_year_of_known_periods_is_what_its_prices_say`.
    pub fn annualised(&self) -> Option<Annualised> {
        let periods = self.periods_per_year?;
        let simple: Vec<f64> = self.history.iter().map(|z| z.exp_m1()).collect();
        let count = simple.len() as f64;
        Some(Annualised {
            rate: compounded(self.rate_per_step, periods),
            mean_return: compounded(self.mean_return(), periods),
            deviation: (periods * count / (count - 1.0).max(1.0)).sqrt() * deviation(&simple),
        })
    }

    /// Returns the mean of the history's simple returns, `e^z - 1`, for one period.
    pub fn mean_return(&self) -> f64 {
        self.history.iter().map(|z| z.exp_m1()).sum::<f64>() / self.history.len() as f64
    }

    /// Returns the standard deviation of the history's log-returns, for one period, with the divisor n.
    pub fn deviation(&self) -> f64 {
        deviation(&self.history)
    }
}

/// Returns the standard deviation of returns, with the divisor n.
pub fn deviation(log_returns: &[f64]) -> f64 {
    CentralMoments::of(&EmpiricalDistribution::new(log_returns)).variance().sqrt()
}

/// Returns the mean of the simple returns `e^z - 1` in excess of the bank's, and its standard error `s / sqrt(n)`, with
/// s the sample standard deviation.
///
/// Checked by: `a_premium_and_its_error_by_hand`.
pub fn premium(log_returns: &[f64], rate: f64) -> (f64, f64) {
    let count = log_returns.len() as f64;
    let simple = || log_returns.iter().map(|z| z.exp_m1());
    let mean = simple().sum::<f64>() / count;
    let square = simple().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean - rate, (square / count).sqrt())
}

/// Returns a simple return compounded over `periods` periods.
pub fn compounded(simple_return: f64, periods: f64) -> f64 {
    (periods * simple_return.ln_1p()).exp_m1().min(f64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of 0.2 and -0.1 is 0.05, and the squares about it sum to 0.045. This is the sample variance; half of it
    /// is under the root.
    #[test]
    fn a_premium_and_its_error_by_hand() {
        let (premium, error) = premium(&[1.2_f64.ln(), 0.9_f64.ln()], 0.01);
        assert!((premium - 0.04).abs() < 1e-15 && (error - 0.0225_f64.sqrt()).abs() < 1e-15);
    }

    /// Prices rise by a fifth or fall by a tenth, each half of the time: 5 % on average. In two periods wealth grows by
    /// 1.05^2, and in the bank by 1.01^2. Each return lies 15 % from the mean, so the sample deviation of two is
    /// sqrt(2) times as large.
    #[test]
    fn a_year_of_known_periods_is_what_its_prices_say() {
        let mut problem = ProblemSpecification::of(vec![1.2_f64.ln(), 0.9_f64.ln()], 0.01);
        assert_eq!(problem.annualised(), None);
        problem.periods_per_year = Some(2.0);
        let Annualised { rate, mean_return, deviation } = problem.annualised().unwrap();
        // Rounding of numbers near 1.
        assert!((rate - 0.0201).abs() < 1e-15 && (mean_return - 0.1025).abs() < 1e-15, "{rate} {mean_return}");
        assert!((deviation - 0.3).abs() < 1e-15, "{deviation}");
    }

    #[test]
    fn the_largest_of_what_is_accepted_is_a_number() {
        let problem =
            ProblemSpecification { periods_per_year: Some(366.0), ..ProblemSpecification::of(vec![5.0, 4.0], 0.5) };
        let Annualised { rate, mean_return, deviation } = problem.annualised().unwrap();
        assert!(rate.is_finite() && mean_return == f64::MAX && deviation.is_finite());
    }
}
