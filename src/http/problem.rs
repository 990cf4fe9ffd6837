//! Every way in which a request can fail, defined once: RFC 9457 problem documents.
//!
//! [`ProblemKind::entry`] is the only place that pairs a kind with its slug, status and title. Responses and the
//! OpenAPI description, including its table of all kinds, are derived from it.

use std::time::Duration;

use axum::Json;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::service::entries::doubts::{Doubt, Doubts};
use crate::service::metrics::PROBLEMS;

/// The kind of a failure; kinds differ by what the client should do next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProblemKind {
    MalformedJson,
    InvalidQuery,
    InvalidHeader,
    Unauthenticated,
    Forbidden,
    UnknownRoute,
    NotFound,
    WrongMethod,
    IdempotencyConflict,
    InUse,
    JobNotEnded,
    ReportConflict,
    ReportGap,
    Unconfirmed,
    SessionCompleted,
    BodyTooLarge,
    QuotaExceeded,
    UnsupportedMediaType,
    Misdirected,
    InvalidField,
    TooManyRequests,
    QueueFull,
    Internal,
    Overloaded,
    StorageFull,
}

impl ProblemKind {
    /// All kinds, in ascending order of status.
    pub const ALL: [ProblemKind; 25] = [
        ProblemKind::MalformedJson,
        ProblemKind::InvalidQuery,
        ProblemKind::InvalidHeader,
        ProblemKind::Unauthenticated,
        ProblemKind::Forbidden,
        ProblemKind::UnknownRoute,
        ProblemKind::NotFound,
        ProblemKind::WrongMethod,
        ProblemKind::IdempotencyConflict,
        ProblemKind::InUse,
        ProblemKind::JobNotEnded,
        ProblemKind::ReportConflict,
        ProblemKind::ReportGap,
        ProblemKind::Unconfirmed,
        ProblemKind::SessionCompleted,
        ProblemKind::BodyTooLarge,
        ProblemKind::QuotaExceeded,
        ProblemKind::UnsupportedMediaType,
        ProblemKind::Misdirected,
        ProblemKind::InvalidField,
        ProblemKind::TooManyRequests,
        ProblemKind::QueueFull,
        ProblemKind::Internal,
        ProblemKind::Overloaded,
        ProblemKind::StorageFull,
    ];

    /// Returns the slug, status and title.
    pub fn entry(self) -> (&'static str, StatusCode, &'static str) {
        use StatusCode as S;
        match self {
            Self::MalformedJson => ("malformed-json", S::BAD_REQUEST, "The body is not JSON"),
            Self::InvalidQuery => ("invalid-query", S::BAD_REQUEST, "A query parameter breaks a rule"),
            Self::InvalidHeader => ("invalid-header", S::BAD_REQUEST, "A header breaks a rule"),
            Self::Unauthenticated => ("unauthenticated", S::UNAUTHORIZED, "The call needs a key"),
            Self::Forbidden => ("forbidden", S::FORBIDDEN, "The key lacks a role"),
            Self::UnknownRoute => ("unknown-route", S::NOT_FOUND, "There is nothing at this address"),
            Self::NotFound => ("not-found", S::NOT_FOUND, "The requested object does not exist"),
            Self::WrongMethod => ("wrong-method", S::METHOD_NOT_ALLOWED, "The address does not accept this method"),
            Self::IdempotencyConflict => {
                ("idempotency-conflict", S::CONFLICT, "The idempotency key was used with another body")
            }
            Self::InUse => ("in-use", S::CONFLICT, "Something else uses it"),
            Self::JobNotEnded => ("job-not-ended", S::CONFLICT, "The job is queued or running"),
            Self::ReportConflict => ("report-conflict", S::CONFLICT, "It was reported before with other content"),
            Self::ReportGap => ("report-gap", S::CONFLICT, "It is not the next in order"),
            Self::Unconfirmed => ("unconfirmed", S::CONFLICT, "The report is probably a mistake"),
            Self::SessionCompleted => ("session-completed", S::CONFLICT, "The session has reached its horizon"),
            Self::BodyTooLarge => ("body-too-large", S::PAYLOAD_TOO_LARGE, "The body is too large"),
            Self::QuotaExceeded => ("quota-exceeded", S::PAYLOAD_TOO_LARGE, "The tenant's quota is used up"),
            Self::UnsupportedMediaType => {
                ("unsupported-media-type", S::UNSUPPORTED_MEDIA_TYPE, "The body must be application/json")
            }
            Self::Misdirected => ("misdirected", S::MISDIRECTED_REQUEST, "The service does not accept this host name"),
            Self::InvalidField => ("invalid-field", S::UNPROCESSABLE_ENTITY, "A field breaks a rule"),
            Self::TooManyRequests => ("too-many-requests", S::TOO_MANY_REQUESTS, "The tenant calls too often"),
            Self::QueueFull => ("queue-full", S::TOO_MANY_REQUESTS, "The tenant's job queue is full"),
            Self::Internal => ("internal", S::INTERNAL_SERVER_ERROR, "The service failed"),
            Self::Overloaded => ("overloaded", S::SERVICE_UNAVAILABLE, "The service cannot answer now"),
            Self::StorageFull => ("storage-full", S::INSUFFICIENT_STORAGE, "The data folder is full"),
        }
    }
}

/// A problem document (RFC 9457).
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ProblemDocument {
    /// Stable reference of the kind of problem: `/problems/<slug>`.
    #[serde(rename = "type")]
    #[schema(value_type = String, example = "/problems/invalid-field")]
    pub kind: Box<str>,
    #[schema(example = "A field breaks a rule")]
    pub title: &'static str,
    #[schema(example = 422)]
    pub status: u16,
    /// This occurrence of the problem, in one sentence.
    #[schema(value_type = String, example = "problem.horizon is 0: must lie in [1, 520]")]
    pub detail: Box<str>,
    /// The invalid field (as a dotted path), header or parameter; every problem that the client can correct names it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>, example = "problem.horizon")]
    pub field: Option<Box<str>>,
    /// Value that the field had.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Value>)]
    pub value: Option<Box<Value>>,
    /// Rule that the field must satisfy.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>, example = "must lie in [1, 520]")]
    pub rule: Option<Box<str>>,
    /// Everything in a report that is probably a mistake; sent again with `confirm`, the report is recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Vec<Doubt>>)]
    pub doubts: Option<Box<Doubts>>,
    /// Time to wait before a retry, if known; sent as `Retry-After`.
    #[serde(skip)]
    pub retry_after: Option<Duration>,
}

/// Most characters shown of a field's name, of a value and of a sentence. Refused text is the caller's own and may hold
/// megabytes.
const SHOWN_FIELD: usize = 120;
pub const SHOWN_VALUE: usize = 80;
const SHOWN_SENTENCE: usize = 400;

/// Returns `text` if it has at most `limit` characters, and otherwise its start.
pub fn shortened(text: &str, limit: usize) -> String {
    match text.char_indices().nth(limit) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

impl ProblemDocument {
    pub fn new(kind: ProblemKind, detail: impl Into<String>) -> Self {
        let (slug, status, title) = kind.entry();
        ProblemDocument {
            kind: format!("/problems/{slug}").into(),
            title,
            status: status.as_u16(),
            detail: shortened(&detail.into(), SHOWN_SENTENCE).into(),
            field: None,
            value: None,
            rule: None,
            doubts: None,
            retry_after: None,
        }
    }

    /// Creates the problem of a field that breaks a rule. A value that is not JSON is shown as text.
    pub fn of_field(kind: ProblemKind, error: FieldError) -> Self {
        let error = FieldError {
            field: shortened(&error.field, SHOWN_FIELD),
            value: shortened(&error.value, SHOWN_VALUE),
            rule: shortened(&error.rule, SHOWN_SENTENCE),
        };
        let detail = error.to_string();
        let value = serde_json::from_str(&error.value).unwrap_or(Value::String(error.value));
        ProblemDocument::new(kind, detail).naming(error.field, value, error.rule)
    }

    /// Creates the problem of a query parameter that breaks a rule.
    pub fn of_parameter(name: &str, value: &str, rule: impl Into<String>) -> Self {
        ProblemDocument::of_field(ProblemKind::InvalidQuery, FieldError::new(name, value, rule))
    }

    /// Adds the field, its value and the rule that it must satisfy.
    pub fn naming(self, field: impl Into<String>, value: impl Into<Value>, rule: impl Into<Box<str>>) -> Self {
        let value = match value.into() {
            Value::String(text) => Value::String(shortened(&text, SHOWN_VALUE)),
            value => value,
        };
        let (field, rule) = (shortened(&field.into(), SHOWN_FIELD), shortened(&rule.into(), SHOWN_SENTENCE));
        ProblemDocument { field: Some(field.into()), value: Some(Box::new(value)), rule: Some(rule.into()), ..self }
    }

    /// Adds the time after which a retry may succeed.
    pub fn to_be_asked_again_in(self, wait: Duration) -> Self {
        ProblemDocument { retry_after: Some(wait), ..self }
    }
}

impl ProblemDocument {
    fn slug(&self) -> &str {
        self.kind.trim_start_matches("/problems/")
    }

    /// Counts the problem; call it once, when the problem is answered.
    pub fn count(&self) {
        metrics::counter!(PROBLEMS, "problem" => self.slug().to_owned()).increment(1);
    }
}

/// Sets the count of every kind to zero, so that the first problem shows as an increase.
pub fn count_from_zero() {
    for kind in ProblemKind::ALL {
        metrics::counter!(PROBLEMS, "problem" => kind.entry().0).increment(0);
    }
}

impl IntoResponse for ProblemDocument {
    fn into_response(self) -> Response {
        let wait = self.retry_after.map(|wait| wait.as_secs_f64().ceil().max(1.0) as u64);
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        self.count();
        let mut response = (status, Json(self)).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        if status == StatusCode::UNAUTHORIZED {
            headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        let passes = [StatusCode::TOO_MANY_REQUESTS, StatusCode::SERVICE_UNAVAILABLE, StatusCode::INSUFFICIENT_STORAGE];
        if let Some(seconds) = wait.or(passes.contains(&status).then_some(1)) {
            headers.insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        response
    }
}
