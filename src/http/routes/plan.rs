//! Plans of spending.

use std::sync::Arc;
use std::time::Instant;

use axum::extract::State;
use axum::response::Response;

use crate::control::evaluation::plan::report::PlanReport;
use crate::http::gate::access::{CallerOf, HeavyCalls};
use crate::http::gate::extract::JsonBytes;
use crate::http::gate::{bodies, decode};
use crate::http::problem::ProblemDocument;
use crate::http::routes::advise::peek_shape;
use crate::service::Service;
use crate::service::advice::plan::PlanAsked;
use crate::service::metrics::ACTION_SECONDS;

/// Returns what to spend and what to hold in each period until a horizon, how likely the money lasts, and what would
/// have to be true for it to fail. Nothing is stored.
#[utoipa::path(post, path = "/plan", tag = "advice",
    request_body(content = PlanAsked, example = json!({
        "problem": { "history": [0.12, -0.08, 0.21, 0.05, -0.03, 0.17, 0.09, -0.11], "rate_per_step": 0.01,
            "horizon": 30, "periods_per_year": 1, "initial_wealth": 500000.0,
            "spending": { "inflation": 0.02 } },
        "wanted": 20000.0
    })),
    responses(
        (status = 200, description = "The plan, and how it fares beside simple rules.", body = PlanReport),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn plan(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    body: JsonBytes,
) -> Result<Response, ProblemDocument> {
    let started = Instant::now();
    let answer = service.sessions.plan(&caller.tenant, body.decoded(question).await?).await?;
    metrics::histogram!(ACTION_SECONDS, "mode" => "plan").record(started.elapsed().as_secs_f64());
    bodies::written(&service, answer).await
}

/// Decodes the request of one asset or several.
fn question(bytes: &[u8]) -> Result<PlanAsked, ProblemDocument> {
    match peek_shape(bytes).is_some_and(|problem| problem.assets.is_some()) {
        true => decode::object(bytes).map(PlanAsked::Assets),
        false => decode::object(bytes).map(PlanAsked::Asset),
    }
}
