//! Stores a session that was exported by another store or for another tenant.

use futures_util::FutureExt;

use super::{CreateSession, SessionRow, insert};
use crate::store::engine::codec::{encode_reals, to_sql};
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, query};
use crate::store::labels::{self, Relabel};
use crate::store::sessions::entries::{self, Append, EntryKind, EntryRow};
use crate::store::sessions::renewals::{self, RenewalTarget};
use crate::store::sessions::words::{self, Labelled, Worded};
use crate::store::tenants::audit::{Actor, AuditAction};
use crate::store::tenants::audit_chain;
use crate::store::tenants::quotas::{self, Quotas, Usage};
use crate::store::{Store, StoreError, policies};

/// A session with everything that was recorded in it.
#[derive(Debug, Clone)]
pub struct SessionImport {
    pub row: SessionRow,
    pub labels: Relabel,
    /// In the order they were recorded.
    pub entries: Vec<EntryRow>,
    /// The result of each renewal among the entries.
    pub renewals: Vec<RenewalTarget>,
}

impl Store {
    /// Stores a session with its entries, its renewals and its labels, all or nothing. The seals are made anew; they
    /// equal those of the session's first store if its tenant has the same name.
    ///
    /// # Errors
    /// [`StoreError::OverQuota`] if the tenant's quota of sessions or of bytes is used up.
    pub async fn import_session(&self, import: SessionImport) -> Result<CreateSession, StoreError> {
        let (by, session) = ((self.quotas, self.actor.clone()), import.row.session.clone());
        self.write_to(&session, "importing a session", move |connection| store(connection, import, by).boxed()).await
    }
}

async fn store(
    mut connection: StoreConnection<'_>,
    import: SessionImport,
    (quotas, actor): (Quotas, Actor),
) -> Result<CreateSession, Failure> {
    let (connection, SessionImport { row, labels, entries, renewals }) = (&mut connection, import);
    for target in &renewals {
        if !policies::lock(connection, &target.policy).await?
            || !policies::is_owned(connection, &row.tenant, &target.policy).await?
        {
            return Ok(CreateSession::NoPolicy);
        }
    }
    let sequence = match insert(connection, &row).await? {
        Ok(sequence) => sequence,
        Err(refused) => return Ok(refused),
    };
    let of = Worded { tenant: &row.tenant, kind: Labelled::Session, sequence };
    words::add(connection, of, [words::identifying(&row.session).as_str()]).await?;
    let room = append(connection, &row, &entries, &renewals).await?;
    let start_bytes = quotas::length(&encode_reals(&row.initial_history)) + quotas::length(row.plan_json.as_bytes());
    let mut usage = Usage::of_session(start_bytes, to_sql(row.horizon).saturating_add(room), to_sql(row.assets));
    if !labels.is_empty() {
        usage = usage.and(labels::put(connection, of, &row.session, &labels).await?.1);
    }
    quotas::take(connection, &row.tenant, usage, quotas).await?;
    let outcome = format!("imported under policy {} with {} entries", row.policy, entries.len());
    audit_chain::record(connection, (quotas, &actor), &row.tenant, AuditAction::ImportSession, &row.session, &outcome)
        .await?;
    Ok(CreateSession::Created)
}

/// Appends the entries of a new session. Returns the number of entries that they count as, beyond the periods that the
/// session began with.
async fn append(
    connection: &mut StoreConnection<'_>,
    row: &SessionRow,
    entries: &[EntryRow],
    renewals: &[RenewalTarget],
) -> Result<i64, Failure> {
    let (mut room, mut targets) = (0_i64, renewals.iter());
    for entry in entries {
        if entries::append_next(connection, entry).await?.0 != Append::Appended {
            return Err(Failure::Corrupt(format!("entry {} of session {}", entry.entry, row.session)));
        }
        room = room.saturating_add(match entry.kind {
            EntryKind::Observation => 0,
            EntryKind::Correction => entry.room(),
            EntryKind::Renewal => {
                let Some(target) = targets.next() else {
                    return Err(Failure::Corrupt(format!("a renewal of session {}", row.session)));
                };
                renewals::refer(connection, entry, target).await?;
                1 + to_sql(target.periods)
            }
        });
    }
    let widen = query("UPDATE sessions SET room = room + $1 WHERE session = $2");
    connection.execute(widen.bind(room).bind(row.session.as_str())).await?;
    Ok(room)
}
