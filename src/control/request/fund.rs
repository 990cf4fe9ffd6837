//! The fund of several assets: its assets, how its composition is chosen, and how its law may be moved.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::asset_history::AssetHistory;
use super::limits::WeightLimits;
use super::means::MeansRule;
use crate::numerics::transport::water_filling::{GroundMetric, inverse_volatility};

/// The data of a policy for several assets, beside the problem of their fund. The shares of that fund are proportional
/// to inverse volatilities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FundSpecification {
    /// Names of the assets, 2 to 30, all different.
    pub assets: Vec<String>,
    /// Distance that sets the adversary's cost of moving a law.
    pub ground_norm: GroundNorm,
    /// How the shares of the assets within the risky holdings are chosen.
    pub composition: CompositionRule,
    /// Limits on the composition. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<WeightLimits>,
    /// The means of the assets under the law at the centre. Default: `sample`.
    #[serde(default)]
    pub means: MeansRule,
    /// Factor on the radius of one fund, so that the laws of all funds lie in their balls at once, 1 to 100; the
    /// training finds it if it is left out. The scale of the problem's radius includes it. It is 1 under rules that depend
    /// on the sample size alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_factor: Option<f64>,
    /// Log-returns by date, oldest first; each date has one value for each asset, null before its first return.
    #[schema(value_type = Vec<Vec<Option<f64>>>)]
    pub history: AssetHistory,
}

/// How the composition of the fund is chosen. Default: `one_step`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CompositionRule {
    /// The composition of the allocation that solves the one-step problem, or inverse volatilities if that allocation
    /// holds nothing.
    #[default]
    OneStep,
    /// Equal shares.
    Equal,
    /// Shares in inverse proportion to the standard deviations of the returns.
    InverseVolatility,
    /// These shares, one for each asset in order; they sum to 1.
    Given(Vec<f64>),
}

/// The distance between the log-returns of two dates. Default: `scaled_one`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum GroundNorm {
    /// The sum of the assets' moves, each weighted by the asset's inverse volatility. The weights sum to 1, so moving
    /// all assets by s costs s. If only n_i of the n returns of an asset are its own, its weight is `sqrt(n_i / n)` of
    /// that.
    #[default]
    ScaledOne,
    /// The largest move of any asset.
    Sup,
}

impl GroundNorm {
    /// Returns the ground cost for the law of `rows`, which are `known` with the means of the law. An asset whose record
    /// is short is cheaper to move than a whole one: the ball grows in its direction and shrinks in none.
    pub fn at(self, rows: &[Vec<f64>], known: &AssetHistory) -> GroundMetric {
        match self {
            GroundNorm::ScaledOne if known.are_equal() => GroundMetric::Weighted(inverse_volatility(rows)),
            GroundNorm::ScaledOne => GroundMetric::Weighted(
                inverse_volatility(rows).iter().zip(known.evidence()).map(|(k, e)| k * e).collect(),
            ),
            GroundNorm::Sup => GroundMetric::Sup,
        }
    }
}
