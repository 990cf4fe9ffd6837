//! The answer of a policy: an advice, and the uncertainty set behind it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::problem::actions::Band;

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
    /// The allocation less the holding: the share of wealth to buy, or to sell if negative.
    pub trade: f64,
    /// Money added at the end of the period, or withdrawn if negative.
    pub contribution: f64,
    /// Certainty equivalent of the robust value, in terminal wealth.
    pub certainty_equivalent: f64,
    /// Terminal wealth if everything is sold now and stays in the bank, with all later contributions and withdrawals.
    /// No law can take it away.
    pub floor: f64,
    /// Radius of the uncertainty set. For the Wasserstein ball it is in log-return. In the parametric frameworks it is
    /// half the width of the confidence region in the mean, in estimated standard deviations of a return.
    pub radius: f64,
    /// Number of returns observed, including the history.
    pub sample_size: usize,
    /// Effective sample size; equal to `sample_size` if `learning` is `equal` and the centre is not `conditional`.
    pub effective_size: f64,
    /// Predicted standard deviation of the log certainty equivalent.
    pub surrogate_sd: f64,
    /// True if the state lies within the region where the surrogates were trained.
    pub in_design: bool,
    /// How the advice was computed.
    pub source: AdviceSource,
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
