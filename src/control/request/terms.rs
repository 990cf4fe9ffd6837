//! The terms of an account's periods: all that a replay needs of a problem.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::contributions::Contributions;
use super::learning::Learning;
use super::means::MeansRule;
use super::specification::Specification;
use crate::control::problem::dynamics::Dynamics;

/// Rate, cost and flows of the periods in which a policy is followed, and how its law is learned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Terms {
    /// T, the number of periods.
    pub horizon: usize,
    /// r, the simple return of the bank per step, as a fraction.
    pub rate_per_step: f64,
    /// c, the trading cost, as a share of the amount traded.
    pub trading_cost: f64,
    /// C, the money added at the end of each period; negative if it is withdrawn.
    pub contributions: Contributions,
    /// Weights of older returns in the learned law.
    pub learning: Learning,
    /// True if the policy plans spending to its horizon, which no renewal moves.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub ends: bool,
    /// Number of periods in a year. A period reported without a date gets the next due date, found from this number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub periods_per_year: Option<f64>,
    /// The means that the law of several assets has.
    #[serde(default, skip_serializing_if = "MeansRule::is_sample")]
    pub means: MeansRule,
}

impl Terms {
    /// Returns the terms of a completed specification.
    pub fn of(specification: &Specification) -> Self {
        let problem = &specification.problem;
        Terms {
            horizon: problem.horizon,
            rate_per_step: problem.rate_per_step,
            trading_cost: problem.trading_cost,
            contributions: problem.contributions.clone(),
            learning: problem.learning,
            ends: problem.spending.is_some(),
            periods_per_year: problem.periods_per_year,
            means: specification.means(),
        }
    }

    /// Returns the rate, cost and contribution of the period after `step` periods. Later contributions are left out.
    pub fn period(&self, step: usize) -> Dynamics {
        let plain = Dynamics::plain(self.rate_per_step, self.trading_cost);
        Dynamics { contribution: self.contributions.at(step), ..plain }
    }
}
