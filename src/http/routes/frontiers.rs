//! Radii compared on histories like the given one.

use std::sync::Arc;

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::control::request::assets::AssetsProblem;
use crate::control::request::frontier::FrontierRequest;
use crate::control::request::specification::ProblemSpecification;
use crate::http::gate::access::{CallerOf, HeavyCalls};
use crate::http::gate::decode;
use crate::http::gate::extract::JsonBytes;
use crate::http::problem::ProblemDocument;
use crate::http::routes::advise::{ProblemShape, peek_shape};
use crate::http::routes::jobs::{Queueing, accepted, idempotency_key};
use crate::service::Service;

/// Queues the frontier of caution: what multiples of the radius lose on resampled histories.
#[utoipa::path(post, path = "/frontier", tag = "jobs",
    request_body(content = FrontierRequest, example = json!({
        "problem": { "history": [0.012, -0.034, 0.021, 0.008, 0.017, -0.009, 0.024, 0.011, -0.03, 0.019, 0.006, -0.012],
            "rate_per_step": 0.001, "periods_per_year": 12.0, "utility": { "kind": "power", "risk_aversion": 3.0 } },
        "scales": [0.0, 0.25, 1.0], "resamples": 100, "block": 3, "seed": 1
    })),
    params(("Idempotency-Key" = Option<String>, Header, description = "Repeating the key with the same body returns the same job.")),
    responses(Queueing))]
pub async fn frontier(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    headers: HeaderMap,
    body: JsonBytes,
) -> Result<Response, ProblemDocument> {
    let request = body.decoded(request).await?;
    Ok(accepted(service.jobs.frontier(&caller, request, idempotency_key(&headers)?).await?))
}

/// A request of which only the problem is read.
#[derive(Deserialize)]
struct Only<P> {
    problem: P,
}

/// Decodes the request. Its problem is decoded by itself first, so that an error names the right field.
fn request(bytes: &[u8]) -> Result<FrontierRequest, ProblemDocument> {
    match peek_shape(bytes) {
        Some(ProblemShape { assets: Some(_), .. }) => reads::<AssetsProblem>(bytes)?,
        Some(_) => reads::<ProblemSpecification>(bytes)?,
        None => {}
    }
    decode::object(bytes)
}

fn reads<P: DeserializeOwned>(bytes: &[u8]) -> Result<(), ProblemDocument> {
    decode::object::<Only<P>>(bytes).map(|Only { problem }| drop(problem))
}
