//! Links to a client's letter.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::http::gate::access::{CallerOf, LiveCalls, ReadCalls};
use crate::http::gate::extract::{Id, JsonBody, Parameters};
use crate::http::problem::ProblemDocument;
use crate::http::routes::letter::sent;
use crate::http::site::asset::HTML;
use crate::http::site::letter as site;
use crate::service::Service;
use crate::service::letter::links::{MadeLink, MakeLink};
use crate::store::LinkRow;

/// A link, without its secret.
#[derive(Debug, Serialize, ToSchema)]
pub struct LetterLink {
    pub link: String,
    /// In milliseconds since 1970.
    pub created_ms: i64,
    /// In milliseconds since 1970.
    pub expires_ms: i64,
}

/// The links of a session, oldest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct LetterLinks {
    pub links: Vec<LetterLink>,
}

/// Makes a link under which a client reads the present letter of one session without a key, until it expires or is
/// deleted. A session has at most ten.
#[utoipa::path(post, path = "/sessions/{id}/links", tag = "sessions",
    params(("id" = String, Path, description = "The session.")),
    request_body(content = MakeLink, example = json!({ "days": 31, "letter": { "firm": { "name": "Example Advisers" }, "currency": "EUR" } })),
    responses(
        (status = 201, description = "Made.", body = MadeLink),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule, or the session is of a declared problem.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn make(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
    JsonBody(new): JsonBody<MakeLink>,
) -> Result<Response, ProblemDocument> {
    Ok((StatusCode::CREATED, Json(service.make_link(&caller, &id, new).await?)).into_response())
}

/// Lists the links of a session, also those that have expired.
#[utoipa::path(get, path = "/sessions/{id}/links", tag = "sessions",
    params(("id" = String, Path, description = "The session.")),
    responses(
        (status = 200, description = "The links.", body = LetterLinks),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn list(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Id(id): Id,
) -> Result<Json<LetterLinks>, ProblemDocument> {
    let shown = |LinkRow { link, created_ms, expires_ms, .. }| LetterLink { link, created_ms, expires_ms };
    let links = service.links(&caller.tenant, &id).await?.into_iter().map(shown).collect();
    Ok(Json(LetterLinks { links }))
}

/// Deletes a link; it leads nowhere from then on.
#[utoipa::path(delete, path = "/links/{id}", tag = "sessions", params(("id" = String, Path, description = "The link.")),
    responses(
        (status = 204, description = "Deleted."),
        (status = 404, description = "There is no such link.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn delete(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
) -> Result<StatusCode, ProblemDocument> {
    service.delete_link(&caller, &id).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Query of a linked letter.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinkQuery {
    link: String,
}

/// Returns the present letter that a link leads to, as a page for a browser.
#[utoipa::path(get, path = "/letter", tag = "sessions",
    params(("link" = String, Query, description = "The secret of the link.")),
    responses(
        (status = 200, description = "The letter.", body = String, content_type = "text/html"),
        (status = 404, description = "The link is unknown, was deleted or has expired; a page that says so.", body = String, content_type = "text/html")))]
pub async fn read(
    State(service): State<Arc<Service>>,
    Parameters(query): Parameters<LinkQuery>,
) -> Result<Response, ProblemDocument> {
    match service.linked_letter(&query.link).await? {
        Some(letter) => sent(&service, &letter).await,
        None => Ok((StatusCode::NOT_FOUND, [(header::CONTENT_TYPE, HTML)], site::GONE).into_response()),
    }
}
