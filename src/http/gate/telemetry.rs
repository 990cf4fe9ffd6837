//! One log line and two metrics for each request; the metrics page.

use std::num::NonZeroU32;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, LazyLock, OnceLock};
use std::time::{Duration, Instant};

use axum::extract::{MatchedPath, Request};
use axum::http::Method;
use axum::response::Response;
use governor::{DefaultDirectRateLimiter, Quota, RateLimiter};
use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle};
use tracing::Span;

use crate::http::connection::connection_table::Connections;
use crate::http::gate::access::Asker;
use crate::http::problem::{self, shortened};
use crate::service::callers::keys::KeyFigures;
use crate::service::metrics as names;
use crate::service::process::{figures, spans};
use crate::store::JobCounts;

/// The recorder of the process; the `metrics` crate allows one.
static RECORDER: OnceLock<Option<PrometheusHandle>> = OnceLock::new();

/// Installs the recorder; later calls change nothing.
pub fn install_recorder() {
    RECORDER.get_or_init(|| {
        let step = Matcher::Full(names::TRAINING_STEP_SECONDS.into());
        let builder = PrometheusBuilder::new()
            .set_buckets(&names::REQUEST_BUCKETS)
            .and_then(|builder| builder.set_buckets_for_metric(step, &names::STEP_BUCKETS));
        let handle = builder.and_then(PrometheusBuilder::install_recorder);
        names::describe();
        figures::describe();
        problem::count_from_zero();
        handle.inspect_err(|error| tracing::error!(%error, "metrics are not available")).ok()
    });
}

/// Interval between upkeeps. Histograms hold every sample until they are read, so this bounds them if nobody reads the
/// page.
const UPKEEP: Duration = Duration::from_secs(5);

/// Runs for ever: reads the histograms, counts the connections, and reports how many log lines were left out.
pub async fn keep_up(connections: Arc<Connections>) {
    metrics::counter!(names::CONNECTIONS_REFUSED).increment(0);
    loop {
        for (phase, count) in connections.count() {
            metrics::gauge!(names::CONNECTIONS, "phase" => phase.name()).set(count as f64);
        }
        let left_out = LEFT_OUT.swap(0, Ordering::Relaxed);
        if left_out > 0 {
            tracing::warn!(left_out, "log lines about callers without a key were left out");
        }
        if let Some(recorder) = RECORDER.get().and_then(Option::as_ref) {
            recorder.run_upkeep();
        }
        tokio::time::sleep(UPKEEP).await;
    }
}

/// Log lines a second about callers without a key, also the largest burst. A disk can bear this for months, and it is
/// enough to see what happens.
const UNKNOWN_CALLERS_LINES: NonZeroU32 = NonZeroU32::new(20).expect("not zero");
/// Longest path logged, in characters; real identifiers are shorter.
const LOGGED_PATH: usize = 200;

static LINES: LazyLock<DefaultDirectRateLimiter> =
    LazyLock::new(|| RateLimiter::direct(Quota::per_second(UNKNOWN_CALLERS_LINES)));
static LEFT_OUT: AtomicU64 = AtomicU64::new(0);

/// Returns true if a line about a caller without a key may be written now.
pub fn may_log() -> bool {
    let may = LINES.check().is_ok();
    if !may {
        LEFT_OUT.fetch_add(1, Ordering::Relaxed);
    }
    may
}

/// Returns the metrics page, with the current counts of the store.
pub fn exposition(jobs: JobCounts, sessions: u64, waiting: [(&'static str, usize); 3], keys: &[KeyFigures]) -> String {
    let by_state = [
        ("queued", jobs.queued),
        ("running", jobs.running),
        ("succeeded", jobs.succeeded),
        ("failed", jobs.failed),
        ("cancelled", jobs.cancelled),
    ];
    for (state, count) in by_state {
        metrics::gauge!(names::JOBS, "state" => state).set(count as f64);
    }
    metrics::gauge!(names::SESSIONS).set(sessions as f64);
    for (turn, requests) in waiting {
        metrics::gauge!(names::TURNS_WAITING, "turn" => turn).set(requests as f64);
    }
    figures::record();
    RECORDER.get().and_then(Option::as_ref).map(PrometheusHandle::render).unwrap_or_default() + &names::of_keys(keys)
}

/// Counts an answer that refuses a tenant.
pub fn count_refusal(status: u16, tenant: &str) {
    if matches!(status, 401 | 403 | 429) {
        metrics::counter!(names::REFUSALS, "tenant" => tenant.to_owned(), "status" => status.to_string()).increment(1);
    }
}

/// A request under way, recorded when it is answered.
pub struct Recording {
    started: Instant,
    method: Method,
    path: String,
    route: String,
    span: Span,
}

impl Recording {
    pub fn start(request: &Request) -> Self {
        let method = request.method().clone();
        let route = request.extensions().get::<MatchedPath>().map_or("unmatched", MatchedPath::as_str).to_owned();
        let span = spans::of_request(method.as_str(), &route);
        Recording { started: Instant::now(), method, path: shortened(request.uri().path(), LOGGED_PATH), route, span }
    }

    /// Returns the span in which the work for the request runs.
    pub fn span(&self) -> Span {
        self.span.clone()
    }

    pub fn end(self, response: &Response) {
        let Recording { started, method, path, route, span } = self;
        let (seconds, status) = (started.elapsed().as_secs_f64(), response.status().as_u16());
        // Otherwise every unknown method that a client can invent would become a label of its own.
        let verb = match method {
            Method::GET => "GET",
            Method::POST => "POST",
            Method::PATCH => "PATCH",
            Method::DELETE => "DELETE",
            Method::HEAD => "HEAD",
            _ => "other",
        };
        metrics::histogram!(names::HTTP_REQUEST_SECONDS, "method" => verb, "route" => route.clone()).record(seconds);
        metrics::counter!(names::HTTP_REQUESTS, "method" => verb, "route" => route, "status" => status.to_string())
            .increment(1);
        let asker = response.extensions().get::<Asker>();
        let tenant = asker.and_then(|asker| asker.tenant.as_ref()).map_or("", |tenant| tenant.as_str());
        count_refusal(status, tenant);
        spans::answered(&span, status, asker.map(|_| tenant));
        let key = asker.map_or("", |asker| &asker.key);
        if !key.is_empty() || may_log() {
            let method = shortened(method.as_str(), LOGGED_PATH);
            tracing::info!(method, path, status, seconds, tenant, key, "request");
        }
    }
}
