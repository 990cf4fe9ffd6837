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

pub mod account_state;
pub mod advised;
pub mod asset_change;
pub mod assets;
pub(super) mod content;
pub mod current_advice;
pub mod fund_advice;
pub mod initial_history;
pub mod live;
pub mod opening;
pub(super) mod peers;
pub mod plan;
pub mod problem_state;
pub(super) mod rows;
pub mod session_state;
pub(super) mod slots;
pub(super) mod sync;
pub(super) mod transition;

use std::sync::Arc;

use tokio::sync::mpsc::Sender;
use tracing::Instrument;

use super::error::ServiceError;
use crate::control::policy::advisor::Advisor;
use crate::control::policy_document::PreparedPolicy;
use crate::service::callers::allowance::HeavyPermit;
use crate::service::callers::fair_queue::{FairQueue, QueueSize};
use crate::service::callers::identity;
use crate::service::callers::keys::Caller;
use crate::service::callers::turns::CallTurns;
use crate::service::catalogue::policies::Policies;
use crate::service::process::clock::Clock;
use crate::service::process::config::Config;
use crate::service::process::memory::Memory;
use crate::service::process::spans;
use crate::service::sessions::current_advice::AdviceContext;
use crate::service::sessions::live::{LiveSession, SESSION_BYTES};
use crate::service::sessions::opening::SessionStart;
use crate::service::sessions::slots::{Generation, SlotGuard, Slots};
use crate::service::subscriptions::outbox::Outbox;
use crate::store::{CreateSession, SessionFacts, SessionRow, Store, Tenant};

/// Lists of sessions read concurrently. These are fewer than the store's connections for lists, so that the lists of
/// jobs, policies and labels always find one.
const LISTS: usize = 2;

/// The tenant of a session, and its name.
pub(super) type Name = (Tenant, String);

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
    pub(super) outbox: Outbox,
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
        (memory, outbox): (&Memory, &Outbox),
        due: Sender<Name>,
    ) -> Self {
        let size = |first| QueueSize { first, long: config.long_limit };
        let advising = FairQueue::new("advise", size(config.advice_limit), config.turn_wait);
        let resolving = FairQueue::new("solve", size(config.resolve_limit), config.turn_wait);
        let listing = CallTurns::new(LISTS, config.turn_wait);
        // There are two generations.
        let weight = memory.for_sessions() / 2;
        let slots = Arc::new(Slots::new(Generation { slots: weight / SESSION_BYTES, weight }));
        let (memory, outbox) = (memory.clone(), outbox.clone());
        Sessions { store, clock, policies, memory, slots, due, outbox, advising, resolving, listing }
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
        let (policy, labels) = (start.policy.clone(), start.labels.clone());
        let (beginning, plan) = self.begins((tenant, turn), start).await?;
        let row = SessionRow {
            session: identity::new_id("session")?,
            tenant: tenant.clone(),
            policy,
            account: beginning.account,
            initial_history: beginning.history,
            horizon: plan.terms.horizon,
            plan_json: plan.json()?,
            due: plan.renew.map(|renew| renew.every),
            assets: beginning.named,
            created_ms: self.clock.now_milliseconds(),
        };
        let new = self.store.about_to_open(&row);
        let opening = self.store.by(caller.actor());
        let opening = opening.create_session(row.clone(), labels, key.clone());
        let (row, seen, is_new) = match opening.instrument(spans::of_write("open a session")).await? {
            CreateSession::Created => (row, new, true),
            // A repeated request has the same start, so its state is the same.
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
        let live = LiveSession::replayed(SessionFacts { row, entries: Vec::new(), seen })?;
        if is_new {
            self.hold(tenant, &live.row.session).await.put(live.clone());
            self.weigh(&live);
        }
        Ok(live)
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

    /// Returns the prepared policy of an investor's session.
    pub(super) async fn advisor(&self, tenant: &Tenant, live: &LiveSession) -> Result<Arc<Advisor>, ServiceError> {
        live.standing.account()?;
        self.policies.advisor(tenant, &live.current.policy).await
    }

    pub(super) async fn means<'a>(
        &'a self,
        tenant: &Tenant,
        live: &LiveSession,
        turn: &'a HeavyPermit,
    ) -> Result<AdviceContext<'a>, ServiceError> {
        Ok(self.means_of(self.policies.policy(tenant, &live.current.policy).await?, Some(turn)))
    }

    pub(super) fn means_of<'a>(&'a self, policy: PreparedPolicy, turn: Option<&'a HeavyPermit>) -> AdviceContext<'a> {
        AdviceContext { policy, advising: &self.advising, resolving: &self.resolving, turn }
    }

    /// Updates the memory counted for a session.
    pub(super) fn weigh(&self, live: &LiveSession) {
        self.slots.weigh(&(live.row.tenant.clone(), live.row.session.clone()), live.bytes());
    }

    pub(super) async fn hold(&self, tenant: &Tenant, session: &str) -> SlotGuard<Name, LiveSession> {
        self.slots.hold((tenant.clone(), session.to_owned())).await
    }
}
