//! What a problem says of the periods of an account: all that a replay of them needs of it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::contributions::Contributions;
use super::learning::Learning;
use super::specification::ProblemSpecification;
use crate::control::problem::dynamics::Dynamics;

/// Rate, cost and flows of the periods that a policy is lived by, and how its law is learned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Terms {
    /// T, periods.
    pub horizon: usize,
    /// r, simple return of the bank per step.
    pub rate_per_step: f64,
    /// c, of what is traded.
    pub trading_cost: f64,
    /// C, money added at the end of each period.
    pub contributions: Contributions,
    /// What older returns weigh.
    pub learning: Learning,
    /// By which a period without a day takes the next one due.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub periods_per_year: Option<f64>,
}

impl Terms {
    /// Of a completed specification.
    pub fn of(problem: &ProblemSpecification) -> Self {
        Terms {
            horizon: problem.horizon,
            rate_per_step: problem.rate_per_step,
            trading_cost: problem.trading_cost,
            contributions: problem.contributions.clone(),
            learning: problem.learning,
            periods_per_year: problem.periods_per_year,
        }
    }

    /// What becomes of money in the period after `step` periods. Nothing is said of what is still to come.
    pub fn period(&self, step: usize) -> Dynamics {
        let plain = Dynamics::plain(self.rate_per_step, self.trading_cost);
        Dynamics { contribution: self.contributions.at(step), ..plain }
    }
}
