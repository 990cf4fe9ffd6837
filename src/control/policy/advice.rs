//! The answer of a policy: an advice, and the uncertainty set behind it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::problem::actions::Band;
use crate::control::problem::spending::PeriodSpending;
use crate::control::problem::state::PeriodOutcome;
use crate::control::request::spending::is_zero;

/// How an advice was computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AdviceSource {
    /// Read from the policy surrogate (or the stored solution of a single-state design).
    PolicySurrogate,
    /// Re-solved on request.
    Resolved,
    /// Re-solved because the state lies outside the design.
    ResolvedOutsideDesign,
    /// Re-solved for a hypothetical radius, which the policy surrogate was not trained for.
    ResolvedOtherRadius,
    /// Not solved: the robust step has no finite solution at the state, or its wealth does not pay for the withdrawals.
    /// All wealth stays in the bank, which no law can hurt.
    Unsolved,
}

/// Spending that is advised for a period.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SpendingAdvice {
    /// Share of wealth.
    pub share: f64,
    /// Amount, in the currency of wealth.
    pub amount: f64,
    /// Part of it that is secured; left out if nothing is.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub secured: f64,
    /// Wealth that pays from the bank for this and for what is secured later; left out if nothing is.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub reserve: f64,
}

impl SpendingAdvice {
    /// Returns the advice for `wealth` in a state with this floor gain. Wealth below the reserve pays what is secured while
    /// it lasts.
    pub fn of(own: &PeriodSpending, floor_gain: f64, wealth: f64) -> Self {
        let share = own.share(floor_gain);
        let PeriodSpending { secured, reserve, .. } = *own;
        if reserve == 0.0 {
            return SpendingAdvice { share, amount: share * wealth, secured, reserve };
        }
        let amount = (secured + share * (wealth - reserve).max(0.0)).min(wealth);
        SpendingAdvice { share: amount / wealth, amount, secured, reserve }
    }

    /// Returns the surplus after spending as a share of the wealth after it: 1 if nothing is secured.
    pub fn surplus_left(&self, wealth: f64) -> f64 {
        if self.reserve == 0.0 {
            return 1.0;
        }
        let left = wealth - self.amount;
        if left > 0.0 { ((left - (self.reserve - self.secured)) / left).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// Returns a band of shares of the surplus as one of shares of wealth, and the secured amount; without spending both
    /// are one, and nothing is secured.
    pub fn of_wealth(spending: Option<Self>, band: Band, wealth: f64) -> (Band, f64) {
        let Some(spending) = spending else { return (band, 0.0) };
        let surplus = spending.surplus_left(wealth);
        (Band { low: surplus * band.low, high: surplus * band.high }, spending.secured)
    }

    /// Returns the share of the surplus that is spent beside what is secured.
    pub fn share_of_surplus(&self, wealth: f64) -> f64 {
        if self.reserve == 0.0 { self.share } else { (self.amount - self.secured) / (wealth - self.reserve) }
    }

    /// Returns the share of wealth to spend: none without spending.
    pub fn share_of(spending: Option<Self>) -> f64 {
        spending.map_or(0.0, |spending| spending.share)
    }
}

/// The robust allocation for the coming period and its worth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Advice {
    /// Share of wealth to hold in the risky asset: the nearest point of the band to the holding.
    pub allocation: f64,
    /// Share of wealth in the risky asset before trading.
    pub holding: f64,
    /// The no-trade region: holdings that are best kept as they are. If trading costs nothing, both ends are the
    /// allocation.
    #[schema(value_type = [f64; 2])]
    pub band: Band,
    /// The share of wealth to buy, or to sell if negative: the allocation less the holding, of the wealth left after
    /// spending.
    pub trade: f64,
    /// Spending before the period, if the problem has any. The allocation is a share of the wealth that is left.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spending: Option<SpendingAdvice>,
    /// Money added at the end of the period, or withdrawn if negative.
    pub contribution: f64,
    /// Certainty equivalent of the robust value, in terminal wealth; with spending, the sure level of spending a period,
    /// in money of now, that is worth as much, with what is secured.
    pub certainty_equivalent: f64,
    /// Terminal wealth, or with spending its sure level, if everything is sold now and stays in the bank, with all later contributions and withdrawals.
    /// No law can take it away.
    pub floor: f64,
    /// Radius of the uncertainty set. For the Wasserstein ball it is in log-return. In the parametric frameworks it is
    /// half the width of the confidence region in the mean, in estimated standard deviations of a return.
    pub radius: f64,
    /// Number of returns observed, including the history.
    pub sample_size: usize,
    /// Effective sample size; equal to `sample_size` if `learning` is `equal` and the centre is not `conditional`.
    pub effective_size: f64,
    /// Predicted standard deviation of the log certainty equivalent; if spending is secured, of what exceeds it.
    pub surrogate_sd: f64,
    /// True if the state lies within the region where the surrogates were trained.
    pub in_design: bool,
    /// How the advice was computed.
    pub source: AdviceSource,
}

impl Advice {
    /// Returns the outcome of a period in which the advice was followed, at this log-return.
    pub fn followed(&self, log_return: f64) -> PeriodOutcome {
        PeriodOutcome {
            spent: SpendingAdvice::share_of(self.spending),
            ..PeriodOutcome::of(self.allocation, log_return)
        }
    }
}

/// The figures of a state's uncertainty set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Uncertainty {
    /// Number of returns observed, including the history.
    pub sample_size: usize,
    /// Effective sample size; equal to `sample_size` if `learning` is `equal` and the centre is not `conditional`.
    pub effective_size: f64,
    /// Raw moments of the learned law, from the first to the specification's count.
    pub moments: Vec<f64>,
    /// (1 - alpha)-quantile of the bridge statistic; absent under radius rules other than `bridge`, `calibrated` and
    /// `joint`. Under `bridge` it is exact for the history of the policy. After more returns it is simulated in
    /// proportion to that value.
    pub quantile: Option<f64>,
    /// The radius, as in an advice.
    pub radius: f64,
}
