//! Walk-forward backtests through histories of returns, or of the noises of a declared problem.

use std::sync::Arc;

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::control::request::backtest_assets::BacktestQuestion;
use crate::http::gate::access::{CallerOf, HeavyCalls};
use crate::http::gate::decode;
use crate::http::gate::extract::JsonBytes;
use crate::http::problem::ProblemDocument;
use crate::http::routes::jobs::{Queueing, accepted, idempotency_key};
use crate::service::Service;

/// Queues a walk-forward backtest through a history of returns, of one asset or of several, or through the noises of a
/// declared problem.
#[utoipa::path(post, path = "/backtest", tag = "jobs",
    request_body(content = BacktestQuestion, example = json!({
        "simple_returns": [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.017, -0.009, 0.024, 0.011, -0.03, 0.019],
        "dates": ["2020-03", "2020-06", "2020-09", "2020-12", "2021-03", "2021-06", "2021-09", "2021-12", "2022-03", "2022-06",
            "2022-09", "2022-12"],
        "rate": 0.0027, "window": 8, "every": 4, "horizon": 4, "alpha": [0.1, 0.5], "risk_aversion": 3.0,
        "trading_cost": 0.001, "cost_blind": false, "count": 100, "seed": 1
    })),
    params(("Idempotency-Key" = Option<String>, Header, description = "Repeating the key with the same body returns the same job.")),
    responses(Queueing))]
pub async fn backtest(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    headers: HeaderMap,
    body: JsonBytes,
) -> Result<Response, ProblemDocument> {
    let request = body.decoded(question).await?;
    Ok(accepted(service.jobs.backtest(&caller, request, idempotency_key(&headers)?).await?))
}

/// The part of a request that shows what walks.
#[derive(Deserialize)]
struct BacktestShape {
    assets: Option<IgnoredAny>,
    problem: Option<IgnoredAny>,
}

/// Decodes the request by its shape, so that an error names the right field.
fn question(bytes: &[u8]) -> Result<BacktestQuestion, ProblemDocument> {
    match decode::object(bytes) {
        Ok(BacktestShape { assets: Some(_), .. }) => decode::object(bytes).map(BacktestQuestion::Assets),
        Ok(BacktestShape { problem: Some(_), .. }) => decode::object(bytes).map(BacktestQuestion::Declared),
        _ => decode::object(bytes).map(BacktestQuestion::Asset),
    }
}
