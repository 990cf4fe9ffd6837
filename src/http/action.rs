//! The answer of `/action`, of one asset and of several.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::assets::advice::named;
use crate::control::policy::advice::{Advice, AdviceSource};
use crate::control::policy::caution::Caution;
use crate::control::policy::sensitivity::{Sensitivity, cautions};
use crate::control::policy::worst_case::WorstCase;
use crate::control::problem::actions::Band;
use crate::service::action::Action as ServiceAction;
use crate::service::assets::{Assets, Composed};

/// The robust allocation for the coming period.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum ActionAnswer {
    Asset(Box<Action>),
    Assets(Box<AssetsAction>),
}

/// The robust allocation of one asset for the coming period.
#[derive(Debug, Serialize, ToSchema)]
pub struct Action {
    pub session: String,
    pub period: usize,
    #[serde(flatten)]
    pub advice: Advice,
    /// The law that is worst for this allocation, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<WorstCase>,
    /// What to know before the advice is followed.
    pub caution: Vec<Caution>,
    /// How near it is to changing, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensitivity: Option<Sensitivity>,
}

/// The robust allocation of several assets for the coming period.
#[derive(Debug, Serialize, ToSchema)]
pub struct AssetsAction {
    pub session: String,
    pub period: usize,
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
    /// The law of the fund's log-return that is worst for this total, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<WorstCase>,
    /// What to know before the advice is followed.
    pub caution: Vec<Caution>,
}

impl ActionAnswer {
    pub fn new(session: String, action: ServiceAction) -> Self {
        let ServiceAction { period, advice, assets, worst_case, sensitivity } = action;
        let caution = cautions(&advice, sensitivity.as_ref());
        match assets {
            None => ActionAnswer::Asset(Box::new(Action { session, period, advice, worst_case, caution, sensitivity })),
            Some(assets) => ActionAnswer::Assets(Box::new(AssetsAction::new(
                (session, period),
                &advice,
                &assets,
                worst_case,
                caution,
            ))),
        }
    }
}

impl AssetsAction {
    fn new(
        (session, period): (String, usize),
        advice: &Advice,
        assets: &Assets,
        worst_case: Option<WorstCase>,
        caution: Vec<Caution>,
    ) -> Self {
        let shares = assets.shares(advice.allocation);
        let trade: Vec<f64> = shares.iter().zip(&assets.fund.holdings).map(|(share, held)| share - held).collect();
        AssetsAction {
            session,
            period,
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
            worst_case,
            caution,
        }
    }
}
