//! Advice without a session.

use std::sync::Arc;
use std::time::Instant;

use axum::Json;
use axum::extract::State;
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::access::{By, Heavy};
use super::decode;
use super::extract::JsonBytes;
use super::problem::Problem;
use crate::service::Service;
use crate::service::advise::{Advise, Advised};
use crate::service::metrics::ACTION_SECONDS;

/// What to hold through one period, from a record of returns: solved exactly, nothing is stored.
#[utoipa::path(post, path = "/advise", tag = "advice",
    request_body(content = Advise, example = json!({
        "problem": { "history": [0.012, -0.034, 0.021, 0.008, 0.017, -0.009], "rate_per_step": 0.001,
            "utility": { "kind": "power", "risk_aversion": 3.0 } },
        "wealth": 250000.0, "holding": 0.6
    })),
    responses(
        (status = 200, description = "The allocation and its worst-case law.", body = Advised),
        (status = 422, description = "A field breaks a rule.", body = Problem, content_type = "application/problem+json")))]
pub async fn advise(
    State(service): State<Arc<Service>>,
    By(caller, _): By<Heavy>,
    JsonBytes(bytes): JsonBytes,
) -> Result<Json<Advised>, Problem> {
    let started = Instant::now();
    let advised = service.sessions.advise(&caller.tenant, question(&bytes)?).await?;
    metrics::histogram!(ACTION_SECONDS, "mode" => "advise").record(started.elapsed().as_secs_f64());
    Ok(Json(advised))
}

/// What tells whether a question says its horizon.
#[derive(Deserialize)]
struct Said {
    problem: SaidOfProblem,
}

#[derive(Deserialize)]
struct SaidOfProblem {
    horizon: Option<IgnoredAny>,
}

/// The question, with the horizon that is meant where none is given.
fn question(bytes: &[u8]) -> Result<Advise, Problem> {
    let mut question: Advise = decode::json(bytes)?;
    let Said { problem } = decode::json(bytes)?;
    if problem.horizon.is_none() {
        question.problem.horizon = 1;
    }
    Ok(question)
}
