//! Names, notes and tags of policies and sessions.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;

use crate::http::gate::access::{CallerOf, LiveCalls};
use crate::http::gate::extract::{Id, JsonBody};
use crate::http::problem::ProblemDocument;
use crate::service::Service;
use crate::store::{Labelled, Labels, Relabel};

/// Changes the name, notes and tags of a policy: an absent field stays, and one that is null or empty is cleared.
#[utoipa::path(patch, path = "/policies/{id}", tag = "policies", params(("id" = String, Path, description = "The policy.")),
    request_body(content = Relabel, example = json!({ "name": "World, monthly", "tags": ["equity"] })),
    responses(
        (status = 200, description = "The name, notes and tags after the change.", body = Labels),
        (status = 404, description = "There is no such policy.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn of_policy(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
    JsonBody(change): JsonBody<Relabel>,
) -> Result<Json<Labels>, ProblemDocument> {
    Ok(Json(service.names.change(&caller, Labelled::Policy, &id, change).await?))
}

/// Changes the name, notes and tags of a session: an absent field stays, and one that is null or empty is cleared.
#[utoipa::path(patch, path = "/sessions/{id}", tag = "sessions", params(("id" = String, Path, description = "The session.")),
    request_body(content = Relabel, example = json!({ "name": "Ada", "notes": "Reports by post.", "tags": ["monthly"] })),
    responses(
        (status = 200, description = "The name, notes and tags after the change.", body = Labels),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn of_session(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
    JsonBody(change): JsonBody<Relabel>,
) -> Result<Json<Labels>, ProblemDocument> {
    Ok(Json(service.names.change(&caller, Labelled::Session, &id, change).await?))
}
