//! The share of the capital that a strategy deserves.

use std::sync::Arc;
use std::time::Instant;

use axum::extract::State;
use axum::response::Response;

use crate::control::request::sleeve::SleeveQuestion;
use crate::control::sleeve::report::SleeveReport;
use crate::http::gate::access::{CallerOf, HeavyCalls};
use crate::http::gate::extract::JsonBytes;
use crate::http::gate::{bodies, decode};
use crate::http::problem::ProblemDocument;
use crate::http::routes::advise::peek_shape;
use crate::service::Service;
use crate::service::advice::sleeve::SleeveRequest;
use crate::service::metrics::ACTION_SECONDS;

/// Returns the share of the capital that the record of a strategy supports, as a part of the Kelly share, which takes
/// the record as the truth, and what would refute it. Nothing is stored.
#[utoipa::path(post, path = "/sleeve", tag = "advice",
    request_body(content = SleeveRequest, example = json!({
        "problem": { "history": [0.031, -0.018, 0.024, 0.012, -0.009, 0.027, 0.015, -0.021], "rate_per_step": 0.001,
            "periods_per_year": 12 }
    })),
    responses(
        (status = 200, description = "The share, beside the Kelly share.", body = SleeveReport),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn sleeve(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    body: JsonBytes,
) -> Result<Response, ProblemDocument> {
    let started = Instant::now();
    let answer = service.sessions.sleeve(&caller.tenant, body.decoded(request).await?).await?;
    metrics::histogram!(ACTION_SECONDS, "mode" => "sleeve").record(started.elapsed().as_secs_f64());
    bodies::written(&service, answer).await
}

/// Decodes the request of one strategy or several; the horizon defaults to 1.
fn request(bytes: &[u8]) -> Result<SleeveRequest, ProblemDocument> {
    let shape = peek_shape(bytes);
    if shape.as_ref().is_some_and(|problem| problem.assets.is_some()) {
        return decode::object(bytes).map(SleeveRequest::Strategies);
    }
    let mut question: SleeveQuestion = decode::object(bytes)?;
    if shape.is_some_and(|problem| problem.horizon.is_none()) {
        question.problem.horizon = 1;
    }
    Ok(SleeveRequest::Strategy(question))
}
