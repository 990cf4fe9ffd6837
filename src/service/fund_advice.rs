//! The advice on several assets by a policy of their fund, as it is told by their names.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use super::assets::{Assets, Composed};
use crate::control::assets::advice::named;
use crate::control::policy::advice::{Advice, AdviceSource};
use crate::control::problem::actions::Band;

/// What to hold of several assets through a period, by a policy of their fund.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct FundAdvice {
    /// Share of wealth to hold in each asset; the rest is in the bank.
    pub allocation: BTreeMap<String, f64>,
    /// Share of wealth in all assets together.
    pub total: f64,
    #[serde(flatten)]
    pub composed: Composed,
    /// The allocation less the holdings: shares of wealth to buy, or where they are negative to sell.
    pub trade: BTreeMap<String, f64>,
    /// The totals that are best kept as they are; where trading costs nothing both ends are the total.
    #[schema(value_type = [f64; 2])]
    pub band: Band,
    /// Money added at the end of the period, withdrawn where it is negative.
    pub contribution: f64,
    /// Certainty equivalent, in terminal wealth, of going on with this composition: the promise that a later one never breaks.
    pub certainty_equivalent: f64,
    /// Terminal wealth of selling everything now and staying in the bank.
    pub floor: f64,
    /// Radius of the ball around the law of the fund, in log-return.
    pub radius: f64,
    /// Dates seen, those of the history among them.
    pub sample_size: usize,
    /// Predicted standard deviation of the log certainty equivalent.
    pub surrogate_sd: f64,
    /// Whether the state of the fund lies where the surrogates were trained.
    pub in_design: bool,
    /// How the total was found.
    pub source: AdviceSource,
}

impl FundAdvice {
    /// That of the fund, asset by asset.
    pub fn new(advice: &Advice, assets: &Assets) -> Self {
        let shares = assets.shares(advice.allocation);
        let trade: Vec<f64> = shares.iter().zip(&assets.fund.holdings).map(|(share, held)| share - held).collect();
        FundAdvice {
            allocation: named(&assets.names, &shares),
            total: advice.allocation,
            composed: assets.composed(),
            trade: named(&assets.names, &trade),
            band: advice.band,
            contribution: advice.contribution,
            certainty_equivalent: advice.certainty_equivalent,
            floor: advice.floor,
            radius: advice.radius,
            sample_size: advice.sample_size,
            surrogate_sd: advice.surrogate_sd,
            in_design: advice.in_design,
            source: advice.source,
        }
    }
}
