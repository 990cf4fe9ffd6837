//! Spans: what a request spends its time on, for OpenTelemetry.
//!
//! They have a target of their own, which the layer that hands them on listens to and nothing else does: where there is no
//! such layer, a span costs one look at a static. They name routes, statuses and tenants, never keys, nor what was sent.

use tracing::Span;
use tracing::field::Empty;

/// What a layer must listen to.
pub const TARGET: &str = "ballast_span";

/// A request on its way to a route of the table.
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

/// Ends [`of_request`]; a tenant where the request had one.
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

/// A write, until it is durable.
pub(super) fn of_write(what: &'static str) -> Span {
    tracing::trace_span!(target: TARGET, "write", otel.name = what)
}

/// The time until a place is free for work.
pub(super) fn of_turn() -> Span {
    tracing::trace_span!(target: TARGET, "turn", otel.name = "wait for a turn")
}

/// Work on a thread that may block.
pub(super) fn of_work(what: &'static str) -> Span {
    tracing::trace_span!(target: TARGET, "work", otel.name = what)
}
