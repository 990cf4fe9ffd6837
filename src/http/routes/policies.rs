//! Policies: immutable, identified by the hash of their bytes.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;

use crate::control::policy::surface::{Surface, SurfaceAxis};
use crate::control::policy_document::PolicyDocument;
use crate::http::gate::access::{CallerOf, HeavyCalls, LiveCalls, ReadCalls};
use crate::http::gate::extract::{Id, JsonBytes, Parameters};
use crate::http::gate::{bodies, decode};
use crate::http::problem::ProblemDocument;
use crate::http::routes::page::{self, Page};
use crate::http::routes::wire;
use crate::service::Service;
use crate::service::process::memory::Large;

/// Lists policies, newest first.
#[utoipa::path(get, path = "/policies", tag = "policies",
    params(("limit" = Option<usize>, Query, minimum = 1, maximum = 1000, description = "1 to 1000; default 50."),
           ("after" = Option<i64>, Query, description = "The `next` of the previous page.")),
    responses(
        (status = 200, description = "A page of policies.", body = wire::PolicyPage),
        (status = 400, description = "A parameter breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn list(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Parameters(page): Parameters<Page>,
) -> Result<Response, ProblemDocument> {
    let (limit, after) = page.bounds()?;
    let room = service.room_for(page::bytes(limit)).await?;
    let rows = service.policies.list(&caller.tenant, limit, after).await?;
    let next = page::next(rows.len(), limit, rows.last().map(|row| row.sequence));
    let value = wire::PolicyPage { policies: rows.into_iter().map(Into::into).collect(), next };
    bodies::written(&service, Large { value, room }).await
}

/// Returns a policy with its specification and the diagnostics of every step.
#[utoipa::path(get, path = "/policies/{id}", tag = "policies", params(("id" = String, Path, description = "The policy.")),
    responses(
        (status = 200, description = "The policy.", body = wire::PolicyDetail),
        (status = 404, description = "There is no such policy.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn get(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Id(id): Id,
) -> Result<Response, ProblemDocument> {
    let created_ms = service.policies.created_ms(&caller.tenant, &id).await?;
    let prepared = service.policies.prepared(&caller.tenant, &id).await?;
    let specification = prepared.posed();
    let detail = wire::PolicyDetail {
        labels: service.names.of(&caller.tenant, &id).await?,
        policy: id,
        created_ms,
        framework: specification.framework(),
        horizon: specification.horizon(),
        annualised: specification.annualised(),
        warnings: prepared.warnings(),
        diagnostics: prepared.diagnostics(),
        specification,
    };
    bodies::written(&service, Large::from(detail)).await
}

/// Query of a surface.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceQuery {
    step: Option<String>,
    across: Option<SurfaceAxis>,
}

impl SurfaceQuery {
    fn step(&self) -> Result<usize, ProblemDocument> {
        let Some(text) = &self.step else { return Ok(0) };
        text.parse().map_err(|_| ProblemDocument::of_parameter("step", text, "must be a whole number, 0 or more"))
    }
}

/// Returns what a policy holds after records like its own, shifted and stretched.
#[utoipa::path(get, path = "/policies/{id}/surface", tag = "policies",
    params(("id" = String, Path, description = "The policy."),
           ("step" = Option<usize>, Query, minimum = 0, maximum = 519, description = "Number of periods observed, below the policy's horizon; default 0."),
           ("across" = inline(Option<SurfaceAxis>), Query, description = "Direction of the columns; if it is left out or the states of the step do not differ in it, the first of the answer's `axes`.")),
    responses(
        (status = 200, description = "The allocations.", body = Surface),
        (status = 400, description = "A parameter breaks a rule.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 404, description = "There is no such policy.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "The policy has no such step.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn surface(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    Id(id): Id,
    Parameters(ask): Parameters<SurfaceQuery>,
) -> Result<Response, ProblemDocument> {
    let surface = service.sessions.surface(&caller.tenant, &id, ask.step()?, ask.across).await?;
    bodies::written(&service, Large::from(surface)).await
}

/// Returns the portable document of a policy; its SHA-256 is the policy's identifier.
#[utoipa::path(get, path = "/policies/{id}/export", tag = "policies", params(("id" = String, Path, description = "The policy.")),
    responses(
        (status = 200, description = "The document.", body = serde_json::Value),
        (status = 404, description = "There is no such policy.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn export(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Id(id): Id,
) -> Result<Response, ProblemDocument> {
    Ok(bodies::sent(service.policies.document(&caller.tenant, &id).await?))
}

/// Stores an exported policy.
#[utoipa::path(post, path = "/policies/import", tag = "policies", request_body = serde_json::Value,
    responses(
        (status = 201, description = "The policy is stored, or was stored already.", body = wire::Imported,
            headers(("Location" = String, description = "The policy."))),
        (status = 422, description = "The document is not a usable policy.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn import(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    body: JsonBytes,
) -> Result<Response, ProblemDocument> {
    let policy = service.policies.import(&caller, body.decoded(document).await?).await?;
    let location = [(header::LOCATION, format!("/policies/{policy}"))];
    Ok((StatusCode::CREATED, location, Json(wire::Imported { policy })).into_response())
}

/// Decodes a policy by its format, so that an error names the right field.
fn document(bytes: &[u8]) -> Result<PolicyDocument, ProblemDocument> {
    match PolicyDocument::is_declared(bytes) {
        true => decode::object(bytes).map(PolicyDocument::Declared),
        false => decode::object(bytes).map(PolicyDocument::Investor),
    }
}

/// Deletes a policy that no session uses.
#[utoipa::path(delete, path = "/policies/{id}", tag = "policies", params(("id" = String, Path, description = "The policy.")),
    responses(
        (status = 204, description = "Deleted."),
        (status = 404, description = "There is no such policy.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 409, description = "Sessions use the policy.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn delete(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
) -> Result<StatusCode, ProblemDocument> {
    service.policies.delete(&caller, &id).await?;
    Ok(StatusCode::NO_CONTENT)
}
