//! What is recorded of a session: periods as they pass, and corrections of those that passed.
//!
//! An entry is decided on all entries before it, and appended as the one after them. Where another process wrote meanwhile it
//! is not, and is decided anew on what is there now: observations and corrections of all processes have one order.

use jiff::Timestamp;
use tracing::Instrument;

use super::allowance::HeavyTurn;
use super::answer::Corrected;
use super::content::json;
use super::corrections::PutRight;
use super::drift::{self, DriftLevel};
use super::error::ServiceError;
use super::keys::Caller;
use super::live::{Live, measured};
use super::memory::Large;
use super::periods::Periods;
use super::plan::Plan;
use super::report::{Correct, Observe};
use super::sessions::{Name, Sessions};
use super::slots::Held;
use super::spans;
use crate::control::error::FieldError;
use crate::store::{Append, EntryKind, EntryRow, Store, Tenant};

impl Sessions {
    /// Records the return of a period, durably before it is answered, exactly once, and answers with an
    /// [`Observed`](super::answer::Observed) in JSON as it was recorded. Where the caller goes away meanwhile
    /// the store may or may not record it, and nothing of it stays in memory.
    ///
    /// # Errors
    /// A field breaks a rule; the period was observed with other content, is not the next, or lies past the horizon.
    pub async fn observe(&self, tenant: &Tenant, observe: &Observe, turn: &HeavyTurn) -> Result<String, ServiceError> {
        let (session, period) = (&observe.session, numbered("period", observe.period)?);
        let report = observe.report();
        let content = json(&report)?;
        let mut held = self.hold(tenant, session).await;
        loop {
            let live = held.current(&self.rows(tenant, session)).await?;
            if period <= live.observed {
                return self.repeat(session, EntryKind::Observation, period, &content).await;
            }
            live.expects(period)?;
            let means = self.means(tenant, live, turn).await?;
            let (standing, answer) = live.after(observe, &report, (&means, self.clock.today())).await?;
            let new = EntryRow {
                session: session.clone(),
                entry: live.seen.entries() + 1,
                kind: EntryKind::Observation,
                number: period,
                content_json: content.clone(),
                answer_json: json(&answer)?,
                created_ms: self.clock.now_milliseconds(),
                key: observe.reported_by.to_string(),
            };
            let levels = (live.standing.bet.level(), answer.drift.level);
            let next = Live {
                row: live.row.clone(),
                standing,
                observed: period,
                corrections: live.corrections,
                renewals: live.renewals,
                current: live.current.clone(),
                renew: live.renew,
                seen: live.seen.followed_by(&new),
                radius: Some(answer.uncertainty.radius),
                advice: None,
            };
            if let Some(answer_json) = self.append(&self.store, &mut held, new, next, levels).await? {
                return Ok(answer_json);
            }
        }
    }

    /// Records another report of a period that passed, as durably and as often as [`Self::observe`] does, and answers with
    /// a [`Corrected`] in JSON. Every advice from then on rests on the corrected returns.
    ///
    /// # Errors
    /// A field breaks a rule, or makes a later period break one; the correction was made with other content, or is not the
    /// next.
    pub async fn correct(
        &self,
        caller: &Caller,
        session: &str,
        correct: &Correct,
        turn: &HeavyTurn,
    ) -> Result<String, ServiceError> {
        let number = numbered("correction", correct.correction)?;
        correct.check()?;
        let (tenant, content) = (&caller.tenant, json(correct)?);
        let mut held = self.hold(tenant, session).await;
        loop {
            let Large { value: facts, room: _room } = self.facts(tenant, session).await?;
            let mut periods = Periods::of(&facts)?;
            if is_repeat(EntryKind::Correction, number, periods.corrections)? {
                return self.repeat(session, EntryKind::Correction, number, &content).await;
            }
            let (renewals, current) = (periods.renewals(), periods.current().clone());
            let advisor = self.policies.advisor(tenant, &current.policy).await?;
            current.follows(correct.period, advisor.specification().problem.framework)?;
            current.check_change(correct, periods.all.len())?;
            let (putting, entry, today) = (correct.clone(), facts.entries.len(), self.clock.today());
            let put_right = move || periods.put_right(&putting, entry, today);
            let PutRight { before, standing, observed, log_return, wealth_change } =
                self.advising.run(tenant, put_right).await??;
            let step = current.step_from(observed, Plan::of(&facts.row)?.renew, renewals);
            let (standing, uncertainty) = measured(&self.means_of(advisor, Some(turn)), tenant, step, standing).await?;
            let answer = Corrected {
                session: session.to_owned(),
                correction: number,
                period: correct.period,
                log_return,
                observed,
                wealth: standing.state.wealth,
                holding: standing.state.holding,
                assets: standing.assets.as_ref().map(|assets| assets.composed()),
                wealth_change,
                date: standing.days.last,
                drift: standing.bet.told(),
                uncertainty,
            };
            let levels = (before.bet.level(), answer.drift.level);
            let new = EntryRow {
                session: session.to_owned(),
                entry: facts.seen.entries() + 1,
                kind: EntryKind::Correction,
                number,
                content_json: content.clone(),
                answer_json: json(&answer)?,
                created_ms: self.clock.now_milliseconds(),
                key: caller.key().to_string(),
            };
            let next = Live {
                renew: Plan::of(&facts.row)?.renew,
                row: facts.row.into(),
                standing,
                observed,
                corrections: number,
                renewals,
                current: current.into(),
                seen: facts.seen.followed_by(&new),
                radius: Some(answer.uncertainty.radius),
                advice: None,
            };
            let store = self.store.by(caller.actor());
            if let Some(answer_json) = self.append(&store, &mut held, new, next, levels).await? {
                return Ok(answer_json);
            }
        }
    }

    /// The first answer to what was recorded already.
    pub(super) async fn repeat(
        &self,
        session: &str,
        kind: EntryKind,
        number: usize,
        content: &str,
    ) -> Result<String, ServiceError> {
        match self.store.entry(session, kind, number).await? {
            Some(row) if row.content_json == content => Ok(row.answer_json),
            Some(row) if kind == EntryKind::Renewal => Err(ServiceError::RenewedAlready {
                number,
                by: if row.key.is_empty() { "the service".to_owned() } else { format!("the key {}", row.key) },
                at: Timestamp::from_millisecond(row.created_ms)
                    .map_or_else(|_| "?".to_owned(), |at| format!("{at:.0}")),
            }),
            _ => Err(ServiceError::Conflict { what: kind.counted(), number }),
        }
    }

    /// Appends the entry that leads to `next` from one level of drift to another, and gives its answer; `None` where another process wrote meanwhile. Memory is
    /// empty while it is under way, so that it never runs ahead of the disk.
    async fn append(
        &self,
        store: &Store,
        held: &mut Held<Name, Live>,
        new: EntryRow,
        next: Live,
        levels: (DriftLevel, DriftLevel),
    ) -> Result<Option<String>, ServiceError> {
        held.clear();
        let answer_json = new.answer_json.clone();
        let due = next.is_due().then(|| (next.row.tenant.clone(), next.row.session.clone()));
        let appended = store.append(new).instrument(spans::of_write("append an entry")).await?;
        let answer = self.settled(held, appended, answer_json, next)?;
        if answer.is_some() {
            drift::count(levels.0, levels.1);
            // Where too many are to be renewed already, a round finds it.
            due.map(|name| self.due.try_send(name));
        }
        Ok(answer)
    }

    /// As [`Self::append`], of an entry that the store has decided on.
    pub(super) fn settled(
        &self,
        held: &mut Held<Name, Live>,
        appended: Append,
        answer_json: String,
        next: Live,
    ) -> Result<Option<String>, ServiceError> {
        match appended {
            Append::Appended => {
                self.weigh(&next);
                held.put(next);
                Ok(Some(answer_json))
            }
            Append::NotNext => Ok(None),
            Append::NoSession => Err(ServiceError::unknown("session", &next.row.session)),
            Append::NoPolicy => Err(ServiceError::unknown("policy", &next.current.policy)),
        }
    }
}

/// Whether the entry of a kind that is numbered so is among the `made`.
///
/// # Errors
/// It is neither that nor the next.
pub(super) fn is_repeat(kind: EntryKind, number: usize, made: usize) -> Result<bool, ServiceError> {
    let expected = made + 1;
    if number > expected {
        return Err(ServiceError::Gap { what: kind.counted(), given: number, expected });
    }
    Ok(number < expected)
}

pub(super) fn numbered(field: &str, number: usize) -> Result<usize, FieldError> {
    if number == 0 { Err(FieldError::new(field, 0, "must be at least 1")) } else { Ok(number) }
}
