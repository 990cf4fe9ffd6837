//! The event stream of a job: each event carries the whole state, not a change.
//!
//! The id of an event is made of the state and the progress shown. So a client that reconnects with `Last-Event-ID`
//! misses nothing and sees nothing twice, even across a restart of the service. A client that has seen the terminal
//! state gets 204, which tells an `EventSource` not to reconnect.
//!
//! The number of open streams of a tenant is limited, and each stream ends after some minutes. Its client reconnects
//! with the id of the last event, and loses nothing.
//!
//! A job that another replica runs is followed by polling the store: finished steps appear, the points inside a step do
//! not. Notifications of PostgreSQL would be faster, but can be lost, so polling would still be needed.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use tokio::sync::watch;

use crate::http::gate::access::{CallerOf, ReadCalls};
use crate::http::gate::extract::Id;
use crate::http::problem::ProblemDocument;
use crate::http::routes::wire;
use crate::service::Service;
use crate::service::callers::allowance::StreamPlace;
use crate::service::callers::keys::Caller;
use crate::service::error::ServiceError;
use crate::store::JobState;

/// Interval within which a change by another process is noticed.
const POLL: Duration = Duration::from_secs(1);
const KEEP_ALIVE: Duration = Duration::from_secs(15);
/// Header that makes buffering proxies pass on each event as it comes; nginx buffers unless this is set.
const UNBUFFERED: [(&str, &str); 1] = [("x-accel-buffering", "no")];

struct JobStream {
    service: Arc<Service>,
    caller: Arc<Caller>,
    job: String,
    changes: watch::Receiver<u64>,
    last_id: String,
    last_state: Option<JobState>,
    place: StreamPlace,
}

/// Follows a job: events `state` and `progress` carry the job. The stream ends at a terminal state.
#[utoipa::path(get, path = "/jobs/{id}/events", tag = "jobs",
    params(("id" = String, Path, description = "The job."),
           ("Last-Event-ID" = Option<String>, Header, description = "The id of the last event seen.")),
    responses(
        (status = 200, description = "Server-sent events, each with the job as JSON. A stream ends after some minutes; reconnect to resume it.", body = String, content_type = "text/event-stream"),
        (status = 204, description = "The client has already seen the final state."),
        (status = 404, description = "There is no such job.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn follow(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Id(job): Id,
    headers: HeaderMap,
) -> Result<Response, ProblemDocument> {
    // First of all, because a refused stream must cost the store nothing.
    let place = caller.allowance.stream().map_err(ServiceError::from)?;
    let changes = service.jobs.changes();
    let now = wire::Job::from(service.jobs.get(&caller.tenant, &job).await?);
    let last_id = headers.get("last-event-id").and_then(|id| id.to_str().ok()).unwrap_or("").to_owned();
    if now.state.is_terminal() && last_id == event_id(&now) {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let caller = caller.caller;
    let events = JobStream { service, caller, job, changes, last_id, last_state: None, place };
    let events = stream::unfold(Some(events), |events| async { events?.next().await });
    let stream = Sse::new(events).keep_alive(KeepAlive::new().interval(KEEP_ALIVE));
    Ok((UNBUFFERED, stream).into_response())
}

impl JobStream {
    /// Returns the next event that differs from the last. Returns none once the job or the service ends, the key is
    /// revoked, or the stream is old.
    async fn next(mut self) -> Option<(Result<Event, Infallible>, Option<Self>)> {
        while !self.caller.has_ended() {
            self.changes.mark_unchanged();
            let job = wire::Job::from(self.service.jobs.get(&self.caller.tenant, &self.job).await.ok()?);
            let id = event_id(&job);
            if id != self.last_id {
                let name = if self.last_state == Some(job.state) { "progress" } else { "state" };
                let event = Event::default().id(&id).event(name).json_data(&job).ok()?;
                (self.last_id, self.last_state) = (id, Some(job.state));
                return Some((Ok(event), (!job.state.is_terminal()).then_some(self)));
            }
            tokio::select! {
                _ = self.changes.changed() => {}
                () = tokio::time::sleep(POLL) => {}
                () = tokio::time::sleep_until(self.place.until.into()) => return None,
                () = self.service.shutdown.begun() => return None,
            }
        }
        None
    }
}

fn event_id(job: &wire::Job) -> String {
    let points = job.progress.points_done.unwrap_or(0);
    let phase = job.progress.phase.map_or("", |phase| match phase {
        crate::control::progress::Phase::Solving => "s",
        crate::control::progress::Phase::Fitting => "f",
        crate::control::progress::Phase::Simulating => "p",
    });
    format!("{}-{}-{points}{phase}", job.state.as_str(), job.progress.steps_done)
}
