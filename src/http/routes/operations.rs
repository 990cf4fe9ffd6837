//! For the operator: is the process alive, is it ready, how is it doing.

use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::description::documentation::Published;
use crate::http::gate::bodies::{self, Embedded};
use crate::http::gate::telemetry;
use crate::http::problem::ProblemDocument;
use crate::service::Service;
use crate::service::process::memory::Large;

/// The state of the service.
#[derive(Debug, Serialize, ToSchema)]
pub struct Health {
    pub status: &'static str,
    pub version: &'static str,
    pub jobs_queued: u64,
    pub jobs_running: u64,
    pub sessions: u64,
}

/// Returns 200 as long as the process answers.
#[utoipa::path(get, path = "/livez", tag = "operations",
    responses((status = 200, description = "The process answers.", body = String, content_type = "text/plain")))]
pub async fn livez() -> &'static str {
    "ok"
}

/// Returns 200 if the store answers and the service accepts work.
#[utoipa::path(get, path = "/readyz", tag = "operations",
    responses(
        (status = 200, description = "The service is ready. The text also warns if the clock of its machine is wrong.", body = String, content_type = "text/plain"),
        (status = 503, description = "The service is draining, or the store does not answer.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn readyz(State(service): State<Arc<Service>>) -> Result<String, ProblemDocument> {
    service.ready().await?;
    Ok(match service.clock_skew_seconds() {
        0 => "ok".to_owned(),
        ahead => format!("ok, but the clock of this machine is {ahead} seconds ahead: nothing is deleted by age"),
    })
}

/// Reports liveness and readiness, with the version and the numbers of jobs and sessions.
#[utoipa::path(get, path = "/health", tag = "operations",
    responses(
        (status = 200, description = "The service is alive and ready.", body = Health),
        (status = 503, description = "The service is draining, or the store does not answer.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn health(State(service): State<Arc<Service>>) -> Result<Json<Health>, ProblemDocument> {
    service.ready().await?;
    let (jobs, sessions) = service.counts().await?;
    Ok(Json(Health {
        status: "ok",
        version: env!("CARGO_PKG_VERSION"),
        jobs_queued: jobs.queued,
        jobs_running: jobs.running,
        sessions,
    }))
}

/// Returns metrics for Prometheus.
#[utoipa::path(get, path = "/metrics", tag = "operations",
    responses((status = 200, description = "Text exposition format.", body = String, content_type = "text/plain")))]
pub async fn metrics(State(service): State<Arc<Service>>) -> Result<Response, ProblemDocument> {
    service.record_store().await?;
    let (jobs, sessions) = service.counts().await?;
    service.record_memory();
    let text = telemetry::exposition(jobs, sessions, service.waiting(), &service.keys.figures());
    let room = service.room_for(text.len()).await?;
    let mut response = bodies::sent(Large { value: text.into_bytes(), room });
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("text/plain; version=0.0.4"));
    Ok(response)
}

/// Returns the description of this interface.
#[utoipa::path(get, path = "/openapi.json", tag = "operations",
    responses((status = 200, description = "OpenAPI 3.1.", body = serde_json::Value)))]
pub async fn openapi(Extension(published): Extension<Published>) -> Response {
    description(published)
}

pub(in crate::http) fn description(published: Published) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], Extension(Embedded), published.as_str()).into_response()
}
