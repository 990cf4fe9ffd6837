//! What the entries of a session make of it: each period as it was reported last, one after the other.
//!
//! The state is a function of the entries alone. A correction is one of them: the periods are passed through again with the
//! corrected report in its place. What was advised for a period stays what it was, and with it what was held where nothing
//! else was reported. A renewal is another: from its place on the terms and the law are those of the next policy.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::answer::Corrected;
use super::assets::{Assets, Composed, ObservedAssets, PlannedAssets};
use super::content::read;
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
    /// As understood when it came; what was advised stays so whatever is put right.
    told: Told,
    /// Whether what was told of it stands: no correction of it, or of a period before it, came after it.
    stands: bool,
    /// Whether that is not what was reported first.
    pub is_corrected: bool,
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
}

/// What a correction makes of a session.
pub struct PutRight {
    /// Where it stood.
    pub before: Standing,
    /// Where it stands now.
    pub standing: Standing,
    /// Of the period put right; `None` where it is missing.
    pub log_return: Option<f64>,
    /// By the last period, as it stands now.
    pub wealth_change: f64,
}

/// What is read of the answer to an observation.
#[derive(Debug, Clone, Deserialize)]
struct Told {
    log_return: Option<f64>,
    advised_allocation: f64,
    executed_allocation: f64,
    wealth: f64,
    assets: Option<ObservedAssets>,
}

impl Told {
    /// The report in the numbers that were acknowledged, which no other processor or library computes otherwise.
    fn report(&self, reported: &Report) -> Report {
        let Report { date, rate, flow, .. } = *reported;
        let common = Report { wealth: Some(self.wealth), date, rate, flow, ..Report::default() };
        match &self.assets {
            Some(assets) => Report {
                log_returns: assets.log_returns.clone(),
                missing: assets.log_returns.is_none(),
                executed_allocations: Some(assets.executed_allocations.clone()),
                ..common
            },
            None => Report {
                log_return: self.log_return,
                missing: self.log_return.is_none(),
                executed_allocation: Some(self.executed_allocation),
                ..common
            },
        }
    }

    /// The report, of several assets with what was advised for those that were held as advised.
    fn held_as_advised(&self, reported: &Report) -> Report {
        let mut report = reported.clone();
        if let Some(assets) = &self.assets {
            report.executed_allocations.get_or_insert_with(|| assets.advised_allocations.clone());
        }
        report
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
        for entry in entries {
            match entry.kind {
                EntryKind::Observation => {
                    let report = read(&entry.content_json)?;
                    let told: Told = read(&entry.answer_json)?;
                    periods.all.push(Period { report, told, stands: true, is_corrected: false });
                }
                EntryKind::Correction => {
                    periods.correct(&read(&entry.content_json)?)?;
                    let told = read::<Corrected>(&entry.answer_json)?.assets;
                    periods.tell(told);
                }
                EntryKind::Renewal => {
                    let renew: Renew = read(&entry.content_json)?;
                    let Renewed { terms, assets, .. } = read(&entry.answer_json)?;
                    periods.tell(assets);
                    periods.stretches.push(plan.stretch(renew.policy, periods.all.len(), terms, renew.window));
                }
            }
        }
        Ok(periods)
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

    /// Puts the correction in the place of what was reported.
    ///
    /// # Errors
    /// It is of no period that was observed.
    pub(super) fn correct(&mut self, correction: &Correct) -> Result<(), FieldError> {
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
        let date = correction.date.or(period.report.date);
        period.report = Report { date, ..correction.report() };
        period.is_corrected = true;
        self.all.iter_mut().skip(index).for_each(|period| period.stands = false);
        Ok(())
    }

    /// The first period that was put right, from 0; the number of periods where none was.
    pub(super) fn first_corrected(&self) -> usize {
        self.all.iter().position(|period| period.is_corrected).unwrap_or(self.all.len())
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

    /// Puts the correction in its place, and passes through all.
    ///
    /// # Errors
    /// It is of no period that was observed, makes a period break a rule, or gives one an unusual return that nobody confirms.
    pub(super) fn put_right(&mut self, correction: &Correct) -> Result<PutRight, ServiceError> {
        let (mut stood, mut passage) = (Vec::with_capacity(self.all.len()), self.passage()?);
        while let Some(step) = passage.next().map_err(ServiceError::of_recorded)? {
            stood.push(step.seen);
        }
        let before = passage.standing;
        self.correct(correction)?;
        let (mut corrected, mut wealth_before, mut passage) = (None, f64::NAN, self.passage()?);
        for (period, stood) in (1..).zip(stood) {
            let passed = passage.next().map_err(|(period, error)| in_period(period, correction, error))?;
            let Some(Step { before, seen, log_return, .. }) = passed else { break };
            wealth_before = before.state.wealth;
            if period == correction.period {
                corrected = log_return;
            }
            // Of a price that is put right, the return after it is another too.
            if stood != seen {
                let report = &self.all[period - 1].report;
                before.usual(report, &seen, correction.confirm).map_err(|error| match error {
                    ServiceError::UnusualReturn(field) => {
                        ServiceError::UnusualReturn(in_period(period, correction, field))
                    }
                    other => other,
                })?;
            }
        }
        let standing = passage.stands();
        let wealth_change = standing.state.wealth - wealth_before;
        Ok(PutRight { before, standing, log_return: corrected, wealth_change })
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
        let Some(Period { report, told, stands, .. }) = self.periods.all.get(self.step) else { return Ok(None) };
        let (dynamics, period) = (self.stretch().dynamics(self.step), self.step + 1);
        let report_told = if *stands { told.report(report) } else { told.held_as_advised(report) };
        let passed = self.standing.after(dynamics, period, &report_told, told.advised_allocation);
        let passed = passed.map_err(|error| (period, error))?;
        let Passed { seen, log_return, executed_allocation, mut standing, .. } = passed;
        standing.price_as(report);
        let before = std::mem::replace(&mut self.standing, standing);
        self.record.learn(&seen);
        self.step = period;
        let told = told.assets.as_ref().map(|assets| &assets.composed);
        self.renew(told).map_err(|error| (period, error))?;
        Ok(Some(Step { before, seen, log_return, executed_allocation }))
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

/// A field that breaks a rule in some period once another is put right.
fn in_period(period: usize, correction: &Correct, error: FieldError) -> FieldError {
    if period == correction.period {
        return error;
    }
    let rule = format!("in period {period}, with period {} put right: {}", correction.period, error.rule);
    FieldError { rule, ..error }
}
