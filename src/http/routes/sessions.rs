//! Live sessions: open a session, report, get advice.

use std::sync::Arc;
use std::time::Instant;

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use utoipa::ToSchema;

use crate::control::policy::advisor::AdviceMode;
use crate::http::gate::access::{self, CallerAsking, CallerOf, LiveCalls, ReadCalls};
use crate::http::gate::bodies;
use crate::http::gate::extract::{Id, JsonBody};
use crate::http::problem::ProblemDocument;
use crate::http::routes::action::ActionAnswer;
use crate::http::routes::jobs::idempotency_key;
use crate::http::routes::wire;
use crate::service::Service;
use crate::service::advice::action::AdviceOptions;
use crate::service::advice::explain::Explain;
use crate::service::callers::allowance::Class;
use crate::service::entries::answer::CorrectionAnswer;
use crate::service::entries::history::HistoryAnswer;
use crate::service::entries::report::Correct;
use crate::service::metrics::ACTION_SECONDS;
use crate::service::process::memory::Large;
use crate::service::sessions::opening::SessionStart;
use crate::service::sessions::plan::{Renew, RenewalAnswer};
use crate::store::{Labels, Relabel};

/// Opens a session.
#[utoipa::path(post, path = "/sessions", tag = "sessions",
    request_body(content = wire::OpenSession, example = json!({
        "policy": "2c882522ef92e64d9ad1cb0dd2b4ff4e7c3b0c1e8f5d2a6b9c0d1e2f3a4b5c6d", "wealth": 2500.0
    })),
    params(("Idempotency-Key" = Option<String>, Header,
            description = "Repeating the key with the same body returns the same session and answer, until the session is deleted.")),
    responses(
        (status = 201, description = "Opened.", body = wire::Session, headers(("Location" = String, description = "The session."))),
        (status = 404, description = "There is no such policy.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 409, description = "The key was used with another body.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn open(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    headers: HeaderMap,
    JsonBody(request): JsonBody<wire::OpenSession>,
) -> Result<Response, ProblemDocument> {
    let wire::OpenSession { policy, history, wealth, holding, holdings, state, renew, rolling, name, notes, tags } =
        request;
    let labels = Relabel { name, notes, tags };
    let called = Labels::default().after(&labels);
    let start = SessionStart { policy, history, wealth, holding, holdings, state, renew, rolling, labels };
    let live = service.sessions.open(&caller, start, idempotency_key(&headers)?, &caller.turn).await?;
    let session = wire::Session { labels: called, ..live.into() };
    let location = [(header::LOCATION, format!("/sessions/{}", session.session))];
    Ok((StatusCode::CREATED, location, Json(session)).into_response())
}

/// Returns a session: its coming period, wealth and state.
#[utoipa::path(get, path = "/sessions/{id}", tag = "sessions", params(("id" = String, Path, description = "The session.")),
    responses(
        (status = 200, description = "The session.", body = wire::Session),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn get(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Id(id): Id,
) -> Result<Response, ProblemDocument> {
    let live = service.sessions.get(&caller.tenant, &id).await?;
    let renewal = service.sessions.renewal(&live).await?;
    let labels = service.names.of(&caller.tenant, &id).await?;
    bodies::written(&service, Large::from(wire::Session { renewal, labels, ..live.into() })).await
}

/// Returns the start of a session and everything recorded in it: what was reported, the answers at that time, and the
/// answers that would be given now.
#[utoipa::path(get, path = "/sessions/{id}/history", tag = "sessions", params(("id" = String, Path, description = "The session.")),
    responses(
        (status = 200, description = "The history.", body = HistoryAnswer),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn history(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Id(id): Id,
) -> Result<Response, ProblemDocument> {
    bodies::written(&service, service.sessions.history(&caller.tenant, &id, &caller.turn).await?).await
}

/// Corrects a period: reports it anew, inserts one that was skipped, or removes one. Each correction is recorded
/// exactly once, and is durable before it is answered. The original reports and answers stay on record.
#[utoipa::path(post, path = "/sessions/{id}/corrections", tag = "sessions",
    params(("id" = String, Path, description = "The session.")),
    request_body(content = Correct, example = json!({
        "correction": 1, "period": 3, "simple_return": 0.011, "reason": "the index was revised"
    })),
    responses(
        (status = 200, description = "Recorded. Repeating the correction with the same content returns the same answer.", body = CorrectionAnswer),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 409, description = "The correction was reported with other content or is not the next; or it is probably a mistake and is not confirmed.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn correct(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
    JsonBody(correction): JsonBody<Correct>,
) -> Result<Response, ProblemDocument> {
    let corrected = service.sessions.correct(&caller, &id, &correction, &caller.turn).await?;
    bodies::recorded(&service, corrected).await
}

/// Continues a session with another policy from the coming period. Each renewal is recorded exactly once, and is
/// durable before it is answered.
#[utoipa::path(post, path = "/sessions/{id}/renewals", tag = "sessions",
    params(("id" = String, Path, description = "The session.")),
    request_body(content = Renew, example = json!({
        "renewal": 1, "policy": "2c882522ef92e64d9ad1cb0dd2b4ff4e7c3b0c1e8f5d2a6b9c0d1e2f3a4b5c6d", "window": 240
    })),
    responses(
        (status = 200, description = "Recorded. Repeating the renewal with the same content returns the same answer.", body = RenewalAnswer),
        (status = 404, description = "There is no such session or policy.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 409, description = "The renewal was reported with other content, or is not the next.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn renew(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
    JsonBody(renewal): JsonBody<Renew>,
) -> Result<Response, ProblemDocument> {
    let (by, turn) = (caller.actor(), Some(&*caller.turn));
    bodies::recorded(&service, service.sessions.renew(&caller.tenant, by, &id, &renewal, turn).await?).await
}

/// Deletes a session and everything recorded in it.
#[utoipa::path(delete, path = "/sessions/{id}", tag = "sessions", params(("id" = String, Path, description = "The session.")),
    responses(
        (status = 204, description = "Deleted."),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn delete(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
) -> Result<StatusCode, ProblemDocument> {
    service.sessions.delete(&caller, &id).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Query of `/action`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActionQuery {
    session: String,
    mode: Option<Mode>,
    explain: Option<Explain>,
    sensitivity: Option<Flag>,
}

/// A boolean query parameter, which arrives as text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Flag {
    True,
    False,
}

#[derive(Debug, Clone, Copy, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum Mode {
    Surrogate,
    Resolve,
}

impl access::ClassedQuery for ActionQuery {
    /// Returns the class. Advice from the surrogate that turns out to need a solve becomes heavy at that point.
    fn class(&self) -> Class {
        match (self.mode, self.explain) {
            (Some(Mode::Resolve), _) | (_, Some(Explain::WorstCase)) => Class::Heavy,
            (Some(Mode::Surrogate) | None, None) if self.sensitivity == Some(Flag::True) => Class::Heavy,
            (Some(Mode::Surrogate) | None, None) => Class::Live,
        }
    }
}

/// Returns the robust allocation for the coming period.
#[utoipa::path(get, path = "/action", tag = "sessions",
    params(("session" = String, Query, description = "The session."),
           ("mode" = inline(Option<Mode>), Query, description = "`surrogate` (default) or `resolve`."),
           ("explain" = inline(Option<Explain>), Query, description = "`worst_case`: re-solve, and show the worst-case law."),
           ("sensitivity" = Option<bool>, Query, description = "`true`: also return how close the advice is to changing.")),
    responses(
        (status = 200, description = "The allocation.", body = ActionAnswer),
        (status = 400, description = "A parameter breaks a rule.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 409, description = "The session has reached its horizon.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "The sensitivity is not available for this session.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn action(
    State(service): State<Arc<Service>>,
    CallerAsking(caller, ask): CallerAsking<ActionQuery>,
) -> Result<Response, ProblemDocument> {
    let (mode, label) = match (ask.explain, ask.mode) {
        (Some(Explain::WorstCase), _) => (AdviceMode::Resolve, "explain"),
        (None, Some(Mode::Resolve)) => (AdviceMode::Resolve, "resolve"),
        (None, _) => (AdviceMode::Surrogate, "surrogate"),
    };
    let sensitivity = ask.sensitivity == Some(Flag::True);
    let label = if sensitivity { "sensitivity" } else { label };
    let question = AdviceOptions { mode, explain: ask.explain.is_some(), sensitivity };
    let started = Instant::now();
    let action = service.sessions.action(&caller.tenant, &ask.session, question, &caller.turn).await?;
    metrics::histogram!(ACTION_SECONDS, "mode" => label).record(started.elapsed().as_secs_f64());
    bodies::written(&service, action.map(|action| ActionAnswer::new(ask.session, action))).await
}
