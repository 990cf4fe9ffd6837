//! The endpoint of the Model Context Protocol.

use std::sync::{Arc, LazyLock};

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json, Router};
use serde::Serialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use crate::http::agents::call::ToolCaller;
use crate::http::agents::message::{RpcError, RpcFailure, RpcId, RpcMessage, RpcParams, RpcSuccess};
use crate::http::agents::revision::{self, RevisionKind};
use crate::http::agents::tools::Toolbox;
use crate::http::connection::exchanges::LocalAddress;
use crate::http::gate::access::{CallerOf, ReadCalls};
use crate::http::gate::bodies;
use crate::http::gate::extract::JsonBytes;
use crate::http::problem::ProblemDocument;
use crate::http::site::guide;
use crate::service::Service;
use crate::service::error::ServiceError;

/// Words for a model that meets this service for the first time.
const INSTRUCTIONS: &str = "Ballast says how much of an investor's money to hold in one or several assets, so that the \
    advice holds for every law of returns that the data cannot reject. All tools read or advise, and none changes \
    anything. `advise` needs only a history of returns. A return is a fraction per period: 0.01 is 1 %. A session is one \
    investor's running plan; `action` returns its advice for the coming period.";
/// The beginning of the address of a page of the guide.
const PAGES: &str = "ballast://guide/";
/// How long a client may keep a list, in milliseconds. Lists change only with the binary.
const LIST_KEPT_MS: u64 = 3_600_000;

/// The tools, and the router that runs their calls.
pub struct AgentTools {
    pub toolbox: &'static LazyLock<Toolbox>,
    pub operations: Router,
}

/// Answers one message of the Model Context Protocol: a JSON-RPC request, or a notification, which is only accepted. The
/// tools read and advise with the rights of the caller's key; the resources are the pages of the guide. `GET` is not accepted, because the service sends no
/// messages of its own.
#[utoipa::path(post, path = "/mcp", tag = "agents",
    request_body(content = RpcMessage, example = json!({ "jsonrpc": "2.0", "id": 1, "method": "tools/list" })),
    responses(
        (status = 200, description = "The JSON-RPC answer: a result or an error.", body = serde_json::Value),
        (status = 202, description = "The notification is accepted."),
        (status = 400, description = "The body is no JSON-RPC message, or its protocol version or headers are wrong.",
            content((RpcFailure = "application/json"), (ProblemDocument = "application/problem+json"))),
        (status = 404, description = "There is no such method.", body = RpcFailure)))]
pub async fn receive(
    State(service): State<Arc<Service>>,
    _counted: CallerOf<ReadCalls>,
    Extension(tools): Extension<Arc<AgentTools>>,
    local: Option<Extension<LocalAddress>>,
    headers: HeaderMap,
    body: JsonBytes,
) -> Result<Response, ProblemDocument> {
    if revision::is_of_another_page(&headers) {
        let error = RpcError::new(RpcError::NO_REQUEST, "a web page of another origin is not answered");
        return Ok((StatusCode::FORBIDDEN, Json(RpcFailure::new(None, error))).into_response());
    }
    let message = match body.decoded(|bytes| Ok(RpcMessage::read(bytes))).await? {
        Ok(message) => message,
        Err(error) => return Ok((StatusCode::BAD_REQUEST, Json(RpcFailure::new(None, error))).into_response()),
    };
    let read = message.params().and_then(|params| {
        let kind = revision::of_message(&headers, &message, &params)?;
        Ok((params, kind))
    });
    let (params, kind) = match read {
        Ok(read) => read,
        Err(error) => return Ok((StatusCode::BAD_REQUEST, Json(RpcFailure::new(message.id, error))).into_response()),
    };
    let Some(id) = message.id else { return Ok(StatusCode::ACCEPTED.into_response()) };
    let caller = ToolCaller { headers, local: local.map(|Extension(local)| local) };
    let exchange = Exchange { service: &service, tools: &tools, kind, id };
    exchange.answer(&message.method, params, caller).await
}

/// A request under way.
struct Exchange<'a> {
    service: &'a Service,
    tools: &'a AgentTools,
    kind: RevisionKind,
    id: RpcId,
}

/// A result with the members that the revision without a handshake adds to every one.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct MarkedResult<R> {
    #[serde(flatten)]
    result: R,
    #[serde(skip_serializing_if = "Option::is_none")]
    result_type: Option<&'static str>,
    #[serde(rename = "_meta", skip_serializing_if = "Option::is_none")]
    meta: Option<Value>,
}

/// The result of a list, which a client may keep.
#[derive(Serialize)]
struct ToolListResult<'a> {
    tools: &'a RawValue,
    #[serde(flatten)]
    kept: Value,
}

impl Exchange<'_> {
    async fn answer(self, method: &str, params: RpcParams, caller: ToolCaller) -> Result<Response, ProblemDocument> {
        match (method, self.kind) {
            ("initialize", _) => self.success(handshake(params.offered.as_deref())).await,
            ("server/discover", RevisionKind::Stateless) => self.success(discovery()).await,
            ("ping", _) => self.success(json!({})).await,
            ("tools/list", _) => {
                let tools = &self.tools.toolbox.listed;
                self.success(ToolListResult { tools, kept: self.kept() }).await
            }
            ("tools/call", _) => self.call(params, caller).await,
            ("resources/list", _) => self.success(self.pages()).await,
            ("resources/templates/list", _) => self.success(self.with_kept(json!({ "resourceTemplates": [] }))).await,
            ("resources/read", _) => self.read(params).await,
            (unknown, _) => {
                let message = format!("there is no method {unknown}");
                Ok(self.failure(RpcError::new(RpcError::UNKNOWN_METHOD, message)))
            }
        }
    }

    async fn call(self, params: RpcParams, caller: ToolCaller) -> Result<Response, ProblemDocument> {
        let toolbox = self.tools.toolbox;
        let Some(tool) = params.name.as_deref().and_then(|name| toolbox.find(name)) else {
            let names: Vec<&str> = toolbox.names().collect();
            let message = format!(
                "there is no tool {}: params.name must be one of {}",
                params.name.unwrap_or_default(),
                names.join(", ")
            );
            return Ok(self.failure(RpcError::new(RpcError::WRONG_PARAMS, message)));
        };
        let answer = tool.call(self.tools.operations.clone(), params.arguments.as_deref(), caller).await;
        self.success(answer.result()).await
    }

    /// Returns the pages of the guide, as resources.
    fn pages(&self) -> Value {
        let page = |(name, title)| json!({ "uri": format!("{PAGES}{name}"), "name": name, "title": title, "mimeType": "text/markdown" });
        self.with_kept(json!({ "resources": guide::titles().map(page).collect::<Vec<Value>>() }))
    }

    async fn read(self, params: RpcParams) -> Result<Response, ProblemDocument> {
        let uri = params.uri.unwrap_or_default();
        let Some(text) = uri.strip_prefix(PAGES).and_then(guide::markdown) else {
            let message = format!("there is no resource {uri}: resources/list has all");
            return Ok(self.failure(RpcError::new(RpcError::WRONG_PARAMS, message)));
        };
        let contents = json!({ "uri": uri, "mimeType": "text/markdown", "text": text });
        self.success(self.with_kept(json!({ "contents": [contents] }))).await
    }

    /// Adds to a result how long it may be kept.
    fn with_kept(&self, mut result: Value) -> Value {
        if let (Value::Object(result), Value::Object(kept)) = (&mut result, self.kept()) {
            result.extend(kept);
        }
        result
    }

    /// Returns how long a list may be kept, which only the revision without a handshake says.
    fn kept(&self) -> Value {
        match self.kind {
            RevisionKind::Stateless => json!({ "ttlMs": LIST_KEPT_MS, "cacheScope": "public" }),
            RevisionKind::WithHandshake => json!({}),
        }
    }

    async fn success(&self, result: impl Serialize) -> Result<Response, ProblemDocument> {
        let is_marked = self.kind == RevisionKind::Stateless;
        let meta = is_marked.then(|| json!({ "io.modelcontextprotocol/serverInfo": server() }));
        let result = MarkedResult { result, result_type: is_marked.then_some("complete"), meta };
        let json = serde_json::to_string(&RpcSuccess::new(&self.id, result)).map_err(ServiceError::internal)?;
        bodies::recorded(self.service, json).await
    }

    /// Returns an error. Its status is 200 after a handshake, because older clients do not read the body of another.
    fn failure(self, error: RpcError) -> Response {
        let status = match (self.kind, error.code) {
            (RevisionKind::WithHandshake, _) => StatusCode::OK,
            (RevisionKind::Stateless, RpcError::UNKNOWN_METHOD) => StatusCode::NOT_FOUND,
            (RevisionKind::Stateless, _) => StatusCode::BAD_REQUEST,
        };
        (status, Json(RpcFailure::new(Some(self.id), error))).into_response()
    }
}

fn server() -> Value {
    json!({ "name": "ballast", "title": "Ballast", "version": env!("CARGO_PKG_VERSION") })
}

fn capabilities() -> Value {
    json!({ "tools": {}, "resources": {} })
}

fn handshake(offered: Option<&str>) -> Value {
    json!({
        "protocolVersion": revision::agreed(offered),
        "capabilities": capabilities(),
        "serverInfo": server(),
        "instructions": INSTRUCTIONS,
    })
}

fn discovery() -> Value {
    json!({
        "supportedVersions": revision::supported(),
        "capabilities": capabilities(),
        "instructions": INSTRUCTIONS,
        "ttlMs": LIST_KEPT_MS,
        "cacheScope": "public",
    })
}
