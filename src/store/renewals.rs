//! The policies that sessions go on by, beside the entries that tell of them.

use futures_util::FutureExt;

use super::audit::{Actor, Deed};
use super::codec::to_sql;
use super::entries::{self, APPENDING, Append, EntryRow};
use super::error::Failure;
use super::query::{Connection, Row, query};
use super::quotas::Quotas;
use super::statement::DUE;
use super::tenant::Tenant;
use super::training_names::withdraw;
use super::{Store, StoreError, policies};

/// What a renewal leads to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Onto {
    pub policy: String,
    /// The last period that the policy advises.
    pub horizon: usize,
    /// Periods that the session may pass now and could not before.
    pub periods: usize,
    /// Periods after which the session is due to be renewed by itself.
    pub due: Option<usize>,
}

impl Store {
    /// As [`Store::append`], of a renewal. The policy stays as long as the session does.
    ///
    /// # Errors
    /// [`StoreError::OverQuota`] where there is no room for it and for the periods that it adds.
    pub async fn renew(&self, new: EntryRow, onto: Onto) -> Result<Append, StoreError> {
        let (by, session) = ((self.quotas, self.actor.clone()), new.session.clone());
        self.write_to(&session, APPENDING, move |connection| renew(connection, new, onto, by).boxed()).await
    }

    /// At most `limit` sessions that are due to be renewed by themselves, in the order they were opened, with their
    /// tenants and sequences; `after` is the sequence of the last one of the page before.
    pub async fn due_sessions(&self, limit: usize, after: i64) -> Result<Vec<(i64, Tenant, String)>, StoreError> {
        let found = |row: &Row| {
            let tenant = Tenant::stored(&row.get::<String>("tenant")?);
            Ok((row.get("sequence")?, tenant, row.get("session")?))
        };
        let page = query(DUE).bind(after).bind(to_sql(limit));
        self.list("listing sessions that are due", page, |rows| rows.iter().map(found).collect()).await
    }
}

async fn renew(
    mut connection: Connection<'_>,
    new: EntryRow,
    onto: Onto,
    by: (Quotas, Actor),
) -> Result<Append, Failure> {
    let connection = &mut connection;
    if !may_go_on(connection, &new.session, &onto.policy).await? {
        return Ok(Append::NoPolicy);
    }
    let (append, tenant) = entries::append_next(connection, &new).await?;
    if append == Append::Appended {
        refer(connection, &new, &onto).await?;
        withdraw(connection, &tenant, &new.session, new.number).await?;
        let outcome = format!("renewal {} onto policy {}", new.number, onto.policy);
        let room = 1 + to_sql(onto.periods);
        entries::take_room(connection, &tenant, &new.session, room, by, (Deed::Renew, &outcome)).await?;
    }
    Ok(append)
}

/// Whether the tenant of a session has the policy, which then stays until this transaction ends; true where there is no such
/// session.
async fn may_go_on(connection: &mut Connection<'_>, session: &str, policy: &str) -> Result<bool, Failure> {
    policies::lock(connection, policy).await?;
    let owned = query(
        "SELECT (SELECT count(*) FROM policy_owners WHERE policy = $2 AND tenant = sessions.tenant) AS owned
         FROM sessions WHERE session = $1",
    );
    let found = connection.row(owned.bind(session).bind(policy)).await?;
    found.map_or(Ok(true), |row| row.get::<i64>("owned").map(|owned| owned > 0))
}

/// What finds the policy of a renewal without its entry.
async fn refer(connection: &mut Connection<'_>, new: &EntryRow, onto: &Onto) -> Result<(), Failure> {
    let refer = query("INSERT INTO renewals (session, number, policy, horizon) VALUES ($1, $2, $3, $4)");
    let refer = refer.bind(new.session.as_str()).bind(to_sql(new.number)).bind(onto.policy.as_str());
    connection.execute(refer.bind(to_sql(onto.horizon))).await?;
    let due = query("UPDATE sessions SET due = $1 WHERE session = $2").bind(onto.due.map(to_sql));
    connection.execute(due.bind(new.session.as_str())).await.map(drop)
}
