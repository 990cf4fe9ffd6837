//! Sessions as an overview shows them.

use jiff::civil::Date;

use crate::service::callers::keys::Caller;
use crate::service::entries::answer::StateSummary;
use crate::service::entries::drift::DriftLevel;
use crate::service::error::ServiceError;
use crate::service::jobs::due::{first_day, next_day};
use crate::service::metrics;
use crate::service::process::clock::day_of;
use crate::service::sessions::Sessions;
use crate::service::sessions::content::read;
use crate::store::{
    Attention, CareCounts, Counted, SessionList, SessionPlace, SessionQuery, SessionSummary, StoreError, Today,
};

/// A session in a list, and its state after its last entry.
#[derive(Debug)]
pub struct Listed {
    pub row: SessionSummary,
    /// `None` before the first report.
    pub stands: Option<StateSummary>,
    /// The last day on which its next report is not late, by the calendar of its policy.
    pub next: Option<Date>,
    /// Why it needs attention.
    pub care: Vec<Attention>,
}

/// A page of sessions, and how many match in all.
#[derive(Debug)]
pub struct Overview {
    pub sessions: Vec<Listed>,
    /// Damaged sessions of the page; nothing of them is shown.
    pub damaged: Vec<String>,
    /// Position of the last row, sound or not, if the page is full.
    pub last: Option<SessionPlace>,
    /// Present if requested.
    pub total: Option<usize>,
    /// Counts over the matching sessions in every state, if requested.
    pub care: Option<CareCounts>,
}

/// Returns the last day on which the next report of a session is not late, if its policy has a calendar.
pub(in crate::service) fn next_report(row: &SessionSummary, stands: Option<&StateSummary>) -> Option<Date> {
    let last_date = stands.and_then(|stands| stands.date);
    let from = last_date.or_else(|| day_of(row.last.as_ref().map_or(row.created_ms, |(_, reported)| *reported)));
    next_day(from?, row.periods_per_year?)
}

impl Sessions {
    /// Lists sessions of the caller's tenant that match the query, one statement after the other under one permit.
    ///
    /// # Errors
    /// The store does not answer, or no permit came in time.
    pub async fn list(&self, caller: &Caller, query: SessionQuery) -> Result<Overview, ServiceError> {
        let (_turn, tenant) = (self.listing.of(&caller.allowance).await?, &caller.tenant);
        let now_ms = self.clock.now_milliseconds();
        let today = day_of(now_ms);
        let calendars = self.store.calendars(tenant).await?;
        let first_days = calendars.into_iter().filter_map(|periods| first_day(today?, periods)).collect();
        let query = SessionQuery { today: Today { first_days }, ..query };
        let sessions = self.store.sessions(tenant, &query).await?;
        let total = match query.counted {
            Counted::Nothing => None,
            Counted::Total | Counted::Care => Some(self.store.total(tenant, &query).await?),
        };
        let care = match query.counted {
            Counted::Care => Some(self.store.care(tenant, &query).await?),
            Counted::Nothing | Counted::Total => None,
        };
        let SessionList { sessions, damaged, last } = sessions;
        let damaged = damaged.into_iter().map(|(session, what)| {
            let error = StoreError::Corrupt { what };
            metrics::count_failure(&error);
            tracing::error!(session, error = &error as &dyn std::error::Error, "a list leaves out a damaged session");
            session
        });
        let damaged = damaged.collect();
        let listed = |row: SessionSummary| {
            let stands: Option<StateSummary> = row.last.as_ref().map(|(answer, _)| read(answer)).transpose()?;
            let is_active = row.observations < row.horizon || row.is_due;
            let next = next_report(&row, stands.as_ref()).filter(|_| is_active);
            let is_last = row.observations + 1 >= row.horizon && !row.is_renewed;
            let needs = |care: &Attention| match care {
                Attention::Ending => !is_active || is_last,
                _ if !is_active => false,
                Attention::Overdue => next.zip(today).is_some_and(|(next, today)| next < today),
                Attention::Renewal => row.is_due,
                Attention::Alarm => stands.as_ref().is_some_and(|stands| stands.drift.level == DriftLevel::Alarm),
            };
            let care = Attention::ALL.into_iter().filter(needs).collect();
            Ok(Listed { row, stands, next, care })
        };
        let sessions = sessions.into_iter().map(listed).collect::<Result<_, ServiceError>>()?;
        Ok(Overview { sessions, damaged, last, total, care })
    }
}
