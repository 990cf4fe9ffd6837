//! Radii tried on records like the one at hand.

use std::sync::Arc;

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

use super::access::{By, Heavy};
use super::decode;
use super::extract::JsonBytes;
use super::jobs::{accepted, idempotency_key};
use super::problem::Problem;
use super::wire;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::frontier::FrontierRequest;
use crate::control::request::specification::ProblemSpecification;
use crate::service::Service;

/// Queue the frontier of caution: what multiples of the radius lose on resampled records.
#[utoipa::path(post, path = "/frontier", tag = "jobs",
    request_body(content = FrontierRequest, example = json!({
        "problem": { "history": [0.012, -0.034, 0.021, 0.008, 0.017, -0.009, 0.024, 0.011, -0.03, 0.019, 0.006, -0.012],
            "rate_per_step": 0.001, "periods_per_year": 12.0, "utility": { "kind": "power", "risk_aversion": 3.0 } },
        "scales": [0.0, 0.25, 1.0], "resamples": 100, "block": 3, "seed": 1
    })),
    params(("Idempotency-Key" = Option<String>, Header, description = "The same key and body again give the same job.")),
    responses(
        (status = 202, description = "Queued; poll the Location or follow its events.", body = wire::AcceptedJob, headers(
            ("Location" = String, description = "The job."),
            ("Retry-After" = u32, description = "Seconds to wait before asking for the job."))),
        (status = 400, description = "The body is not JSON.", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "The key was used with another body.", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule.", body = Problem, content_type = "application/problem+json")))]
pub async fn frontier(
    State(service): State<Arc<Service>>,
    By(caller, _): By<Heavy>,
    headers: HeaderMap,
    JsonBytes(bytes): JsonBytes,
) -> Result<Response, Problem> {
    let request = request(&bytes)?;
    Ok(accepted(service.jobs.frontier(&caller, request, idempotency_key(&headers)?).await?))
}

/// A request of which the problem alone is read.
#[derive(Deserialize)]
struct Only<P> {
    problem: P,
}

#[derive(Deserialize)]
struct Said {
    assets: Option<IgnoredAny>,
}

/// The request. Its problem is read by itself first, so that what is wrong in it is told by its own field.
fn request(bytes: &[u8]) -> Result<FrontierRequest, Problem> {
    if let Ok(Only { problem: Said { assets } }) = decode::json(bytes) {
        match assets {
            Some(_) => reads::<AssetsProblem>(bytes)?,
            None => reads::<ProblemSpecification>(bytes)?,
        }
    }
    decode::json(bytes)
}

fn reads<P: DeserializeOwned>(bytes: &[u8]) -> Result<(), Problem> {
    decode::json::<Only<P>>(bytes).map(|Only { problem }| drop(problem))
}
