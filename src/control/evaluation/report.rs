//! The report of an evaluation, as it travels; `docs/evaluation.md` says where the intervals come from.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::request::evaluation::EvaluationRequest;
use crate::control::request::framework::Framework;
use crate::numerics::summary::Estimate;

/// Name and version of the report's form.
pub const FORMAT: &str = "ballast-evaluation-1";

/// Strategies compared on common returns. `docs/evaluation.md` says where the intervals come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct EvaluationReport {
    pub format: String,
    /// The completed request.
    pub request: EvaluationRequest,
    /// The strategy that differences are taken against.
    pub reference: String,
    /// Frameworks first, then constant mixes, in the order of the request.
    pub strategies: Vec<StrategyReport>,
    /// Common bin edges of terminal utility, ascending.
    pub histogram_edges: Vec<f64>,
    pub histories: Vec<HistoryReport>,
    pub costs: Costs,
}

/// What the evaluation cost; the only part that differs between two runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Costs {
    pub training_seconds: f64,
    pub simulation_seconds: f64,
    /// Mean of one re-solved step; null where there was none.
    pub resolve_seconds: Option<f64>,
}

/// One strategy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StrategyReport {
    pub strategy: String,
    pub framework: Option<Framework>,
    /// The allocation of a constant mix.
    pub constant_mix: Option<f64>,
    /// The policy followed; null for constant mixes and where each history had its own.
    pub policy: Option<String>,
    pub utility: UtilityReport,
    /// Terminal wealth that is worth as much for certain.
    pub certainty_equivalent: Estimate,
    pub wealth: WealthReport,
    /// This strategy less the reference, on the same returns; null for the reference.
    pub difference: Option<Difference>,
    /// Counts of the bins between `histogram_edges`.
    pub histogram: Vec<usize>,
    pub periods: Option<Vec<PeriodReport>>,
    pub coverage: Option<Coverage>,
    /// Share of steps advised by solving the step anew.
    pub resolved_share: Option<f64>,
}

/// Terminal utility.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct UtilityReport {
    pub mean: Estimate,
    pub variance: Estimate,
    pub quantile_20: Estimate,
    pub quantile_90: Estimate,
    /// Of the paths of one history, averaged over histories.
    pub max: Estimate,
    pub min: Estimate,
}

/// Terminal wealth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WealthReport {
    pub mean: Estimate,
}

/// A paired difference to the reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Difference {
    pub utility: Estimate,
    pub certainty_equivalent: Estimate,
}

/// One period over all paths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PeriodReport {
    pub period: usize,
    pub sample_size: usize,
    pub allocation: Spread,
    /// Share of paths that held nothing in the risky asset.
    pub all_bank_share: f64,
    pub radius: Option<RadiusSpread>,
}

/// Mean and quantiles over paths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Spread {
    pub mean: f64,
    pub quantile_10: f64,
    pub quantile_90: f64,
}

/// The radius over paths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RadiusSpread {
    pub mean: f64,
    pub quantile_10: f64,
    pub quantile_50: f64,
    pub quantile_90: f64,
    /// On the first path.
    pub first_path: f64,
}

/// How often the ball held the true law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Coverage {
    /// 1 - alpha, under a radius rule that has one.
    pub target: Option<f64>,
    pub by_sample_size: Vec<CoverageAtSize>,
    /// Share of paths on which some period's ball did not hold it.
    pub ever_left: Estimate,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CoverageAtSize {
    pub sample_size: usize,
    pub covered: Estimate,
}

/// One initial history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct HistoryReport {
    /// The bridge quantile there; null under other radius rules.
    pub quantile: Option<f64>,
    pub radius: f64,
    /// What each framework promises there: the certainty equivalent of its first advice, by its own account.
    pub promised: Vec<f64>,
    /// Mean terminal utility of each strategy, in their order.
    pub mean_utility: Vec<f64>,
}

impl EvaluationReport {
    /// The strategy of this name.
    pub fn strategy(&self, name: &str) -> Option<&StrategyReport> {
        self.strategies.iter().find(|strategy| strategy.strategy == name)
    }
}
