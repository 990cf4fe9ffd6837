//! What the entries of a session make of it: each period as it was reported last, one after the other.
//!
//! The state is a function of the entries alone. A correction is one of them: the periods are passed through again with the
//! corrected report in its place. What was advised for a period stays what it was, and with it what was held where nothing
//! else was reported.

use std::sync::Arc;

use jiff::civil::Date;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::drift::{Bet, Drift};
use super::error::ServiceError;
use super::report::{Correct, Report};
use crate::control::error::FieldError;
use crate::control::policy::advice::Uncertainty;
use crate::control::policy::advisor::Advisor;
use crate::control::problem::actions::Band;
use crate::control::problem::state::{Realised, State};
use crate::control::request::rules;
use crate::numerics::empirical::EmpiricalDistribution;
use crate::numerics::moments::CentralMoments;
use crate::store::{EntryKind, EntryRow};

/// The session after an observation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Observed {
    pub session: String,
    pub period: usize,
    /// Null where it is missing.
    pub log_return: Option<f64>,
    /// The holdings that were best kept at the start of the period; where trading costs nothing both ends are the advised
    /// allocation.
    #[schema(value_type = [f64; 2])]
    pub band: Band,
    pub advised_allocation: f64,
    pub executed_allocation: f64,
    /// Wealth at the end of the period, with what was added to it.
    pub wealth: f64,
    /// Share of it in the risky asset, as the return left it.
    pub holding: f64,
    /// Whether the horizon is reached.
    pub completed: bool,
    /// Whether the returns still come as they came.
    pub drift: Drift,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// The session after a correction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Corrected {
    pub session: String,
    pub correction: usize,
    /// The period put right.
    pub period: usize,
    /// What it is now; null where it is missing.
    pub log_return: Option<f64>,
    /// Periods observed, which is as before.
    pub observed: usize,
    /// Wealth now.
    pub wealth: f64,
    /// Share of it in the risky asset.
    pub holding: f64,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

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

/// # Errors
/// The return is most likely a slip, and nobody confirms it.
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
    /// As advised when it came.
    pub advised: f64,
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

/// What is read of the answer to an observation.
#[derive(Deserialize)]
struct Told {
    advised_allocation: f64,
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
                    let Told { advised_allocation: advised } = read(&entry.answer_json)?;
                    periods.all.push(Period { report, advised, is_corrected: false });
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
        Ok(())
    }

    /// Passes through all of them, and tells `tell` of each: its number, where the session stood before, and what it made
    /// of it. Cost: a copy of the law for each.
    ///
    /// # Errors
    /// A report that breaks a rule where it now stands, and the number of its period.
    pub(super) fn pass(
        &self,
        advisor: &Advisor,
        start: Standing,
        mut tell: impl FnMut(usize, &Standing, &Passed),
    ) -> Result<Standing, (usize, FieldError)> {
        let mut standing = start;
        for (step, period) in self.all.iter().enumerate() {
            let passed = standing.after(advisor, step, &period.report, period.advised);
            let passed = passed.map_err(|error| (step + 1, error))?;
            tell(step + 1, &standing, &passed);
            standing = passed.standing;
        }
        Ok(standing)
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

/// What an entry holds.
pub(super) fn read<'a, T: Deserialize<'a>>(json: &'a str) -> Result<T, ServiceError> {
    serde_json::from_str(json).map_err(ServiceError::internal)
}
