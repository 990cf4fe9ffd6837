//! Decisions of declared problems.

use std::sync::Arc;
use std::time::Instant;

use axum::extract::State;
use axum::response::Response;

use crate::http::gate::access::{CallerOf, HeavyCalls};
use crate::http::gate::bodies;
use crate::http::gate::extract::JsonBody;
use crate::http::problem::ProblemDocument;
use crate::service::Service;
use crate::service::advice::decide::{Decide, DecideReply};
use crate::service::metrics::ACTION_SECONDS;

/// Returns the actions of a declared problem at a state, with their worst law. They are solved, and nothing is stored.
#[utoipa::path(post, path = "/decide", tag = "advice",
    request_body(content = Decide, example = json!({
        "policy": "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef",
        "period": 2, "state": { "stock": 7.0 }, "noises": [18.0]
    })),
    responses(
        (status = 200, description = "The actions and their worst law, or the actions over ranges of inputs.", body = DecideReply),
        (status = 404, description = "There is no such policy.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn decide(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    JsonBody(request): JsonBody<Decide>,
) -> Result<Response, ProblemDocument> {
    let started = Instant::now();
    let answer = service.sessions.decide(&caller.tenant, request).await?;
    metrics::histogram!(ACTION_SECONDS, "mode" => "decide").record(started.elapsed().as_secs_f64());
    bodies::written(&service, answer).await
}
