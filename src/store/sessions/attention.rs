//! Conditions in SQL that select the sessions that need attention: counted over all matches, and listed by reason.

use crate::store::engine::codec::from_sql;
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreRow, query};
use crate::store::engine::statement::{ANSWER, HORIZON, IS_WAITING, OBSERVATIONS, Statement};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// The reason why a session needs attention.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Attention {
    /// Its next report is late, by the calendar of its policy.
    Overdue,
    /// It waits for its next policy.
    Renewal,
    /// Its drift alarm is raised.
    Alarm,
    /// It is completed, or it is in its last period and no automatic renewal follows.
    Ending,
}

impl Attention {
    pub const ALL: [Attention; 4] = [Attention::Overdue, Attention::Renewal, Attention::Alarm, Attention::Ending];
}

/// The dates that decide which reports are late, at the moment of the query.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Today {
    pub first_days: Vec<FirstDay>,
}

/// A session is overdue if its last report is before this day and its policy has this many periods a year.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstDay {
    pub periods_per_year: f64,
    /// The day, for example 2008-09-30.
    pub date: String,
    /// The beginning of that day.
    pub begin_ms: i64,
}

/// How many sessions match, how many of them need attention, and for which reasons; a session may have several.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CareCounts {
    pub sessions: usize,
    pub any: usize,
    pub overdue: usize,
    pub renewal: usize,
    pub alarm: usize,
    pub ending: usize,
}

impl Store {
    /// Lists the distinct numbers of periods a year among the policies of a tenant.
    pub async fn calendars(&self, tenant: &Tenant) -> Result<Vec<f64>, StoreError> {
        let found = query(
            "SELECT DISTINCT periods_per_year FROM policies
             JOIN policy_owners ON policy_owners.policy = policies.policy
             WHERE policy_owners.tenant = $1 AND periods_per_year IS NOT NULL",
        );
        let decode = |rows: &[StoreRow]| rows.iter().map(|row| row.get("periods_per_year")).collect();
        self.list("listing calendars", found.bind(tenant.as_str()), decode).await
    }
}

impl Attention {
    pub(in crate::store) fn column(self) -> &'static str {
        match self {
            Attention::Overdue => "overdue",
            Attention::Renewal => "renewal",
            Attention::Alarm => "alarm",
            Attention::Ending => "ending",
        }
    }
}

/// Adds the condition that a session needs this kind of attention. A completed session only matches `Ending`.
pub(in crate::store) fn needs(statement: &mut Statement, care: Attention, today: &Today) {
    if care != Attention::Ending {
        statement.and(&format!("({OBSERVATIONS} < {HORIZON} OR {IS_WAITING}) AND "), []);
    }
    match care {
        Attention::Ending => statement.and(
            &format!(
                "(({OBSERVATIONS} >= {HORIZON} AND NOT {IS_WAITING})
                  OR ({OBSERVATIONS} + 1 >= {HORIZON} AND sessions.due IS NULL))"
            ),
            [],
        ),
        Attention::Alarm => statement
            .and(&format!("coalesce(json_extract(json_extract({ANSWER}, '$.drift'), '$.level') = 'alarm', 1 = 0)"), []),
        Attention::Renewal => statement.and(IS_WAITING, []),
        Attention::Overdue if today.first_days.is_empty() => statement.and("1 = 0", []),
        Attention::Overdue => {
            statement.and("coalesce(CASE", []);
            for FirstDay { periods_per_year, date, begin_ms } in &today.first_days {
                statement.and(
                    &format!(
                        " WHEN policies.periods_per_year = ? THEN coalesce(json_extract({ANSWER}, '$.date') < ?,
                      coalesce(last.created_ms, sessions.created_ms) < ?)"
                    ),
                    [(*periods_per_year).into(), date.as_str().into(), (*begin_ms).into()],
                );
            }
            statement.and(" END, 1 = 0)", []);
        }
    }
}

/// Adds the condition that a session needs attention for any reason.
pub(super) fn needs_any(statement: &mut Statement, today: &Today) {
    statement.and(" AND (", []);
    for (place, care) in Attention::ALL.into_iter().enumerate() {
        statement.and(if place == 0 { "(" } else { " OR (" }, []);
        needs(statement, care, today);
        statement.and(")", []);
    }
    statement.and(")", []);
}

impl CareCounts {
    pub(in crate::store) fn from_rows(rows: &[StoreRow]) -> Result<Self, Failure> {
        let Some(row) = rows.first() else { return Ok(CareCounts::default()) };
        let count = |column: &str| from_sql(row.get::<i64>(column)?);
        Ok(CareCounts {
            sessions: count("sessions")?,
            any: count("any_of_them")?,
            overdue: count("overdue")?,
            renewal: count("renewal")?,
            alarm: count("alarm")?,
            ending: count("ending")?,
        })
    }
}
