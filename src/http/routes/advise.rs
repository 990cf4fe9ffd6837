//! Advice without a session.

use std::sync::Arc;
use std::time::Instant;

use axum::extract::State;
use axum::response::Response;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::http::gate::access::{CallerOf, HeavyCalls};
use crate::http::gate::extract::JsonBytes;
use crate::http::gate::{bodies, decode};
use crate::http::problem::ProblemDocument;
use crate::service::Service;
use crate::service::advice::advise::{Advise, Advised};
use crate::service::advice::advise_assets::{AdviseAssets, AssetsAdvised};
use crate::service::metrics::ACTION_SECONDS;

/// A request about one asset, or about several, which `problem.assets` names.
#[derive(Debug, ToSchema)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant)]
pub enum AdviseQuestion {
    Asset(Advise),
    Assets(AdviseAssets),
}

/// The answer to a request about one asset or several.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum AdviseAnswer {
    Asset(Box<Advised>),
    Assets(Box<AssetsAdvised>),
}

/// Returns the allocation for one period, from a history of returns of one asset or several. It is solved exactly, and
/// nothing is stored.
#[utoipa::path(post, path = "/advise", tag = "advice",
    request_body(content = AdviseQuestion, example = json!({
        "problem": { "history": [0.012, -0.034, 0.021, 0.008, 0.017, -0.009], "rate_per_step": 0.001,
            "utility": { "kind": "power", "risk_aversion": 3.0 } },
        "wealth": 250000.0, "holding": 0.6
    })),
    responses(
        (status = 200, description = "The allocation and its worst-case law.", body = AdviseAnswer),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn advise(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    body: JsonBytes,
) -> Result<Response, ProblemDocument> {
    let started = Instant::now();
    let (sessions, tenant) = (&service.sessions, &caller.tenant);
    let (answer, mode) = match body.decoded(question).await? {
        AdviseQuestion::Asset(request) => {
            (sessions.advise(tenant, request).await?.map(|advised| AdviseAnswer::Asset(advised.into())), "advise")
        }
        AdviseQuestion::Assets(request) => {
            (AdviseAnswer::Assets(sessions.advise_assets(tenant, request).await?.into()).into(), "advise_assets")
        }
    };
    metrics::histogram!(ACTION_SECONDS, "mode" => mode).record(started.elapsed().as_secs_f64());
    bodies::written(&service, answer).await
}

/// The parts of a request that show if it gives a horizon, names assets, or declares states.
#[derive(Deserialize)]
struct AdviseShape {
    problem: ProblemShape,
}

#[derive(Deserialize)]
pub(super) struct ProblemShape {
    pub(super) horizon: Option<IgnoredAny>,
    pub(in crate::http) assets: Option<IgnoredAny>,
    pub(in crate::http) states: Option<IgnoredAny>,
}

/// Reads the shape of `problem`; `None` if there is no readable problem.
pub(super) fn peek_shape(bytes: &[u8]) -> Option<ProblemShape> {
    decode::object(bytes).ok().map(|AdviseShape { problem }| problem)
}

/// Decodes the request; the horizon defaults to 1.
fn question(bytes: &[u8]) -> Result<AdviseQuestion, ProblemDocument> {
    let Some(problem) = peek_shape(bytes) else { return Ok(AdviseQuestion::Asset(decode::object(bytes)?)) };
    if problem.assets.is_some() {
        return Ok(AdviseQuestion::Assets(decode::object(bytes)?));
    }
    let mut question: Advise = decode::object(bytes)?;
    if problem.horizon.is_none() {
        question.problem.horizon = 1;
    }
    Ok(AdviseQuestion::Asset(question))
}
