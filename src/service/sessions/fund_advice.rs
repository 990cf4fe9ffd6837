//! Advice on several assets by a policy of their fund, by asset name.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::assets::advice::named;
use crate::control::policy::advice::{Advice, AdviceSource, SpendingAdvice};
use crate::control::problem::actions::Band;
use crate::service::sessions::assets::{Assets, Composition};

/// The holdings of several assets to keep through a period, by a policy of their fund.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct FundAdvice {
    /// Share of wealth to hold in each asset; the rest is in the bank.
    pub allocation: BTreeMap<String, f64>,
    /// Share of wealth in all assets together.
    pub total: f64,
    #[serde(flatten)]
    pub composed: Composition,
    /// Shares of wealth to buy, or to sell if negative: the allocation, of the wealth left after spending, less the holdings.
    pub trade: BTreeMap<String, f64>,
    /// The totals that are best kept as they are. If trading costs nothing, both ends are the total.
    #[schema(value_type = [f64; 2])]
    pub band: Band,
    /// Spending before the period, if the problem has any. Allocations are shares of the wealth that is left.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spending: Option<SpendingAdvice>,
    /// Money added at the end of the period; negative if withdrawn.
    pub contribution: f64,
    /// Certainty equivalent, in terminal wealth or with spending in its sure level, of keeping this composition. A later
    /// composition never promises less.
    pub certainty_equivalent: f64,
    /// Terminal wealth, or with spending its sure level, from selling everything now and staying in the bank.
    pub floor: f64,
    /// Radius of the ball around the law of the fund, in log-return.
    pub radius: f64,
    /// Dates observed, including those of the history.
    pub sample_size: usize,
    /// Predicted standard deviation of the log certainty equivalent.
    pub surrogate_sd: f64,
    /// True if the state of the fund lies in the region where the surrogates were trained.
    pub in_design: bool,
    /// How the total was found.
    pub source: AdviceSource,
}

impl FundAdvice {
    /// Converts the advice of the fund to advice for each asset.
    pub fn new(advice: &Advice, assets: &Assets) -> Self {
        let shares = assets.shares(advice.allocation);
        let left = 1.0 - SpendingAdvice::share_of(advice.spending);
        let trade: Vec<f64> =
            shares.iter().zip(&assets.fund.holdings).map(|(share, held)| share * left - held).collect();
        FundAdvice {
            allocation: named(&assets.names, &shares),
            total: advice.allocation,
            composed: assets.composed(),
            trade: named(&assets.names, &trade),
            band: advice.band,
            spending: advice.spending,
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
