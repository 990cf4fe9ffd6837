//! The audit: an entry for every change that a caller makes. The entry is written in the transaction of the change, so
//! an entry exists if and only if the change happened. [`crate::store::tenants::audit_chain`] writes and keeps the entries.
//!
//! Observations have no audit entry. They are most of what is ever written, and an observation's own row already serves
//! as one: it is appended once, numbered and sealed, and the seal covers the key that reported it. [`Store::deeds`]
//! shows both.
//!
//! Not done, and why:
//! - Entries for rejected calls. They change nothing, and anybody could write entries by being rejected. The request
//!   log names their keys, and metrics count them by tenant.
//! - Entries for what jobs and the service itself do later. A job's row records how it ended, and its audit entry
//!   records who requested it.

use std::sync::Arc;

use crate::store::engine::codec::{Seal, hexadecimal, to_sql};
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreRow, query};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// The caller that changes something, and the time of the change.
#[derive(Debug, Clone, PartialEq)]
pub struct Actor {
    /// The name of the key; empty if no key was required.
    pub key: Arc<str>,
    /// The roles of the key, or a word that replaces them if there is no key.
    pub roles: Arc<str>,
    pub at_ms: i64,
}

impl Actor {
    /// Returns the actor for a person who runs a command on the store itself.
    pub fn operator(at_ms: i64) -> Self {
        Actor { key: "".into(), roles: "operator".into(), at_ms }
    }

    /// Returns the actor for a change that the service makes by itself.
    pub fn service(at_ms: i64) -> Self {
        Actor { key: "".into(), roles: "service".into(), at_ms }
    }

    /// Returns the chain that holds this actor's entries: named by the key, or by `roles` if there is no key.
    pub(in crate::store) fn chain(&self) -> &str {
        if self.key.is_empty() { &self.roles } else { &self.key }
    }

    /// Returns true for a caller, false for an operator or the service itself.
    pub(super) fn is_caller(&self) -> bool {
        !matches!(self.chain(), "operator" | "service")
    }
}

/// A kind of change that the audit records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AuditAction {
    OpenSession,
    ImportSession,
    Observe,
    Correct,
    Renew,
    LabelSession,
    CreateLink,
    DeleteLink,
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
    Subscribe,
    RotateSecret,
    Resend,
    Unsubscribe,
    CutAudit,
    Repair,
}

impl AuditAction {
    /// The name on the wire and in SQL.
    pub fn as_str(self) -> &'static str {
        match self {
            AuditAction::OpenSession => "session.open",
            AuditAction::ImportSession => "session.import",
            AuditAction::Observe => "session.observe",
            AuditAction::Correct => "session.correct",
            AuditAction::Renew => "session.renew",
            AuditAction::LabelSession => "session.label",
            AuditAction::CreateLink => "session.link",
            AuditAction::DeleteLink => "session.unlink",
            AuditAction::DeleteSession => "session.delete",
            AuditAction::QueueJob => "job.queue",
            AuditAction::CancelJob => "job.cancel",
            AuditAction::DeleteJob => "job.delete",
            AuditAction::ImportPolicy => "policy.import",
            AuditAction::LabelPolicy => "policy.label",
            AuditAction::DeletePolicy => "policy.delete",
            AuditAction::CreateKey => "key.create",
            AuditAction::RotateKey => "key.rotate",
            AuditAction::RevokeKey => "key.revoke",
            AuditAction::Subscribe => "subscription.create",
            AuditAction::RotateSecret => "subscription.rotate",
            AuditAction::Resend => "subscription.resend",
            AuditAction::Unsubscribe => "subscription.delete",
            AuditAction::CutAudit => "audit.cut",
            AuditAction::Repair => "store.repair",
        }
    }
}

/// One recorded change.
#[derive(Debug, Clone, PartialEq)]
pub struct AuditRow {
    /// Order over all tenants; the cursor of [`Store::deeds`]. It is 0 for an observation.
    pub sequence: i64,
    pub tenant: Tenant,
    pub key: String,
    pub roles: String,
    pub deed: String,
    /// The thing that was changed.
    pub object: String,
    /// The result of the change.
    pub outcome: String,
    pub at_ms: i64,
    /// Counts from 1 in the chain of the key; for an observation, in its session.
    pub number: i64,
    /// Covers every field except the sequence, and the seal of the entry before; in hexadecimal digits.
    pub seal: String,
}

/// Selects audit entries; an empty filter selects all of them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AuditFilter {
    pub tenant: Option<Tenant>,
    pub object: Option<String>,
}

impl Store {
    /// Returns at most `limit` entries, newest first. `after` is the `sequence` of the last row of the page before. If
    /// the object is a session, the first page also holds up to `limit` of its observations.
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
        let decode = |rows: &[StoreRow]| rows.iter().map(AuditRow::from_row).collect();
        let mut page: Vec<AuditRow> = self.list("reading the audit", page, decode).await?;
        if let (Some(object), None) = (&filter.object, after) {
            let observed = self.observed(object, limit).await?;
            let is_wanted = |row: &AuditRow| filter.tenant.as_ref().is_none_or(|tenant| row.tenant == *tenant);
            page.extend(observed.into_iter().filter(is_wanted));
            page.sort_by_key(|row| std::cmp::Reverse(row.at_ms));
        }
        Ok(page)
    }
}

impl AuditRow {
    pub(super) fn chained(&self, previous: &[u8]) -> Seal {
        Seal::of("audit")
            .bytes(previous)
            .text(self.tenant.as_str())
            .integer(self.number)
            .text(&self.key)
            .text(&self.roles)
            .text(&self.deed)
            .text(&self.object)
            .text(&self.outcome)
            .integer(self.at_ms)
    }

    pub(in crate::store) fn from_row(row: &StoreRow) -> Result<Self, Failure> {
        let (previous, seal): (Vec<u8>, Vec<u8>) = (row.get("previous")?, row.get("seal")?);
        let read = AuditRow {
            sequence: row.get("sequence")?,
            tenant: Tenant::stored(&row.get::<String>("tenant")?),
            key: row.get("access_key")?,
            roles: row.get("roles")?,
            deed: row.get("deed")?,
            object: row.get("object")?,
            outcome: row.get("outcome")?,
            at_ms: row.get("at_ms")?,
            number: row.get("number")?,
            seal: hexadecimal(&seal),
        };
        let chain: String = row.get("chain")?;
        let is_own =
            Actor { key: read.key.as_str().into(), roles: read.roles.as_str().into(), at_ms: 0 }.chain() == chain;
        let what = || entry(&chain, read.tenant.as_str(), read.number);
        if is_own {
            read.chained(&previous).verify(&seal, what)?
        } else {
            return Err(Failure::Corrupt(what()));
        }
        Ok(read)
    }
}

/// Returns the name of an entry for damage reports.
pub(in crate::store) fn entry(chain: &str, tenant: &str, number: i64) -> String {
    format!("entry {number} of {chain} in the audit of {tenant}")
}
