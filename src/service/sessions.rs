//! Live sessions: wealth and the law learned so far.
//!
//! A session is its rows. The state in memory is a replay of them, or the start of one, and the slot is empty during a
//! write. So memory never runs ahead of the disk. Before every use the state is compared with the store, and a state of
//! other rows is dropped. So no process advises from an outdated law, or from one that a restored database never had.
//! One lock per session orders its observations in this process (see `crate::service::sessions::slots`).
//!
//! A session belongs to its tenant and does not exist for others. Slots are named by tenant and session, so no call
//! waits for, fills or empties the slot of another tenant.
//!
//! Its modules hold the state of one session in memory, its rows, its slots and its sequence of policies. What is
//! recorded of a session is decided in [`crate::service::entries`].

pub(super) mod asset_change;
pub mod assets;
pub(super) mod content;
pub mod fund_advice;
pub mod initial_history;
pub mod live;
pub(super) mod peers;
pub mod plan;
pub(super) mod rows;
pub(super) mod session_state;
pub(super) mod slots;
pub(super) mod sync;

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Serialize;
use tokio::sync::mpsc::Sender;
use tracing::Instrument;

use super::error::ServiceError;
use crate::control::error::FieldError;
use crate::control::policy::advisor::Advisor;
use crate::control::policy::content_hash;
use crate::control::problem::state::State;
use crate::control::request::assets::check_rows;
use crate::control::request::specification::Specification;
use crate::service::callers::allowance::HeavyPermit;
use crate::service::callers::fair_queue::{FairQueue, QueueSize};
use crate::service::callers::identity;
use crate::service::callers::keys::Caller;
use crate::service::callers::turns::CallTurns;
use crate::service::catalogue::policies::Policies;
use crate::service::jobs::idempotency;
use crate::service::process::clock::Clock;
use crate::service::process::config::Config;
use crate::service::process::memory::Memory;
use crate::service::process::spans;
use crate::service::sessions::asset_change::AssetNames;
use crate::service::sessions::assets::Assets;
use crate::service::sessions::initial_history::InitialHistory;
use crate::service::sessions::live::{AdviceContext, LiveSession, SESSION_BYTES};
use crate::service::sessions::plan::{Renewing, SessionPlan};
use crate::service::sessions::session_state::SessionState;
use crate::service::sessions::slots::{Generation, SlotGuard, Slots};
use crate::store::{CreateSession, Relabel, RequestKey, SessionRow, Store, Tenant};

/// Lists of sessions read concurrently. These are fewer than the store's connections for lists, so that the lists of
/// jobs, policies and labels always find one.
const LISTS: usize = 2;

/// The tenant of a session, and its name.
pub(super) type Name = (Tenant, String);

/// The start of a session. History and wealth default to the policy's, and holdings default to 0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SessionStart {
    pub policy: String,
    pub history: Option<InitialHistory>,
    pub wealth: Option<f64>,
    pub holding: Option<f64>,
    pub holdings: Option<BTreeMap<String, f64>>,
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

impl SessionStart {
    /// Returns the request for this start under a key. Its hash differs from that of any job's request, which has other
    /// fields.
    fn under(&self, key: String) -> Result<RequestKey, ServiceError> {
        idempotency::check(&key)?;
        let sent = serde_json::to_vec(self).map_err(ServiceError::internal)?;
        Ok(RequestKey { key, request_hash: content_hash(&sent) })
    }

    /// Returns the initial state for the policy of `advisor`.
    fn begins(self, advisor: &Advisor) -> Result<Beginning, FieldError> {
        let SessionStart { history, wealth, holding, holdings, .. } = self;
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
        let assets = Assets::at(&fund.assets, rows, holdings.as_ref())?;
        let state = assets.fund.begin(advisor, wealth)?;
        Ok(Beginning { state, assets: Some(assets.into()), history })
    }
}

/// The sessions of the store.
#[derive(Clone)]
pub struct Sessions {
    pub(super) store: Store,
    pub(super) clock: Clock,
    pub(super) policies: Arc<Policies>,
    pub(super) memory: Memory,
    slots: Arc<Slots<Name, LiveSession>>,
    /// Receives sessions that became due for renewal.
    pub(super) due: Sender<Name>,
    pub(super) advising: FairQueue,
    pub(super) resolving: FairQueue,
    pub(super) listing: CallTurns,
}

impl Sessions {
    pub(super) fn new(
        config: &Config,
        store: Store,
        clock: Clock,
        policies: Arc<Policies>,
        memory: &Memory,
        due: Sender<Name>,
    ) -> Self {
        let size = |first| QueueSize { first, long: config.long_limit };
        let advising = FairQueue::new("advise", size(config.advice_limit), config.turn_wait);
        let resolving = FairQueue::new("solve", size(config.resolve_limit), config.turn_wait);
        let listing = CallTurns::new(LISTS, config.turn_wait);
        // There are two generations.
        let weight = memory.for_sessions() / 2;
        let slots = Arc::new(Slots::new(Generation { slots: weight / SESSION_BYTES, weight }));
        Sessions { store, clock, policies, memory: memory.clone(), slots, due, advising, resolving, listing }
    }

    /// Opens a session. The same key and start again return the same session as it was opened.
    ///
    /// # Errors
    /// There is no such policy, history, wealth or holding breaks a rule, or the key was used with another request.
    pub async fn open(
        &self,
        caller: &Caller,
        start: SessionStart,
        key: Option<String>,
        turn: &HeavyPermit,
    ) -> Result<LiveSession, ServiceError> {
        let tenant = &caller.tenant;
        let key = key.map(|key| start.under(key)).transpose()?;
        start.labels.check()?;
        let SessionStart { policy, renew, rolling, labels, .. } = start.clone();
        let advisor = self.policies.advisor(tenant, &policy).await?;
        let beginning = start.begins(&advisor)?;
        // Withdrawals are checked against wealth, whatever is held.
        advisor.check_withdrawals(&beginning.state)?;
        let plan = SessionPlan::new(&advisor, beginning.state.law.sample_size(), renew, rolling)?;
        if beginning.assets.is_some() && Assets::must_solve(&advisor, 0) {
            turn.begin().await?;
        }
        let Beginning { state, assets, history } = self.composed(tenant, &advisor, beginning).await?;
        let plan = SessionPlan { assets: assets.as_ref().map(|assets| assets.planned()), ..plan };
        self.policies.starts_from(&advisor, state.law.sample_size(), plan.terms.horizon)?;
        let row = SessionRow {
            session: identity::new_id("session")?,
            tenant: tenant.clone(),
            policy,
            initial_wealth: state.wealth,
            initial_holding: state.holding,
            initial_history: history,
            horizon: plan.terms.horizon,
            plan_json: plan.json()?,
            due: renew.map(|renew| renew.every),
            assets: assets.as_ref().map_or(0, |assets| assets.names.len()),
            created_ms: self.clock.now_milliseconds(),
        };
        let new = self.store.about_to_open(&row);
        let opening = self.store.by(caller.actor());
        let opening = opening.create_session(row.clone(), labels, key.clone());
        let (row, seen, is_new) = match opening.instrument(spans::of_write("open a session")).await? {
            CreateSession::Created => (row, new, true),
            // A repeated request has the same start, so its state is the one above.
            CreateSession::Repeated(earlier) => {
                let seen = earlier.as_opened();
                (earlier, seen, false)
            }
            CreateSession::KeyConflict => {
                return Err(ServiceError::KeyConflict { key: key.map_or_else(String::new, |key| key.key) });
            }
            CreateSession::NoPolicy => return Err(ServiceError::unknown("policy", &row.policy)),
            CreateSession::Exists => return Err(ServiceError::internal("a session of this random name exists")),
        };
        let live = LiveSession {
            current: Arc::new(plan.stretch(row.policy.clone(), 0, plan.terms.clone(), None)),
            standing: SessionState::at(&row.session, state, assets),
            row: Arc::new(row),
            names: AssetNames::from(plan.names()),
            observed: 0,
            corrections: 0,
            renewals: 0,
            renew,
            seen,
            radius: None,
            advice: None,
        };
        if is_new {
            self.hold(tenant, &live.row.session).await.put(live.clone());
            self.weigh(&live);
        }
        Ok(live)
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

    /// Returns the bytes of the sessions in memory.
    pub(super) fn bytes(&self) -> usize {
        self.slots.bytes()
    }

    /// Returns the number of sessions in memory.
    pub fn in_memory(&self) -> usize {
        self.slots.count()
    }

    /// Returns a session.
    ///
    /// # Errors
    /// There is no such session.
    pub async fn get(&self, tenant: &Tenant, session: &str) -> Result<LiveSession, ServiceError> {
        let mut held = self.hold(tenant, session).await;
        held.current(&self.rows(tenant, session)).await.cloned()
    }

    /// Deletes a session.
    ///
    /// # Errors
    /// There is no such session.
    pub async fn delete(&self, caller: &Caller, session: &str) -> Result<(), ServiceError> {
        // Waits until nobody uses it any more.
        let mut held = self.hold(&caller.tenant, session).await;
        held.clear();
        let deleting = self.store.by(caller.actor());
        let deleting = deleting.delete_session(&caller.tenant, session);
        let deleted = deleting.instrument(spans::of_write("delete a session")).await?;
        if !deleted {
            return Err(ServiceError::unknown("session", session));
        }
        // The training that it requested is no longer needed.
        let _ = self.due.try_send((caller.tenant.clone(), session.to_owned()));
        Ok(())
    }

    /// Returns the prepared policy of a session.
    pub(super) async fn advisor(&self, tenant: &Tenant, live: &LiveSession) -> Result<Arc<Advisor>, ServiceError> {
        self.policies.advisor(tenant, &live.current.policy).await
    }

    pub(super) async fn means<'a>(
        &'a self,
        tenant: &Tenant,
        live: &LiveSession,
        turn: &'a HeavyPermit,
    ) -> Result<AdviceContext<'a>, ServiceError> {
        Ok(self.means_of(self.advisor(tenant, live).await?, Some(turn)))
    }

    pub(super) fn means_of<'a>(&'a self, advisor: Arc<Advisor>, turn: Option<&'a HeavyPermit>) -> AdviceContext<'a> {
        AdviceContext { advisor, advising: &self.advising, resolving: &self.resolving, turn }
    }

    /// Updates the memory counted for a session.
    pub(super) fn weigh(&self, live: &LiveSession) {
        self.slots.weigh(&(live.row.tenant.clone(), live.row.session.clone()), live.bytes());
    }

    pub(super) async fn hold(&self, tenant: &Tenant, session: &str) -> SlotGuard<Name, LiveSession> {
        self.slots.hold((tenant.clone(), session.to_owned())).await
    }
}
