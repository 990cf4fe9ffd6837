//! The report of an evaluation, as it is sent; `docs/evaluation.md` explains the intervals.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::problem::utility::{marginal_utility, utility};
use crate::control::request::evaluation::EvaluationRequest;
use crate::control::request::framework::Framework;
use crate::numerics::statistics::summary::Estimate;

/// Name and version of the report format.
pub const FORMAT: &str = "ballast-evaluation-1";

/// Strategies compared on common returns. `docs/evaluation.md` explains the intervals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct EvaluationReport {
    /// `ballast-evaluation-1`.
    pub format: String,
    /// The completed request.
    pub request: EvaluationRequest,
    /// The strategy from which differences are taken.
    pub reference: String,
    /// Strategies: frameworks first, then constant mixes, in the order of the request.
    pub strategies: Vec<StrategyReport>,
    /// Terminal wealth of All in the bank, the origin of utility: utility is 0 there, and grows as the logarithm of
    /// wealth does.
    pub floor: f64,
    /// Common bin edges of terminal utility, ascending.
    pub histogram_edges: Vec<f64>,
    /// Common bin edges of terminal wealth, ascending and evenly spaced.
    pub wealth_edges: Vec<f64>,
    /// Histories in the order they were drawn.
    pub histories: Vec<HistoryReport>,
    /// Sentences about each framework that changes its allocation.
    pub sentences: Vec<String>,
    /// Run times.
    pub costs: Costs,
}

/// Run times of the evaluation, the only part that differs between two runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Costs {
    /// Seconds of all trainings.
    pub training_seconds: f64,
    /// Seconds of the simulation.
    pub simulation_seconds: f64,
    /// Mean seconds of one re-solved step; null if there was none.
    pub resolve_seconds: Option<f64>,
}

/// The results of one strategy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StrategyReport {
    /// Its name: `Cautious, learns`, `50 % in stocks`, `All in the bank` and the like.
    pub strategy: String,
    /// The framework; null for constant mixes and strategies of your own.
    pub framework: Option<Framework>,
    /// The allocation of a constant mix; null for others.
    pub constant_mix: Option<f64>,
    /// The policy followed; null for strategies without one, and if each history had its own.
    pub policy: Option<String>,
    /// Utility of terminal wealth, measured from `floor`: `(U(x) - U(floor)) / (floor U'(floor))`. This form loses no
    /// digits at high risk aversion or wealth.
    pub utility: UtilityReport,
    /// Certainty equivalent of terminal wealth.
    pub certainty_equivalent: Estimate,
    /// Terminal wealth in the currency of the initial wealth, and its course on the way.
    pub wealth: WealthReport,
    /// This strategy less the reference, on the same returns; null for the reference.
    pub difference: Option<Difference>,
    /// Comparison with the constant mix of its own average; null for strategies without a policy.
    pub own_mix: Option<OwnMix>,
    /// Counts of the bins between `histogram_edges`.
    pub histogram: Vec<usize>,
    /// Results period by period; null for constant mixes.
    pub periods: Option<Vec<PeriodReport>>,
    /// Coverage of the ball; null if the framework has no Wasserstein ball.
    pub coverage: Option<Coverage>,
    /// Share of steps whose advice was solved anew.
    pub resolved_share: Option<f64>,
}

/// Statistics of terminal utility.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct UtilityReport {
    /// Mean over paths.
    pub mean: Estimate,
    /// Variance over paths.
    pub variance: Estimate,
    /// Value below which a fifth of the paths end.
    pub quantile_20: Estimate,
    /// Value below which nine tenths of the paths end.
    pub quantile_90: Estimate,
    /// Largest value over the paths of one history, averaged over histories; an extreme has no interval.
    pub max: f64,
    /// Smallest value over the paths of one history, averaged over histories; an extreme has no interval.
    pub min: f64,
}

/// Statistics of terminal wealth and of its course.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WealthReport {
    /// Mean over paths.
    pub mean: Estimate,
    /// Value below which a fifth of the paths end.
    pub quantile_20: Estimate,
    /// Value below which nine tenths of the paths end.
    pub quantile_90: Estimate,
    /// Largest value over the paths of one history, averaged over histories; an extreme has no interval.
    pub max: f64,
    /// Smallest value over the paths of one history, averaged over histories; an extreme has no interval.
    pub min: f64,
    /// The mean of the worst twentieth of the paths.
    pub worst_twentieth: Estimate,
    /// Counts of the bins between `wealth_edges`, without the paths that end with the wealth of all in the bank.
    pub histogram: Vec<usize>,
    /// Number of paths that end with the wealth of all in the bank, to a billionth of it.
    pub at_bank: usize,
    /// Share of the paths that end below the initial wealth plus all contributions.
    pub chance_of_loss: Estimate,
    /// Mean over paths of the largest fall below the highest value so far, as a share of it. Contributions and
    /// withdrawals are neither gain nor fall.
    pub max_drawdown: Estimate,
}

/// A paired difference from the reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Difference {
    /// Difference of mean terminal utility.
    pub utility: Estimate,
    /// Difference of certainty equivalents, in terminal wealth.
    pub certainty_equivalent: Estimate,
}

/// The constant mix of a strategy's own average allocation, on the same returns. Nobody could have chosen it
/// beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OwnMix {
    /// The average allocation, over all periods of all paths.
    pub allocation: f64,
    /// Certainty equivalent of the strategy less that of the mix, in terminal wealth: the gain from changing the
    /// allocation.
    pub beyond: Estimate,
}

/// One period over all paths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PeriodReport {
    /// Number of the period, from 1.
    pub period: usize,
    /// Number of returns known at its start.
    pub sample_size: usize,
    /// Share of wealth held in the risky asset.
    pub allocation: Spread,
    /// Share of paths that held nothing in the risky asset.
    pub all_bank_share: f64,
    /// The radius; null if the framework has no Wasserstein ball.
    pub radius: Option<RadiusSpread>,
}

/// Mean and quantiles over paths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Spread {
    /// Mean over paths.
    pub mean: f64,
    /// Value below which a tenth of the paths lie.
    pub quantile_10: f64,
    /// Value below which nine tenths of the paths lie.
    pub quantile_90: f64,
}

/// The radius over paths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RadiusSpread {
    /// Mean over paths; all fields are in log-return.
    pub mean: f64,
    /// Value below which a tenth of the paths lie.
    pub quantile_10: f64,
    /// The median.
    pub quantile_50: f64,
    /// Value below which nine tenths of the paths lie.
    pub quantile_90: f64,
    /// Radius on the first path.
    pub first_path: f64,
}

/// How often the ball held the true law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Coverage {
    /// Target coverage `1 - alpha`, if the radius rule has an alpha. Under `joint` it is for all balls of a path together.
    pub target: Option<f64>,
    /// Coverage by ascending sample size; one entry if the ball is frozen.
    pub by_sample_size: Vec<CoverageAtSize>,
    /// Share of paths on which some period's ball did not hold the true law.
    pub ever_left: Estimate,
}

/// How often the ball held the true law at one sample size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CoverageAtSize {
    /// Number of returns known.
    pub sample_size: usize,
    /// Share of paths whose ball held the true law.
    pub covered: Estimate,
    /// Share of paths whose ball lay inside the first ball of the path, `W1(F_0, F_t) + e_t <= e_0`, with F the centres
    /// and e the radii. If every return is allowed, this is exact, because mass may move beyond the last return. With a
    /// `support` a ball may lie inside without it, and the share is a lower bound.
    pub inside_first: Estimate,
}

/// Results at one initial history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct HistoryReport {
    /// The bridge quantile there; null under radius rules other than `bridge`, `calibrated` and `joint`.
    pub quantile: Option<f64>,
    /// Radius of the first framework with a ball, in log-return; 0 if there is none.
    pub radius: f64,
    /// Certainty equivalent that each framework promises there, in its first advice.
    pub promised: Vec<f64>,
    /// Mean terminal utility of each strategy, in their order.
    pub mean_utility: Vec<f64>,
}

impl EvaluationReport {
    /// Returns the report with utilities as the request defines them, `U(floor) + floor U'(floor) u`.
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

    /// Returns the strategy that follows policies of this framework.
    pub fn framework(&self, framework: Framework) -> Option<&StrategyReport> {
        self.strategies.iter().find(|strategy| strategy.framework == Some(framework))
    }

    /// Returns the strategy of this name.
    pub fn strategy(&self, name: &str) -> Option<&StrategyReport> {
        self.strategies.iter().find(|strategy| strategy.strategy == name)
    }
}
