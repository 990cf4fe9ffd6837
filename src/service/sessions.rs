//! Live sessions: an investor's wealth and the law learned so far.
//!
//! A session is its rows: the state in memory is a replay of them and is dropped whenever a write fails, so memory
//! never runs ahead of the disk. One lock per session orders its observations in this process. Where other processes
//! write to the same store, the rows' head is read before every use, and a state replayed from other rows is dropped:
//! no replica advises from a law that another has taken further, or that a restored database never had. A session is its
//! tenant's: to everybody else it does not exist.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::OwnedMutexGuard;
use tracing::Instrument;

use super::bounded::{Bounded, Size};
use super::clock::Clock;
use super::config::Config;
use super::error::ServiceError;
use super::identity;
use super::keys::Caller;
use super::live::Live;
use super::observation::{Observe, Observed};
use super::policies::Policies;
use super::slots::{Slot, Slots};
use super::spans;
use crate::control::advisor::{Advice, AdviceMode, Advisor};
use crate::control::error::FieldError;
use crate::control::worst_case::WorstCase;
use crate::store::{
    Append, CreateSession, NewObservation, NewSession, ObservationRow, SessionRow, SessionSummary, Store, Tenant,
};

/// What [`Sessions::action`] found.
pub struct Action {
    pub period: usize,
    pub advice: Advice,
    pub worst_case: Option<WorstCase>,
}

/// How an action is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    Advise(AdviceMode),
    /// Re-solve, and show the worst-case law.
    Explain,
}

/// The sessions of the store.
#[derive(Clone)]
pub struct Sessions {
    store: Store,
    clock: Clock,
    policies: Arc<Policies>,
    slots: Arc<Mutex<Slots>>,
    pub(super) advising: Bounded,
    pub(super) resolving: Bounded,
}

impl Sessions {
    pub(super) fn new(config: &Config, store: Store, clock: Clock, policies: Arc<Policies>) -> Self {
        let size = |common| Size { common, guests: config.guest_limit };
        let advising = Bounded::new("advise", size(config.advice_limit), config.turn_wait);
        let resolving = Bounded::new("solve", size(config.resolve_limit), config.turn_wait);
        Sessions { store, clock, policies, slots: Arc::default(), advising, resolving }
    }

    /// Opens a session; history and wealth default to the policy's.
    ///
    /// # Errors
    /// There is no such policy, or history or wealth breaks a rule.
    pub async fn open(
        &self,
        caller: &Caller,
        policy: &str,
        history: Option<Vec<f64>>,
        wealth: Option<f64>,
    ) -> Result<Live, ServiceError> {
        let tenant = &caller.tenant;
        let advisor = self.policies.advisor(tenant, policy).await?;
        let state = advisor.initial_state(history.as_deref(), wealth)?;
        self.policies.starts_from(&advisor, state.law.sample_size())?;
        let problem = &advisor.specification().problem;
        let row = SessionRow {
            session: identity::new_id("session")?,
            tenant: tenant.clone(),
            policy: policy.to_owned(),
            initial_wealth: state.wealth,
            initial_history: history.unwrap_or_else(|| problem.history.clone()),
            horizon: problem.horizon,
            created_ms: self.clock.now_milliseconds(),
        };
        let new = NewSession {
            session: row.session.clone(),
            tenant: tenant.clone(),
            policy: row.policy.clone(),
            wealth: row.initial_wealth,
            history: row.initial_history.clone(),
            horizon: row.horizon,
            created_ms: row.created_ms,
        };
        match self.store.by(caller.actor()).create_session(new).instrument(spans::of_write("open a session")).await? {
            CreateSession::Created => {
                let head = row.head();
                Ok(Live { row: Arc::new(row), state, head, price: None, radius: None, advice: None })
            }
            CreateSession::NoPolicy => Err(ServiceError::unknown("policy", policy)),
            CreateSession::Exists => Err(ServiceError::internal("a session of this random name exists")),
        }
    }

    /// # Errors
    /// There is no such session.
    pub async fn get(&self, tenant: &Tenant, session: &str) -> Result<Live, ServiceError> {
        let mut slot = self.slot(session).lock_owned().await;
        self.replayed(tenant, session, &mut slot).await.cloned()
    }

    /// Requests that wait for their turn to be advised, and to have a step solved.
    pub fn waiting(&self) -> [(&'static str, usize); 2] {
        [&self.advising, &self.resolving].map(|turns| (turns.name, turns.waiting()))
    }

    /// At most `limit` sessions, newest first, after the session with sequence `after`.
    ///
    /// # Errors
    /// The store does not answer.
    pub async fn list(
        &self,
        tenant: &Tenant,
        limit: usize,
        after: Option<i64>,
    ) -> Result<Vec<SessionSummary>, ServiceError> {
        Ok(self.store.sessions(tenant, limit, after).await?)
    }

    /// The session's start and every observation.
    ///
    /// # Errors
    /// There is no such session.
    pub async fn history(
        &self,
        tenant: &Tenant,
        session: &str,
    ) -> Result<(SessionRow, Vec<ObservationRow>), ServiceError> {
        let row = self.store.session(session).await?.filter(|row| row.tenant == *tenant);
        let row = row.ok_or_else(|| ServiceError::unknown("session", session))?;
        Ok((row, self.store.observations(session).await?))
    }

    /// # Errors
    /// There is no such session.
    pub async fn delete(&self, caller: &Caller, session: &str) -> Result<(), ServiceError> {
        let mut slot = self.slot(session).lock_owned().await;
        *slot = None;
        let deleting = self.store.by(caller.actor());
        let deleting = deleting.delete_session(&caller.tenant, session);
        let deleted = deleting.instrument(spans::of_write("delete a session")).await?;
        self.forget(session);
        if deleted { Ok(()) } else { Err(ServiceError::unknown("session", session)) }
    }

    /// Records the return of a period, durably before it is answered, exactly once.
    /// Runs to its end even where the caller goes away.
    ///
    /// # Errors
    /// A field breaks a rule; the period was observed with other content, is not the next, or lies past the horizon.
    pub async fn observe(&self, tenant: &Tenant, report: Observe) -> Result<Observed, ServiceError> {
        let (sessions, tenant) = (self.clone(), tenant.clone());
        let recording = async move {
            let mut slot = sessions.slot(&report.session).lock_owned().await;
            let outcome = sessions.record(&tenant, &report, &mut slot).await;
            if let Err(ServiceError::Store(_) | ServiceError::Internal(_)) = outcome {
                *slot = None;
            }
            outcome
        };
        let recording = tokio::spawn(recording.in_current_span());
        recording.await.map_err(ServiceError::internal)?
    }

    async fn record(
        &self,
        tenant: &Tenant,
        report: &Observe,
        slot: &mut OwnedMutexGuard<Option<Live>>,
    ) -> Result<Observed, ServiceError> {
        let live = self.replayed(tenant, &report.session, slot).await?;
        let content_hash = report.content_hash().map_err(ServiceError::internal)?;
        if report.period == 0 {
            return Err(FieldError::new("period", 0, "must be at least 1").into());
        }
        if report.period <= live.observed() {
            return self.repeat(report, &content_hash).await;
        }
        live.expects(report.period)?;
        let log_return = report.checked_log_return(live.price)?;
        let advisor = self.advisor(tenant, live).await?;
        let (state, answer) = live.after(report, log_return, &advisor, &self.advising).await?;
        let new = NewObservation {
            session: report.session.clone(),
            period: report.period,
            content_hash,
            log_return,
            executed_allocation: answer.executed_allocation,
            advised_allocation: live.advice.as_ref().map_or(answer.executed_allocation, |advice| advice.allocation),
            wealth_after: answer.wealth,
            answer_json: serde_json::to_string(&answer).map_err(ServiceError::internal)?,
            created_ms: self.clock.now_milliseconds(),
        };
        let next = live.taken_to(new.head(), state, report.price, answer.uncertainty.radius);
        match self.store.append_observation(new).instrument(spans::of_write("append an observation")).await? {
            Append::Appended => {
                **slot = Some(next);
                Ok(answer)
            }
            Append::Repeated { answer_json } => serde_json::from_str(&answer_json).map_err(ServiceError::internal),
            Append::Conflict => Err(ServiceError::PeriodConflict { period: report.period }),
            Append::OutOfOrder { expected } => Err(ServiceError::PeriodGap { given: report.period, expected }),
            Append::NoSession => Err(ServiceError::unknown("session", &report.session)),
        }
    }

    /// The first answer to a period already observed.
    async fn repeat(&self, report: &Observe, content_hash: &str) -> Result<Observed, ServiceError> {
        match self.store.observation(&report.session, report.period).await? {
            Some(row) if row.content_hash == content_hash => {
                serde_json::from_str(&row.answer_json).map_err(ServiceError::internal)
            }
            _ => Err(ServiceError::PeriodConflict { period: report.period }),
        }
    }

    /// The robust allocation for the coming period.
    ///
    /// # Errors
    /// There is no such session, or it has reached its horizon.
    pub async fn action(&self, tenant: &Tenant, session: &str, question: Question) -> Result<Action, ServiceError> {
        let mut slot = self.slot(session).lock_owned().await;
        let live = self.replayed(tenant, session, &mut slot).await?;
        if live.observed() >= live.row.horizon {
            return Err(ServiceError::Completed { session: session.to_owned(), horizon: live.row.horizon });
        }
        let period = live.observed() + 1;
        let surrogate = question == Question::Advise(AdviceMode::Surrogate);
        if let Some(advice) = live.advice.clone().filter(|_| surrogate) {
            return Ok(Action { period, advice, worst_case: None });
        }
        let advisor = self.advisor(tenant, live).await?;
        if surrogate {
            let advice = live.surrogate_advice(&advisor, &self.advising).await?.clone();
            return Ok(Action { period, advice, worst_case: None });
        }
        let (state, step) = (live.state.clone(), live.observed());
        drop(slot);
        let solving = self.resolving.run(tenant, move || match question {
            Question::Explain => {
                let (advice, worst_case) = advisor.explain(step, &state);
                (advice, Some(worst_case))
            }
            Question::Advise(mode) => (advisor.advise(step, &state, mode), None),
        });
        let (advice, worst_case) = solving.await?;
        Ok(Action { period, advice, worst_case })
    }

    /// The policy of a session, made ready.
    pub(super) async fn advisor(&self, tenant: &Tenant, live: &Live) -> Result<Arc<Advisor>, ServiceError> {
        self.policies.advisor(tenant, &live.row.policy).await
    }

    /// The session as its rows have it now, where it is the tenant's.
    async fn replayed<'a>(
        &self,
        tenant: &Tenant,
        session: &str,
        slot: &'a mut OwnedMutexGuard<Option<Live>>,
    ) -> Result<&'a mut Live, ServiceError> {
        if self.store.is_shared()
            && let Some(live) = slot.as_ref()
            && self.store.head(session).await?.as_ref() != Some(&live.head)
        {
            **slot = None;
        }
        if slot.is_none() {
            match self.replay(tenant, session).await {
                Ok(live) => **slot = Some(live),
                Err(error) => {
                    self.forget(session);
                    return Err(error);
                }
            }
        }
        let live = slot.as_mut().ok_or_else(|| ServiceError::internal("a session vanished while it was locked"))?;
        if live.row.tenant == *tenant { Ok(live) } else { Err(ServiceError::unknown("session", session)) }
    }

    async fn replay(&self, tenant: &Tenant, session: &str) -> Result<Live, ServiceError> {
        let (row, observations) = self.history(tenant, session).await?;
        let advisor = self.policies.advisor(tenant, &row.policy).await?;
        let mut state = advisor.initial_state(Some(&row.initial_history), Some(row.initial_wealth))?;
        for observation in &observations {
            state = advisor.advance(&state, observation.executed_allocation, observation.log_return);
            state.wealth = observation.wealth_after;
        }
        let last = observations.last().and_then(|row| serde_json::from_str::<Observed>(&row.answer_json).ok());
        let price = last.and_then(|answer| answer.price);
        self.lock().grow(state.law.sample_size() + row.initial_history.len());
        let head = observations.last().map_or_else(|| row.head(), |last| last.head(session));
        Ok(Live { row: Arc::new(row), state, head, price, radius: None, advice: None })
    }

    fn slot(&self, session: &str) -> Slot {
        self.lock().of(session)
    }

    fn forget(&self, session: &str) {
        self.lock().forget(session);
    }

    fn lock(&self) -> MutexGuard<'_, Slots> {
        // No code panics while holding the lock.
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
