//! The fund of several assets, in figures: what it is of, how its composition is chosen, how its law may be moved.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::numerics::levelling::{Ground, inverse_volatility};

/// What a policy for several assets knows beside the problem of their fund, whose shares are those of inverse volatilities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FundSpecification {
    /// Names of the assets.
    pub assets: Vec<String>,
    /// What moving a law costs the adversary.
    pub ground_norm: GroundNorm,
    /// How the shares of the assets in what is held are chosen.
    pub composition: CompositionRule,
    /// What the radius of one fund was multiplied by, for laws of all funds to lie in their balls at once: the scale of the
    /// problem's radius holds it. 1 under rules that look at the sample size alone.
    pub radius_factor: f64,
    /// Log-returns, date by date, oldest first; each date has one for each asset.
    pub history: Vec<Vec<f64>>,
}

/// How the composition of the fund is chosen.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CompositionRule {
    /// That of the allocation that solves the one-step problem; inverse volatilities where it holds nothing.
    #[default]
    OneStep,
    /// Equal shares.
    Equal,
    /// Shares in inverse proportion to the deviations of the returns.
    InverseVolatility,
    /// These shares, in the order of the assets, which sum to 1.
    Given(Vec<f64>),
}

/// The distance between two dates' log-returns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum GroundNorm {
    /// The sum of the moves, each times its asset's inverse volatility, which sum to 1: moving all assets by s costs s.
    #[default]
    ScaledOne,
    /// The largest move.
    Sup,
}

impl GroundNorm {
    /// The ground cost at a history.
    pub fn at(self, rows: &[Vec<f64>]) -> Ground {
        match self {
            GroundNorm::ScaledOne => Ground::Weighted(inverse_volatility(rows)),
            GroundNorm::Sup => Ground::Sup,
        }
    }
}
