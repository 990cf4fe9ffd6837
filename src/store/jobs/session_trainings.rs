//! Trainings that sessions request for their renewals: sessions of one tenant that need the same policy share one job.
//!
//! Idempotency keys record the owners of a job, under names that no caller can send, because no header contains a line
//! break. A session's request names its job. So does the specification, which is the same text for every session. A
//! training that a caller queued is also named by its specification, so its policy serves sessions as well.
//!
//! A training made for sessions is cancelled once no session requests it. Only a few of them wait in a tenant's queue
//! at a time, and none counts towards the quota of queued jobs.
//!
//! Checked by: `tests/operation/renewal_scale.rs`.

use futures_util::FutureExt;

use crate::control::policy::content_hash;
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, StoreRow, query};
use crate::store::jobs::job::{JobRow, NewJob};
use crate::store::jobs::training_names::{
    OF_SESSION, TrainingRequest, name, next_renewal, of_specification, queued_for_sessions,
};
use crate::store::jobs::{cancel, count, insert, turns};
use crate::store::sessions::idempotency::FOR_SESSIONS;
use crate::store::tenants::audit::Actor;
use crate::store::tenants::quotas::Quotas;
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// The most trainings for sessions in a tenant's queue at a time; the next is queued once one begins. A worker runs one
/// at a time, so more would only delay the tenant's own jobs.
const QUEUED_FOR_SESSIONS: i64 = 8;

/// The answer to a session's request.
#[derive(Debug, Clone, PartialEq)]
pub enum SessionTraining {
    /// The job that is training its policy, or has trained it.
    Job(JobRow),
    /// The queue already holds the most trainings for sessions.
    Later,
    /// The session is gone, or was already renewed.
    Obsolete,
}

impl Store {
    /// Finds the job that trains the same specification as `new`, for a session; queues `new` if there is none.
    ///
    /// # Errors
    /// [`StoreError::OverQuota`] if the tenant's quota of bytes is used up.
    pub async fn train_for_session(
        &self,
        new: NewJob,
        request: TrainingRequest,
    ) -> Result<SessionTraining, StoreError> {
        let by = (self.quotas, self.actor.clone());
        self.write("creating a job", move |connection| train(connection, new, request, by).boxed()).await
    }

    /// Cancels the trainings made for sessions that no session requests any more, and returns their jobs.
    pub async fn cancel_unrequested(&self, now_ms: i64) -> Result<Vec<String>, StoreError> {
        let find = query(
            "SELECT DISTINCT jobs.job, jobs.tenant FROM jobs JOIN idempotency_keys AS named ON named.job = jobs.job
             WHERE jobs.state IN ('queued', 'running') AND NOT jobs.cancel_requested
                 AND substr(named.idempotency_key, 1, 7) = $1
                 AND NOT EXISTS (SELECT 1 FROM idempotency_keys AS request WHERE request.job = jobs.job
                                 AND substr(request.idempotency_key, 1, 8) = $2)",
        );
        let found = |row: &StoreRow| Ok((row.get("job")?, Tenant::stored(&row.get::<String>("tenant")?)));
        let find = find.bind(FOR_SESSIONS).bind(OF_SESSION);
        let found: Vec<(String, Tenant)> = self
            .list("finding trainings that no session requests", find, |rows| rows.iter().map(found).collect())
            .await?;
        let mut cancelled = Vec::new();
        for (job, tenant) in found {
            let (actor, of) = (self.actor.clone(), (tenant, job.clone()));
            let is_cancelled = self.write("cancelling a job", move |connection| {
                cancel_if_unrequested(connection, of, actor, now_ms).boxed()
            });
            if is_cancelled.await? {
                cancelled.push(job);
            }
        }
        Ok(cancelled)
    }
}

/// Finds or queues the training. The tenant's turn stays locked, as when a caller queues a job.
async fn train(
    mut connection: StoreConnection<'_>,
    new: NewJob,
    request: TrainingRequest,
    (quotas, actor): (Quotas, Actor),
) -> Result<SessionTraining, Failure> {
    let connection = &mut connection;
    turns::enter(connection, &new.tenant).await?;
    let named = query(
        "SELECT jobs.* FROM idempotency_keys JOIN jobs ON jobs.job = idempotency_keys.job
         WHERE idempotency_keys.tenant = $1 AND idempotency_key = $2",
    );
    if let Some(row) = connection.row(named.bind(new.tenant.as_str()).bind(request.key())).await? {
        return JobRow::from_row(&row).map(SessionTraining::Job);
    }
    if !is_awaited(connection, &new.tenant, &request).await? {
        return Ok(SessionTraining::Obsolete);
    }
    let specification = content_hash(new.request_json.as_bytes());
    if let Some(row) = of_specification(connection, &new.tenant, &specification).await? {
        name(connection, &new.tenant, &row.job, &request.key()).await?;
        return Ok(SessionTraining::Job(row));
    }
    if queued_for_sessions(connection, &new.tenant).await? >= QUEUED_FOR_SESSIONS {
        return Ok(SessionTraining::Later);
    }
    let bytes = insert(connection, &new).await?;
    for key in [request.key(), format!("{FOR_SESSIONS}{specification}")] {
        name(connection, &new.tenant, &new.job, &key).await?;
    }
    count(connection, &new, bytes, quotas, actor).await.map(SessionTraining::Job)
}

/// Returns whether the session exists and waits for this renewal; it stays so until this transaction ends.
async fn is_awaited(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    request: &TrainingRequest,
) -> Result<bool, Failure> {
    let session = query("SELECT session FROM sessions WHERE session = $1 AND tenant = $2");
    let session = session.bind(request.session.as_str()).bind(tenant.as_str()).for_update_but_references();
    if connection.row(session).await?.is_none() {
        return Ok(false);
    }
    next_renewal(connection, &request.session).await.map(|next| next == request.renewal)
}

/// Cancels a job that no session requests. The tenant's turn is locked, so that no session requests it in between.
async fn cancel_if_unrequested(
    mut connection: StoreConnection<'_>,
    (tenant, job): (Tenant, String),
    actor: Actor,
    now_ms: i64,
) -> Result<bool, Failure> {
    turns::enter(&mut connection, &tenant).await?;
    let request =
        query("SELECT 1 AS one FROM idempotency_keys WHERE job = $1 AND substr(idempotency_key, 1, 8) = $2 LIMIT 1");
    if connection.row(request.bind(job.as_str()).bind(OF_SESSION)).await?.is_some() {
        return Ok(false);
    }
    cancel(connection, job, actor, now_ms).await.map(|row| row.is_some())
}
