//! Output of logs and traces.
//!
//! Logs go to standard error. Traces are sent by OpenTelemetry's own protocol over HTTP if
//! `OTEL_EXPORTER_OTLP_ENDPOINT` gives an address. Its other variables (`OTEL_SERVICE_NAME`, `OTEL_TRACES_SAMPLER`,
//! `OTEL_EXPORTER_OTLP_HEADERS` and so on) apply as documented there. Traces are sent from their own thread, in
//! batches; if the collector does not answer, spans are dropped and nothing waits. A request's trace is never taken
//! from its caller, because callers could then have all of their traces kept.

use std::io::IsTerminal;

use ballast::service::process::spans;
use opentelemetry::trace::TracerProvider;
use opentelemetry_otlp::SpanExporter;
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tracing::Subscriber;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer, fmt};

const ENDPOINT: &str = "OTEL_EXPORTER_OTLP_ENDPOINT";
const SERVICE_NAME: &str = "OTEL_SERVICE_NAME";

/// The exporter of traces; sends what is left when it ends.
pub struct Traces(Option<SdkTracerProvider>);

/// Starts logs and traces. `RUST_LOG` chooses what is logged: for people on a terminal, as JSON elsewhere.
///
/// # Errors
/// The variables of OpenTelemetry contradict themselves.
pub fn start() -> Result<Traces, Box<dyn std::error::Error>> {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info,sqlx=warn"));
    if std::env::var_os(ENDPOINT).is_none_or(|endpoint| endpoint.is_empty()) {
        tracing_subscriber::registry().with(filter).with(logging()).init();
        return Ok(Traces(None));
    }
    let resource = Resource::builder();
    let resource = match std::env::var_os(SERVICE_NAME) {
        Some(_) => resource.build(),
        None => resource.with_service_name("ballast").build(),
    };
    let exporter = SpanExporter::builder().with_http().build()?;
    let provider = SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource).build();
    let layer = tracing_opentelemetry::layer().with_location(false).with_threads(false).with_level(false);
    let layer = layer.with_target(false).with_tracked_inactivity(false).with_tracer(provider.tracer("ballast"));
    let only_spans = Targets::new().with_target(spans::TARGET, LevelFilter::TRACE);
    let subscriber = tracing_subscriber::registry().with(logging().with_filter(filter));
    subscriber.with(layer.with_filter(only_spans)).init();
    Ok(Traces(Some(provider)))
}

fn logging<S: Subscriber + for<'span> LookupSpan<'span>>() -> Box<dyn Layer<S> + Send + Sync> {
    let logging = fmt::layer().with_writer(std::io::stderr);
    if std::io::stderr().is_terminal() { logging.boxed() } else { logging.json().flatten_event(true).boxed() }
}

impl Traces {
    /// Sends what is left, for as long as OpenTelemetry allows.
    pub async fn end(self) {
        let Some(provider) = self.0 else { return };
        let ended = tokio::task::spawn_blocking(move || provider.shutdown()).await;
        if let Ok(Err(error)) = ended {
            tracing::warn!(%error, "the last traces were not sent");
        }
    }
}
