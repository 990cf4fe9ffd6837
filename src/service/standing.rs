//! Where a session stands, and where a report leads from there.

use std::sync::Arc;

use jiff::civil::Date;

use super::drift::Bet;
use super::error::ServiceError;
use super::report::Report;
use crate::control::error::FieldError;
use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::state::{Realised, State};
use crate::control::request::learning::Learning;
use crate::control::request::rules;
use crate::numerics::empirical::EmpiricalDistribution;
use crate::numerics::moments::CentralMoments;

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
    /// All returns seen, where the law is of the last of them alone.
    seen: Option<EmpiricalDistribution>,
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
        Standing { state, price: None, date: None, bet: Bet::default(), seen: None, session: session.into() }
    }

    /// The same with the law that the last `window` returns of `record` teach, which holds all that were seen.
    ///
    /// # Errors
    /// They are no history.
    pub(super) fn renewed(
        &self,
        record: &[f64],
        window: Option<usize>,
        learning: Learning,
    ) -> Result<Self, FieldError> {
        let last = last_of(record, window);
        let state = State::new(last, self.state.wealth, learning)?.with_holding(self.state.holding)?;
        let seen = (last.len() < record.len()).then(|| EmpiricalDistribution::new(record));
        let Standing { price, date, bet, .. } = *self;
        Ok(Standing { state, price, date, bet, seen, session: self.session.clone() })
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

    /// After `period`, of which `report` tells, and for which `advised` was advised.
    ///
    /// # Errors
    /// As [`Standing::log_return`]; wealth leaves the range that is taken.
    pub(super) fn after(
        &self,
        dynamics: Dynamics,
        period: usize,
        report: &Report,
        advised: f64,
    ) -> Result<Passed, FieldError> {
        let log_return = self.log_return(report)?;
        let executed_allocation = report.executed_allocation.unwrap_or(advised);
        let Report { rate, flow, .. } = *report;
        let realised = Realised { action: executed_allocation, log_return, rate, flow };
        let mut state = self.state.next_state(dynamics, &realised);
        state.wealth = match report.wealth {
            Some(reported) => reported,
            None => reached(state.wealth, report)?,
        };
        let mut seen = self.seen.clone();
        seen.iter_mut().zip(log_return).for_each(|(seen, log_return)| seen.push(log_return));
        let bet = self.bet.after(seen.as_ref().unwrap_or(&state.law), log_return, &self.session, period);
        let (price, date, session) = (report.price, report.date.or(self.date), self.session.clone());
        let standing = Standing { state, price, date, bet, seen, session };
        Ok(Passed { log_return, executed_allocation, standing })
    }

    /// Returns that it holds.
    pub(super) fn returns(&self) -> usize {
        let seen = self.seen.as_ref().map_or(0, EmpiricalDistribution::sample_size);
        self.state.law.sample_size() + seen
    }
}

/// The last `window` of the returns seen, or as many as a history may hold.
pub(super) fn last_of(record: &[f64], window: Option<usize>) -> &[f64] {
    let most = window.unwrap_or(usize::MAX).min(*rules::HISTORY_LENGTH.end());
    &record[record.len().saturating_sub(most)..]
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
