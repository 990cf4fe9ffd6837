//! Sessions as documents, by which they move to another service or tenant.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

use crate::http::gate::access::{CallerOf, HeavyCalls, ReadCalls};
use crate::http::gate::extract::{Id, JsonBytes};
use crate::http::gate::{bodies, decode};
use crate::http::problem::ProblemDocument;
use crate::http::routes::wire;
use crate::service::Service;

/// Returns a session as one document: its start, its labels and everything recorded in it, with their hash. Its policies
/// are exported by themselves.
#[utoipa::path(get, path = "/sessions/{id}/export", tag = "sessions", params(("id" = String, Path, description = "The session.")),
    responses(
        (status = 200, description = "The document.", body = serde_json::Value),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn export(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Id(id): Id,
) -> Result<Response, ProblemDocument> {
    bodies::written(&service, service.sessions.export(&caller.tenant, &id).await?).await
}

/// Stores an exported session under its name, once its policies are imported. It is replayed first, and must lead to the
/// state that the document says.
#[utoipa::path(post, path = "/sessions/import", tag = "sessions", request_body = serde_json::Value,
    responses(
        (status = 201, description = "The session is stored.", body = wire::Session,
            headers(("Location" = String, description = "The session."))),
        (status = 404, description = "There is no such policy.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 409, description = "The session exists.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "The document is not that of a session, or was changed.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn import(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    body: JsonBytes,
) -> Result<Response, ProblemDocument> {
    let document = body.decoded(decode::object).await?;
    let live = service.sessions.import(&caller, document, &caller.turn).await?;
    let labels = service.names.of(&caller.tenant, &live.row.session).await?;
    let session = wire::Session { labels, ..live.into() };
    let location = [(header::LOCATION, format!("/sessions/{}", session.session))];
    Ok((StatusCode::CREATED, location, Json(session)).into_response())
}
