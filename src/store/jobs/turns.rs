//! The order of claims: tenants take turns, so that no tenant's queue delays another's.
//!
//! Each tenant has the number of its last turn, and a claim serves the lowest number among the tenants with a queued
//! job. The served tenant gets a number above all others. Until its next turn every other tenant is served at most
//! once. A job at the head of its tenant's queue therefore waits for at most one claim of each other tenant, whatever
//! they queue and whenever. A tenant that queues for the first time starts at zero. Within a tenant the oldest job is
//! first.
//!
//! Over PostgreSQL, concurrent claims skip a tenant that another claim serves or that is just queueing; it keeps its
//! number, and so its turn. Cost of a claim: one index lookup for each tenant that it skips, however much is queued.
//!
//! Checked by: `tests/service/turns.rs`, `tests/service/store_model.rs`.

use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, query};
use crate::store::jobs::job::JobRow;
use crate::store::jobs::state::JobState;
use crate::store::tenants::tenant::Tenant;

/// Adds a tenant to those that take turns, and locks its turn: no other transaction queues for it until this one ends.
pub(in crate::store) async fn enter(connection: &mut StoreConnection<'_>, tenant: &Tenant) -> Result<(), Failure> {
    let place = query("INSERT INTO turns (tenant, turn) VALUES ($1, 0) ON CONFLICT (tenant) DO NOTHING");
    connection.execute(place.bind(tenant.as_str())).await?;
    connection.lock(query("SELECT turn FROM turns WHERE tenant = $1").bind(tenant.as_str()).for_update()).await
}

/// Finds the queued job whose turn it is and locks it for this transaction; its tenant goes to the end of the order.
pub(in crate::store) async fn take(connection: &mut StoreConnection<'_>) -> Result<Option<JobRow>, Failure> {
    let queued = JobState::Queued.as_str();
    // A subquery of one row is looked up for each tenant; `EXISTS` may become a join over all queued jobs.
    let next = query(
        "SELECT tenant FROM turns
         WHERE (SELECT 1 FROM jobs WHERE jobs.tenant = turns.tenant AND jobs.state = $1 LIMIT 1) IS NOT NULL
         ORDER BY turn, tenant LIMIT 1",
    );
    let Some(next) = connection.row(next.bind(queued).for_update_of_free()).await? else { return Ok(None) };
    let tenant: String = next.get("tenant")?;
    let oldest = query("SELECT * FROM jobs WHERE tenant = $1 AND state = $2 ORDER BY sequence LIMIT 1");
    let oldest = oldest.bind(tenant.as_str()).bind(queued).for_update_of_free();
    let Some(row) = connection.row(oldest).await? else { return Ok(None) };
    let serve = query("UPDATE turns SET turn = (SELECT max(turn) + 1 FROM turns) WHERE tenant = $1");
    connection.execute(serve.bind(tenant)).await?;
    JobRow::from_row(&row).map(Some)
}
