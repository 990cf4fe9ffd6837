//! The revisions of the protocol. Since 2026-07-28 every request names its revision, and headers repeat parts of the
//! body. Before, a client began with `initialize`. Both are answered without any state between requests.

use axum::http::HeaderMap;
use axum::http::header::{HOST, ORIGIN};
use axum::http::uri::{Authority, Uri};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::json;

use crate::http::agents::message::{RpcError, RpcMessage, RpcParams};

/// The revision in which every request stands alone.
const STATELESS: &str = "2026-07-28";
/// The revisions that begin with a handshake, newest first.
const WITH_HANDSHAKE: [&str; 3] = ["2025-11-25", "2025-06-18", "2025-03-26"];

const REVISION_HEADER: &str = "mcp-protocol-version";
const METHOD_HEADER: &str = "mcp-method";
const NAME_HEADER: &str = "mcp-name";
/// The marks around a header value that is encoded, because it is not plain ASCII.
const ENCODED: (&str, &str) = ("=?base64?", "?=");

/// The kind of revision that a request follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RevisionKind {
    Stateless,
    WithHandshake,
}

/// Returns all supported revisions, newest first.
pub fn supported() -> [&'static str; 4] {
    let [first, second, third] = WITH_HANDSHAKE;
    [STATELESS, first, second, third]
}

/// Returns the revision that answers a handshake: the offered one, or the newest if that is unknown.
pub fn agreed(offered: Option<&str>) -> &'static str {
    let known = WITH_HANDSHAKE.into_iter().find(|known| offered == Some(known));
    known.unwrap_or(WITH_HANDSHAKE[0])
}

/// Returns the kind of revision that a message follows.
///
/// # Errors
/// The revision is not supported, or the headers do not repeat the body as the revision demands.
pub fn of_message(headers: &HeaderMap, message: &RpcMessage, params: &RpcParams) -> Result<RevisionKind, RpcError> {
    let header = |name: &str| headers.get(name).map(|value| value.to_str().unwrap_or_default());
    let meta = params.meta.as_ref();
    let (named, declared) = (header(REVISION_HEADER), meta.and_then(|meta| meta.revision.as_deref()));
    if message.method == "initialize" {
        return Ok(RevisionKind::WithHandshake);
    }
    let Some(declared) = declared else {
        return match named {
            None => Ok(RevisionKind::WithHandshake),
            Some(named) if WITH_HANDSHAKE.contains(&named) => Ok(RevisionKind::WithHandshake),
            Some(STATELESS) if message.id.is_none() => Ok(RevisionKind::Stateless),
            Some(STATELESS) => {
                Err(RpcError::new(RpcError::WRONG_PARAMS, "params._meta must name the protocol version of the request"))
            }
            Some(named) => Err(unsupported(named)),
        };
    };
    if named != Some(declared) {
        return Err(mismatch("MCP-Protocol-Version", declared));
    }
    if declared != STATELESS {
        return Err(unsupported(declared));
    }
    if header(METHOD_HEADER) != Some(&*message.method) {
        return Err(mismatch("Mcp-Method", &message.method));
    }
    let name = match message.method.as_str() {
        "tools/call" => params.name.as_deref(),
        "resources/read" => params.uri.as_deref(),
        _ => None,
    };
    if let Some(name) = name.filter(|name| header(NAME_HEADER).and_then(decoded).as_deref() != Some(name)) {
        return Err(mismatch("Mcp-Name", name));
    }
    match meta.is_some_and(|meta| meta.capabilities.is_some()) {
        true => Ok(RevisionKind::Stateless),
        false => Err(RpcError::new(RpcError::WRONG_PARAMS, "params._meta must name the capabilities of the client")),
    }
}

fn unsupported(revision: &str) -> RpcError {
    let data = json!({ "supported": supported(), "requested": revision });
    let message = format!("the protocol version {revision} is not supported");
    RpcError { data: Some(data), ..RpcError::new(RpcError::UNKNOWN_REVISION, message) }
}

fn mismatch(header: &str, value: &str) -> RpcError {
    RpcError::new(RpcError::HEADER_MISMATCH, format!("the header {header} must be {value}, as in the body"))
}

/// Decodes a header value; `None` if its encoding is damaged.
fn decoded(value: &str) -> Option<String> {
    match value.strip_prefix(ENCODED.0).and_then(|rest| rest.strip_suffix(ENCODED.1)) {
        Some(encoded) => String::from_utf8(STANDARD.decode(encoded).ok()?).ok(),
        None => Some(value.to_owned()),
    }
}

/// Returns true if a web page of another origin sends the request. Its name may have been made to resolve to this
/// service.
pub fn is_of_another_page(headers: &HeaderMap) -> bool {
    let Some(origin) = headers.get(ORIGIN) else { return false };
    let page = origin.to_str().ok().and_then(|origin| origin.parse::<Uri>().ok()?.into_parts().authority);
    let own = headers.get(HOST).and_then(|host| host.to_str().ok()?.parse::<Authority>().ok());
    page.is_none() || page != own
}

#[cfg(test)]
mod tests {
    use axum::http::{HeaderName, HeaderValue};

    use super::*;

    fn headers(named: &[(&'static str, &str)]) -> HeaderMap {
        let pair = |(name, value): &(&'static str, &str)| {
            (HeaderName::from_static(name), HeaderValue::from_str(value).unwrap())
        };
        named.iter().map(pair).collect()
    }

    fn kind(named: &[(&'static str, &str)], body: serde_json::Value) -> Result<RevisionKind, i32> {
        let message = RpcMessage::read(body.to_string().as_bytes()).unwrap();
        let params = message.params().unwrap();
        of_message(&headers(named), &message, &params).map_err(|error| error.code)
    }

    #[test]
    fn a_request_that_names_its_revision_repeats_it_in_its_headers() {
        let body = |name: &str, revision: &str| {
            json!({ "jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": { "name": name, "_meta": {
                "io.modelcontextprotocol/protocolVersion": revision,
                "io.modelcontextprotocol/clientCapabilities": {} } } })
        };
        let [revision, method] = [(REVISION_HEADER, STATELESS), (METHOD_HEADER, "tools/call")];
        let all = [revision, method, (NAME_HEADER, "action")];
        assert_eq!(kind(&all, body("action", STATELESS)), Ok(RevisionKind::Stateless));
        assert_eq!(kind(&[revision, method], body("action", STATELESS)), Err(RpcError::HEADER_MISMATCH));
        assert_eq!(kind(&all, body("advise", STATELESS)), Err(RpcError::HEADER_MISMATCH));
        assert_eq!(kind(&all, body("action", "2025-11-25")), Err(RpcError::HEADER_MISMATCH));
        let future = [(REVISION_HEADER, "2199-01-01"), method, (NAME_HEADER, "action")];
        assert_eq!(kind(&future, body("action", "2199-01-01")), Err(RpcError::UNKNOWN_REVISION));
        let encoded = [revision, method, (NAME_HEADER, "=?base64?w6k=?=")];
        assert_eq!(kind(&encoded, body("\u{e9}", STATELESS)), Ok(RevisionKind::Stateless));
        let mut without = body("action", STATELESS);
        without["params"]["_meta"].as_object_mut().unwrap().remove("io.modelcontextprotocol/clientCapabilities");
        assert_eq!(kind(&all, without), Err(RpcError::WRONG_PARAMS));
    }

    #[test]
    fn a_request_that_names_no_revision_follows_a_handshake() {
        let body = json!({ "jsonrpc": "2.0", "id": 1, "method": "tools/list" });
        assert_eq!(kind(&[], body.clone()), Ok(RevisionKind::WithHandshake));
        assert_eq!(kind(&[(REVISION_HEADER, "2025-06-18")], body.clone()), Ok(RevisionKind::WithHandshake));
        assert_eq!(kind(&[(REVISION_HEADER, STATELESS)], body.clone()), Err(RpcError::WRONG_PARAMS));
        assert_eq!(kind(&[(REVISION_HEADER, "1999-01-01")], body), Err(RpcError::UNKNOWN_REVISION));
        assert_eq!([agreed(Some("2025-06-18")), agreed(Some("1999-01-01"))], ["2025-06-18", "2025-11-25"]);
    }

    #[test]
    fn pages_of_another_origin_are_known_by_their_origin() {
        for (origin, is_other) in [
            ("http://localhost:8080", false),
            ("http://localhost:9090", true),
            ("https://evil.example", true),
            ("null", true),
        ] {
            assert_eq!(is_of_another_page(&headers(&[("host", "localhost:8080"), ("origin", origin)])), is_other);
        }
        assert!(!is_of_another_page(&headers(&[("host", "localhost:8080")])));
    }
}
