//! The state y = (x, h, F^).

use crate::control::error::FieldError;
use crate::control::problem::dynamics::Dynamics;
use crate::control::request::learning::Learning;
use crate::control::request::rules;
use crate::numerics::law::empirical::EmpiricalDistribution;

/// The lowest log-return that a law learns; a total loss counts as this much.
pub const LEAST_LEARNED: f64 = -rules::LOG_RETURN;

/// The realised values of a period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeriodOutcome {
    /// Share of wealth held in the risky asset through the period.
    pub action: f64,
    /// z, minus infinity after a total loss; if it is not known the asset counts as unmoved, and nothing is learned.
    pub log_return: Option<f64>,
    /// The rate that the bank paid, if it was not the rate of the problem.
    pub rate: Option<f64>,
    /// The money added at its end, if that was not the contribution of the problem.
    pub flow: Option<f64>,
    /// Share of wealth bought and sold for it, if it differs from the change of the holding, as with several assets.
    pub traded: Option<f64>,
    /// Share of wealth spent at its start.
    pub spent: f64,
}

impl PeriodOutcome {
    /// Returns a period with the rate, the contribution and the trade of the problem, in which nothing was spent.
    pub fn of(action: f64, log_return: f64) -> Self {
        PeriodOutcome { action, log_return: Some(log_return), rate: None, flow: None, traded: None, spent: 0.0 }
    }

    /// Returns the dynamics of the period with the rate and the flow that were realised.
    pub fn dynamics(&self, dynamics: Dynamics) -> Dynamics {
        let rate_per_step = self.rate.unwrap_or(dynamics.rate_per_step);
        let contribution = self.flow.unwrap_or(dynamics.contribution);
        Dynamics { rate_per_step, contribution, ..dynamics }
    }

    /// Returns the share of wealth bought and sold, from the share `holding`, of which none is spent.
    pub fn turnover(&self, holding: f64) -> f64 {
        self.traded.unwrap_or_else(|| f64::abs(self.action * (1.0 - self.spent) - holding))
    }
}

/// Wealth, the share of it held, and the empirical law of log-returns.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// x, positive.
    pub wealth: f64,
    /// h, the share of wealth in the risky asset before trading. It matters if trading costs.
    pub holding: f64,
    /// F^, the law of the returns seen.
    pub law: EmpiricalDistribution,
}

impl State {
    /// Builds the state of an investor with `wealth`, all of it in the bank, after `history`, oldest first, learned by
    /// `learning`.
    ///
    /// # Errors
    /// A history or a wealth that breaks its rule, under the names `history` and `wealth`.
    pub fn new(history: &[f64], wealth: f64, learning: Learning) -> Result<Self, FieldError> {
        rules::history("history", history, learning)?;
        rules::wealth("wealth", wealth)?;
        Ok(State { wealth, holding: 0.0, law: learning.law(history) })
    }

    /// Returns the state with the share `holding` of wealth in the risky asset.
    ///
    /// # Errors
    /// A holding that is not a valid share.
    pub fn with_holding(self, holding: f64) -> Result<Self, FieldError> {
        rules::share("holding", holding)?;
        Ok(State { holding, ..self })
    }

    /// Returns G(y, a, z): next wealth and holding after a period of `dynamics` with the values `realised`, and the law
    /// with the return learned. Wealth bears all of a loss, also one that is lower than any the law learns.
    pub fn next_state(&self, dynamics: Dynamics, realised: &PeriodOutcome) -> State {
        let PeriodOutcome { action, log_return, .. } = *realised;
        let (dynamics, traded) = (realised.dynamics(dynamics), realised.turnover(self.holding));
        let left = self.wealth * (1.0 - realised.spent);
        let (wealth, holding) = dynamics.next_after(left, traded, action, log_return.unwrap_or(0.0));
        let mut law = self.law.clone();
        log_return.into_iter().for_each(|seen| law.push(seen.max(LEAST_LEARNED)));
        State { wealth, holding, law }
    }
}
