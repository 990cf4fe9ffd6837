//! Out-of-sample comparisons.

use std::sync::Arc;

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;

use crate::control::request::evaluation::EvaluationRequest;
use crate::http::gate::access::{CallerOf, HeavyCalls, ReadCalls};
use crate::http::gate::bodies;
use crate::http::gate::extract::{Id, JsonBody};
use crate::http::problem::ProblemDocument;
use crate::http::routes::jobs::{Queueing, accepted, idempotency_key};
use crate::http::routes::wire;
use crate::service::Service;

/// Queues a comparison of frameworks on common simulated returns.
#[utoipa::path(post, path = "/evaluate", tag = "jobs",
    request_body(content = EvaluationRequest, example = json!({
        "problem": {
            "rate_per_step": 0.0027, "history": [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008],
            "law": { "kind": "gaussian_mixture", "components": [
                { "weight": 0.4, "mean": 0.006, "variance": 0.016 }, { "weight": 0.6, "mean": 0.016, "variance": 0.00625 }
            ] }
        },
        "frameworks": ["adaptive", "static", "known_law", "plug_in"],
        "constant_mixes": [0.0, 0.5, 1.0],
        "paths": 1000,
        "histories": { "kind": "drawn", "count": 200 },
        "level": 0.95
    })),
    params(("Idempotency-Key" = Option<String>, Header, description = "Repeating the key with the same body returns the same job.")),
    responses(Queueing))]
pub async fn evaluate(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    headers: HeaderMap,
    JsonBody(request): JsonBody<EvaluationRequest>,
) -> Result<Response, ProblemDocument> {
    Ok(accepted(service.evaluate(&caller, request, idempotency_key(&headers)?).await?))
}

/// Returns the report of a succeeded evaluation, walk-forward backtest or frontier.
#[utoipa::path(get, path = "/jobs/{id}/report", tag = "jobs", params(("id" = String, Path, description = "The job.")),
    responses(
        (status = 200, description = "The report.", body = wire::JobReport),
        (status = 404, description = "There is no such job, or it has no report.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn report(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    Id(id): Id,
) -> Result<Response, ProblemDocument> {
    Ok(bodies::sent(service.jobs.report(&caller.tenant, &id).await?))
}
