//! What the entries of a session make of it: each period as it was reported last, one after the other.
//!
//! The state is a function of the entries alone. A correction is one of them: the periods are passed through again with the
//! corrected report in its place. What was advised for a period stays what it was, and with it what was held where nothing
//! else was reported. A renewal is another: from its place on the terms and the law are those of the next policy.

use std::collections::BTreeMap;

use super::acknowledged::Acknowledged;
use super::answer::Corrected;
use super::assets::{Assets, Composed, PlannedAssets};
use super::change::Change;
use super::content::{answer, content};
use super::error::ServiceError;
use super::plan::{Plan, Renew, Renewed, Stretch};
use super::record::{Record, Seen};
use super::report::{Correct, Report};
use super::standing::{Passed, Standing};
use crate::control::error::FieldError;
use crate::control::problem::state::State;
use crate::control::request::learning::Learning;
use crate::store::{EntryKind, SessionFacts};

/// A period as its entries tell of it.
#[derive(Debug, Clone)]
pub struct Period {
    /// As reported last.
    pub report: Report,
    /// As understood when it came; what was advised stays so whatever is put right. `None` of a period that was put in later.
    acknowledged: Option<Acknowledged>,
    /// Whether what was acknowledged of it stands: no correction of it, or of a period before it, came after it.
    stands: bool,
    /// Index of the entry that first reported it.
    pub entry: usize,
    /// Numbers of the corrections that put it in or reported it anew.
    pub corrections: Vec<usize>,
}

/// All periods of a session, and the policies that it lives them by.
#[derive(Debug, Clone)]
pub struct Periods {
    pub all: Vec<Period>,
    /// Number of corrections.
    pub corrections: usize,
    /// The first policy, and those that followed it.
    pub stretches: Vec<Stretch>,
    start: Standing,
    history: Record,
    /// What corrections and renewals told of several assets, one after the other, after so many periods.
    composed: BTreeMap<usize, Vec<Composed>>,
}

/// What the session starts from, up to some period.
pub struct Passage<'a> {
    periods: &'a Periods,
    /// Where it stands, under the policy that comes next.
    pub standing: Standing,
    /// All returns seen, in their order.
    pub record: Record,
    /// Periods passed.
    step: usize,
    /// Of the policy that comes next.
    stretch: usize,
}

/// A period that was passed.
pub struct Step {
    /// Where the session stood.
    pub before: Standing,
    pub seen: Seen,
    /// `None` where it is missing; of several assets that of what was held.
    pub log_return: Option<f64>,
    pub executed_allocation: f64,
    /// Shares of wealth held in several assets; none of one.
    pub executed: Vec<f64>,
}

impl Period {
    /// Whether a correction put it in.
    pub(super) fn is_inserted(&self) -> bool {
        self.acknowledged.is_none()
    }
}

impl Periods {
    /// # Errors
    /// The entries are not those of the session.
    pub(super) fn of(facts: &SessionFacts) -> Result<Self, ServiceError> {
        let SessionFacts { row, entries, .. } = facts;
        let plan = Plan::of(row)?;
        let history =
            Record::new(plan.assets.as_ref().map_or(1, |assets| assets.names.len()), row.initial_history.clone());
        let assets = plan.assets.as_ref().map(|PlannedAssets { names, composed }| {
            Assets::told(names, history.rows_of(history.all()), composed).map(Box::new)
        });
        let assets = assets.transpose()?;
        let (wealth, learning) = (row.initial_wealth, plan.terms.learning);
        let state = match &assets {
            // A fund may vary less than a history must.
            Some(assets) => State { wealth, holding: 0.0, law: learning.law(&assets.fund.returns()) },
            None => State::new(history.all(), wealth, learning)?,
        };
        let state = state.with_holding(row.initial_holding)?;
        let first = plan.stretch(row.policy.clone(), 0, plan.terms.clone(), None);
        let mut periods = Periods {
            all: Vec::new(),
            corrections: 0,
            stretches: vec![first],
            start: Standing::at(&row.session, state, assets),
            history,
            composed: BTreeMap::new(),
        };
        let names = plan.names();
        for (index, entry) in entries.iter().enumerate() {
            match entry.kind {
                EntryKind::Observation => periods.all.push(Period {
                    report: content(entry, names)?,
                    acknowledged: Some(answer(entry, names)?),
                    stands: true,
                    entry: index,
                    corrections: Vec::new(),
                }),
                EntryKind::Correction => {
                    periods.correct(&content(entry, names)?, index)?;
                    let told = answer::<Corrected>(entry, names)?.assets;
                    periods.tell(told);
                }
                EntryKind::Renewal => {
                    let renew: Renew = content(entry, names)?;
                    let Renewed { terms, assets, .. } = answer(entry, names)?;
                    periods.tell(assets);
                    periods.stretches.push(plan.stretch(renew.policy, periods.all.len(), terms, renew.window));
                }
            }
        }
        Ok(periods)
    }

    /// Names of the assets where there are several; none of one.
    pub(super) fn names(&self) -> &[String] {
        self.start.names()
    }

    /// What an entry told of several assets that is no period.
    fn tell(&mut self, told: Option<Composed>) {
        self.composed.entry(self.all.len()).or_default().extend(told);
    }

    /// The policy that advises the coming period.
    pub(super) fn current(&self) -> &Stretch {
        // The first is there from the start.
        &self.stretches[self.stretches.len() - 1]
    }

    /// Policies that followed the first.
    pub(super) fn renewals(&self) -> usize {
        self.stretches.len() - 1
    }

    /// Makes the change of a correction, which is the entry with this index.
    ///
    /// # Errors
    /// It is of no period that was observed.
    pub(super) fn correct(&mut self, correction: &Correct, entry: usize) -> Result<(), FieldError> {
        let observed = self.all.len();
        let index = correction.period.wrapping_sub(1);
        let Some(period) = self.all.get_mut(index) else {
            let rule = match observed {
                0 => "must name a period that was observed, and none was".to_owned(),
                _ => format!("must lie in [1, {observed}], the periods observed"),
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
                self.all.insert(index, Period { report, acknowledged: None, stands: false, entry, corrections });
                for (after, composed) in self.composed.split_off(&(index + 1)) {
                    self.composed.insert(after + 1, composed);
                }
            }
            Change::Remove => {
                self.all.remove(index);
                // What was told since rests on the period, so it falls with it.
                self.composed.split_off(&(index + 1));
            }
        }
        self.all.iter_mut().skip(index).for_each(|period| period.stands = false);
        Ok(())
    }

    /// The first period that is not as it was acknowledged, from 0; the number of periods where all are.
    pub(super) fn first_changed(&self) -> usize {
        self.all.iter().position(|period| !period.stands).unwrap_or(self.all.len())
    }

    /// What the first advice rests on.
    pub(super) fn at_start(&self, learning: Learning) -> State {
        self.start.clone().with_law(learning).state
    }

    /// From the start, to be passed through period by period. Cost of each: a copy of the law.
    ///
    /// # Errors
    /// The first policy was renewed before the first period, by returns that are no history.
    pub(super) fn passage(&self) -> Result<Passage<'_>, FieldError> {
        let (standing, record) = (self.start.clone(), self.history.clone());
        let mut passage = Passage { periods: self, standing, record, step: 0, stretch: 0 };
        passage.renew(None)?;
        Ok(passage)
    }

    /// Where the session stands after all of them.
    ///
    /// # Errors
    /// A report that was recorded does not keep the rules any more.
    pub(super) fn replay(&self) -> Result<Passage<'_>, ServiceError> {
        let mut passage = self.passage()?;
        while passage.next().map_err(ServiceError::of_recorded)?.is_some() {}
        passage.standing = passage.stands();
        Ok(passage)
    }
}

impl<'a> Passage<'a> {
    /// Passes the next period: what was acknowledged of it, where that stands, else what follows. `None` after the last.
    ///
    /// # Errors
    /// A report that breaks a rule where it now stands, with the number of its period.
    pub(super) fn next(&mut self) -> Result<Option<Step>, (usize, FieldError)> {
        let Some(Period { report, acknowledged, stands, .. }) = self.periods.all.get(self.step) else {
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
        let Passed { seen, log_return, executed_allocation, executed, mut standing } = passed;
        standing.price_as(report);
        let before = std::mem::replace(&mut self.standing, standing);
        self.record.learn(&seen);
        self.step = period;
        let composed = acknowledged.as_ref().and_then(|acknowledged| acknowledged.composed());
        self.renew(composed).map_err(|error| (period, error))?;
        Ok(Some(Step { before, seen, log_return, executed_allocation, executed }))
    }

    /// Where it stands, with the law of several assets' fund, which is not kept up on the way.
    pub(super) fn stands(&self) -> Standing {
        self.standing.clone().with_law(self.stretch().terms.learning)
    }

    /// The policy that advises the period after those passed.
    pub(super) fn stretch(&self) -> &'a Stretch {
        &self.periods.stretches[self.stretch]
    }

    /// Goes on under the policies that begin here, with the composition of several assets that was told last: `told` with the
    /// period, unless a correction or a renewal came after it.
    fn renew(&mut self, told: Option<&Composed>) -> Result<(), FieldError> {
        told.map_or(Ok(()), |told| self.standing.take(told))?;
        let begin = self.periods.stretches[self.stretch + 1..].iter().take_while(|next| next.after == self.step);
        // The last one makes its law of the same returns, whatever those before it did.
        self.stretch += begin.count();
        let Stretch { after, window, terms, .. } = self.stretch();
        if self.stretch > 0 && *after == self.step {
            self.standing = self.standing.renewed(&self.record, *window, terms.learning)?;
        }
        let told_later = self.periods.composed.get(&self.step);
        told_later.into_iter().flatten().try_for_each(|told| self.standing.take(told))
    }
}
