//! Who did what: an entry for every change that a caller makes, written in the transaction of the change itself, so that
//! it tells of what happened and of nothing else.
//!
//! The entries of a tenant are a chain: they are numbered from 1, and each is sealed over the seal of the one before; the
//! end of the chain stands beside it. One that was altered, taken out or slipped in is therefore found by a check, and so
//! are entries missing at the end. Each tenant has a chain of its own: who writes to one chain waits for the commit of
//! whoever wrote to it before, which tenants need not do for each other.
//!
//! Observations have no entry. They are most of what is ever written, and a row of theirs is what an entry is: appended
//! once, numbered and sealed, with the key that reported it under the seal. [`Store::deeds`] shows both.
//!
//! What bounds it: [`Store::cut_audit`] drops the oldest entries of a chain by age and number, keeps the seal at which it
//! was cut, so that the rest is still held to be whole, and says so in an entry. A tenant that floods its chain drives out
//! entries of its own alone.
//!
//! Not done, and why: entries of calls that were refused (they change nothing, and would let anybody write; the log of
//! requests names their keys, and metrics count them by tenant); entries for what jobs and the service itself do later (a
//! job's row says how it ended, and its entry who asked for it).

use std::sync::Arc;

use futures_util::FutureExt;

use super::codec::{Seal, to_sql};
use super::error::Failure;
use super::query::{Connection, Row, query};
use super::tenant::Tenant;
use super::{Store, StoreError};

/// Who changes something, and when.
#[derive(Debug, Clone, PartialEq)]
pub struct Actor {
    /// The name of a key; empty where none was asked for.
    pub key: Arc<str>,
    /// What the key may do, or what stands for it.
    pub roles: Arc<str>,
    pub at_ms: i64,
}

impl Actor {
    /// Whoever runs a command on the store itself.
    pub fn operator(at_ms: i64) -> Self {
        Actor { key: "".into(), roles: "operator".into(), at_ms }
    }

    /// The service by itself.
    pub fn service(at_ms: i64) -> Self {
        Actor { key: "".into(), roles: "service".into(), at_ms }
    }
}

/// What can be done to a thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deed {
    OpenSession,
    Observe,
    Correct,
    Renew,
    LabelSession,
    DeleteSession,
    QueueJob,
    CancelJob,
    DeleteJob,
    ImportPolicy,
    LabelPolicy,
    DeletePolicy,
    CreateKey,
    RotateKey,
    RevokeKey,
    CutAudit,
}

impl Deed {
    /// The name on the wire and in SQL.
    pub fn as_str(self) -> &'static str {
        match self {
            Deed::OpenSession => "session.open",
            Deed::Observe => "session.observe",
            Deed::Correct => "session.correct",
            Deed::Renew => "session.renew",
            Deed::LabelSession => "session.label",
            Deed::DeleteSession => "session.delete",
            Deed::QueueJob => "job.queue",
            Deed::CancelJob => "job.cancel",
            Deed::DeleteJob => "job.delete",
            Deed::ImportPolicy => "policy.import",
            Deed::LabelPolicy => "policy.label",
            Deed::DeletePolicy => "policy.delete",
            Deed::CreateKey => "key.create",
            Deed::RotateKey => "key.rotate",
            Deed::RevokeKey => "key.revoke",
            Deed::CutAudit => "audit.cut",
        }
    }
}

/// One thing that was done.
#[derive(Debug, Clone, PartialEq)]
pub struct AuditRow {
    /// Order over all tenants; the cursor of [`Store::deeds`]. 0 of an observation.
    pub sequence: i64,
    pub tenant: Tenant,
    pub key: String,
    pub roles: String,
    pub deed: String,
    /// What it was done to.
    pub object: String,
    /// What came of it.
    pub outcome: String,
    pub at_ms: i64,
}

/// What is asked of the audit; all of it where nothing is given.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AuditFilter {
    pub tenant: Option<Tenant>,
    pub object: Option<String>,
}

/// How long entries are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AuditBounds {
    /// Entries from before this are dropped.
    pub before_ms: i64,
    /// And all but so many of the newest of a tenant.
    pub entries: i64,
}

/// Entries of one chain dropped in one transaction, so that others are not kept waiting.
const CUT_AT_ONCE: i64 = 5_000;

impl Store {
    /// At most `limit` entries, newest first; `after` is the `sequence` of the last row of the page before. Where the object
    /// is a session, at most as many of its observations are on the first page beside them.
    pub async fn deeds(
        &self,
        filter: &AuditFilter,
        limit: usize,
        after: Option<i64>,
    ) -> Result<Vec<AuditRow>, StoreError> {
        let page = |statement: &'static str| query(statement).bind(after.unwrap_or(i64::MAX)).bind(to_sql(limit));
        let page = match (&filter.tenant, &filter.object) {
            (None, None) => page("SELECT * FROM audit WHERE sequence < $1 ORDER BY sequence DESC LIMIT $2"),
            (Some(tenant), None) => {
                page("SELECT * FROM audit WHERE sequence < $1 AND tenant = $3 ORDER BY sequence DESC LIMIT $2")
                    .bind(tenant.as_str())
            }
            (None, Some(object)) => {
                page("SELECT * FROM audit WHERE sequence < $1 AND object = $3 ORDER BY sequence DESC LIMIT $2")
                    .bind(object.as_str())
            }
            (Some(tenant), Some(object)) => page(
                "SELECT * FROM audit WHERE sequence < $1 AND tenant = $3 AND object = $4
                 ORDER BY sequence DESC LIMIT $2",
            )
            .bind(tenant.as_str())
            .bind(object.as_str()),
        };
        let decode = |rows: &[Row]| rows.iter().map(AuditRow::from_row).collect();
        let mut page: Vec<AuditRow> = self.list("reading the audit", page, decode).await?;
        if let (Some(object), None) = (&filter.object, after) {
            let observed = self.observed(object, limit).await?;
            let asked = |row: &AuditRow| filter.tenant.as_ref().is_none_or(|tenant| row.tenant == *tenant);
            page.extend(observed.into_iter().filter(asked));
            page.sort_by_key(|row| std::cmp::Reverse(row.at_ms));
        }
        Ok(page)
    }

    /// Drops entries past their bounds, oldest first, a few thousand of each chain; their number. What was cut is itself an
    /// entry.
    pub async fn cut_audit(&self, bounds: AuditBounds, now_ms: i64) -> Result<u64, StoreError> {
        let chains = query("SELECT tenant FROM audit_chains ORDER BY tenant");
        let names = |rows: &[Row]| rows.iter().map(|row| row.get("tenant")).collect::<Result<Vec<String>, _>>();
        let mut dropped = 0;
        for tenant in self.list("reading the audit", chains, names).await? {
            dropped += self
                .write("cutting the audit", move |connection| cut(connection, tenant, bounds, now_ms).boxed())
                .await?;
        }
        Ok(dropped)
    }
}

/// Writes an entry; in the transaction of what it tells of.
pub(super) async fn record(
    connection: &mut Connection<'_>,
    actor: &Actor,
    tenant: &Tenant,
    deed: Deed,
    object: &str,
    outcome: &str,
) -> Result<(), Failure> {
    // The chain is held from here on, so that no two entries follow the same one.
    let extend = query(
        "INSERT INTO audit_chains (tenant, number, seal, cut_number, cut_seal) VALUES ($1, 1, $2, 0, $2)
         ON CONFLICT (tenant) DO UPDATE SET number = audit_chains.number + 1 RETURNING number, seal",
    );
    let extended = connection.row(extend.bind(tenant.as_str()).bind(first_seal(tenant))).await?;
    let extended = extended.ok_or_else(|| Failure::Corrupt(format!("the chain of the audit of {tenant}")))?;
    let (number, previous): (i64, Vec<u8>) = (extended.get("number")?, extended.get("seal")?);
    let row = AuditRow {
        sequence: 0,
        tenant: tenant.clone(),
        key: actor.key.to_string(),
        roles: actor.roles.to_string(),
        deed: deed.as_str().to_owned(),
        object: object.to_owned(),
        outcome: outcome.to_owned(),
        at_ms: actor.at_ms,
    };
    let seal = row.seal(number, &previous).finish();
    let insert = query(
        "INSERT INTO audit (tenant, number, access_key, roles, deed, object, outcome, at_ms, previous, seal)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10)",
    );
    let insert = insert
        .bind(tenant.as_str())
        .bind(number)
        .bind(row.key)
        .bind(row.roles)
        .bind(row.deed)
        .bind(row.object)
        .bind(row.outcome)
        .bind(row.at_ms)
        .bind(previous)
        .bind(seal.clone());
    connection.execute(insert).await?;
    let end = query("UPDATE audit_chains SET seal = $1 WHERE tenant = $2");
    connection.execute(end.bind(seal).bind(tenant.as_str())).await.map(drop)
}

fn first_seal(tenant: &Tenant) -> Vec<u8> {
    Seal::of("audit chain").text(tenant.as_str()).finish()
}

async fn cut(mut connection: Connection<'_>, tenant: String, bounds: AuditBounds, now_ms: i64) -> Result<u64, Failure> {
    let connection = &mut connection;
    let hold = query("SELECT number, cut_number FROM audit_chains WHERE tenant = $1").bind(tenant.as_str());
    let Some(chain) = connection.row(hold.for_update()).await? else { return Ok(0) };
    let (end, before): (i64, i64) = (chain.get("number")?, chain.get("cut_number")?);
    let kept = query("SELECT min(number) AS number FROM audit WHERE tenant = $1 AND at_ms >= $2");
    let kept = connection.row(kept.bind(tenant.as_str()).bind(bounds.before_ms)).await?;
    let young: Option<i64> = kept.map_or(Ok(None), |row| row.get("number"))?;
    // The newest entry stays, whatever its age: what the chain ends with is then always there to be compared.
    let last = young.map_or(end - 1, |young| young - 1).max(end - bounds.entries.max(1)).min(before + CUT_AT_ONCE);
    if last <= before {
        return Ok(0);
    }
    let seal = query("SELECT seal FROM audit WHERE tenant = $1 AND number = $2").bind(tenant.as_str()).bind(last);
    let seal = connection.row(seal).await?;
    let seal: Vec<u8> = seal.ok_or_else(|| missing(&tenant, last))?.get("seal")?;
    let drop_them = query("DELETE FROM audit WHERE tenant = $1 AND number <= $2").bind(tenant.as_str()).bind(last);
    let dropped = connection.execute(drop_them).await?;
    let mark = query("UPDATE audit_chains SET cut_number = $1, cut_seal = $2 WHERE tenant = $3");
    connection.execute(mark.bind(last).bind(seal.clone()).bind(tenant.as_str())).await?;
    let seal: String = seal.iter().map(|byte| format!("{byte:02x}")).collect();
    let outcome = format!("dropped {dropped} entries; the last had the seal {seal}");
    let (actor, object) = (Actor::service(now_ms), format!("entries to {last}"));
    record(connection, &actor, &Tenant::stored(&tenant), Deed::CutAudit, &object, &outcome).await?;
    Ok(dropped)
}

pub(super) fn missing(tenant: &str, number: i64) -> Failure {
    Failure::Corrupt(format!("entry {number} of the audit of {tenant}"))
}

impl AuditRow {
    fn seal(&self, number: i64, previous: &[u8]) -> Seal {
        Seal::of("audit")
            .bytes(previous)
            .text(self.tenant.as_str())
            .integer(number)
            .text(&self.key)
            .text(&self.roles)
            .text(&self.deed)
            .text(&self.object)
            .text(&self.outcome)
            .integer(self.at_ms)
    }

    pub(super) fn from_row(row: &Row) -> Result<Self, Failure> {
        let read = AuditRow {
            sequence: row.get("sequence")?,
            tenant: Tenant::stored(&row.get::<String>("tenant")?),
            key: row.get("access_key")?,
            roles: row.get("roles")?,
            deed: row.get("deed")?,
            object: row.get("object")?,
            outcome: row.get("outcome")?,
            at_ms: row.get("at_ms")?,
        };
        let (number, previous): (i64, Vec<u8>) = (row.get("number")?, row.get("previous")?);
        let seal: Vec<u8> = row.get("seal")?;
        read.seal(number, &previous).verify(&seal, || format!("entry {number} of the audit of {}", read.tenant))?;
        Ok(read)
    }
}
