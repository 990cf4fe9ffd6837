//! The futures of a policy or of a session: a course under the worst laws, beside one under the record's.

use std::sync::Arc;

use axum::extract::State;
use axum::response::Response;
use serde::Deserialize;

use crate::control::policy::futures::Futures;
use crate::http::gate::access::{CallerOf, HeavyCalls};
use crate::http::gate::bodies;
use crate::http::gate::extract::{Id, Parameters};
use crate::http::problem::ProblemDocument;
use crate::service::Service;

/// Query of futures.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FuturesQuery {
    paths: Option<String>,
}

impl FuturesQuery {
    fn paths(&self) -> Result<Option<usize>, ProblemDocument> {
        let parse = |text: &String| {
            text.parse().map_err(|_| ProblemDocument::of_parameter("paths", text, "must be a whole number, 20 to 1000"))
        };
        self.paths.as_ref().map(parse).transpose()
    }
}

/// Plays a policy from its start in two worlds: one in which every period brings the law that is worst for what is
/// decided, and one in which periods are drawn from the record.
#[utoipa::path(get, path = "/policies/{id}/futures", tag = "policies",
    params(("id" = String, Path, description = "The policy."),
           ("paths" = Option<usize>, Query, minimum = 20, maximum = 1000, description = "Paths of each world, 20 to 1000; at most 20,000 periods on all paths. Default 100, or as many as these periods allow.")),
    responses(
        (status = 200, description = "The futures.", body = Futures),
        (status = 400, description = "A parameter breaks a rule.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 404, description = "There is no such policy.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "Too many paths, or a state of a declared problem leaves its range.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn of_policy(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    Id(id): Id,
    Parameters(ask): Parameters<FuturesQuery>,
) -> Result<Response, ProblemDocument> {
    let futures = service.sessions.futures_of_policy(&caller.tenant, &id, ask.paths()?).await?;
    bodies::written(&service, futures).await
}

/// Plays a session on, from its coming period to the last that its policy decides, in the two worlds of a policy's
/// futures.
#[utoipa::path(get, path = "/sessions/{id}/futures", tag = "sessions",
    params(("id" = String, Path, description = "The session."),
           ("paths" = Option<usize>, Query, minimum = 20, maximum = 1000, description = "Paths of each world, 20 to 1000; at most 20,000 periods on all paths. Default 100, or as many as these periods allow.")),
    responses(
        (status = 200, description = "The futures.", body = Futures),
        (status = 400, description = "A parameter breaks a rule.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 409, description = "The session has reached its horizon.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "Too many paths, or a state of a declared problem leaves its range.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn of_session(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    Id(id): Id,
    Parameters(ask): Parameters<FuturesQuery>,
) -> Result<Response, ProblemDocument> {
    let futures = service.sessions.futures_of_session(&caller.tenant, &id, ask.paths()?).await?;
    bodies::written(&service, futures).await
}
