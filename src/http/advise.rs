//! Advice without a session.

use std::sync::Arc;
use std::time::Instant;

use axum::Json;
use axum::extract::State;
use serde_json::Value;

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
    let question: Advise = decode::json(&for_one_period(&bytes)?)?;
    let advised = service.sessions.advise(&caller.tenant, question).await?;
    metrics::histogram!(ACTION_SECONDS, "mode" => "advise").record(started.elapsed().as_secs_f64());
    Ok(Json(advised))
}

/// The same question with the horizon that is meant where none is given.
fn for_one_period(bytes: &[u8]) -> Result<Vec<u8>, Problem> {
    let mut body: Value = decode::json(bytes)?;
    if let Some(problem) = body.get_mut("problem").and_then(Value::as_object_mut) {
        problem.entry("horizon").or_insert(1.into());
    }
    Ok(body.to_string().into_bytes())
}
