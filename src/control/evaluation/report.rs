//! The report of an evaluation, as it travels; `docs/evaluation.md` says where the intervals come from.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::problem::utility::{marginal_utility, utility};
use crate::control::request::evaluation::EvaluationRequest;
use crate::control::request::framework::Framework;
use crate::numerics::summary::Estimate;

/// Name and version of the report's form.
pub const FORMAT: &str = "ballast-evaluation-1";

/// Strategies compared on common returns. `docs/evaluation.md` says where the intervals come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct EvaluationReport {
    /// `ballast-evaluation-1`.
    pub format: String,
    /// The completed request.
    pub request: EvaluationRequest,
    /// The strategy that differences are taken against.
    pub reference: String,
    /// Frameworks first, then constant mixes, in the order of the request.
    pub strategies: Vec<StrategyReport>,
    /// Terminal wealth of All in the bank, from which utility is counted: it is 0 there, and grows as the logarithm of wealth does.
    pub floor: f64,
    /// Common bin edges of terminal utility, ascending.
    pub histogram_edges: Vec<f64>,
    /// Common bin edges of terminal wealth, ascending and evenly apart.
    pub wealth_edges: Vec<f64>,
    /// In the order they were drawn.
    pub histories: Vec<HistoryReport>,
    /// What the figures say of each framework that changes its allocation.
    pub sentences: Vec<String>,
    /// What it took.
    pub costs: Costs,
}

/// What the evaluation cost; the only part that differs between two runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Costs {
    /// Seconds of all trainings.
    pub training_seconds: f64,
    /// Seconds of the simulation.
    pub simulation_seconds: f64,
    /// Mean of one re-solved step; null where there was none.
    pub resolve_seconds: Option<f64>,
}

/// One strategy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StrategyReport {
    /// Its name: `Cautious, learns`, `50 % in stocks`, `All in the bank` and the like.
    pub strategy: String,
    /// Null for constant mixes.
    pub framework: Option<Framework>,
    /// The allocation of a constant mix.
    pub constant_mix: Option<f64>,
    /// The policy followed; null for constant mixes and where each history had its own.
    pub policy: Option<String>,
    /// Utility of terminal wealth, counted from `floor`: `(U(x) - U(floor)) / (floor U'(floor))`, so that no digits are lost at high risk
    /// aversion or wealth.
    pub utility: UtilityReport,
    /// Terminal wealth that is worth as much for certain.
    pub certainty_equivalent: Estimate,
    /// Terminal, in units of the initial wealth's currency, and what it went through.
    pub wealth: WealthReport,
    /// This strategy less the reference, on the same returns; null for the reference.
    pub difference: Option<Difference>,
    /// Beside the constant mix of its own average; null for constant mixes.
    pub own_mix: Option<OwnMix>,
    /// Counts of the bins between `histogram_edges`.
    pub histogram: Vec<usize>,
    /// Period by period; null for constant mixes.
    pub periods: Option<Vec<PeriodReport>>,
    /// Null where the framework has no Wasserstein ball.
    pub coverage: Option<Coverage>,
    /// Share of steps advised by solving the step anew.
    pub resolved_share: Option<f64>,
}

/// Terminal utility.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct UtilityReport {
    /// Over paths.
    pub mean: Estimate,
    /// Over paths.
    pub variance: Estimate,
    /// A fifth of the paths end with less.
    pub quantile_20: Estimate,
    /// Nine tenths of the paths end with less.
    pub quantile_90: Estimate,
    /// Of the paths of one history, averaged over histories; an extreme has no interval.
    pub max: f64,
    /// Of the paths of one history, averaged over histories; an extreme has no interval.
    pub min: f64,
}

/// Terminal wealth, and how it came to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WealthReport {
    /// Over paths.
    pub mean: Estimate,
    /// A fifth of the paths end with less.
    pub quantile_20: Estimate,
    /// Nine tenths of the paths end with less.
    pub quantile_90: Estimate,
    /// Of the paths of one history, averaged over histories; an extreme has no interval.
    pub max: f64,
    /// Of the paths of one history, averaged over histories; an extreme has no interval.
    pub min: f64,
    /// The mean of the worst twentieth of the paths.
    pub worst_twentieth: Estimate,
    /// Counts of the bins between `wealth_edges`, without the paths that end as all in the bank does.
    pub histogram: Vec<usize>,
    /// Paths that end as all in the bank does, to a billionth of it.
    pub at_bank: usize,
    /// Share of the paths that end with less than was put in: the initial wealth and all contributions.
    pub chance_of_loss: Estimate,
    /// Mean over paths of the largest fall on the way below the highest so far, as a share of it; what is added or withdrawn is
    /// neither gain nor fall.
    pub max_drawdown: Estimate,
}

/// A paired difference to the reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Difference {
    /// Of mean terminal utility.
    pub utility: Estimate,
    /// Of the certainty equivalent, in terminal wealth.
    pub certainty_equivalent: Estimate,
}

/// The constant mix of a strategy's own average allocation, which nobody could have chosen beforehand, on the same returns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OwnMix {
    /// The average, over all periods of all paths.
    pub allocation: f64,
    /// Certainty equivalent of the strategy less that of the mix, in terminal wealth: what changing the allocation earned.
    pub beyond: Estimate,
}

/// One period over all paths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PeriodReport {
    /// From 1.
    pub period: usize,
    /// Returns known at its start.
    pub sample_size: usize,
    /// Share of wealth held in the risky asset.
    pub allocation: Spread,
    /// Share of paths that held nothing in the risky asset.
    pub all_bank_share: f64,
    /// Null where the framework has no Wasserstein ball.
    pub radius: Option<RadiusSpread>,
}

/// Mean and quantiles over paths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Spread {
    /// Over paths.
    pub mean: f64,
    /// A tenth of the paths have less.
    pub quantile_10: f64,
    /// Nine tenths of the paths have less.
    pub quantile_90: f64,
}

/// The radius over paths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RadiusSpread {
    /// Over paths, in log-return, as all below.
    pub mean: f64,
    /// A tenth of the paths have less.
    pub quantile_10: f64,
    /// The median.
    pub quantile_50: f64,
    /// Nine tenths of the paths have less.
    pub quantile_90: f64,
    /// On the first path.
    pub first_path: f64,
}

/// How often the ball held the true law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Coverage {
    /// 1 - alpha, under a radius rule that has one.
    pub target: Option<f64>,
    /// Ascending; one entry where the ball is frozen.
    pub by_sample_size: Vec<CoverageAtSize>,
    /// Share of paths on which some period's ball did not hold it.
    pub ever_left: Estimate,
}

/// How often the ball held the true law at one sample size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CoverageAtSize {
    /// Returns known then.
    pub sample_size: usize,
    /// Share of the paths.
    pub covered: Estimate,
}

/// One initial history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct HistoryReport {
    /// The bridge quantile there; null under other radius rules than `bridge` and `calibrated`.
    pub quantile: Option<f64>,
    /// Of the first framework with a ball, in log-return; 0 where there is none.
    pub radius: f64,
    /// What each framework promises there: the certainty equivalent of its first advice, by its own account.
    pub promised: Vec<f64>,
    /// Mean terminal utility of each strategy, in their order.
    pub mean_utility: Vec<f64>,
}

impl EvaluationReport {
    /// The same with utilities as the request defines them, `U(floor) + floor U'(floor) u`.
    pub fn in_utility(mut self) -> Self {
        let kind = self.request.problem.utility;
        let (origin, unit) = (utility(kind, self.floor), self.floor * marginal_utility(kind, self.floor));
        let absolute = |value: f64| origin + unit * value;
        for strategy in &mut self.strategies {
            let found = &mut strategy.utility;
            for estimate in [&mut found.mean, &mut found.quantile_20, &mut found.quantile_90] {
                *estimate = estimate.mapped(absolute);
            }
            found.variance = found.variance.mapped(|variance| unit * unit * variance);
            (found.max, found.min) = (absolute(found.max), absolute(found.min));
            if let Some(difference) = &mut strategy.difference {
                difference.utility = difference.utility.mapped(|apart| unit * apart);
            }
        }
        let means = self.histories.iter_mut().flat_map(|history| &mut history.mean_utility);
        means.chain(&mut self.histogram_edges).for_each(|value| *value = absolute(*value));
        self
    }

    /// The strategy that follows policies of this framework.
    pub fn framework(&self, framework: Framework) -> Option<&StrategyReport> {
        self.strategies.iter().find(|strategy| strategy.framework == Some(framework))
    }

    /// The strategy of this name.
    pub fn strategy(&self, name: &str) -> Option<&StrategyReport> {
        self.strategies.iter().find(|strategy| strategy.strategy == name)
    }
}
