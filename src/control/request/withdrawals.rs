//! Checks that the bank alone pays for everything that is withdrawn.

use crate::control::error::FieldError;
use crate::control::problem::dynamics::Dynamics;
use crate::control::request::specification::ProblemSpecification;

/// Fraction of its initial money, at present value, below which the bank counts as empty.
const ROUNDING: f64 = 1e-9;

/// Checks that an initial wealth, left in the bank, pays for everything that is withdrawn.
///
/// # Errors
/// The money runs out, or less than the required spare is left.
pub fn check_start(problem: &ProblemSpecification, field: &str, wealth: f64) -> Result<(), FieldError> {
    let periods = Dynamics::of(problem);
    let refused = |rule: String| Err(FieldError::new(field, wealth, rule));
    match (check_bank(&periods[..problem.horizon], wealth), periods[0].least_wealth()) {
        (Err(rule), _) => refused(rule),
        (Ok(()), least) if wealth < least => refused(format!(
            "must be at least {least}: the bank must hold 1 % more than the withdrawals in problem.contributions need"
        )),
        _ => Ok(()),
    }
}

/// Checks that the proceeds of selling everything, `liquidated`, pay from the bank for everything that is withdrawn in
/// `periods`.
///
/// # Errors
/// The money runs out; the text is the rule that is broken.
pub fn check_bank(periods: &[Dynamics], liquidated: f64) -> Result<(), String> {
    let (mut left, mut discount) = (liquidated, 1.0);
    let is_empty = |period: &Dynamics| {
        discount /= 1.0 + period.rate_per_step;
        left += discount * period.contribution;
        left <= ROUNDING * liquidated
    };
    match periods.iter().position(is_empty) {
        None => Ok(()),
        Some(index) => Err(format!(
            "must be more: even if all is sold and kept in the bank, the withdrawals in problem.contributions empty it by the end of period {}",
            index + 1
        )),
    }
}

/// Returns the total of an initial wealth and what is still to come.
pub fn total_wealth(problem: &ProblemSpecification, wealth: f64) -> f64 {
    Dynamics::of(problem)[0].total(wealth, 0.0)
}
