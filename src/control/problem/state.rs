//! The state y = (x, h, F^).

use crate::control::error::FieldError;
use crate::control::problem::dynamics::Dynamics;
use crate::control::request::rules;
use crate::numerics::empirical::EmpiricalDistribution;

/// Wealth, the share of it held, and the empirical law of log-returns.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// x, positive.
    pub wealth: f64,
    /// h, the share of wealth in the risky asset before trading. It matters where trading costs.
    pub holding: f64,
    /// F^, of the returns seen.
    pub law: EmpiricalDistribution,
}

impl State {
    /// The state of an investor with `wealth`, all of it in the bank, who has seen `history`.
    ///
    /// # Errors
    /// A history or a wealth that breaks its rule, under the names `history` and `wealth`.
    pub fn new(history: &[f64], wealth: f64) -> Result<Self, FieldError> {
        rules::history("history", history)?;
        rules::wealth("wealth", wealth)?;
        Ok(State { wealth, holding: 0.0, law: EmpiricalDistribution::new(history) })
    }

    /// The same with the share `holding` of wealth in the risky asset.
    ///
    /// # Errors
    /// A holding that is no share.
    pub fn with_holding(self, holding: f64) -> Result<Self, FieldError> {
        rules::share("holding", holding)?;
        Ok(State { holding, ..self })
    }

    /// G(y, a, z): next wealth and holding after a period of `dynamics`, and the law with the return learned.
    pub fn next_state(&self, dynamics: Dynamics, action: f64, log_return: f64) -> State {
        let (wealth, holding) = dynamics.next(self.wealth, self.holding, action, log_return);
        let mut law = self.law.clone();
        law.push(log_return);
        State { wealth, holding, law }
    }
}
