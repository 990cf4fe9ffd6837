//! Whose job is next: tenants take turns, so that nobody's queue is in another's way.
//!
//! Each tenant has the number of its last turn, and a claim serves the lowest number among those with a queued job. Who is
//! served gets a number above all others: until a tenant's next turn every other is served once at most, so a job at the
//! head of its tenant's queue waits for one claim of each other tenant and no more, whatever they queue and whenever.
//! Whoever queues for the first time starts at zero. Within a tenant the oldest job is first.
//!
//! Over PostgreSQL, claims that meet pass over a tenant that another serves or that is just queueing; it keeps its number,
//! and with it its place. Cost of a claim: one look into an index for each tenant passed over, whatever is queued.
//!
//! Checked by: `tests/service/turns.rs`, `tests/service/store_model.rs`.

use super::error::Failure;
use super::job::JobRow;
use super::job_state::JobState;
use super::query::{Connection, query};
use super::tenant::Tenant;

/// Gives a tenant a place among those who take turns. Nobody else queues for it until this transaction ends.
pub(super) async fn enter(connection: &mut Connection<'_>, tenant: &Tenant) -> Result<(), Failure> {
    let place = query("INSERT INTO turns (tenant, turn) VALUES ($1, 0) ON CONFLICT (tenant) DO NOTHING");
    connection.execute(place.bind(tenant.as_str())).await?;
    connection.lock(query("SELECT turn FROM turns WHERE tenant = $1").bind(tenant.as_str()).for_update()).await
}

/// The queued job whose turn it is, to be changed by this transaction alone; its tenant goes to the end of the line.
pub(super) async fn take(connection: &mut Connection<'_>) -> Result<Option<JobRow>, Failure> {
    let queued = JobState::Queued.as_str();
    // A subquery of one row is looked up for each tenant; `EXISTS` may become a join over everything that is queued.
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
