//! Returns read from text.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;

use super::access::{By, Heavy};
use super::extract::JsonBody;
use super::problem::Problem;
use crate::returns::Reading;
use crate::service::Service;
use crate::service::returns::ReadReturns;

/// What a text of returns or prices says: one record, or what must be asked, or where it is wrong. Nothing is stored.
#[utoipa::path(post, path = "/returns", tag = "advice",
    request_body(content = ReadReturns, example = json!({
        "text": "month,fund,rf\n2020-01,1.2,0.1\n2020-02,-3.4,0.1\n2020-03,2.1,0.1\n",
        "choices": { "unit": "percent" }
    })),
    responses((status = 200, description = "The reading.", body = Reading)))]
pub async fn read(
    State(service): State<Arc<Service>>,
    By(caller, _): By<Heavy>,
    JsonBody(question): JsonBody<ReadReturns>,
) -> Result<Json<Reading>, Problem> {
    Ok(Json(service.sessions.read_returns(&caller.tenant, question).await?))
}
