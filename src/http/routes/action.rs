//! The answer of `/action`: for one asset, for several and for a declared problem.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::policy::advice::Advice;
use crate::control::policy::caution::Caution;
use crate::control::policy::declared::Decided;
use crate::control::policy::sensitivity::{Sensitivity, cautions};
use crate::control::policy::worst_case::WorstCase;
use crate::service::advice::action::{AccountAdvice, AdviceKind, PeriodAdvice as ServiceAction};
use crate::service::sessions::fund_advice::FundAdvice;

/// The robust allocation for the coming period.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum ActionAnswer {
    Asset(Box<AssetAction>),
    Assets(Box<AssetsAction>),
    Declared(Box<DeclaredAdvice>),
}

/// The robust actions of a declared problem's coming period.
#[derive(Debug, Serialize, ToSchema)]
pub struct DeclaredAdvice {
    pub session: String,
    /// The states before the period, by name.
    pub state: BTreeMap<String, f64>,
    #[serde(flatten)]
    pub decided: Decided,
    /// Points to know before you follow the advice.
    pub caution: Vec<Caution>,
}

/// The robust allocation of one asset for the coming period.
#[derive(Debug, Serialize, ToSchema)]
pub struct AssetAction {
    pub session: String,
    pub period: usize,
    #[serde(flatten)]
    pub advice: Advice,
    /// The law that is worst for this allocation; present only if it was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<WorstCase>,
    /// Points to know before you follow the advice.
    pub caution: Vec<Caution>,
    /// Closeness of the advice to changing; present only if it was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensitivity: Option<Sensitivity>,
}

/// The robust allocation of several assets for the coming period.
#[derive(Debug, Serialize, ToSchema)]
pub struct AssetsAction {
    pub session: String,
    pub period: usize,
    #[serde(flatten)]
    pub advice: FundAdvice,
    /// The law of the fund's log-return that is worst for this total allocation; present only if it was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<WorstCase>,
    /// Points to know before you follow the advice.
    pub caution: Vec<Caution>,
}

impl ActionAnswer {
    pub fn new(session: String, action: ServiceAction) -> Self {
        let ServiceAction { period, kind, waiting } = action;
        let AccountAdvice { advice, assets, worst_case, sensitivity } = match kind {
            AdviceKind::Account(account) => *account,
            AdviceKind::Declared(decided, state) => {
                let decided = Decided { period, ..*decided };
                let caution = waiting.map(|horizon| Caution::waiting(period, horizon)).into_iter().collect();
                return ActionAnswer::Declared(Box::new(DeclaredAdvice { session, state, decided, caution }));
            }
        };
        let mut caution = cautions(&advice, sensitivity.as_ref());
        caution.extend(waiting.map(|horizon| Caution::waiting(period, horizon)));
        match assets {
            None => {
                ActionAnswer::Asset(Box::new(AssetAction { session, period, advice, worst_case, caution, sensitivity }))
            }
            Some(assets) => {
                let advice = FundAdvice::new(&advice, &assets);
                ActionAnswer::Assets(Box::new(AssetsAction { session, period, advice, worst_case, caution }))
            }
        }
    }
}
