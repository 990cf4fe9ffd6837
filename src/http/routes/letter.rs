//! The letter to a client.

use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderName, HeaderValue, header};
use axum::response::Response;
use serde::Deserialize;

use crate::http::gate::access::{self, CallerAsking};
use crate::http::gate::bodies;
use crate::http::gate::extract::{Id, JsonBody};
use crate::http::problem::ProblemDocument;
use crate::http::routes::sessions::Flag;
use crate::http::site::asset::HTML;
use crate::http::site::letter as site;
use crate::service::Service;
use crate::service::callers::allowance::Class;
use crate::service::error::ServiceError;
use crate::service::letter::LetterReasons;
use crate::service::letter::content::Letter;
use crate::service::letter::request::LetterRequest;

/// The header that says the trades in one line, for programs that sort letters.
const TRADES: HeaderName = HeaderName::from_static("ballast-trades");

/// The header that keeps a letter out of the indexes of search engines.
const ROBOTS: HeaderName = HeaderName::from_static("x-robots-tag");

/// Query of a letter.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LetterQuery {
    sensitivity: Option<Flag>,
}

impl LetterQuery {
    fn reasons(&self) -> LetterReasons {
        match self.sensitivity {
            Some(Flag::True) => LetterReasons::WorthAndChange,
            Some(Flag::False) | None => LetterReasons::Worth,
        }
    }
}

impl access::ClassedQuery for LetterQuery {
    /// Returns the class: that of the history, or that of an advice with its sensitivity.
    fn class(&self) -> Class {
        match self.reasons() {
            LetterReasons::WorthAndChange => Class::Heavy,
            LetterReasons::Worth => Class::Read,
        }
    }
}

/// Writes the letter of a session to its client: one HTML document of one A4 page, with what to hold and to trade, how it
/// went, and why. Nothing of the request is kept.
#[utoipa::path(post, path = "/sessions/{id}/letter", tag = "sessions",
    params(("id" = String, Path, description = "The session."),
           ("sensitivity" = Option<bool>, Query, description = "`true`: also say what would change the advice, if it is of one asset.")),
    request_body(content = LetterRequest, example = json!({
        "firm": { "name": "Example Advisers", "closing": "Please call us.", "disclaimer": "Past returns do not predict the future." },
        "currency": "EUR", "smallest_trade": { "amount": 500.0 }
    })),
    responses(
        (status = 200, description = "The letter.", body = String, content_type = "text/html",
            headers(("Ballast-Trades" = String, description = "The trades in one line, such as `Buy EUR 1,234.50`, or `Nothing`."))),
        (status = 400, description = "A parameter breaks a rule.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 404, description = "There is no such session.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule, or the session is of a declared problem.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn letter(
    State(service): State<Arc<Service>>,
    CallerAsking(caller, query): CallerAsking<LetterQuery>,
    Id(id): Id,
    JsonBody(request): JsonBody<LetterRequest>,
) -> Result<Response, ProblemDocument> {
    let letter = service.letter(&caller.tenant, &id, (request, query.reasons()), &caller.turn).await?;
    sent(&service, &letter).await
}

/// Sends a letter as its document.
pub(super) async fn sent(service: &Service, letter: &Letter) -> Result<Response, ProblemDocument> {
    // A header holds letters of ASCII only.
    let trades = letter.trades.replace('\u{a0}', " ");
    let trades = HeaderValue::from_str(&trades).map_err(ServiceError::internal)?;
    let mut response = bodies::recorded(service, site::page(letter)).await?;
    let policy = HeaderValue::from_static(site::content_security_policy());
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(HTML)),
        (header::CONTENT_SECURITY_POLICY, policy),
        (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
        (ROBOTS, HeaderValue::from_static("noindex")),
        (TRADES, trades),
    ];
    for (name, value) in headers {
        response.headers_mut().insert(name, value);
    }
    Ok(response)
}
