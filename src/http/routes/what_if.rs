//! Requests that change nothing.

use std::sync::Arc;
use std::time::Instant;

use axum::extract::State;
use axum::response::Response;

use crate::http::gate::access::{CallerOf, HeavyCalls};
use crate::http::gate::bodies;
use crate::http::gate::extract::JsonBody;
use crate::http::problem::ProblemDocument;
use crate::service::Service;
use crate::service::advice::what_if::{WhatIf, WhatIfAnswer};
use crate::service::metrics::ACTION_SECONDS;

/// Returns the allocation for another wealth, radius or next return; nothing is changed.
#[utoipa::path(post, path = "/what-if", tag = "sessions",
    request_body(content = WhatIf, example = json!({
        "session": "session_0123456789abcdef0123456789abcdef",
        "sweep": { "radius_scale": { "from": 0.0, "to": 2.0, "points": 21 } }
    })),
    responses(
        (status = 200, description = "One point, or the points of a sweep.", body = WhatIfAnswer),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 409, description = "The session has reached its horizon.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn what_if(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    JsonBody(request): JsonBody<WhatIf>,
) -> Result<Response, ProblemDocument> {
    let started = Instant::now();
    let answer = service.sessions.what_if(&caller.tenant, request).await?;
    metrics::histogram!(ACTION_SECONDS, "mode" => "what_if").record(started.elapsed().as_secs_f64());
    bodies::written(&service, answer).await
}
