//! Rebuilds a session from its entries: each period as last reported, in order.
//!
//! The state is a function of the entries alone. After a correction, which is an entry, the periods are replayed with
//! the corrected report. The advice given for a period does not change, so the holdings do not either unless a report
//! changes them. A renewal is an entry also: from there on the terms and the law are those of the next policy.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::control::error::FieldError;
use crate::service::entries::acknowledged::Acknowledged;
use crate::service::entries::change::Change;
use crate::service::entries::record::{PeriodNoise, SessionRecord};
use crate::service::entries::report::{Correct, Report};
use crate::service::error::ServiceError;
use crate::service::sessions::asset_change::{AssetChange, AssetNames};
use crate::service::sessions::assets::Composition;
use crate::service::sessions::content::{answer, content, names_after};
use crate::service::sessions::plan::{DeclaredRenewed, PolicyTenure, Renew, Renewed, SessionPlan, terms_of};
use crate::service::sessions::session_state::{Moved, NextPolicy, SessionState};
use crate::service::sessions::transition::Transition;
use crate::store::{EntryKind, SessionFacts};

/// A period according to its entries.
#[derive(Debug, Clone)]
pub struct SessionPeriod {
    /// The last report of it.
    pub report: Report,
    /// The first answer to it. Its advice holds whatever is corrected later. `None` if the period was inserted.
    acknowledged: Option<Acknowledged>,
    /// True if the acknowledged numbers still hold: no later correction of it or of an earlier period.
    stands: bool,
    /// Index of the entry that first reported it.
    pub entry: usize,
    /// Numbers of the corrections that inserted it or reported it again.
    pub corrections: Vec<usize>,
}

/// All periods of a session, and its policies.
#[derive(Debug, Clone)]
pub struct Periods {
    pub all: Vec<SessionPeriod>,
    /// Number of corrections.
    pub corrections: usize,
    /// The first policy and its successors.
    pub stretches: Vec<PolicyTenure>,
    start: SessionState,
    history: SessionRecord,
    /// The names of several assets, entry by entry.
    pub names: AssetNames,
    /// Renewals, and compositions of several assets that corrections and renewals reported, in order, by the number of
    /// periods before them.
    events: BTreeMap<usize, Vec<BetweenPeriods>>,
}

/// Something recorded between two periods.
#[derive(Debug, Clone)]
enum BetweenPeriods {
    /// The composition of several assets that an answer reported.
    Composed(Box<Composition>),
    /// The next policy began.
    Renewed(Box<NextPolicy>),
}

/// A replay of a session up to some period.
pub struct Replay<'a> {
    periods: &'a Periods,
    /// The state under the policy that comes next.
    pub standing: SessionState,
    /// All that the law could learn, in order.
    pub record: SessionRecord,
    /// Periods replayed.
    step: usize,
    /// Index of the policy that comes next.
    stretch: usize,
}

/// A replayed period.
pub struct ReplayedPeriod {
    /// The state before it.
    pub before: SessionState,
    pub seen: PeriodNoise,
    pub moved: Moved,
}

impl SessionPeriod {
    /// Returns whether a correction inserted it.
    pub(super) fn is_inserted(&self) -> bool {
        self.acknowledged.is_none()
    }
}

impl Periods {
    /// Reads the periods from the entries.
    ///
    /// # Errors
    /// The entries are not those of the session.
    pub(in crate::service) fn of(facts: &SessionFacts) -> Result<Self, ServiceError> {
        let SessionFacts { row, entries, .. } = facts;
        let plan = SessionPlan::of(row)?;
        let (start, history) = SessionState::start(row, &plan)?;
        let first = plan.stretch(row.policy.clone(), 0, plan.terms.clone(), None);
        let mut periods = Periods {
            all: Vec::new(),
            corrections: 0,
            stretches: vec![first],
            start,
            history,
            names: AssetNames::from(plan.names()),
            events: BTreeMap::new(),
        };
        for (index, entry) in entries.iter().enumerate() {
            let own = periods.names.last().clone();
            if let Some(changed) = names_after(entry)? {
                periods.names.change(entry.entry, changed.into());
            }
            let names = &periods.names.last().clone();
            match entry.kind {
                EntryKind::Observation => periods.all.push(SessionPeriod {
                    report: content(entry, names)?,
                    acknowledged: Some(Acknowledged::of(&periods.start, entry, names)?),
                    stands: true,
                    entry: index,
                    corrections: Vec::new(),
                }),
                EntryKind::Correction => {
                    periods.correct(&content(entry, names)?, index)?;
                    let Recomposed { assets } = answer(entry, names)?;
                    periods.add(assets.map(composed));
                }
                EntryKind::Renewal => {
                    let renew: Renew = content(entry, names)?;
                    let (next, terms, assets) = match &periods.start {
                        SessionState::Account(_) => {
                            let Renewed { terms, assets, .. } = answer(entry, names)?;
                            let change = AssetChange::new((&own, names), &renew, periods.all.len())?;
                            (NextPolicy::Account(change), terms, assets)
                        }
                        SessionState::Declared(_) => {
                            let DeclaredRenewed { problem, .. } = answer(entry, names)?;
                            let terms = terms_of(&problem);
                            (NextPolicy::Declared(problem.into()), terms, None)
                        }
                    };
                    periods.add([BetweenPeriods::Renewed(next.into())].into_iter().chain(assets.map(composed)));
                    periods.stretches.push(plan.stretch(renew.policy, periods.all.len(), terms, renew.window));
                }
            }
        }
        Ok(periods)
    }

    /// Records what came after the periods so far.
    fn add(&mut self, events: impl IntoIterator<Item = BetweenPeriods>) {
        self.events.entry(self.all.len()).or_default().extend(events);
    }

    /// Returns the policy that advises the coming period.
    pub(in crate::service) fn current(&self) -> &PolicyTenure {
        // There is always a first one.
        &self.stretches[self.stretches.len() - 1]
    }

    /// Returns the number of policies after the first.
    pub(in crate::service) fn renewals(&self) -> usize {
        self.stretches.len() - 1
    }

    /// Applies a correction, which is the entry with this index.
    ///
    /// # Errors
    /// It names no observed period.
    pub(super) fn correct(&mut self, correction: &Correct, entry: usize) -> Result<(), FieldError> {
        let observed = self.all.len();
        let index = correction.period.wrapping_sub(1);
        let Some(period) = self.all.get_mut(index) else {
            let rule = match observed {
                0 => "must name an observed period, but none is observed yet".to_owned(),
                _ => format!("must lie in [1, {observed}], the observed periods"),
            };
            return Err(FieldError::new("period", correction.period, rule));
        };
        self.corrections += 1;
        match correction.change {
            Change::Replace => {
                let date = correction.date.or(period.report.date);
                period.report = Report { date, ..correction.report() };
                period.corrections.push(self.corrections);
            }
            Change::Insert => {
                let (report, corrections) = (correction.report(), vec![self.corrections]);
                self.all.insert(index, SessionPeriod { report, acknowledged: None, stands: false, entry, corrections });
                for (after, events) in self.events.split_off(&(index + 1)) {
                    self.events.insert(after + 1, events);
                }
            }
            Change::Remove => {
                self.all.remove(index);
                // Later compositions depend on the period, so they are removed with it. No renewal is as late.
                self.events.split_off(&(index + 1));
            }
        }
        self.all.iter_mut().skip(index).for_each(|period| period.stands = false);
        Ok(())
    }

    /// Returns the index of the first period that differs from its acknowledgement; the number of periods if none does.
    pub(super) fn first_changed(&self) -> usize {
        self.all.iter().position(|period| !period.stands).unwrap_or(self.all.len())
    }

    /// Returns the state at the start. The law of several assets is not rebuilt.
    pub(super) fn at_start(&self) -> &SessionState {
        &self.start
    }

    /// Starts a replay, to be advanced period by period. Cost of each period: a copy of the law.
    ///
    /// # Errors
    /// The first policy was renewed before the first period, from returns that are not a valid history.
    pub(super) fn passage(&self) -> Result<Replay<'_>, FieldError> {
        let (standing, record) = (self.start.clone(), self.history.clone());
        let mut passage = Replay { periods: self, standing, record, step: 0, stretch: 0 };
        passage.renew(None)?;
        Ok(passage)
    }

    /// Replays all periods and returns the final state.
    ///
    /// # Errors
    /// A recorded report no longer keeps the rules.
    pub(in crate::service) fn replay(&self) -> Result<Replay<'_>, ServiceError> {
        let mut passage = self.passage()?;
        while passage.next().map_err(ServiceError::of_recorded)?.is_some() {}
        passage.standing = passage.stands();
        Ok(passage)
    }
}

impl Periods {
    /// Returns the final state with every period computed again from its report, whatever was answered.
    ///
    /// # Errors
    /// A recorded report does not keep the rules.
    pub(super) fn recomputed(&self) -> Result<SessionState, ServiceError> {
        let mut anew = self.clone();
        anew.all.iter_mut().for_each(|period| period.stands = false);
        let standing = anew.replay()?.standing;
        Ok(standing)
    }
}

impl<'a> Replay<'a> {
    /// Replays the next period: as acknowledged if that still holds, otherwise recomputed. `None` after the last.
    ///
    /// # Errors
    /// A report breaks a rule in its present position; comes with the number of its period.
    pub(in crate::service) fn next(&mut self) -> Result<Option<ReplayedPeriod>, (usize, FieldError)> {
        let Some(SessionPeriod { report, acknowledged, stands, .. }) = self.periods.all.get(self.step) else {
            return Ok(None);
        };
        let period = self.step + 1;
        let (completed, advised) = match acknowledged {
            Some(acknowledged) if *stands => (acknowledged.report(report), acknowledged.advised()),
            Some(acknowledged) => (acknowledged.held_as_advised(report), acknowledged.advised()),
            // Nothing was advised for it, so nothing was traded.
            None => self.standing.held_on(report),
        };
        let passed = self.standing.after((self.stretch(), self.step), &completed, &advised);
        let Transition { seen, moved, mut standing } = passed.map_err(|error| (period, error))?;
        standing.price_as(report);
        let before = std::mem::replace(&mut self.standing, standing);
        self.record.learn(period, &seen);
        self.step = period;
        let composed = acknowledged.as_ref().and_then(|acknowledged| acknowledged.composed());
        self.renew(composed).map_err(|error| (period, error))?;
        Ok(Some(ReplayedPeriod { before, seen, moved }))
    }

    /// Returns the state with the law of the fund of several assets, which a replay does not keep up to date.
    pub(in crate::service) fn stands(&self) -> SessionState {
        self.standing.clone().with_law(self.stretch().terms.learning)
    }

    /// Returns the policy that advises the period after those replayed.
    pub(in crate::service) fn stretch(&self) -> &'a PolicyTenure {
        &self.periods.stretches[self.stretch]
    }

    /// Switches to the policies that begin here, with the last reported composition of several assets. This is
    /// `reported`, which came with the period, unless a correction or a renewal came later.
    fn renew(&mut self, reported: Option<&Composition>) -> Result<(), FieldError> {
        reported.map_or(Ok(()), |reported| self.standing.take(reported))?;
        for event in self.periods.events.get(&self.step).into_iter().flatten() {
            match event {
                BetweenPeriods::Composed(reported) => self.standing.take(reported)?,
                BetweenPeriods::Renewed(next) => {
                    self.stretch += 1;
                    if let Some(change) = next.asset_change() {
                        self.record = change.record(&self.record);
                    }
                    self.standing = self.standing.renewed(&self.record, self.stretch(), next)?;
                }
            }
        }
        Ok(())
    }
}

/// The part of the answer to a correction that a replay reads.
#[derive(Deserialize)]
struct Recomposed {
    #[serde(default)]
    assets: Option<Composition>,
}

fn composed(reported: Composition) -> BetweenPeriods {
    BetweenPeriods::Composed(Box::new(reported))
}
