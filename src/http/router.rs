//! Every route, once: the router and its OpenAPI description come from the same list.

use std::panic::AssertUnwindSafe;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, Uri, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::get;
use axum::{Extension, Router};
use futures_util::FutureExt;
use tracing::Instrument;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::problem::{ProblemDocument, ProblemKind};
use crate::http::agents::tools::Toolbox;
use crate::http::description::documentation::{self, Published};
use crate::http::description::{bounds, defaults, identifiers, problem_responses, reference};
use crate::http::gate::access::{self, CallerOf, Gate, ReadCalls};
use crate::http::gate::bodies::{self, Bodies};
use crate::http::gate::hosts::Hosts;
use crate::http::gate::telemetry;
use crate::http::routes::{
    advise, audit, backtests, calendar, decide, evaluations, events, frontiers, futures, holder, jobs, labels, letter,
    links, mcp, moving, operations, orders, overview, plan, policies, reports, returns, sessions, sleeve,
    subscriptions, what_if, wire,
};
use crate::http::site::{dashboard, guide};
use crate::service::Service;
use crate::service::process::config::Config;

/// Limit for bodies other than policies: the longest history and design fit several times.
const BODY_BYTES: usize = 4 << 20;

#[derive(OpenApi)]
#[openapi(
    // `jobs::Queueing` refers to it without describing it.
    components(schemas(wire::AcceptedJob)),
    info(title = "Ballast", description = "Nonparametric adaptive robust control for an investor. Every error is a problem document (RFC 9457)."),
    tags(
        (name = "advice", description = "Get advice at once: nothing is trained and nothing is stored."),
        (name = "jobs", description = "Train and compare policies in the background."),
        (name = "policies", description = "Manage trained policies."),
        (name = "sessions", description = "Run sessions: report returns and get live advice."),
        (name = "subscriptions", description = "Be told of events by signed webhooks or by e-mail."),
        (name = "agents", description = "Let agents read and get advice, by the Model Context Protocol."),
        (name = "operations", description = "Operate the service."))
)]
struct Description;

fn routes() -> OpenApiRouter<Arc<Service>> {
    users().merge(agents()).merge(operators()).merge(pages())
}

fn users() -> OpenApiRouter<Arc<Service>> {
    OpenApiRouter::with_openapi(Description::openapi())
        .routes(routes!(jobs::train))
        .routes(routes!(jobs::list))
        .routes(routes!(jobs::get, jobs::delete))
        .routes(routes!(jobs::cancel))
        .routes(routes!(events::follow))
        .routes(routes!(evaluations::evaluate))
        .routes(routes!(evaluations::report))
        .routes(routes!(backtests::backtest))
        .routes(routes!(frontiers::frontier))
        .routes(routes!(policies::list))
        .routes(routes!(policies::get, policies::delete, labels::of_policy))
        .routes(routes!(policies::export))
        .routes(routes!(policies::surface))
        .routes(routes!(futures::of_policy))
        .routes(routes!(policies::import))
        .routes(routes!(sessions::open, overview::list))
        .routes(routes!(calendar::reports))
        .routes(routes!(sessions::get, sessions::delete, labels::of_session))
        .routes(routes!(sessions::history))
        .routes(routes!(moving::export))
        .routes(routes!(moving::import))
        .routes(routes!(futures::of_session))
        .routes(routes!(reports::observe))
        .routes(routes!(sessions::correct))
        .routes(routes!(sessions::renew))
        .routes(routes!(sessions::action))
        .routes(routes!(letter::letter))
        .routes(routes!(links::make, links::list))
        .routes(routes!(links::delete))
        .routes(routes!(links::read))
        .routes(routes!(what_if::what_if))
        .routes(routes!(orders::orders))
        .routes(routes!(advise::advise))
        .routes(routes!(plan::plan))
        .routes(routes!(sleeve::sleeve))
        .routes(routes!(decide::decide))
        .routes(routes!(returns::read))
        .routes(routes!(holder::get))
        .routes(routes!(subscriptions::create, subscriptions::list))
        .routes(routes!(subscriptions::delete))
        .routes(routes!(subscriptions::rotate))
        .routes(routes!(subscriptions::resend))
}

fn agents() -> OpenApiRouter<Arc<Service>> {
    OpenApiRouter::new().routes(routes!(mcp::receive))
}

fn operators() -> OpenApiRouter<Arc<Service>> {
    OpenApiRouter::new()
        .routes(routes!(operations::livez))
        .routes(routes!(operations::readyz))
        .routes(routes!(operations::health))
        .routes(routes!(operations::metrics))
        .routes(routes!(audit::list))
        .routes(routes!(operations::openapi))
        .routes(routes!(documentation::docs))
        .routes(routes!(documentation::docs_file))
}

fn pages() -> OpenApiRouter<Arc<Service>> {
    OpenApiRouter::new()
        .routes(routes!(dashboard::root))
        .routes(routes!(dashboard::file))
        .routes(routes!(guide::start))
        .routes(routes!(guide::file))
        .routes(routes!(guide::llms))
}

/// Returns the OpenAPI description.
pub fn description() -> utoipa::openapi::OpenApi {
    let mut description = routes().into_openapi();
    identifiers::tell(&mut description);
    problem_responses::with_every_problem(&mut description);
    bounds::tell(&mut description);
    defaults::tell(&mut description);
    description
}

static PUBLISHED: LazyLock<String> = LazyLock::new(|| description().to_pretty_json().unwrap_or_default() + "\n");

static TOOLBOX: LazyLock<Toolbox> = LazyLock::new(|| Toolbox::new(&description()));

/// Returns the description as checked in under `api/openapi.json`.
pub fn description_json() -> &'static str {
    &PUBLISHED
}

/// Returns the description as a page for people, as checked in under `docs/requests.md`.
pub fn reference_page() -> String {
    reference::page(&description())
}

/// Returns the whole application; for a replica that only runs jobs, its operator part.
pub fn application(service: Arc<Service>, config: &Config) -> Router {
    if !config.role.answers() {
        return for_operators(service, config);
    }
    let surroundings = Surroundings::new(&service, config);
    // An agent's call passes the gate as itself and once more as its operation.
    let operations = guarded(users(), service.clone(), surroundings.clone());
    let tools = Arc::new(mcp::AgentTools { toolbox: &TOOLBOX, operations });
    let agents = agents().route_layer(Extension(tools));
    let routes = publishing(operators().merge(pages())).merge(users()).merge(agents);
    guarded(routes, service, surroundings)
}

/// Returns the operator part of the application.
pub fn for_operators(service: Arc<Service>, config: &Config) -> Router {
    let surroundings = Surroundings::new(&service, config);
    guarded(publishing(operators()), service, surroundings)
}

/// Returns the application that answers while the service starts: the process is alive, and not ready. Each connection
/// gets one answer.
pub fn starting() -> Router {
    let not_yet = || async {
        let problem = ProblemDocument::new(ProblemKind::Overloaded, "the service is starting");
        ([(header::CONNECTION, "close")], problem)
    };
    let alive = || async { ([(header::CONNECTION, "close")], operations::livez().await) };
    Router::new().route("/livez", get(alive)).fallback(not_yet)
}

/// Adds the description to the routes. The users' routes do without it, because they do not need it and are called
/// most.
fn publishing(routes: OpenApiRouter<Arc<Service>>) -> OpenApiRouter<Arc<Service>> {
    let published: Published = &PUBLISHED;
    routes.route_layer(Extension(published))
}

fn guarded(routes: OpenApiRouter<Arc<Service>>, service: Arc<Service>, surroundings: Surroundings) -> Router {
    let (router, _) = routes.split_for_parts();
    router
        .fallback(unknown_route)
        .method_not_allowed_fallback(wrong_method)
        .layer(middleware::from_fn_with_state(surroundings, answered))
        .with_state(service)
}

/// The context in which every handler runs.
#[derive(Clone)]
struct Surroundings {
    gate: Gate,
    limit: Duration,
}

impl Surroundings {
    fn new(service: &Arc<Service>, config: &Config) -> Self {
        let gate = Gate {
            service: service.clone(),
            large_body_bytes: config.body_limit_bytes,
            body_bytes: config.body_limit_bytes.min(BODY_BYTES),
            bodies: Bodies::new(config.memory_limit.bytes, config.body_limit_bytes),
            hosts: Arc::new(Hosts::new(&config.hosts)),
        };
        Surroundings { gate, limit: config.request_timeout }
    }
}

/// Admits a request, bounds its time, answers if it panics, forbids browsers to store the answer or to guess its type,
/// and records it. This is one layer, because each layer costs every request the clones and allocations of all below it.
async fn answered(State(around): State<Surroundings>, request: Request, next: Next) -> Response {
    let recording = telemetry::Recording::start(&request);
    let service = around.gate.service.clone();
    let answering = async {
        let response = within_time(around.limit, access::admit(State(around.gate), request, next)).await;
        bodies::budgeted(&service, response).await
    };
    let mut response = match AssertUnwindSafe(answering.instrument(recording.span())).catch_unwind().await {
        Ok(response) => response,
        Err(_) => ProblemDocument::new(ProblemKind::Internal, "the cause is in the log").into_response(),
    };
    let headers = response.headers_mut();
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    recording.end(&response);
    response
}

/// Redirects a browser that requests a page by its address without the `#`; the page itself asks for a key.
async fn unknown_route(
    caller: Result<CallerOf<ReadCalls>, ProblemDocument>,
    method: Method,
    headers: HeaderMap,
    uri: Uri,
) -> Result<Redirect, ProblemDocument> {
    let wants = headers.get(header::ACCEPT).and_then(|accept| accept.to_str().ok());
    if method == Method::GET && wants.is_some_and(|accept| accept.contains("text/html")) {
        return Ok(Redirect::to(&format!("/#{}", uri.path())));
    }
    caller?;
    let problem = ProblemDocument::new(ProblemKind::UnknownRoute, format!("there is nothing at {}", uri.path()));
    Err(problem.naming("path", uri.path(), "must be a path listed in /openapi.json"))
}

async fn wrong_method(_: Option<CallerOf<ReadCalls>>, method: Method, uri: Uri) -> ProblemDocument {
    let problem = ProblemDocument::new(ProblemKind::WrongMethod, format!("{} does not accept {method}", uri.path()));
    problem.naming("method", method.as_str(), "must be one of the methods in the Allow header")
}

/// Bounds the time to the head of the response, and so also the time for a slow body; event streams run on.
async fn within_time(limit: Duration, answering: impl Future<Output = Response>) -> Response {
    match tokio::time::timeout(limit, answering).await {
        Ok(response) => response,
        Err(_) => {
            let detail = format!("no answer within {} s", limit.as_secs());
            ProblemDocument::new(ProblemKind::Overloaded, detail).into_response()
        }
    }
}
