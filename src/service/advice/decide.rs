//! The actions of a declared problem's policy, at a state that the caller knows. Nothing is stored.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::policy::declared::Decided;
use crate::control::request::by_name::distinct_if_given;
use crate::service::advice::explain::ATOM_BYTES;
use crate::service::advice::policy_map::{InputRange, MapQuestion, PolicyMap};
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::service::sessions::current_advice::of_state;
use crate::store::Tenant;

/// A state of a declared problem, and what was seen on the way to it.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Decide {
    /// The policy.
    pub policy: String,
    /// The period to decide, from 1. Default: 1.
    #[serde(default = "first")]
    #[schema(example = 2)]
    pub period: usize,
    /// The states before the period, each by its name. Default in the first period: the declared start.
    #[serde(default, deserialize_with = "distinct_if_given")]
    #[schema(example = json!({ "stock": 7.0 }))]
    pub state: Option<BTreeMap<String, f64>>,
    /// The noises of all periods before this one, oldest first. Default: none.
    #[serde(default)]
    #[schema(example = json!([18.0]))]
    pub noises: Vec<f64>,
    /// Ranges of one or two inputs: decides at all of their values instead. An input is a state, or the noise, which then
    /// was the same in every period before this one. Default: none.
    #[serde(default)]
    #[schema(example = json!([]))]
    pub across: Vec<InputRange>,
}

fn first() -> usize {
    1
}

/// The actions of a period.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct DecideAnswer {
    pub policy: String,
    #[serde(flatten)]
    pub decided: Decided,
}

/// The answer to a decision: at a state, or over ranges of inputs.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
pub enum DecideReply {
    One(Box<DecideAnswer>),
    Map(Box<PolicyMap>),
}

impl Sessions {
    /// Decides a period at a state. The robust step is solved against the value that was trained for the step after.
    ///
    /// # Errors
    /// There is no such policy, a field breaks a rule, actions lead the state out of its range, or too much work waits
    /// already.
    pub async fn decide(&self, tenant: &Tenant, question: Decide) -> Result<Large<DecideReply>, ServiceError> {
        let Decide { policy, period, state, noises, across } = question;
        let advisor = self.policies.decider(tenant, &policy).await?;
        if !across.is_empty() {
            let map = MapQuestion::new(advisor.clone(), period, (state, noises), across)?;
            let columns = self.map_columns(tenant, &map).await?;
            return Ok(Large::from(DecideReply::Map(map.answer(policy, columns).into())));
        }
        let problem = &advisor.specification().problem;
        // Noises beyond the horizon are refused.
        let returns = problem.history.len() + problem.horizon;
        let solve = move || advisor.decide(period, state.as_ref(), &noises);
        let room = self.memory.answers(returns * ATOM_BYTES).await?;
        let decided = self.resolving.run_on_record(tenant, returns, solve).await?.map_err(of_state)?;
        Ok(Large { value: DecideReply::One(DecideAnswer { policy, decided }.into()), room })
    }
}
