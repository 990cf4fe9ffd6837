//! What a policy answers: an advice, and the uncertainty set behind it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::problem::actions::Band;

/// Where an advice came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AdviceSource {
    /// The policy surrogate (or the stored solution of a single-state design).
    PolicySurrogate,
    /// Re-solved on request.
    Resolved,
    /// Re-solved because the state lies outside the design.
    ResolvedOutsideDesign,
    /// Re-solved for a hypothetical radius, which the policy surrogate was not trained for.
    ResolvedOtherRadius,
    /// The robust step has no finite solution at the state, or its wealth does not pay for what is withdrawn: all of it stays in
    /// the bank, which no law can hurt.
    Unsolved,
}

/// The robust allocation for the coming period and what it is worth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Advice {
    /// Share of wealth to hold in the risky asset: the holding, brought to the nearer end of the band.
    pub allocation: f64,
    /// Share of wealth in the risky asset before trading.
    pub holding: f64,
    /// The holdings that are best kept as they are; where trading costs nothing both ends are the allocation.
    #[schema(value_type = [f64; 2])]
    pub band: Band,
    /// The allocation less the holding: the share of wealth to buy, or where it is negative to sell.
    pub trade: f64,
    /// Money added at the end of the period, withdrawn where it is negative.
    pub contribution: f64,
    /// Certainty equivalent of the robust value, in terminal wealth.
    pub certainty_equivalent: f64,
    /// Terminal wealth of selling everything now and staying in the bank, with all that is added and withdrawn until then: no
    /// law can take it away.
    pub floor: f64,
    /// Radius of the uncertainty set: of the Wasserstein ball, in log-return; in the parametric frameworks half the width
    /// of the confidence region in the mean, in estimated standard deviations of a return.
    pub radius: f64,
    /// Returns seen, those of the history among them.
    pub sample_size: usize,
    /// How many returns of equal weight tell as much: as many as were seen where `learning` is `equal`.
    pub effective_size: f64,
    /// Predicted standard deviation of the log certainty equivalent.
    pub surrogate_sd: f64,
    /// Whether the state lies where the surrogates were trained.
    pub in_design: bool,
    /// How it was found.
    pub source: AdviceSource,
}

/// The uncertainty set of a state, in figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Uncertainty {
    /// Returns seen, those of the history among them.
    pub sample_size: usize,
    /// How many returns of equal weight tell as much: as many as were seen where `learning` is `equal`.
    pub effective_size: f64,
    /// Raw moments of the law learned, first to the specification's count.
    pub moments: Vec<f64>,
    /// (1 - alpha)-quantile of the bridge statistic; absent under other radius rules than `bridge` and `calibrated`. Under `bridge`
    /// it is exact for the history of the policy, and simulated in proportion to that after returns were learned.
    pub quantile: Option<f64>,
    /// As in an advice.
    pub radius: f64,
}
