//! Extractors that reject with problem documents instead of axum's plain text.

use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, StatusCode, header};
use serde::de::DeserializeOwned;

use crate::http::gate::decode;
use crate::http::problem::{ProblemDocument, ProblemKind};
use crate::service::callers::allowance::HeavyPermit;
use crate::service::callers::fair_queue::FairQueue;
use crate::service::error::ServiceError;
use crate::store::Tenant;

/// A JSON body that is an object.
pub struct JsonBody<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned + Send + 'static> FromRequest<S> for JsonBody<T> {
    type Rejection = ProblemDocument;

    async fn from_request(request: Request, state: &S) -> Result<Self, ProblemDocument> {
        JsonBytes::from_request(request, state).await?.decoded(decode::object).await.map(JsonBody)
    }
}

/// The bytes of a body declared to be JSON, not yet decoded.
pub struct JsonBytes {
    bytes: Bytes,
    large: Option<LargeBody>,
}

/// The queue in which a large body is decoded, and its tenant, as the gate passes them to the extractors.
#[derive(Clone)]
pub struct LargeBody {
    pub decoding: FairQueue,
    pub tenant: Tenant,
}

impl JsonBytes {
    /// Returns the length in bytes.
    pub fn length(&self) -> usize {
        self.bytes.len()
    }

    /// Decodes the body. A large one waits in the queue and runs on a thread that may block, so that it does not delay
    /// other calls.
    ///
    /// # Errors
    /// The errors of `decode`, or no permit became free in time.
    pub async fn decoded<T: Send + 'static>(
        self,
        decode: impl FnOnce(&[u8]) -> Result<T, ProblemDocument> + Send + 'static,
    ) -> Result<T, ProblemDocument> {
        let JsonBytes { bytes, large } = self;
        match large {
            None => decode(&bytes),
            Some(LargeBody { decoding, tenant }) => decoding.run(&tenant, move || decode(&bytes)).await?,
        }
    }
}

/// The permits of a heavy call, to be taken once its body is read.
#[derive(Clone)]
pub struct AfterBody(pub Arc<HeavyPermit>);

/// Largest body allowed, in bytes, as the gate passes it to the extractors.
#[derive(Debug, Clone, Copy)]
pub struct BodyLimit(pub usize);

impl<S: Send + Sync> FromRequest<S> for JsonBytes {
    type Rejection = ProblemDocument;

    async fn from_request(request: Request, state: &S) -> Result<Self, ProblemDocument> {
        refuse_other_media(request.headers())?;
        refuse_encoded(request.headers())?;
        let declared = request.headers().get(header::CONTENT_LENGTH).and_then(|length| length.to_str().ok());
        let size = declared.and_then(|length| length.parse::<u64>().ok()).map(|length| format!("{length} bytes"));
        let limit = request.extensions().get::<BodyLimit>().map_or(0, |limit| limit.0);
        let turn = request.extensions().get::<AfterBody>().cloned();
        let large = request.extensions().get::<LargeBody>().cloned();
        let bytes = Bytes::from_request(request, state).await.map_err(|rejection| {
            let size = size.unwrap_or_else(|| "a stream".to_owned());
            match rejection.status() {
                StatusCode::PAYLOAD_TOO_LARGE => {
                    let rule = format!("must hold at most {limit} bytes");
                    ProblemDocument::new(ProblemKind::BodyTooLarge, rejection.body_text()).naming("body", size, rule)
                }
                _ => ProblemDocument::new(ProblemKind::MalformedJson, rejection.body_text()).naming(
                    "body",
                    size,
                    "must arrive complete",
                ),
            }
        })?;
        if let Some(AfterBody(turn)) = turn {
            turn.begin().await.map_err(ServiceError::from)?;
        }
        Ok(JsonBytes { bytes, large })
    }
}

fn refuse_other_media(headers: &HeaderMap) -> Result<(), ProblemDocument> {
    let declared = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or("");
    let media = declared.split(';').next().unwrap_or("").trim().to_ascii_lowercase();
    if media == "application/json" || (media.starts_with("application/") && media.ends_with("+json")) {
        return Ok(());
    }
    let detail = format!("the content-type is '{declared}'; it must be application/json");
    let problem = ProblemDocument::new(ProblemKind::UnsupportedMediaType, detail);
    Err(problem.naming("content-type", declared, "must be application/json"))
}

/// Rejects an encoded body, because nothing here decodes one: it would be misread.
fn refuse_encoded(headers: &HeaderMap) -> Result<(), ProblemDocument> {
    let mut encodings = headers.get_all(header::CONTENT_ENCODING).iter().map(|value| value.to_str().unwrap_or("?"));
    let Some(encoding) = encodings.find(|encoding| !encoding.eq_ignore_ascii_case("identity")) else { return Ok(()) };
    let problem =
        ProblemDocument::new(ProblemKind::UnsupportedMediaType, "the body is encoded; it must be sent unencoded");
    Err(problem.naming("content-encoding", encoding, "must be absent"))
}

/// The parameters of the query string.
pub struct Parameters<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned> FromRequestParts<S> for Parameters<T> {
    type Rejection = ProblemDocument;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ProblemDocument> {
        let query = parts.uri.query().unwrap_or_default().to_owned();
        let Query(pairs) =
            Query::<Vec<(String, String)>>::from_request_parts(parts, state).await.map_err(|rejection| {
                let problem = ProblemDocument::new(ProblemKind::InvalidQuery, rejection.body_text());
                problem.naming("query", query, "must be a query string")
            })?;
        decode::parameters(pairs).map(Parameters)
    }
}

/// The identifier in the path.
pub struct Id(pub String);

impl<S: Send + Sync> FromRequestParts<S> for Id {
    type Rejection = ProblemDocument;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ProblemDocument> {
        let path = parts.uri.path().to_owned();
        let Path(id) = Path::<String>::from_request_parts(parts, state).await.map_err(|rejection| {
            ProblemDocument::new(ProblemKind::NotFound, rejection.body_text()).naming(
                "id",
                path,
                "must be percent-encoded UTF-8",
            )
        })?;
        Ok(Id(id))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use axum::body::Body;
    use serde_json::Value;

    use super::*;
    use crate::service::callers::fair_queue::QueueSize;

    /// Decodes a large or a small body while no decoding permit is free.
    async fn decoded(is_large: bool) -> Result<Value, ProblemDocument> {
        let decoding = FairQueue::new("decode", QueueSize { first: 0, long: 0 }, Duration::from_millis(1));
        let request = Request::builder().header(header::CONTENT_TYPE, "application/json");
        let mut request = request.body(Body::from(r#"{"problem": 1}"#)).unwrap();
        if is_large {
            request.extensions_mut().insert(LargeBody { decoding, tenant: Tenant::default() });
        }
        JsonBody::<Value>::from_request(request, &()).await.map(|JsonBody(value)| value)
    }

    #[tokio::test]
    async fn a_large_body_is_decoded_in_its_turn_and_a_small_one_at_once() {
        assert_eq!(decoded(false).await.unwrap()["problem"], 1);
        assert_eq!(decoded(true).await.unwrap_err().status, 503);
    }
}
