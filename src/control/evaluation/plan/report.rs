//! The answer to the request for a plan.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::policy::advice::Advice;
use crate::control::policy::worst_case::WorstCase;
use crate::control::request::annualised::Annualised;
use crate::control::request::warnings::Warning;
use crate::numerics::statistics::summary::Estimate;

/// A plan and how it fares. Amounts are in money of now. Figures of simulated paths have intervals at 95 %.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PlanReport {
    /// The answer in sentences, the most important first.
    pub sentences: Vec<String>,
    /// Spending now, and the holding until the next period.
    pub advice: Advice,
    /// Shares of several assets in what is held, by name, restored in each period; left out for one asset.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub composition: Option<BTreeMap<String, f64>>,
    /// The law that is worst for it; left out if what is held depends on more than the period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<WorstCase>,
    /// Spending and holding of each period; empty if they depend on more than the period.
    pub periods: Vec<PlannedPeriod>,
    /// Spending and holding by the state of the plan, if they depend on one: at the times of the fan.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub states: Option<PlannedStates>,
    /// The chance that the amount wanted lasts.
    pub wanted: WantedSpending,
    /// The largest amounts that can be spent in every period to the horizon, and leave nothing; none if the plan aims at a
    /// goal.
    pub sustainable: Vec<SustainableSpending>,
    /// The plan beside simple rules, on the same paths. Rules of a year need `problem.periods_per_year`.
    pub strategies: Vec<PlanStrategy>,
    /// Wealth and spending of the plan on these paths.
    pub fan: PlanFan,
    /// The mean return with which the amount wanted would last, or the goal aimed at would be reached, with the certainty
    /// asked for, no more; null if the plan holds nothing, or if no mean return decides it.
    pub breaking: Option<BreakingReturn>,
    /// Annualised figures, if `problem.periods_per_year` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub annualised: Option<Annualised>,
    /// Parts of the request that may be a mistake.
    pub warnings: Vec<Warning>,
}

/// Spending and holding of a period.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PlannedPeriod {
    /// Number of the period, from 1.
    pub period: usize,
    /// Share of wealth to spend at its start; of the surplus, beside what is secured, if anything is.
    pub spent: f64,
    /// Share of what is left to hold in the risky asset; of the surplus that is left, if anything is secured.
    pub held: f64,
    /// Wealth that must be in the bank at its start for all that is secured, in money of now; left out if nothing is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reserve: Option<f64>,
}

/// Spending and holding of a plan by its state.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PlannedStates {
    /// The meaning of the numbers of the states.
    pub described_by: PlanStateNumber,
    /// The plan in some periods, ascending.
    pub periods: Vec<PeriodByState>,
}

/// The number by which the state of a plan is described.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PlanStateNumber {
    /// Wealth over the money that pays from the bank for all that is wanted, at most 1.
    Funded,
    /// The value of money that stays invested over its highest so far: one less the drawdown.
    OfPeak,
}

/// Spending and holding of a period in some states; linear between them.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PeriodByState {
    /// Number of the period, from 1.
    pub period: usize,
    /// The numbers of the states, ascending.
    pub states: Vec<f64>,
    /// Share of wealth to spend in each; left out if the plan aims at a goal and spends the amount wanted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spent: Option<Vec<f64>>,
    /// Share of what is left to hold in the risky asset in each.
    pub held: Vec<f64>,
}

/// A figure on paths of either law.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct InBothWorlds {
    /// Returns are drawn from the centre of the ball: from the record, unless `problem.centre` says otherwise.
    pub record: Estimate,
    /// Each of these returns is moved as the law that is worst for the plan moves it in its period.
    pub worst: Estimate,
}

/// An amount that is wanted in every period.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct WantedSpending {
    /// The amount, in money of now.
    pub amount: f64,
    /// Probability that it can be spent in every period to the horizon, holding the shares of the plan: of all that is
    /// left, also where the plan itself keeps a reserve.
    pub lasts: InBothWorlds,
}

/// Largest amount for every period.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SustainableSpending {
    /// The rule that is held by: `plan` or `sixty_forty`.
    pub holding: PlanRule,
    /// The amount that lasts with the certainty asked for.
    pub amount: InBothWorlds,
}

/// Rules for spending and holding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PlanRule {
    /// The plan.
    Plan,
    /// The plan of somebody who takes the record for the true law: without a ball.
    Trusting,
    /// The spending of the plan, with 60 % always held in the risky asset.
    SixtyForty,
    /// 4 % of the first wealth a year in every period, in money of now, with 60 % held.
    FourPercent,
    /// 4 % of present wealth a year, with 60 % held.
    ShareOfWealth,
}

/// Figures of a rule.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PlanStrategy {
    /// The rule.
    pub rule: PlanRule,
    /// Probability that the money runs out before the horizon.
    pub ruin: InBothWorlds,
    /// Spending of a period, the mean over a path, in the middle case.
    pub mean_spending: InBothWorlds,
    /// Lowest spending of a period on a path, in the middle case.
    pub lowest_spending: InBothWorlds,
    /// Lowest spending of a period on a path, in the worst twentieth of cases.
    pub poor_spending: InBothWorlds,
    /// Wealth at the horizon, in the middle case.
    pub bequest: InBothWorlds,
    /// Probability to reach the goal at the horizon; left out if there is no goal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reaches_goal: Option<InBothWorlds>,
    /// Mean shortfall: what is missing of the goal at the horizon, and of all amounts before. Left out if there is no goal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shortfall: Option<InBothWorlds>,
    /// Largest drawdown of money that stays invested, in the worst twentieth of cases.
    pub max_drawdown: InBothWorlds,
    /// Sure level of spending with the utility of the problem; 0 if a path runs out. Left out if the plan aims at a goal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certainty_equivalent: Option<InBothWorlds>,
}

/// Quantiles of the plan's paths.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PlanFan {
    /// The shares of paths below the quantiles.
    pub shares: [f64; 5],
    /// If returns are drawn from the centre.
    pub record: Vec<FanPeriod>,
    /// If each is moved as the worst law moves it.
    pub worst: Vec<FanPeriod>,
}

/// Quantiles after some periods.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct FanPeriod {
    /// Number of periods since the start.
    pub after: usize,
    /// Wealth before spending.
    pub wealth: [f64; 5],
    /// Spending of the period that begins, negative if money is put in; null at the horizon.
    pub spending: Option<[f64; 5]>,
}

/// The mean return that decides whether an amount lasts, or whether the goal aimed at is reached.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct BreakingReturn {
    /// Mean simple return of the risky asset a period, as a fraction.
    pub mean_return: f64,
    /// That of the record.
    pub mean_seen: f64,
    /// Their distance in standard errors of the record's mean: negative if the breaking return is lower.
    pub standard_errors: f64,
}
