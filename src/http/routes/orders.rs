//! Orders that follow the advice of a session.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;

use crate::http::gate::access::{CallerOf, ReadCalls};
use crate::http::gate::extract::JsonBody;
use crate::http::problem::ProblemDocument;
use crate::service::Service;
use crate::service::advice::orders::{OrdersAnswer, OrdersQuestion};

/// Returns the orders, in whole lots of units, that bring what you hold to the advice of a session; nothing is changed.
#[utoipa::path(post, path = "/orders", tag = "sessions",
    request_body(content = OrdersQuestion, example = json!({
        "session": "session_0123456789abcdef0123456789abcdef",
        "prices": { "asset": 101.5 }, "units": { "asset": 120.0 }, "cash": 8000.0, "trading_cost": 0.001
    })),
    responses(
        (status = 200, description = "The orders.", body = OrdersAnswer),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 409, description = "The session has reached its horizon.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn orders(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
    JsonBody(question): JsonBody<OrdersQuestion>,
) -> Result<Json<OrdersAnswer>, ProblemDocument> {
    Ok(Json(service.sessions.orders(&caller.tenant, question, &caller.turn).await?))
}
