//! Sessions as an overview shows them: found, sorted and listed page by page.
//!
//! A row takes the state of its session from the answer of the last entry, which is joined to it. Nothing is stored
//! twice, so a row never disagrees with the entries, and an observation writes only its entry. Only the listed rows are
//! read in full; the sort key is read for every session that matches.
//!
//! All that is shown was verified: the start of a session and its last entry by their seals. If either is damaged, only
//! the session's name is listed.

use crate::store::engine::codec::{from_sql, to_sql};
use crate::store::engine::error::Failure;
use crate::store::engine::query::{Query, StoreRow};
use crate::store::engine::statement::{HORIZON, IS_WAITING, OBSERVATIONS, Statement, TABLES, WEALTH};
use crate::store::labels::Labels;
use crate::store::sessions::SessionRow;
use crate::store::sessions::attention::{Attention, CareCounts, Today, needs, needs_any};
use crate::store::sessions::entries::EntryRow;
use crate::store::sessions::initial_account::InitialAccount;
use crate::store::sessions::search::{self, Among, OpeningSpan, Rarest};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// The sort order of a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SessionOrder {
    /// By the order in which they were opened.
    #[default]
    Created,
    /// By name, ignoring case.
    Name,
    /// By current wealth.
    Wealth,
    /// By the time of the last report; sessions without a report come first.
    LastReport,
}

/// A filter by the state of sessions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SessionFilter {
    /// Sessions that their policy advises.
    Active,
    /// Sessions whose next policy is to be trained.
    Waiting,
    /// Sessions at their horizon with no policy to follow.
    Completed,
    /// Sessions that need attention for this reason, or for any.
    Needing(Option<Attention>),
}

/// The counts to make beside a page, each of which reads every matching session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Counted {
    #[default]
    Nothing,
    /// The number of matching sessions.
    Total,
    /// The number of matching sessions, and of those that need attention.
    Care,
}

/// The query of a list of sessions; by default all of them, in the order they were opened.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SessionQuery {
    /// Beginnings of words of the session or of its policy, in any order, ignoring case.
    pub search: Option<String>,
    /// A whole tag.
    pub tag: Option<String>,
    pub is: Option<SessionFilter>,
    /// The dates that decide which sessions are overdue.
    pub today: Today,
    pub order: SessionOrder,
    pub descending: bool,
    pub limit: usize,
    pub counted: Counted,
    /// The last row of the page before.
    pub after: Option<SessionPlace>,
}

/// The position of a row in its list.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionPlace {
    pub key: SessionKey,
    /// Orders rows that have the same key.
    pub sequence: i64,
}

/// The sort key of a row.
#[derive(Debug, Clone, PartialEq)]
pub enum SessionKey {
    Created,
    Name(String),
    Wealth(f64),
    LastReport(i64),
}

/// A session without its history.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionSummary {
    pub session: String,
    pub labels: Labels,
    /// The policy that advises the coming period.
    pub policy: String,
    pub policy_name: String,
    /// The periods a year of that policy, if it states them.
    pub periods_per_year: Option<f64>,
    /// The account of an investor at the start.
    pub account: Option<InitialAccount>,
    /// The last period that the policy advises.
    pub horizon: usize,
    pub created_ms: i64,
    /// Number of periods observed.
    pub observations: usize,
    /// True if its next policy is to be trained.
    pub is_due: bool,
    /// True if it is renewed automatically at some time.
    pub is_renewed: bool,
    /// The answer to the last observation or correction, and its time.
    pub last: Option<(String, i64)>,
    pub place: SessionPlace,
}

/// A page of sessions.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionList {
    pub sessions: Vec<SessionSummary>,
    /// The damaged sessions of the page, each with its damage.
    pub damaged: Vec<(String, String)>,
    /// The position of the last row, sound or damaged, if the page is full.
    pub last: Option<SessionPlace>,
}

impl Store {
    /// Lists a page of the sessions of a tenant.
    pub async fn sessions(&self, tenant: &Tenant, query: &SessionQuery) -> Result<SessionList, StoreError> {
        let mut list = SessionList { sessions: Vec::new(), damaged: Vec::new(), last: None };
        let look_at = match self.rarest_of(tenant, query).await? {
            None => vec![Among::All],
            Some(rarest) if query.order == SessionOrder::Created => rarest.windows(),
            Some(rarest) => vec![rarest.all()],
        };
        for among in look_at {
            list = self.list("listing sessions", query.page(tenant, &among), |rows| query.listed(rows)).await?;
            if list.last.is_some() {
                break;
            }
        }
        Ok(list)
    }

    async fn rarest_of(&self, tenant: &Tenant, query: &SessionQuery) -> Result<Option<Rarest>, StoreError> {
        let word = |given: &Option<String>| given.clone().unwrap_or_default();
        self.rarest(tenant, &word(&query.search), &word(&query.tag)).await
    }

    /// Counts the sessions of a tenant that match.
    pub async fn total(&self, tenant: &Tenant, query: &SessionQuery) -> Result<usize, StoreError> {
        let decode = |rows: &[StoreRow]| rows.first().map_or(Ok(0), |row| from_sql(row.get("total")?));
        let among = self.rarest_of(tenant, query).await?.map_or(Among::All, Rarest::all);
        self.list("counting sessions", query.count(tenant, &among), decode).await
    }

    /// Counts the matching sessions that need attention; ignores the filter by state.
    pub async fn care(&self, tenant: &Tenant, query: &SessionQuery) -> Result<CareCounts, StoreError> {
        let among = self.rarest_of(tenant, query).await?.map_or(Among::All, Rarest::all);
        self.list("counting sessions that need care", query.caring(tenant, &among), CareCounts::from_rows).await
    }
}

impl SessionQuery {
    fn listed(&self, rows: &[StoreRow]) -> Result<SessionList, Failure> {
        let last = rows.last().filter(|_| rows.len() == self.limit);
        let last = last.map(|row| self.order.place(row)).transpose()?;
        let mut list = SessionList { sessions: Vec::new(), damaged: Vec::new(), last };
        for row in rows {
            match SessionSummary::from_row(row, self.order) {
                Ok(session) => list.sessions.push(session),
                Err(failure) => list.damaged.push((row.get("session")?, failure.damage()?)),
            }
        }
        Ok(list)
    }

    fn span(&self) -> OpeningSpan {
        let (order, beyond, first) = if self.descending { ("DESC", '<', i64::MAX) } else { ("ASC", '>', 0) };
        let start = self.after.as_ref().map_or(first, |place| place.sequence);
        OpeningSpan { start, order, beyond }
    }

    fn page(&self, tenant: &Tenant, among: &Among) -> Query {
        let key = self.order.key();
        let columns = format!(
            "SELECT sessions.sequence, sessions.session, sessions.tenant, sessions.policy AS first_policy,
                    sessions.initial_wealth, sessions.initial_holding, sessions.history_seal,
                    sessions.horizon AS first_horizon, sessions.plan_json, sessions.created_ms, sessions.seal,
                    last.entry, last.kind, last.number, last.content_json, last.numbers, last.access_key, last.seal AS last_seal,
                    labels.name, labels.notes, labels.tags,
                    coalesce(renewals.policy, sessions.policy) AS policy, called.name AS policy_name,
                    policies.periods_per_year, {HORIZON} AS horizon, {OBSERVATIONS} AS observations, sessions.due,
                    last.answer_json, last.created_ms AS reported_ms, {key} AS sort_key {TABLES}"
        );
        let mut statement = Statement::of(&columns);
        among.narrow(&mut statement, tenant, self.span());
        self.only_matching(&mut statement);
        let OpeningSpan { order, beyond, .. } = self.span();
        if let Some(SessionPlace { key: value, sequence }) = &self.after {
            let value = match value {
                SessionKey::Created => (*sequence).into(),
                SessionKey::Name(name) => name.as_str().into(),
                SessionKey::Wealth(wealth) => (*wealth).into(),
                SessionKey::LastReport(reported_ms) => (*reported_ms).into(),
            };
            let part = format!(" AND ({key}, sessions.sequence) {beyond} (?, ?)");
            statement.and(&part, [value, (*sequence).into()]);
        }
        let by_key = if self.order == SessionOrder::Created { String::new() } else { format!("sort_key {order}, ") };
        let end = format!(" ORDER BY {by_key}sessions.sequence {order} LIMIT ?");
        statement.and(&end, [to_sql(self.limit).into()]);
        statement.query()
    }

    fn count(&self, tenant: &Tenant, among: &Among) -> Query {
        let is_narrowed = self.search.is_some() || self.tag.is_some() || self.is.is_some();
        let tables = if is_narrowed { TABLES } else { "FROM sessions" };
        let mut statement = Statement::of(&format!("SELECT count(*) AS total {tables}"));
        among.narrow(&mut statement, tenant, self.span());
        self.only_matching(&mut statement);
        statement.query()
    }

    fn caring(&self, tenant: &Tenant, among: &Among) -> Query {
        let mut statement = Statement::of("SELECT count(*) AS sessions");
        let sum = |word: &str| format!(", coalesce(sum({word}), 0) AS {word}");
        for part in ["any_of_them", "overdue", "renewal", "alarm", "ending"].map(sum) {
            statement.and(&part, []);
        }
        statement.and(
            " FROM (SELECT flags.*, CASE WHEN overdue + renewal + alarm + ending > 0 THEN 1 ELSE 0 END AS any_of_them FROM (SELECT ",
            [],
        );
        for (place, care) in Attention::ALL.into_iter().enumerate() {
            statement.and(if place == 0 { "CASE WHEN " } else { ", CASE WHEN " }, []);
            needs(&mut statement, care, &self.today);
            statement.and(&format!(" THEN 1 ELSE 0 END AS {}", care.column()), []);
        }
        statement.and(&format!(" {TABLES}"), []);
        let all = SessionQuery { is: None, ..self.clone() };
        among.narrow(&mut statement, tenant, self.span());
        all.only_matching(&mut statement);
        statement.and(") AS flags) AS counted", []);
        statement.query()
    }

    fn only_matching(&self, statement: &mut Statement) {
        if let Some(search) = &self.search {
            search::matches(statement, search);
        }
        if let Some(tag) = &self.tag {
            // The text contains the tag if removing the tag changes it.
            statement.and(" AND replace(labels.tags, ?, '') <> labels.tags", [format!("\n{tag}\n").into()]);
        }
        match self.is {
            None => {}
            Some(SessionFilter::Needing(None)) => needs_any(statement, &self.today),
            Some(SessionFilter::Needing(Some(care))) => {
                statement.and(" AND ", []);
                needs(statement, care, &self.today);
            }
            Some(SessionFilter::Active) => {
                statement.and(&format!(" AND {OBSERVATIONS} < {HORIZON} AND NOT {IS_WAITING}"), [])
            }
            Some(SessionFilter::Waiting) => statement.and(&format!(" AND {IS_WAITING}"), []),
            Some(SessionFilter::Completed) => {
                statement.and(&format!(" AND {OBSERVATIONS} >= {HORIZON} AND NOT {IS_WAITING}"), []);
            }
        }
    }
}

impl SessionOrder {
    fn key(self) -> &'static str {
        match self {
            SessionOrder::Created => "sessions.sequence",
            SessionOrder::Name => "coalesce(labels.folded_name, '')",
            SessionOrder::Wealth => WEALTH,
            SessionOrder::LastReport => "coalesce(last.created_ms, 0)",
        }
    }

    fn place(self, row: &StoreRow) -> Result<SessionPlace, Failure> {
        let key = match self {
            SessionOrder::Created => SessionKey::Created,
            SessionOrder::Name => SessionKey::Name(row.get("sort_key")?),
            SessionOrder::Wealth => SessionKey::Wealth(row.get("sort_key")?),
            SessionOrder::LastReport => SessionKey::LastReport(row.get("sort_key")?),
        };
        Ok(SessionPlace { key, sequence: row.get("sequence")? })
    }
}

impl SessionSummary {
    fn from_row(row: &StoreRow, order: SessionOrder) -> Result<Self, Failure> {
        let observations = from_sql(row.get("observations")?)?;
        let due = row.get::<Option<i64>>("due")?.map(from_sql).transpose()?;
        let start = SessionRow::start_of(row)?;
        let last = last_of(row)?;
        Ok(SessionSummary {
            session: start.session,
            labels: Labels::from_row(row)?,
            policy: row.get("policy")?,
            policy_name: row.get::<Option<String>>("policy_name")?.unwrap_or_default(),
            periods_per_year: row.get("periods_per_year")?,
            account: start.account,
            horizon: from_sql(row.get("horizon")?)?,
            created_ms: start.created_ms,
            observations,
            is_due: due.is_some_and(|due| due <= observations),
            is_renewed: due.is_some(),
            last: last.map(|entry| (entry.answer_json, entry.created_ms)),
            place: order.place(row)?,
        })
    }
}

/// Returns the last entry that changed a session, verified; `None` before the first.
fn last_of(row: &StoreRow) -> Result<Option<EntryRow>, Failure> {
    match row.get::<Option<i64>>("entry")? {
        Some(_) => EntryRow::beside(row, "reported_ms", "last_seal").map(Some),
        None => Ok(None),
    }
}
