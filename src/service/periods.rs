//! What the entries of a session make of it: each period as it was reported last, one after the other.
//!
//! The state is a function of the entries alone. A correction is one of them: the periods are passed through again with the
//! corrected report in its place. What was advised for a period stays what it was, and with it what was held where nothing
//! else was reported.

use std::sync::Arc;

use jiff::civil::Date;
use serde::Deserialize;

use super::drift::Bet;
use super::error::ServiceError;
use super::report::{Correct, Report};
use crate::control::error::FieldError;
use crate::control::policy::advisor::Advisor;
use crate::control::problem::state::{Realised, State};
use crate::control::request::rules;
use crate::numerics::empirical::EmpiricalDistribution;
use crate::numerics::moments::CentralMoments;
use crate::store::{EntryKind, EntryRow};

/// Where a session stands between two periods.
#[derive(Debug, Clone, PartialEq)]
pub struct Standing {
    pub state: State,
    /// The price reported for the last period, if one was.
    pub price: Option<f64>,
    /// The last date reported.
    pub date: Option<Date>,
    /// Against the returns' coming as they came.
    pub bet: Bet,
    session: Arc<str>,
}

/// What a report makes of a period.
#[derive(Debug, Clone, PartialEq)]
pub struct Passed {
    pub log_return: Option<f64>,
    pub executed_allocation: f64,
    pub standing: Standing,
}

impl Standing {
    /// At the start of `session`.
    pub(super) fn at(session: &str, state: State) -> Self {
        Standing { state, price: None, date: None, bet: Bet::default(), session: session.into() }
    }

    /// The log-return that `report` tells of the coming period, `None` where it is missing.
    ///
    /// # Errors
    /// A field breaks a rule; the date is none after the last.
    pub(super) fn log_return(&self, report: &Report) -> Result<Option<f64>, FieldError> {
        report.check()?;
        if let (Some(date), Some(last)) = (report.date, self.date)
            && date <= last
        {
            return Err(FieldError::new("date", date, format!("must be later than {last}, that of a period before")));
        }
        report.log_return(self.price)
    }

    /// After the period that follows `step` periods: `report` tells of it, `advised` was advised for it.
    ///
    /// # Errors
    /// As [`Standing::log_return`]; wealth leaves the range that is taken.
    pub(super) fn after(
        &self,
        advisor: &Advisor,
        step: usize,
        report: &Report,
        advised: f64,
    ) -> Result<Passed, FieldError> {
        let log_return = self.log_return(report)?;
        let executed_allocation = report.executed_allocation.unwrap_or(advised);
        let Report { rate, flow, .. } = *report;
        let realised = Realised { action: executed_allocation, log_return, rate, flow };
        let mut state = advisor.advance(step, &self.state, &realised);
        state.wealth = match report.wealth {
            Some(reported) => reported,
            None => reached(state.wealth, report)?,
        };
        let bet = self.bet.after(&state.law, log_return, &self.session, step + 1);
        let (price, date, session) = (report.price, report.date.or(self.date), self.session.clone());
        let standing = Standing { state, price, date, bet, session };
        Ok(Passed { log_return, executed_allocation, standing })
    }
}

/// Returns further from the record than so many of its standard deviations are unusual, where they are also large.
const UNUSUAL_DEVIATIONS: f64 = 8.0;
/// Of a simple return, either way: what is smaller is never unusual.
const UNUSUAL_RETURN: f64 = 0.2;

/// Asks about a return z that lies far from a record of mean m and standard deviation s: `|z - m| > 8 s` and `|e^z - 1| > 0.2`.
/// Checked by: `tests/account.rs::a_return_that_is_most_likely_a_slip_is_asked_about`.
///
/// # Errors
/// It is most likely a slip, and nobody confirms it.
pub(super) fn usual(
    report: &Report,
    record: &EmpiricalDistribution,
    log_return: Option<f64>,
    is_confirmed: bool,
) -> Result<(), ServiceError> {
    let unless_confirmed = log_return.filter(|_| !is_confirmed).map(|log_return| (log_return, log_return.exp_m1()));
    let Some((log_return, simple_return)) = unless_confirmed.filter(|(_, simple)| simple.abs() > UNUSUAL_RETURN) else {
        return Ok(());
    };
    let moments = CentralMoments::of(record);
    let deviations = (log_return - moments.mean()).abs() / moments.variance().sqrt();
    if deviations <= UNUSUAL_DEVIATIONS {
        return Ok(());
    }
    let percent = 100.0 * simple_return;
    let rule = format!(
        "must come with \"confirm\": true where it is meant: a return of {percent:.1} % lies {deviations:.1} standard deviations from the record"
    );
    let (field, value) = report.given();
    Err(ServiceError::UnusualReturn(FieldError::new(field, value, rule)))
}

/// Wealth as return, allocation and flow give it.
fn reached(wealth: f64, report: &Report) -> Result<f64, FieldError> {
    let (low, high) = rules::WEALTH;
    if (low..=high).contains(&wealth) {
        return Ok(wealth);
    }
    let leaves = format!(
        "what the return, the allocation and what is added give is {wealth}, and a wealth lies in [{low}, {high}]"
    );
    Err(match report.flow {
        Some(flow) => FieldError::new("flow", flow, format!("must leave a wealth that is taken: {leaves}")),
        None => FieldError::new("wealth", "null", format!("must be reported: {leaves}")),
    })
}

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

/// All periods of a session.
#[derive(Debug, Clone, Default)]
pub struct Periods {
    pub all: Vec<Period>,
    /// Number of corrections.
    pub corrections: usize,
}

/// What a correction makes of a session.
pub struct PutRight {
    /// Where it stood.
    pub before: Standing,
    /// Where it stands now.
    pub standing: Standing,
    /// Of the period put right; `None` where it is missing.
    pub log_return: Option<f64>,
}

/// What is read of the answer to an observation.
#[derive(Debug, Clone, Copy, Deserialize)]
struct Told {
    log_return: Option<f64>,
    advised_allocation: f64,
    executed_allocation: f64,
    wealth: f64,
}

impl Told {
    /// The report in the numbers that were acknowledged, which no other processor or library computes otherwise.
    fn report(self, reported: &Report) -> Report {
        Report {
            log_return: self.log_return,
            missing: self.log_return.is_none(),
            executed_allocation: Some(self.executed_allocation),
            wealth: Some(self.wealth),
            date: reported.date,
            rate: reported.rate,
            flow: reported.flow,
            ..Report::default()
        }
    }
}

impl Periods {
    /// # Errors
    /// The entries are not those of a session.
    pub(super) fn of(entries: &[EntryRow]) -> Result<Self, ServiceError> {
        let mut periods = Periods::default();
        for entry in entries {
            match entry.kind {
                EntryKind::Observation => {
                    let report = read(&entry.content_json)?;
                    let told = read(&entry.answer_json)?;
                    periods.all.push(Period { report, told, stands: true, is_corrected: false });
                }
                EntryKind::Correction => periods.correct(&read(&entry.content_json)?)?,
            }
        }
        Ok(periods)
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
        period.report = correction.report();
        period.is_corrected = true;
        self.all.iter_mut().skip(index).for_each(|period| period.stands = false);
        Ok(())
    }

    /// The first period that was put right, from 0; the number of periods where none was.
    pub(super) fn first_corrected(&self) -> usize {
        self.all.iter().position(|period| period.is_corrected).unwrap_or(self.all.len())
    }

    /// What the period after `step` makes of where the session stood before it: what was acknowledged, where that stands, else
    /// what follows.
    ///
    /// # Errors
    /// A report that breaks a rule where it now stands.
    pub(super) fn passed(&self, advisor: &Advisor, step: usize, before: &Standing) -> Result<Passed, FieldError> {
        let Period { report, told, stands, .. } = &self.all[step];
        if !stands {
            return before.after(advisor, step, report, told.advised_allocation);
        }
        let mut passed = before.after(advisor, step, &told.report(report), told.advised_allocation)?;
        passed.standing.price = report.price;
        Ok(passed)
    }

    /// Passes through all of them, and tells `tell` of each: its number, where the session stood before, and what it made
    /// of it. Cost: a copy of the law for each.
    ///
    /// # Errors
    /// As [`Self::passed`], with the number of the period.
    pub(super) fn pass(
        &self,
        advisor: &Advisor,
        start: Standing,
        mut tell: impl FnMut(usize, &Standing, &Passed),
    ) -> Result<Standing, (usize, FieldError)> {
        let mut standing = start;
        for step in 0..self.all.len() {
            let passed = self.passed(advisor, step, &standing).map_err(|error| (step + 1, error))?;
            tell(step + 1, &standing, &passed);
            standing = passed.standing;
        }
        Ok(standing)
    }

    /// Puts the correction in its place, and passes through all.
    ///
    /// # Errors
    /// It is of no period that was observed, makes a period break a rule, or gives one an unusual return that nobody confirms.
    pub(super) fn put_right(
        &mut self,
        advisor: &Advisor,
        start: &Standing,
        correction: &Correct,
    ) -> Result<PutRight, ServiceError> {
        let mut stood = Vec::with_capacity(self.all.len());
        let before = self.replay(advisor, start.clone(), |_, _, passed| stood.push(passed.log_return))?;
        self.correct(correction)?;
        let mut found = (None, Ok(()));
        let passed = self.pass(advisor, start.clone(), |period, before, passed| {
            let log_return = passed.log_return;
            if period == correction.period {
                found.0 = log_return;
            }
            // Of a price that is put right, the return after it is another too.
            if found.1.is_ok() && stood[period - 1] != log_return {
                let report = &self.all[period - 1].report;
                found.1 =
                    usual(report, &before.state.law, log_return, correction.confirm).map_err(|error| (period, error));
            }
        });
        let standing = passed.map_err(|(period, error)| in_period(period, correction, error))?;
        let (log_return, is_usual) = found;
        is_usual.map_err(|(period, error)| match error {
            ServiceError::UnusualReturn(field) => ServiceError::UnusualReturn(in_period(period, correction, field)),
            other => other,
        })?;
        Ok(PutRight { before, standing, log_return })
    }

    /// As [`Self::pass`], of what was recorded: every report kept the rules when it was.
    ///
    /// # Errors
    /// One does not keep them any more.
    pub(super) fn replay(
        &self,
        advisor: &Advisor,
        start: Standing,
        tell: impl FnMut(usize, &Standing, &Passed),
    ) -> Result<Standing, ServiceError> {
        let passed = self.pass(advisor, start, tell);
        passed.map_err(|(period, error)| ServiceError::internal(format!("period {period}: {error}")))
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

/// What an entry holds.
pub(super) fn read<'a, T: Deserialize<'a>>(json: &'a str) -> Result<T, ServiceError> {
    serde_json::from_str(json).map_err(ServiceError::internal)
}
