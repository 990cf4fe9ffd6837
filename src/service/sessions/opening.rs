//! The start of a session: what a request leaves out, and the state and the plan that follow.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Serialize;

use crate::control::error::FieldError;
use crate::control::policy::advisor::Advisor;
use crate::control::policy::content_hash;
use crate::control::policy::declared::DeclaredAdvisor;
use crate::control::policy_document::PreparedPolicy;
use crate::control::problem::state::State;
use crate::control::request::assets::check_rows;
use crate::control::request::specification::Specification;
use crate::service::callers::allowance::HeavyPermit;
use crate::service::entries::report::none_of;
use crate::service::error::ServiceError;
use crate::service::jobs::idempotency;
use crate::service::sessions::Sessions;
use crate::service::sessions::assets::Assets;
use crate::service::sessions::initial_history::InitialHistory;
use crate::service::sessions::plan::{PlannedProblem, Renewing, SessionPlan};
use crate::store::{InitialAccount, Relabel, RequestKey, Tenant};

/// The start of a session. History and wealth default to the policy's, and holdings default to 0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SessionStart {
    pub policy: String,
    pub history: Option<InitialHistory>,
    pub wealth: Option<f64>,
    pub holding: Option<f64>,
    pub holdings: Option<BTreeMap<String, f64>>,
    /// The states of a declared problem. They default to its own start.
    pub state: Option<BTreeMap<String, f64>>,
    pub renew: Option<Renewing>,
    pub rolling: bool,
    pub labels: Relabel,
}

/// The initial state of a session.
struct Beginning {
    state: State,
    /// Present if there are several assets.
    assets: Option<Box<Assets>>,
    /// Known log-returns, date after date.
    history: Vec<f64>,
}

/// The facts of a session's start beside its plan.
#[derive(Debug, PartialEq)]
pub(in crate::service) struct SessionBeginning {
    pub(in crate::service) account: Option<InitialAccount>,
    /// Known noises: of an investor the log-returns, date after date.
    pub(in crate::service) history: Vec<f64>,
    /// The number of assets, or of states and actions, if there are several.
    pub(in crate::service) named: usize,
}

/// Returns the start of a declared problem's session, and its plan.
///
/// # Errors
/// The state is not one, a field of an investor is given, or the session cannot renew itself as it says.
fn declared_begins(
    advisor: &DeclaredAdvisor,
    start: SessionStart,
) -> Result<(SessionBeginning, SessionPlan), FieldError> {
    let of_investors = [
        ("history", start.history.is_some()),
        ("wealth", start.wealth.is_some()),
        ("holding", start.holding.is_some()),
        ("holdings", start.holdings.is_some()),
        ("rolling", start.rolling),
    ];
    none_of(&of_investors, "must be absent: the policy is of a declared problem, and the field is for investors")?;
    let mut problem = advisor.policy().specification().problem.clone();
    let history = std::mem::take(&mut problem.history);
    let state = advisor.state("state", start.state.as_ref())?;
    let named = problem.states.len() + problem.actions.len();
    let plan = SessionPlan::of_declared(PlannedProblem { problem, state }, start.renew)?;
    Ok((SessionBeginning { account: None, history, named }, plan))
}

impl SessionStart {
    /// Returns the request for this start under a key. Its hash differs from that of any job's request, which has other
    /// fields.
    pub(super) fn under(&self, key: String) -> Result<RequestKey, ServiceError> {
        idempotency::check(&key)?;
        let sent = serde_json::to_vec(self).map_err(ServiceError::internal)?;
        Ok(RequestKey { key, request_hash: content_hash(&sent) })
    }

    /// Returns the initial state for the policy of `advisor`.
    fn begins(self, advisor: &Advisor) -> Result<Beginning, FieldError> {
        let SessionStart { history, wealth, holding, holdings, state, .. } = self;
        none_of(
            &[("state", state.is_some())],
            "must be absent: the policy is of an investor, who has wealth and holdings",
        )?;
        let Specification { problem, fund, .. } = advisor.specification();
        let Some(fund) = fund else {
            if let Some(InitialHistory::Several(rows)) = &history {
                let rule = "must be a list of numbers: the policy has one asset";
                return Err(FieldError::new("history", format!("{} rows", rows.len()), rule));
            }
            if holdings.is_some() {
                return Err(FieldError::new("holdings", "an object", "must be absent: the policy has one asset"));
            }
            let history = history.map(InitialHistory::values);
            let state = advisor.initial_state(history.as_deref(), wealth)?.with_holding(holding.unwrap_or(0.0))?;
            let history = history.unwrap_or_else(|| problem.history.clone());
            return Ok(Beginning { state, assets: None, history });
        };
        if let Some(holding) = holding {
            let rule = "must be absent: the policy has several assets. Give holdings, the share of each asset";
            return Err(FieldError::new("holding", holding, rule));
        }
        let rows = match history {
            None => fund.history.clone(),
            Some(InitialHistory::Several(rows)) => rows,
            Some(InitialHistory::One(values)) => {
                let rule = format!("must be a list of rows, each with the log-returns of {}", fund.assets.join(", "));
                return Err(FieldError::new("history", format!("{} values", values.len()), rule));
            }
        };
        check_rows("history", &rows, &fund.assets, None)?;
        let history = rows.concat();
        let assets = Assets::at(&fund.assets, rows, fund.means, holdings.as_ref())?;
        let state = assets.fund.begin(advisor, wealth)?;
        Ok(Beginning { state, assets: Some(assets.into()), history })
    }
}

impl Sessions {
    /// Returns the start of a session, and its plan.
    ///
    /// # Errors
    /// There is no such policy, or history, wealth, holdings or states break a rule.
    pub(in crate::service) async fn begins(
        &self,
        (tenant, turn): (&Tenant, &HeavyPermit),
        start: SessionStart,
    ) -> Result<(SessionBeginning, SessionPlan), ServiceError> {
        match self.policies.policy(tenant, &start.policy).await? {
            PreparedPolicy::Investor(advisor) => self.account_begins((tenant, turn), &advisor, start).await,
            PreparedPolicy::Declared(advisor) => Ok(declared_begins(&advisor, start)?),
        }
    }

    /// Returns the start of an investor's session, and its plan.
    async fn account_begins(
        &self,
        (tenant, turn): (&Tenant, &HeavyPermit),
        advisor: &Arc<Advisor>,
        start: SessionStart,
    ) -> Result<(SessionBeginning, SessionPlan), ServiceError> {
        let (renew, rolling) = (start.renew, start.rolling);
        let beginning = start.begins(advisor)?;
        // Withdrawals are checked against wealth, whatever is held.
        advisor.check_withdrawals(&beginning.state)?;
        let plan = SessionPlan::new(advisor, beginning.state.law.sample_size(), renew, rolling)?;
        if beginning.assets.is_some() && Assets::must_solve(advisor, 0) {
            turn.begin().await?;
        }
        let Beginning { state, assets, history } = self.composed(tenant, advisor, beginning).await?;
        let plan = SessionPlan { assets: assets.as_ref().map(|assets| assets.planned()), ..plan };
        self.policies.starts_from(advisor, state.law.sample_size(), plan.terms.horizon)?;
        let account = Some(InitialAccount { wealth: state.wealth, holding: state.holding });
        let named = assets.as_ref().map_or(0, |assets| assets.names.len());
        Ok((SessionBeginning { account, history, named }, plan))
    }

    /// Chooses the composition of several assets before the first period, and the state of their fund.
    async fn composed(
        &self,
        tenant: &Tenant,
        advisor: &Arc<Advisor>,
        beginning: Beginning,
    ) -> Result<Beginning, ServiceError> {
        let Beginning { state, assets: Some(mut assets), history } = beginning else { return Ok(beginning) };
        let advisor = advisor.clone();
        let compose = move || Beginning { state: assets.compose(&advisor, 0, &state), assets: Some(assets), history };
        self.resolving.run(tenant, compose).await
    }
}
