//! Events about reports that are missing: one for each kind and period of a session.

use std::collections::HashMap;

use futures_util::FutureExt;

use crate::store::engine::codec::{from_sql, to_sql};
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, StoreRow, query};
use crate::store::subscriptions::events::{EventKind, NewEvent, publish};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

impl Store {
    /// Returns how many reports each session of a tenant had when an event of this kind was last stored for it.
    pub async fn reminded(&self, tenant: &Tenant, kind: EventKind) -> Result<HashMap<String, usize>, StoreError> {
        let reminders = query(
            "SELECT reminders.session, observations FROM reminders
             JOIN sessions ON sessions.session = reminders.session
             WHERE sessions.tenant = $1 AND event = $2",
        );
        let decode = |rows: &[StoreRow]| {
            rows.iter().map(|row| Ok((row.get("session")?, from_sql(row.get("observations")?)?))).collect()
        };
        self.probe("listing reminders", reminders.bind(tenant.as_str()).bind(kind.as_str()), decode).await
    }

    /// Stores an event about the report after `observations` others of its session, and returns true, unless one of its
    /// kind was stored for that report before.
    pub async fn remind(&self, tenant: &Tenant, observations: usize, event: NewEvent) -> Result<bool, StoreError> {
        let tenant = tenant.clone();
        self.write("storing a reminder", move |connection| remind_once(connection, tenant, observations, event).boxed())
            .await
    }
}

async fn remind_once(
    mut connection: StoreConnection<'_>,
    tenant: Tenant,
    observations: usize,
    event: NewEvent,
) -> Result<bool, Failure> {
    // A session that was deleted meanwhile needs no report.
    let store = query(
        "INSERT INTO reminders (session, event, observations)
         SELECT session, $2, $3 FROM sessions WHERE session = $1 AND tenant = $4
         ON CONFLICT (session, event) DO UPDATE SET observations = excluded.observations
             WHERE reminders.observations < excluded.observations",
    );
    let store = store.bind(event.session.as_str()).bind(event.kind.as_str()).bind(to_sql(observations));
    if connection.execute(store.bind(tenant.as_str())).await? == 0 {
        return Ok(false);
    }
    publish(&mut connection, &tenant, &event).await?;
    Ok(true)
}
