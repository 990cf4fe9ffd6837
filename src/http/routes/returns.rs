//! Reads returns from text.

use std::sync::Arc;

use axum::extract::State;
use axum::response::Response;

use crate::http::gate::access::{CallerOf, HeavyCalls};
use crate::http::gate::bodies;
use crate::http::gate::extract::JsonBody;
use crate::http::problem::ProblemDocument;
use crate::returns::Reading;
use crate::service::Service;
use crate::service::advice::returns::ReadReturns;
use crate::service::process::memory::Large;

/// Most bytes of the answer for each byte of the text: a number of two digits may be written with seventeen.
const ANSWERED_A_BYTE: usize = 16;

/// Reads returns or prices from a text. The answer is one history, the questions that you must answer first, or where
/// the text is wrong. Nothing is stored.
#[utoipa::path(post, path = "/returns", tag = "advice",
    request_body(content = ReadReturns, example = json!({
        "text": "month,fund,rf\n2020-01,1.2,0.1\n2020-02,-3.4,0.1\n2020-03,2.1,0.1\n",
        "choices": { "unit": "percent" }
    })),
    responses((status = 200, description = "The history, the open questions, or the place of the error.", body = Reading)))]
pub async fn read(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<HeavyCalls>,
    JsonBody(question): JsonBody<ReadReturns>,
) -> Result<Response, ProblemDocument> {
    let room = service.room_for(ANSWERED_A_BYTE * question.text.len()).await?;
    let value = service.sessions.read_returns(&caller.tenant, question).await?;
    bodies::written(&service, Large { value, room }).await
}
