//! Whether the bank alone pays for everything that is withdrawn.

use crate::control::error::FieldError;
use crate::control::problem::dynamics::Dynamics;
use crate::control::request::specification::ProblemSpecification;

/// A bank is empty once less than this part of what it began with is not withdrawn, all at present value.
const ROUNDING: f64 = 1e-9;

/// Checks that a wealth at the start, left in the bank, pays for everything that is withdrawn.
///
/// # Errors
/// It runs dry.
pub fn check_start(problem: &ProblemSpecification, field: &str, wealth: f64) -> Result<(), FieldError> {
    let periods = Dynamics::of(problem);
    let refused = |rule: String| Err(FieldError::new(field, wealth, rule));
    match (check_bank(&periods[..problem.horizon], wealth), periods[0].least_wealth()) {
        (Err(rule), _) => refused(rule),
        (Ok(()), least) if wealth < least => refused(format!(
            "must be at least {least}, so that a hundredth is to spare of what must stay in the bank for what \
             problem.contributions withdraws"
        )),
        _ => Ok(()),
    }
}

/// Checks that what selling everything leaves, `liquidated`, left in the bank, pays for everything that is withdrawn in
/// `periods`.
///
/// # Errors
/// What must be, where it runs dry.
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
            "must be more: all sold and left in the bank, it does not last to the end of period {}, for what problem.contributions withdraws",
            index + 1
        )),
    }
}

/// A wealth at the start with what is to come.
pub fn total_wealth(problem: &ProblemSpecification, wealth: f64) -> f64 {
    Dynamics::of(problem)[0].total(wealth, 0.0)
}
