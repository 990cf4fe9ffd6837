//! Spans of where a request spends its time, for OpenTelemetry.
//!
//! They have a target of their own, to which only the exporting layer listens. Without such a layer, a span costs one
//! read of a static. Spans name routes, statuses and tenants, never keys or request contents.

use tracing::Span;
use tracing::field::Empty;

/// The target that a layer must listen to.
pub const TARGET: &str = "ballast_span";

/// Opens the span of a request to a route of the table.
pub fn of_request(method: &str, route: &str) -> Span {
    tracing::trace_span!(
        target: TARGET,
        "request",
        otel.name = format_args!("{method} {route}"),
        otel.kind = "server",
        otel.status_code = Empty,
        http.request.method = method,
        http.route = route,
        http.response.status_code = Empty,
        tenant = Empty,
    )
}

/// Records the outcome of the request in its span, with the tenant if it had one.
pub fn answered(span: &Span, status: u16, tenant: Option<&str>) {
    if span.is_disabled() {
        return;
    }
    span.record("http.response.status_code", status);
    if let Some(tenant) = tenant {
        span.record("tenant", tenant);
    }
    if status >= 500 {
        span.record("otel.status_code", "ERROR");
    }
}

/// Opens the span of a write, until it is durable.
pub(in crate::service) fn of_write(what: &'static str) -> Span {
    tracing::trace_span!(target: TARGET, "write", otel.name = what)
}

/// Opens the span of the wait for a permit.
pub(in crate::service) fn of_turn() -> Span {
    tracing::trace_span!(target: TARGET, "turn", otel.name = "wait for a turn")
}

/// Opens the span of work on a thread that may block.
pub(in crate::service) fn of_work(what: &'static str) -> Span {
    tracing::trace_span!(target: TARGET, "work", otel.name = what)
}
