//! Rebuilds a session from its entries: each period as last reported, in order.
//!
//! The state is a function of the entries alone. After a correction, which is an entry, the periods are replayed with
//! the corrected report. The advice given for a period does not change, so the holdings do not either unless a report
//! changes them. A renewal is an entry also: from there on the terms and the law are those of the next policy.

use std::collections::BTreeMap;

use crate::control::error::FieldError;
use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::state::State;
use crate::control::request::learning::Learning;
use crate::service::entries::acknowledged::Acknowledged;
use crate::service::entries::answer::Corrected;
use crate::service::entries::change::Change;
use crate::service::entries::record::{PeriodReturns, SessionRecord};
use crate::service::entries::report::{Correct, Report};
use crate::service::error::ServiceError;
use crate::service::sessions::asset_change::{AssetChange, AssetNames};
use crate::service::sessions::assets::{Assets, Composition, PlannedAssets};
use crate::service::sessions::content::{answer, content, names_after};
use crate::service::sessions::plan::{PolicyTenure, Renew, Renewed, SessionPlan};
use crate::service::sessions::session_state::{SessionState, Transition};
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
    /// The next policy began, perhaps with other assets.
    Renewed(Option<Box<AssetChange>>),
}

/// A replay of a session up to some period.
pub struct Replay<'a> {
    periods: &'a Periods,
    /// The state under the policy that comes next.
    pub standing: SessionState,
    /// All observed returns, in order.
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
    pub seen: PeriodReturns,
    /// `None` if it is missing; for several assets, the return of the holdings.
    pub log_return: Option<f64>,
    pub executed_allocation: f64,
    /// Shares of wealth held in several assets; empty for one asset.
    pub executed: Vec<f64>,
    /// Share of wealth bought and sold for them.
    pub turnover: f64,
    /// The dynamics of the period, with the rate and the flow reported.
    pub dynamics: Dynamics,
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
        let history = SessionRecord::new(
            plan.assets.as_ref().map_or(1, |assets| assets.names.len()),
            row.initial_history.clone(),
        );
        let assets = plan.assets.as_ref().map(|PlannedAssets { names, composed }| {
            Assets::with_composition(names, history.rows_of(history.all()), composed).map(Box::new)
        });
        let assets = assets.transpose()?;
        let (wealth, learning) = (row.initial_wealth, plan.terms.learning);
        let state = match &assets {
            // The returns of a fund may vary less than those of a history must.
            Some(assets) => State { wealth, holding: 0.0, law: learning.law(&assets.fund.returns()) },
            None => State::new(history.all(), wealth, learning)?,
        };
        let state = state.with_holding(row.initial_holding)?;
        let first = plan.stretch(row.policy.clone(), 0, plan.terms.clone(), None);
        let mut periods = Periods {
            all: Vec::new(),
            corrections: 0,
            stretches: vec![first],
            start: SessionState::at(&row.session, state, assets),
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
                    acknowledged: Some(answer(entry, names)?),
                    stands: true,
                    entry: index,
                    corrections: Vec::new(),
                }),
                EntryKind::Correction => {
                    periods.correct(&content(entry, names)?, index)?;
                    let composition = answer::<Corrected>(entry, names)?.assets;
                    periods.add(composition.map(composed));
                }
                EntryKind::Renewal => {
                    let renew: Renew = content(entry, names)?;
                    let Renewed { terms, assets, .. } = answer(entry, names)?;
                    let change = AssetChange::new((&own, names), &renew, periods.all.len())?;
                    periods
                        .add([BetweenPeriods::Renewed(change.map(Box::new))].into_iter().chain(assets.map(composed)));
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

    /// Returns the state behind the first advice.
    pub(super) fn at_start(&self, learning: Learning) -> State {
        self.start.clone().with_law(learning).state
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

impl<'a> Replay<'a> {
    /// Replays the next period: as acknowledged if that still holds, otherwise recomputed. `None` after the last.
    ///
    /// # Errors
    /// A report breaks a rule in its present position; comes with the number of its period.
    pub(in crate::service) fn next(&mut self) -> Result<Option<ReplayedPeriod>, (usize, FieldError)> {
        let Some(SessionPeriod { report, acknowledged, stands, .. }) = self.periods.all.get(self.step) else {
            return Ok(None);
        };
        let (dynamics, period) = (self.stretch().dynamics(self.step), self.step + 1);
        let (completed, advised) = match acknowledged {
            Some(acknowledged) if *stands => (acknowledged.report(report), acknowledged.advised_allocation),
            Some(acknowledged) => (acknowledged.held_as_advised(report), acknowledged.advised_allocation),
            // Nothing was advised for it, so nothing was traded.
            None => (self.standing.held_on(report), self.standing.state.holding),
        };
        let passed =
            self.standing.after(dynamics, period, &completed, (advised, self.stretch().terms.periods_per_year));
        let passed = passed.map_err(|error| (period, error))?;
        let Transition { seen, log_return, executed_allocation, executed, turnover, dynamics, mut standing } = passed;
        standing.price_as(report);
        let before = std::mem::replace(&mut self.standing, standing);
        self.record.learn(period, &seen);
        self.step = period;
        let composed = acknowledged.as_ref().and_then(|acknowledged| acknowledged.composed());
        self.renew(composed).map_err(|error| (period, error))?;
        Ok(Some(ReplayedPeriod { before, seen, log_return, executed_allocation, executed, turnover, dynamics }))
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
                BetweenPeriods::Renewed(change) => {
                    self.stretch += 1;
                    let change = change.as_deref();
                    if let Some(change) = change {
                        self.record = change.record(&self.record);
                    }
                    let PolicyTenure { window, terms, .. } = self.stretch();
                    self.standing = self.standing.renewed(&self.record, *window, terms.learning, change)?;
                }
            }
        }
        Ok(())
    }
}

fn composed(reported: Composition) -> BetweenPeriods {
    BetweenPeriods::Composed(Box::new(reported))
}
