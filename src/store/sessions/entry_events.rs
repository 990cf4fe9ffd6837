//! Appends an entry together with the events that it causes, in one transaction.

use futures_util::FutureExt;

use crate::store::engine::error::Failure;
use crate::store::engine::query::StoreConnection;
use crate::store::sessions::entries::{APPENDING, Append, EntryKind, EntryRow, append_next, take_room};
use crate::store::subscriptions::events::{NewEvent, publish};
use crate::store::tenants::audit::{Actor, AuditAction};
use crate::store::tenants::quotas::Quotas;
use crate::store::{Store, StoreError};

impl Store {
    /// Appends the entry like [`Store::append`], and stores its events if it was appended.
    ///
    /// # Errors
    /// Those of [`Store::append`].
    pub async fn append_with(&self, new: EntryRow, events: Vec<NewEvent>) -> Result<Append, StoreError> {
        if events.is_empty() && new.kind == EntryKind::Observation {
            return self.append_observation(new).await;
        }
        let (by, session) = ((self.quotas, self.actor.clone()), new.session.clone());
        self.write_to(&session, APPENDING, move |connection| append(connection, new, events, by).boxed()).await
    }
}

/// Appends an entry and, if no quota was reserved for it when its session was opened, reserves it and records the entry in
/// the audit. Stores the events before the totals of the tenant are taken, in the order in which every other writer locks them.
async fn append(
    mut connection: StoreConnection<'_>,
    new: EntryRow,
    events: Vec<NewEvent>,
    by: (Quotas, Actor),
) -> Result<Append, Failure> {
    let connection = &mut connection;
    let (append, tenant) = append_next(connection, &new).await?;
    if append != Append::Appended {
        return Ok(append);
    }
    for event in &events {
        publish(connection, &tenant, event).await?;
    }
    if new.kind != EntryKind::Observation {
        let outcome = format!("{} {} recorded", new.kind.counted(), new.number);
        take_room(connection, &tenant, &new.session, new.room(), by, (AuditAction::Correct, &outcome)).await?;
    }
    Ok(append)
}
