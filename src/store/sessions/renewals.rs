//! The policies that sessions continue with, stored beside the entries that record the renewals.

use futures_util::FutureExt;

use crate::store::engine::codec::to_sql;
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, StoreRow, query};
use crate::store::engine::statement::DUE;
use crate::store::jobs::training_names::withdraw;
use crate::store::sessions::entries::{self, APPENDING, Append, EntryRow};
use crate::store::tenants::audit::{Actor, AuditAction};
use crate::store::tenants::quotas::Quotas;
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError, policies};

/// The result of a renewal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RenewalTarget {
    pub policy: String,
    /// The last period that the policy advises.
    pub horizon: usize,
    /// Additional periods that the session may now pass.
    pub periods: usize,
    /// The number of periods after which the session is due for automatic renewal.
    pub due: Option<usize>,
}

impl Store {
    /// Appends a renewal like [`Store::append`]. Its policy stays as long as the session does.
    ///
    /// # Errors
    /// [`StoreError::OverQuota`] if the quota has no room for the entry and the periods that it adds.
    pub async fn renew(&self, new: EntryRow, onto: RenewalTarget) -> Result<Append, StoreError> {
        let (by, session) = ((self.quotas, self.actor.clone()), new.session.clone());
        self.write_to(&session, APPENDING, move |connection| renew(connection, new, onto, by).boxed()).await
    }

    /// Returns at most `limit` sessions that are due for automatic renewal, in the order they were opened, with their
    /// tenants and sequences. `after` is the sequence of the last session of the page before.
    pub async fn due_sessions(&self, limit: usize, after: i64) -> Result<Vec<(i64, Tenant, String)>, StoreError> {
        let found = |row: &StoreRow| {
            let tenant = Tenant::stored(&row.get::<String>("tenant")?);
            Ok((row.get("sequence")?, tenant, row.get("session")?))
        };
        let page = query(DUE).bind(after).bind(to_sql(limit));
        self.list("listing sessions that are due", page, |rows| rows.iter().map(found).collect()).await
    }
}

async fn renew(
    mut connection: StoreConnection<'_>,
    new: EntryRow,
    onto: RenewalTarget,
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
        entries::take_room(connection, &tenant, &new.session, room, by, (AuditAction::Renew, &outcome)).await?;
    }
    Ok(append)
}

/// Returns whether the tenant of a session has the policy, which is then locked until this transaction ends. Returns
/// true if there is no such session.
async fn may_go_on(connection: &mut StoreConnection<'_>, session: &str, policy: &str) -> Result<bool, Failure> {
    policies::lock(connection, policy).await?;
    let owned = query(
        "SELECT (SELECT count(*) FROM policy_owners WHERE policy = $2 AND tenant = sessions.tenant) AS owned
         FROM sessions WHERE session = $1",
    );
    let found = connection.row(owned.bind(session).bind(policy)).await?;
    found.map_or(Ok(true), |row| row.get::<i64>("owned").map(|owned| owned > 0))
}

/// Stores the row that finds the policy of a renewal without its entry.
pub(super) async fn refer(
    connection: &mut StoreConnection<'_>,
    new: &EntryRow,
    onto: &RenewalTarget,
) -> Result<(), Failure> {
    let refer = query("INSERT INTO renewals (session, number, policy, horizon) VALUES ($1, $2, $3, $4)");
    let refer = refer.bind(new.session.as_str()).bind(to_sql(new.number)).bind(onto.policy.as_str());
    connection.execute(refer.bind(to_sql(onto.horizon))).await?;
    let due = query("UPDATE sessions SET due = $1 WHERE session = $2").bind(onto.due.map(to_sql));
    connection.execute(due.bind(new.session.as_str())).await.map(drop)
}
