//! The calendar of due reports, for programs that people plan their days with.

use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::Response;

use crate::http::gate::access::{CallerOf, ReadCalls};
use crate::http::gate::bodies;
use crate::http::problem::ProblemDocument;
use crate::http::routes::page;
use crate::service::Service;
use crate::service::catalogue::calendar::MOST_IN_CALENDAR;
use crate::service::process::memory::Large;

/// Returns a calendar with the day on which the next report of each active session is due, for at most 1,000 sessions:
/// those that reported longest ago. Sessions whose policies give no periods a year are left out. After a report the event
/// of its session has the next day, under the same `UID`.
#[utoipa::path(get, path = "/reports.ics", tag = "sessions",
    responses((status = 200, description = "The calendar (iCalendar, RFC 5545).", body = String, content_type = "text/calendar")))]
pub async fn reports(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
) -> Result<Response, ProblemDocument> {
    let room = service.room_for(page::bytes(MOST_IN_CALENDAR)).await?;
    let value = service.sessions.calendar(&caller).await?.into_bytes();
    let mut response = bodies::sent(Large { value, room });
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("text/calendar; charset=utf-8"));
    Ok(response)
}
