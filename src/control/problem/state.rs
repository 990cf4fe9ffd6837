//! The state y = (x, F^) and its dynamics.

use crate::control::error::FieldError;
use crate::control::request::rules;
use crate::numerics::empirical::EmpiricalDistribution;

/// Wealth and the empirical law of log-returns.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// x, positive.
    pub wealth: f64,
    /// F^, of the returns seen.
    pub law: EmpiricalDistribution,
}

/// Wealth after one step, per unit of wealth: `(1 - a)(1 + r) + a e^z`.
pub fn growth(action: f64, log_return: f64, rate_per_step: f64) -> f64 {
    (1.0 - action) * (1.0 + rate_per_step) + action * log_return.exp()
}

/// S(x, a, z): wealth after holding the share `action` in the risky asset through `log_return`.
pub fn next_wealth(wealth: f64, action: f64, log_return: f64, rate_per_step: f64) -> f64 {
    wealth * growth(action, log_return, rate_per_step)
}

/// G(y, a, z): the next wealth, and the law with the return learned.
pub fn next_state(state: &State, action: f64, log_return: f64, rate_per_step: f64) -> State {
    let mut law = state.law.clone();
    law.push(log_return);
    State { wealth: next_wealth(state.wealth, action, log_return, rate_per_step), law }
}

/// Terminal wealth of all-bank from `wealth` over `steps` steps.
pub fn floor(wealth: f64, rate_per_step: f64, steps: usize) -> f64 {
    wealth * (1.0 + rate_per_step).powf(steps as f64)
}

impl State {
    /// The state of an investor with `wealth` who has seen `history`.
    ///
    /// # Errors
    /// A history or a wealth that breaks its rule, under the names `history` and `wealth`.
    pub fn new(history: &[f64], wealth: f64) -> Result<Self, FieldError> {
        rules::history("history", history)?;
        rules::wealth("wealth", wealth)?;
        Ok(State { wealth, law: EmpiricalDistribution::new(history) })
    }
}
