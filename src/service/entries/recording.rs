//! Records the entries of a session: observations of periods, and corrections of them.
//!
//! An entry is computed from all entries before it, and appended after them. If another process wrote meanwhile, the
//! append fails and the entry is computed again. So observations and corrections of all processes have one order.

use jiff::Timestamp;
use serde::Serialize;
use tracing::Instrument;

use crate::control::error::FieldError;
use crate::control::policy::advice::Uncertainty;
use crate::service::callers::allowance::HeavyPermit;
use crate::service::callers::keys::Caller;
use crate::service::entries::advice_events::{BeforeReport, alarm, by_name};
use crate::service::entries::answer::{Corrected, CorrectionAnswer, Observed};
use crate::service::entries::corrections::AppliedCorrection;
use crate::service::entries::doubts::{self, Doubts};
use crate::service::entries::drift::{self, DriftLevel};
use crate::service::entries::periods::{Periods, ReplayedPeriod};
use crate::service::entries::report::{Correct, Observe, Report};
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::process::spans;
use crate::service::sessions::asset_change::AssetNames;
use crate::service::sessions::content::{self, Packed, json};
use crate::service::sessions::current_advice::with_uncertainty;
use crate::service::sessions::live::LiveSession;
use crate::service::sessions::plan::{Renewed, SessionPlan};
use crate::service::sessions::session_state::SessionState;
use crate::service::sessions::slots::SlotGuard;
use crate::service::sessions::{Name, Sessions};
use crate::store::{Append, EntryKind, EntryRow, NewEvent, Store, Tenant};

impl Sessions {
    /// Records the return of a period exactly once, durably before the answer. Returns an [`Observed`] in JSON as it
    /// was recorded. If the caller disconnects, the write may or may not commit; either way nothing of it stays in
    /// memory.
    ///
    /// # Errors
    /// A field breaks a rule, or the period was observed with other content, is not the next, or lies past the horizon.
    pub async fn observe(
        &self,
        tenant: &Tenant,
        observe: &Observe,
        turn: &HeavyPermit,
    ) -> Result<String, ServiceError> {
        let (session, period) = (&observe.session, numbered("period", observe.period)?);
        let report = observe.report();
        let mut held = self.hold(tenant, session).await;
        loop {
            let live = held.current(&self.rows(tenant, session)).await?;
            if period <= live.observed {
                let names = live.names.clone();
                return self.repeat(session, (EntryKind::Observation, period), &report, &names).await;
            }
            live.check_next_period(period)?;
            if live.corrections > 0 && !observe.confirm {
                self.check_new(tenant, (session, period), &report, &live.names).await?;
            }
            let means = self.means(tenant, live, turn).await?;
            let (standing, answer) = live.after(observe, &report, (&means, self.clock.today())).await?;
            let Packed { content_json, answer_json, numbers, sent } =
                Packed::of(&report, &answer, live.standing.names())?;
            let (radius, drift) = answer.radius_and_drift();
            let advised = if self.outbox.is_followed(tenant) { by_name(live) } else { None };
            let new = EntryRow {
                session: session.clone(),
                entry: live.seen.entries() + 1,
                kind: EntryKind::Observation,
                number: period,
                content_json,
                answer_json,
                numbers,
                created_ms: self.clock.now_milliseconds(),
                key: observe.reported_by.to_string(),
            };
            let levels = (live.standing.bet().level(), drift);
            let mut next = LiveSession {
                row: live.row.clone(),
                names: live.names.clone(),
                standing,
                observed: period,
                corrections: live.corrections,
                renewals: live.renewals,
                current: live.current.clone(),
                renew: live.renew,
                seen: live.seen.followed_by(&new),
                radius: Some(radius),
                advice: None,
            };
            let events = self.events(&means, BeforeReport { advised, levels }, &mut next).await?;
            if self.append(&self.store, &mut held, (new, events), next, levels).await? {
                return Ok(sent);
            }
        }
    }

    /// Checks that a report is not one that was recorded under this number before a correction removed a period, and
    /// that still counts under another number.
    ///
    /// # Errors
    /// It is such a report, which may be sent again because its answer was lost.
    async fn check_new(
        &self,
        tenant: &Tenant,
        (session, period): (&str, usize),
        report: &Report,
        names: &AssetNames,
    ) -> Result<(), ServiceError> {
        let row = self.store.entry(session, EntryKind::Observation, period).await?;
        let Some(row) = row else { return Ok(()) };
        if !content::records(&row, report, names.at(row.entry))? {
            return Ok(());
        }
        let Large { value: facts, room: _room } = self.facts(tenant, session).await?;
        let periods = Periods::of(&facts)?;
        match periods.all.iter().position(|counted| counted.entry + 1 == row.entry) {
            Some(index) => Err(ServiceError::Unconfirmed(Doubts(vec![doubts::of_repeat(period, index + 1)]))),
            None => Ok(()),
        }
    }

    /// Records another report of an observed period, with the guarantees of [`Self::observe`]. Returns a [`Corrected`]
    /// in JSON. Every later advice uses the corrected returns.
    ///
    /// # Errors
    /// A field breaks a rule or makes a later period break one, or the correction was made with other content or is not
    /// the next.
    pub async fn correct(
        &self,
        caller: &Caller,
        session: &str,
        correct: &Correct,
        turn: &HeavyPermit,
    ) -> Result<String, ServiceError> {
        let (number, tenant) = (numbered("correction", correct.correction)?, &caller.tenant);
        correct.check()?;
        let mut held = self.hold(tenant, session).await;
        loop {
            let Large { value: facts, room: _room } = self.facts(tenant, session).await?;
            let mut periods = Periods::of(&facts)?;
            if is_repeat(EntryKind::Correction, number, periods.corrections)? {
                return self.repeat(session, (EntryKind::Correction, number), correct, &periods.names).await;
            }
            let (renewals, current, names) = (periods.renewals(), periods.current().clone(), periods.names.clone());
            let policy = self.policies.policy(tenant, &current.policy).await?;
            current.follows(correct.period, &policy)?;
            current.check_change(correct, periods.all.len())?;
            let (putting, entry, today) = (correct.clone(), facts.entries.len(), self.clock.today());
            let renew = SessionPlan::of(&facts.row)?.renew;
            let AppliedCorrection { before, standing, observed, now, before_last } =
                self.advising.run(tenant, move || periods.apply_correction(&putting, entry, today)).await??;
            let step = current.step_from(observed, renew, renewals);
            let (standing, uncertainty) =
                with_uncertainty(&self.means_of(policy, Some(turn)), tenant, step, standing).await?;
            let radius = uncertainty.radius;
            let answer = corrected((session, correct), observed, (now, &before_last), &standing, uncertainty)?;
            let levels = (before.bet().level(), standing.bet().level());
            let Packed { content_json, answer_json, numbers, sent } = Packed::of(correct, &answer, standing.names())?;
            let new = EntryRow {
                session: session.to_owned(),
                entry: facts.seen.entries() + 1,
                kind: EntryKind::Correction,
                number,
                content_json,
                answer_json,
                numbers,
                created_ms: self.clock.now_milliseconds(),
                key: caller.key().to_string(),
            };
            let next = LiveSession {
                renew,
                row: facts.row.into(),
                names,
                standing,
                observed,
                corrections: number,
                renewals,
                current: current.into(),
                seen: facts.seen.followed_by(&new),
                radius: Some(radius),
                advice: None,
            };
            let events = alarm(&next, levels, self.clock.now_milliseconds()).into_iter().collect();
            if self.append(&self.store.by(caller.actor()), &mut held, (new, events), next, levels).await? {
                return Ok(sent);
            }
        }
    }

    /// Returns the first answer to an entry that is already recorded, for a session with these names of assets.
    pub(in crate::service) async fn repeat(
        &self,
        session: &str,
        (kind, number): (EntryKind, usize),
        content: &(impl Serialize + Sync),
        names: &AssetNames,
    ) -> Result<String, ServiceError> {
        match self.store.entry(session, kind, number).await? {
            Some(row) if content::records(&row, content, names.at(row.entry))? => {
                let entry = row.entry;
                sent(row, names.at(entry))
            }
            Some(row) if kind == EntryKind::Renewal => Err(ServiceError::RenewedAlready {
                number,
                by: if row.key.is_empty() { "the service".to_owned() } else { format!("the key {}", row.key) },
                at: Timestamp::from_millisecond(row.created_ms)
                    .map_or_else(|_| "?".to_owned(), |at| format!("{at:.0}")),
            }),
            _ => Err(ServiceError::Conflict { what: kind.counted(), number }),
        }
    }

    /// Appends the entry that leads to `next`, with its events; returns false if another process wrote meanwhile. Counts
    /// a rise of the drift level between the two `levels`. The slot is empty during the write, so that memory never runs
    /// ahead of the disk.
    async fn append(
        &self,
        store: &Store,
        held: &mut SlotGuard<Name, LiveSession>,
        (new, events): (EntryRow, Vec<NewEvent>),
        next: LiveSession,
        levels: (DriftLevel, DriftLevel),
    ) -> Result<bool, ServiceError> {
        held.clear();
        let due = next.is_due().then(|| (next.row.tenant.clone(), next.row.session.clone()));
        let is_told = !events.is_empty();
        let appended = store.append_with(new, events).instrument(spans::of_write("append an entry")).await?;
        let is_appended = self.after_append(held, appended, next)?;
        if is_appended {
            drift::count(levels.0, levels.1);
            if is_told {
                self.outbox.ring();
            }
            // If the renewer's queue is full, its next round finds the session.
            due.map(|name| self.due.try_send(name));
        }
        Ok(is_appended)
    }

    /// Handles the store's answer to an append as [`Self::append`] does.
    pub(super) fn after_append(
        &self,
        held: &mut SlotGuard<Name, LiveSession>,
        appended: Append,
        next: LiveSession,
    ) -> Result<bool, ServiceError> {
        match appended {
            Append::Appended => {
                self.weigh(&next);
                held.put(next);
                Ok(true)
            }
            Append::NotNext => Ok(false),
            Append::NoSession => Err(ServiceError::unknown("session", &next.row.session)),
            Append::NoPolicy => Err(ServiceError::unknown("policy", &next.current.policy)),
        }
    }
}

/// Returns the answer to a correction: the periods observed after it, its period as it is now, and the state before the
/// last one.
fn corrected(
    of: (&str, &Correct),
    observed: usize,
    (now, before_last): (Option<ReplayedPeriod>, &SessionState),
    standing: &SessionState,
    uncertainty: Uncertainty,
) -> Result<CorrectionAnswer, ServiceError> {
    Ok(match standing {
        SessionState::Account(after) => {
            let now = now.as_ref().map(|now| now.moved.account()).transpose()?;
            let answer = after.corrected(of, observed, (now, before_last.account()?), uncertainty);
            CorrectionAnswer::Account(answer.into())
        }
        SessionState::Declared(after) => {
            let noise = now.and_then(|now| now.moved.noise());
            let answer = after.corrected(of, observed, noise, uncertainty);
            CorrectionAnswer::Declared(answer.into())
        }
    })
}

/// Returns the answer of an entry as it was sent.
fn sent(row: EntryRow, names: &[String]) -> Result<String, ServiceError> {
    match row.kind {
        _ if names.is_empty() => Ok(row.answer_json),
        EntryKind::Observation => json(&content::answer::<Observed>(&row, names)?),
        EntryKind::Correction => json(&content::answer::<Corrected>(&row, names)?),
        EntryKind::Renewal => json(&content::answer::<Renewed>(&row, names)?),
    }
}

/// Returns whether the entry with this number is among those `made`.
///
/// # Errors
/// It is neither among them nor the next.
pub(super) fn is_repeat(kind: EntryKind, number: usize, made: usize) -> Result<bool, ServiceError> {
    let expected = made + 1;
    if number > expected {
        return Err(ServiceError::Gap { what: kind.counted(), given: number, expected });
    }
    Ok(number < expected)
}

pub(in crate::service) fn numbered(field: &str, number: usize) -> Result<usize, FieldError> {
    if number == 0 { Err(FieldError::new(field, 0, "must be at least 1")) } else { Ok(number) }
}
