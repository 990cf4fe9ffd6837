//! Whether the bank alone pays for everything that is withdrawn.

use crate::control::error::FieldError;
use crate::control::problem::dynamics::Dynamics;
use crate::control::request::specification::ProblemSpecification;

/// Checks that a wealth at the start, left in the bank, pays for everything that is withdrawn.
///
/// # Errors
/// It runs dry.
pub fn check_start(problem: &ProblemSpecification, field: &str, wealth: f64) -> Result<(), FieldError> {
    check_bank(&Dynamics::of(problem)[..problem.horizon], 0, wealth)
        .map_err(|rule| FieldError::new(field, wealth, rule))
}

/// Checks that what selling everything leaves, `liquidated`, left in the bank, pays for everything that is withdrawn in
/// `periods`, before which `passed` others have passed.
///
/// # Errors
/// What must be, where it runs dry.
pub fn check_bank(periods: &[Dynamics], passed: usize, liquidated: f64) -> Result<(), String> {
    let mut bank = liquidated;
    let is_empty = |period: &Dynamics| {
        bank = bank * (1.0 + period.rate_per_step) + period.contribution;
        bank <= 0.0
    };
    match periods.iter().position(is_empty) {
        None => Ok(()),
        Some(index) => Err(format!(
            "must be more: all sold and left in the bank, it does not last to the end of period {}, for what problem.contributions withdraws",
            passed + index + 1
        )),
    }
}

/// A wealth at the start with what is to come.
pub fn total_wealth(problem: &ProblemSpecification, wealth: f64) -> f64 {
    Dynamics::of(problem)[0].total(wealth, 0.0)
}
