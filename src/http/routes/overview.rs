//! The list of sessions: searched, sorted, and page by page.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::State;
use axum::response::Response;
use jiff::civil::Date;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::http::gate::access::{CallerOf, ReadCalls};
use crate::http::gate::bodies;
use crate::http::gate::extract::Parameters;
use crate::http::problem::ProblemDocument;
use crate::http::routes::page::{self, Page};
use crate::http::routes::wire::{SessionStatus, session_state};
use crate::service::Service;
use crate::service::catalogue::overview::Listed;
use crate::service::entries::answer::StateSummary;
use crate::service::entries::drift::DriftLevel;
use crate::service::process::memory::Large;
use crate::store::{
    Attention, CareCounts, Counted, LONGEST_TAG, Labels, SessionFilter, SessionKey, SessionOrder, SessionPlace,
    SessionQuery,
};

/// Most letters of a search text: more than any name has.
const LONGEST_SEARCH: usize = 100;

/// Query parameters of the list, as text.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SessionListQuery {
    search: Option<String>,
    tag: Option<String>,
    state: Option<SessionFilterName>,
    sort: Option<String>,
    limit: Option<String>,
    after: Option<String>,
    count: Option<CountName>,
}

#[derive(Debug, Clone, Copy, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum CountName {
    Total,
    Care,
}

#[derive(Debug, Clone, Copy, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum SessionFilterName {
    Active,
    Waiting,
    Completed,
    Care,
    Overdue,
    Renewal,
    Alarm,
    Ending,
}

/// A session in a list.
#[derive(Debug, Serialize, ToSchema)]
pub struct SessionEntry {
    pub session: String,
    #[serde(flatten)]
    pub labels: Labels,
    /// The policy that advises the coming period.
    pub policy: String,
    /// Name of that policy; empty if it has none.
    pub policy_name: String,
    /// Periods a year of that policy; null if it gives none.
    pub periods_per_year: Option<f64>,
    /// The coming period, from 1; `horizon + 1` once completed.
    pub period: usize,
    /// The last period that the policy advises.
    pub horizon: usize,
    pub state: SessionStatus,
    /// Null, as all figures of wealth, if the session lives a declared problem.
    pub initial_wealth: Option<f64>,
    pub wealth: Option<f64>,
    /// Share of wealth in the risky asset, before trading.
    pub holding: Option<f64>,
    /// Change of wealth in the last period; null before the first.
    pub wealth_change: Option<f64>,
    /// Log-return of the last period, by which sessions that see one return can be compared. That of several assets is
    /// the return of their fund. Null if it is missing, or if an earlier period was corrected since.
    pub log_return: Option<f64>,
    /// Log-returns of several assets in the last period, by name. Null as `log_return` is, and after any correction.
    pub log_returns: Option<BTreeMap<String, Option<f64>>>,
    /// Last day that was reported.
    #[schema(value_type = Option<String>, format = Date)]
    pub date: Option<Date>,
    /// Time of the last report or correction, in milliseconds since 1970.
    pub last_report_ms: Option<i64>,
    /// Last day on which the next report is not overdue, by the policy's periods a year. It is one period after the
    /// last day reported. If no day was reported, it counts from the day, in UTC, of the last report or of the opening.
    /// Null if this is not known, or the session is completed.
    #[schema(value_type = Option<String>, format = Date)]
    pub next: Option<Date>,
    /// Reasons why the session needs care; empty if it needs none.
    pub care: Vec<CareReason>,
    /// Standard deviation of the log-returns learned so far; for several assets, those of their fund. Null before the
    /// first report, or if the policy reports fewer than two moments.
    pub deviation: Option<f64>,
    /// Evidence that the returns have changed.
    pub drift: DriftLevel,
    pub created_ms: i64,
}

impl From<Listed> for SessionEntry {
    fn from(Listed { row, stands, next, care }: Listed) -> Self {
        let stands = stands.as_ref();
        SessionEntry {
            period: row.observations + 1,
            state: session_state(row.observations, row.horizon, row.is_due),
            wealth: stands.map_or(row.account.map(|account| account.wealth), |stands| stands.wealth),
            holding: stands.map_or(row.account.map(|account| account.holding), |stands| stands.holding),
            wealth_change: stands.and_then(|stands| stands.wealth_change),
            log_return: stands.and_then(StateSummary::last_return),
            log_returns: stands.and_then(StateSummary::last_returns).cloned(),
            date: stands.and_then(|stands| stands.date),
            drift: stands.map_or(DriftLevel::None, |stands| stands.drift.level),
            last_report_ms: row.last.map(|(_, reported_ms)| reported_ms),
            session: row.session,
            labels: row.labels,
            policy: row.policy,
            policy_name: row.policy_name,
            periods_per_year: row.periods_per_year,
            horizon: row.horizon,
            initial_wealth: row.account.map(|account| account.wealth),
            next,
            care: care.into_iter().map(CareReason::from).collect(),
            deviation: stands.and_then(|stands| stands.deviation),
            created_ms: row.created_ms,
        }
    }
}

/// Reason why a session needs care.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CareReason {
    /// The next report is late.
    Overdue,
    /// The session waits for its next policy.
    Renewal,
    /// The returns of the session have changed (drift alarm).
    Alarm,
    /// The session is completed, or in its last period without automatic renewal.
    Ending,
}

impl From<Attention> for CareReason {
    fn from(care: Attention) -> Self {
        match care {
            Attention::Overdue => CareReason::Overdue,
            Attention::Renewal => CareReason::Renewal,
            Attention::Alarm => CareReason::Alarm,
            Attention::Ending => CareReason::Ending,
        }
    }
}

/// Numbers of sessions that need care, by reason; a session may have several reasons.
#[derive(Debug, Serialize, ToSchema)]
pub struct CareCount {
    /// Sessions that match.
    pub sessions: usize,
    /// Sessions that need care for any of the reasons.
    pub any: usize,
    /// Sessions whose next report is late.
    pub overdue: usize,
    /// Sessions that wait for their next policies.
    pub renewal: usize,
    /// Sessions whose returns have changed (drift alarm).
    pub alarm: usize,
    /// Sessions that are completed, or in their last period without automatic renewal.
    pub ending: usize,
}

impl From<CareCounts> for CareCount {
    fn from(CareCounts { sessions, any, overdue, renewal, alarm, ending }: CareCounts) -> Self {
        CareCount { sessions, any, overdue, renewal, alarm, ending }
    }
}

/// A page of sessions.
#[derive(Debug, Serialize, ToSchema)]
pub struct SessionPage {
    pub sessions: Vec<SessionEntry>,
    /// Sessions of this page whose stored data is damaged. They are not shown, and a call for one gets 500 until an
    /// operator has restored it.
    pub damaged: Vec<String>,
    /// Sessions that match, over all pages; null unless `count` requests it.
    pub total: Option<usize>,
    /// Sessions that need care among those that match `search` and `tag`, in any `state`; null unless `count` requests
    /// it.
    pub care: Option<CareCount>,
    /// Cursor to pass as `after` for the next page; null on the last page.
    pub next: Option<String>,
}

/// Lists sessions: all, or those that match, newest first by default.
#[utoipa::path(get, path = "/sessions", tag = "sessions",
    params(("search" = Option<String>, Query, max_length = 100, description = "Words, in any order and in upper or lower case. Each must begin a word in the name or tags of the session or of its policy, or be at least the first eight digits of the identifier of either."),
           ("tag" = Option<String>, Query, max_length = 50, description = "A tag that the sessions must have."),
           ("state" = inline(Option<SessionFilterName>), Query, description = "`waiting`: sessions that wait for their next policy. `care`: sessions that need attention for any of the reasons `overdue`, `renewal`, `alarm` and `ending`."),
           ("sort" = Option<String>, Query, description = "`created`, `name`, `wealth` or `last_report`, with `-` in front for descending order; default `-created`."),
           ("limit" = Option<usize>, Query, minimum = 1, maximum = 1000, description = "1 to 1000; default 50."),
           ("after" = Option<String>, Query, description = "The `next` of the previous page, with the same `sort`."),
           ("count" = inline(Option<CountName>), Query, description = "`total`: also count the matching sessions. `care`: also count those of them that need attention. Both read every matching session, so request them only with the first page.")),
    responses(
        (status = 200, description = "A page of sessions.", body = SessionPage),
        (status = 400, description = "A parameter breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn list(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Parameters(query): Parameters<SessionListQuery>,
) -> Result<Response, ProblemDocument> {
    let query = query.read()?;
    let room = service.room_for(page::bytes(query.limit)).await?;
    let found = service.sessions.list(&caller, query.clone()).await?;
    let next = found.last.as_ref().map(|place| cursor(&query, place));
    let sessions = found.sessions.into_iter().map(SessionEntry::from).collect();
    let (damaged, care) = (found.damaged, found.care.map(CareCount::from));
    let value = SessionPage { sessions, damaged, total: found.total, care, next };
    bodies::written(&service, Large { value, room }).await
}

impl SessionListQuery {
    fn read(self) -> Result<SessionQuery, ProblemDocument> {
        let (limit, _) = Page::new(self.limit, None).bounds()?;
        for (field, given, most) in [("search", &self.search, LONGEST_SEARCH), ("tag", &self.tag, LONGEST_TAG)] {
            if let Some(text) = given.as_ref().filter(|text| text.chars().count() > most) {
                return Err(ProblemDocument::of_parameter(field, text, format!("must have at most {most} letters")));
            }
        }
        let sort = self.sort.as_deref().unwrap_or("-created");
        let (word, descending) = sort.strip_prefix('-').map_or((sort, false), |word| (word, true));
        let order = match word {
            "created" => SessionOrder::Created,
            "name" => SessionOrder::Name,
            "wealth" => SessionOrder::Wealth,
            "last_report" => SessionOrder::LastReport,
            _ => {
                let rule = "must be created, name, wealth or last_report, with - in front for descending order";
                return Err(ProblemDocument::of_parameter("sort", sort, rule));
            }
        };
        let is = self.state.map(|state| match state {
            SessionFilterName::Active => SessionFilter::Active,
            SessionFilterName::Waiting => SessionFilter::Waiting,
            SessionFilterName::Completed => SessionFilter::Completed,
            SessionFilterName::Care => SessionFilter::Needing(None),
            SessionFilterName::Overdue => SessionFilter::Needing(Some(Attention::Overdue)),
            SessionFilterName::Renewal => SessionFilter::Needing(Some(Attention::Renewal)),
            SessionFilterName::Alarm => SessionFilter::Needing(Some(Attention::Alarm)),
            SessionFilterName::Ending => SessionFilter::Needing(Some(Attention::Ending)),
        });
        let counted = self.count.map_or(Counted::Nothing, |count| match count {
            CountName::Total => Counted::Total,
            CountName::Care => Counted::Care,
        });
        let search = self.search.filter(|search| !search.is_empty());
        let query =
            SessionQuery { search, tag: self.tag, is, order, descending, limit, counted, ..SessionQuery::default() };
        let after = self.after.map(|text| {
            let rule = "must be the `next` of the previous page, with the same sort";
            place(&query, &text).ok_or_else(|| ProblemDocument::of_parameter("after", &text, rule))
        });
        Ok(SessionQuery { after: after.transpose()?, ..query })
    }
}

/// Returns the prefix of a cursor, which identifies the order of the list.
fn mark(query: &SessionQuery) -> String {
    let order = match query.order {
        SessionOrder::Created => 'c',
        SessionOrder::Name => 'n',
        SessionOrder::Wealth => 'w',
        SessionOrder::LastReport => 'r',
    };
    format!("{order}{}", if query.descending { 'd' } else { 'a' })
}

/// Returns the cursor of a page's last row: its sort key at that time, and its sequence number among equal keys.
fn cursor(query: &SessionQuery, SessionPlace { key, sequence }: &SessionPlace) -> String {
    let key = match key {
        SessionKey::Created => String::new(),
        SessionKey::Name(name) => name.bytes().map(|byte| format!("{byte:02x}")).collect(),
        SessionKey::Wealth(wealth) => format!("{:016x}", wealth.to_bits()),
        SessionKey::LastReport(reported_ms) => reported_ms.to_string(),
    };
    format!("{}.{sequence}.{key}", mark(query))
}

fn place(query: &SessionQuery, text: &str) -> Option<SessionPlace> {
    let (marked, rest) = text.split_once('.')?;
    let (sequence, key) = rest.split_once('.')?;
    let key = match query.order {
        _ if marked != mark(query) => return None,
        SessionOrder::Created => key.is_empty().then_some(SessionKey::Created)?,
        SessionOrder::Name => SessionKey::Name(text_of(key)?),
        SessionOrder::Wealth => {
            let wealth = u64::from_str_radix(key, 16).ok().map(f64::from_bits);
            SessionKey::Wealth(wealth.filter(|wealth| wealth.is_finite())?)
        }
        SessionOrder::LastReport => SessionKey::LastReport(key.parse().ok()?),
    };
    Some(SessionPlace { key, sequence: sequence.parse().ok()? })
}

/// Decodes text from the hexadecimal digits of its bytes.
fn text_of(digits: &str) -> Option<String> {
    let pairs = digits.as_bytes().chunks(2);
    let bytes = pairs.map(|pair| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok());
    String::from_utf8(bytes.collect::<Option<_>>()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cursor_is_read_as_it_was_written_and_under_its_own_order_alone() {
        for (order, key) in [
            (SessionOrder::Created, SessionKey::Created),
            (SessionOrder::Name, SessionKey::Name("été, \"x\"\u{1F600}".into())),
            (SessionOrder::Name, SessionKey::Name(String::new())),
            (SessionOrder::Wealth, SessionKey::Wealth(0.1 + 0.2)),
            (SessionOrder::LastReport, SessionKey::LastReport(-7)),
        ] {
            let query = SessionQuery { order, descending: true, ..SessionQuery::default() };
            let found = SessionPlace { key, sequence: 41 };
            let written = cursor(&query, &found);
            assert_eq!(place(&query, &written), Some(found), "{written}");
            assert_eq!(place(&SessionQuery { descending: false, ..query.clone() }, &written), None);
        }
        let query = SessionQuery { order: SessionOrder::Wealth, ..SessionQuery::default() };
        for text in ["", "wa", "wa.1", "wa.x.3ff0000000000000", "wa.1.7ff0000000000000", "wa.1.zz", "17"] {
            assert_eq!(place(&query, text), None, "{text}");
        }
    }
}
