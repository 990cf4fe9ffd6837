//! The messages of JSON-RPC 2.0, as the Model Context Protocol sends them: one a request, and never a list.

use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use serde_json::value::RawValue;
use utoipa::ToSchema;
use utoipa::openapi::{ObjectBuilder, RefOr, Schema, Type};

/// A request, or a notification if it has no `id`.
#[derive(Debug, Deserialize, ToSchema)]
pub struct RpcMessage {
    #[expect(dead_code, reason = "decoding checks it")]
    jsonrpc: RpcVersion,
    /// Identifier that the answer repeats. A notification has none.
    #[serde(default, deserialize_with = "present")]
    #[schema(value_type = RpcId, required = false)]
    pub id: Option<RpcId>,
    /// Name of the method, such as `tools/call`.
    pub method: String,
    /// Parameters of the method.
    #[serde(default, deserialize_with = "object")]
    #[schema(schema_with = any_object, required = false)]
    params: Option<Box<RawValue>>,
}

/// The version of JSON-RPC.
#[derive(Debug, Deserialize, ToSchema)]
enum RpcVersion {
    #[serde(rename = "2.0")]
    Second,
}

/// An identifier of a request: text or a whole number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum RpcId {
    Text(String),
    Number(i64),
}

/// Reads a value that is not null.
fn present<'de, D: Deserializer<'de>>(reader: D) -> Result<Option<RpcId>, D::Error> {
    RpcId::deserialize(reader).map(Some)
}

/// Reads an object, and rejects a list, which serde would read as the members in their order.
fn object<'de, D: Deserializer<'de>>(reader: D) -> Result<Option<Box<RawValue>>, D::Error> {
    let text = Box::<RawValue>::deserialize(reader)?;
    match text.get().starts_with('{') {
        true => Ok(Some(text)),
        false => Err(serde::de::Error::custom("params must be an object")),
    }
}

fn any_object() -> RefOr<Schema> {
    let object = ObjectBuilder::new().schema_type(Type::Object).description(Some("Parameters of the method."));
    object.build().into()
}

/// The parameters of all methods together; each method reads its own.
#[derive(Debug, Default, Deserialize)]
pub struct RpcParams {
    /// Name of a tool.
    pub name: Option<String>,
    /// Arguments of a tool.
    pub arguments: Option<Box<RawValue>>,
    /// Address of a resource.
    pub uri: Option<String>,
    /// Revision that a handshake offers.
    #[serde(rename = "protocolVersion")]
    pub offered: Option<String>,
    #[serde(rename = "_meta")]
    pub meta: Option<RequestMeta>,
}

/// Members of a request about the request itself, in the revision without a handshake.
#[derive(Debug, Default, Deserialize)]
pub struct RequestMeta {
    #[serde(rename = "io.modelcontextprotocol/protocolVersion")]
    pub revision: Option<String>,
    #[serde(rename = "io.modelcontextprotocol/clientCapabilities")]
    pub capabilities: Option<serde_json::Map<String, Value>>,
}

impl RpcMessage {
    /// Decodes a body.
    ///
    /// # Errors
    /// The body is not JSON, or is not one request or notification.
    pub fn read(body: &[u8]) -> Result<Self, RpcError> {
        if let Err(error) = serde_json::from_slice::<serde::de::IgnoredAny>(body) {
            return Err(RpcError::new(RpcError::NOT_JSON, format!("the body must be JSON: {error}")));
        }
        if !body.trim_ascii_start().starts_with(b"{") {
            let rule = "the body must be one request or notification: send each in a body of its own";
            return Err(RpcError::new(RpcError::NO_REQUEST, rule));
        }
        serde_json::from_slice(body).map_err(|error| {
            let rule = format!("the body must be a JSON-RPC 2.0 request or notification: {error}");
            RpcError::new(RpcError::NO_REQUEST, rule)
        })
    }

    /// Decodes the parameters.
    ///
    /// # Errors
    /// A parameter has the wrong type.
    pub fn params(&self) -> Result<RpcParams, RpcError> {
        let Some(params) = &self.params else { return Ok(RpcParams::default()) };
        serde_json::from_str(params.get()).map_err(|error| RpcError::new(RpcError::WRONG_PARAMS, error.to_string()))
    }
}

/// The reason why a request has no result.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct RpcError {
    /// Code of JSON-RPC or of the protocol.
    pub code: i32,
    pub message: String,
    /// Revisions of the protocol that are supported, if the requested one is not.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub data: Option<Value>,
}

impl RpcError {
    pub const NOT_JSON: i32 = -32700;
    pub const NO_REQUEST: i32 = -32600;
    pub const UNKNOWN_METHOD: i32 = -32601;
    pub const WRONG_PARAMS: i32 = -32602;
    pub const HEADER_MISMATCH: i32 = -32020;
    pub const UNKNOWN_REVISION: i32 = -32022;

    pub fn new(code: i32, message: impl Into<String>) -> Self {
        RpcError { code, message: message.into(), data: None }
    }
}

/// The answer to a request that has no result.
#[derive(Debug, Serialize, ToSchema)]
pub struct RpcFailure {
    #[schema(value_type = String, example = "2.0")]
    jsonrpc: &'static str,
    /// Identifier of the request; null if it could not be read.
    id: Option<RpcId>,
    error: RpcError,
}

impl RpcFailure {
    pub fn new(id: Option<RpcId>, error: RpcError) -> Self {
        RpcFailure { jsonrpc: "2.0", id, error }
    }
}

/// The answer to a request that has a result.
#[derive(Debug, Serialize)]
pub struct RpcSuccess<'a, R> {
    jsonrpc: &'static str,
    id: &'a RpcId,
    result: R,
}

impl<'a, R> RpcSuccess<'a, R> {
    pub fn new(id: &'a RpcId, result: R) -> Self {
        RpcSuccess { jsonrpc: "2.0", id, result }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_one_request_or_notification() {
        let read = |body: &str| RpcMessage::read(body.as_bytes());
        let request = read(r#"{"jsonrpc": "2.0", "id": 7, "method": "ping", "params": {"name": "x"}}"#).unwrap();
        assert_eq!(
            (request.id.clone(), request.params().unwrap().name.as_deref()),
            (Some(RpcId::Number(7)), Some("x"))
        );
        assert_eq!(read(r#"{"jsonrpc": "2.0", "method": "ping"}"#).unwrap().id, None);
        for (code, body) in [
            (RpcError::NOT_JSON, "{"),
            (RpcError::NOT_JSON, ""),
            (RpcError::NO_REQUEST, "[]"),
            (RpcError::NO_REQUEST, r#"[{"jsonrpc": "2.0", "id": 1, "method": "ping"}]"#),
            (RpcError::NO_REQUEST, r#"{"id": 1, "method": "ping"}"#),
            (RpcError::NO_REQUEST, r#"{"jsonrpc": "1.0", "id": 1, "method": "ping"}"#),
            (RpcError::NO_REQUEST, r#"{"jsonrpc": "2.0", "id": null, "method": "ping"}"#),
            (RpcError::NO_REQUEST, r#"{"jsonrpc": "2.0", "id": 1.5, "method": "ping"}"#),
            (RpcError::NO_REQUEST, r#"{"jsonrpc": "2.0", "id": 1, "result": {}}"#),
            (RpcError::NO_REQUEST, r#"{"jsonrpc": "2.0", "id": 1, "method": "ping", "params": ["x"]}"#),
        ] {
            assert_eq!(read(body).unwrap_err().code, code, "{body}");
        }
        let params = read(r#"{"jsonrpc": "2.0", "id": 1, "method": "ping", "params": {"name": 5}}"#).unwrap().params();
        assert_eq!(params.unwrap_err().code, RpcError::WRONG_PARAMS);
    }
}
