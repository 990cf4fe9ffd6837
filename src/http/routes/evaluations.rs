//! Out-of-sample comparisons.

use std::sync::Arc;

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::control::request::declared_comparison::EvaluationQuestion;
use crate::http::gate::access::{CallerOf, HeavyCalls, ReadCalls};
use crate::http::gate::extract::{Id, JsonBytes};
use crate::http::gate::{bodies, decode};
use crate::http::problem::ProblemDocument;
use crate::http::routes::jobs::{Queueing, accepted, idempotency_key};
use crate::http::routes::wire;
use crate::service::Service;

/// Queues a comparison of strategies on common simulated returns, or of policies and rules of a declared problem on common
/// noises.
#[utoipa::path(post, path = "/evaluate", tag = "jobs",
    request_body(content = EvaluationQuestion, example = json!({
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
    body: JsonBytes,
) -> Result<Response, ProblemDocument> {
    let question = body.decoded(question).await?;
    Ok(accepted(service.evaluate(&caller, question, idempotency_key(&headers)?).await?))
}

/// Decodes the request by its shape, so that an error names the right field.
fn question(bytes: &[u8]) -> Result<EvaluationQuestion, ProblemDocument> {
    #[derive(Deserialize)]
    struct Shape {
        problem: Option<Declaring>,
        policies: Option<IgnoredAny>,
    }
    #[derive(Deserialize)]
    struct Declaring {
        states: Option<IgnoredAny>,
    }
    match decode::object(bytes) {
        Ok(Shape { problem: Some(Declaring { states: Some(_) }), .. } | Shape { problem: None, policies: Some(_) }) => {
            decode::object(bytes).map(EvaluationQuestion::Declared)
        }
        _ => decode::object(bytes).map(EvaluationQuestion::Investor),
    }
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
