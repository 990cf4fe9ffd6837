//! A JSON client of the service over a real socket, as a user's program would be. The demo calls it, and the program in
//! `lab` that measures the service.

use std::net::SocketAddr;

use http_body_util::{BodyExt, Full};
use hyper::body::{Bytes, Incoming};
use hyper::{Method, Request, Response, StatusCode, header};
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::TokioExecutor;
use serde_json::Value;
use thiserror::Error;

pub struct ApiClient {
    http: Client<HttpConnector, Full<Bytes>>,
    address: SocketAddr,
}

#[derive(Debug, Error)]
pub enum ApiError {
    #[error("{call} could not be built")]
    Build { call: String, source: hyper::http::Error },
    #[error("{call} did not reach a service")]
    Connect { call: String, source: hyper_util::client::legacy::Error },
    #[error("{call} was cut off")]
    CutOff { call: String, source: hyper::Error },
    #[error("{call} answered {status}: {problem}")]
    Refused { call: String, status: StatusCode, problem: String },
    #[error("{call} answered something other than JSON")]
    Json { call: String, source: serde_json::Error },
}

/// A stream of server-sent events, read one `data` at a time.
pub struct Events {
    call: String,
    body: Incoming,
    unread: Vec<u8>,
}

impl ApiClient {
    pub fn new(address: SocketAddr) -> Self {
        ApiClient { http: Client::builder(TokioExecutor::new()).build_http(), address }
    }

    pub async fn get(&self, path: &str) -> Result<Value, ApiError> {
        self.json(Method::GET, path, Bytes::new()).await
    }

    pub async fn post(&self, path: &str, body: &Value) -> Result<Value, ApiError> {
        self.json(Method::POST, path, body.to_string().into()).await
    }

    /// Reads the answer at `path` to its end and ignores it.
    pub async fn touch(&self, path: &str) -> Result<(), ApiError> {
        let (call, response) = self.send(Method::GET, path, Bytes::new()).await?;
        whole_body(&call, response).await.map(drop)
    }

    /// Opens the event stream at `path`.
    pub async fn events(&self, path: &str) -> Result<Events, ApiError> {
        let (call, response) = self.send(Method::GET, path, Bytes::new()).await?;
        Ok(Events { call, body: response.into_body(), unread: Vec::new() })
    }

    async fn json(&self, method: Method, path: &str, body: Bytes) -> Result<Value, ApiError> {
        let (call, response) = self.send(method, path, body).await?;
        let bytes = whole_body(&call, response).await?;
        serde_json::from_slice(&bytes).map_err(|source| ApiError::Json { call, source })
    }

    async fn send(&self, method: Method, path: &str, body: Bytes) -> Result<(String, Response<Incoming>), ApiError> {
        let call = format!("{method} {path}");
        let request = Request::builder()
            .method(method)
            .uri(format!("http://{}{path}", self.address))
            .header(header::CONTENT_TYPE, "application/json")
            .body(Full::new(body))
            .map_err(|source| ApiError::Build { call: call.clone(), source })?;
        let answer = self.http.request(request).await;
        let response = answer.map_err(|source| ApiError::Connect { call: call.clone(), source })?;
        let status = response.status();
        if status.is_success() {
            return Ok((call, response));
        }
        let problem = String::from_utf8_lossy(&whole_body(&call, response).await?).into_owned();
        Err(ApiError::Refused { call, status, problem })
    }
}

async fn whole_body(call: &str, response: Response<Incoming>) -> Result<Bytes, ApiError> {
    let body = response.into_body().collect().await;
    Ok(body.map_err(|source| ApiError::CutOff { call: call.into(), source })?.to_bytes())
}

impl Events {
    /// Returns the data of the next event as JSON; `None` when the stream has ended. Comments and other fields are
    /// skipped.
    pub async fn next(&mut self) -> Result<Option<Value>, ApiError> {
        loop {
            while let Some(event) = next_block(&mut self.unread) {
                if let Some(data) = event_data(&event) {
                    let value = serde_json::from_str(&data);
                    return value.map(Some).map_err(|source| ApiError::Json { call: self.call.clone(), source });
                }
            }
            let Some(frame) = self.body.frame().await else { return Ok(None) };
            let frame = frame.map_err(|source| ApiError::CutOff { call: self.call.clone(), source })?;
            if let Ok(bytes) = frame.into_data() {
                self.unread.extend_from_slice(&bytes);
            }
        }
    }
}

/// Removes the first event from `unread`: everything up to an empty line.
fn next_block(unread: &mut Vec<u8>) -> Option<String> {
    let end = unread.windows(2).position(|pair| pair == b"\n\n")?;
    let block: Vec<u8> = unread.drain(..end + 2).collect();
    Some(String::from_utf8_lossy(&block).into_owned())
}

/// Returns the `data` lines of an event, joined; `None` if it has none.
fn event_data(event: &str) -> Option<String> {
    let lines: Vec<&str> = event
        .lines()
        .filter_map(|line| line.strip_prefix("data:"))
        .map(|data| data.strip_prefix(' ').unwrap_or(data))
        .collect();
    (!lines.is_empty()).then(|| lines.join("\n"))
}

/// Encodes a text as a part of an address: every byte but letters, digits and four marks.
pub fn percent_encoded(text: &str) -> String {
    let mut encoded = String::with_capacity(text.len());
    for byte in text.bytes() {
        match byte {
            b'0'..=b'9' | b'a'..=b'z' | b'A'..=b'Z' | b'-' | b'.' | b'_' | b'~' => encoded.push(char::from(byte)),
            byte => encoded.push_str(&format!("%{byte:02X}")),
        }
    }
    encoded
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_come_out_whole_however_they_are_cut() {
        let stream = b": hello\n\nid: 1\nevent: progress\ndata: {\"a\":\ndata: 1}\n\ndata:2\n\ndata: cut";
        for size in 1..stream.len() {
            let (mut unread, mut found) = (Vec::new(), Vec::new());
            for piece in stream.chunks(size) {
                unread.extend_from_slice(piece);
                while let Some(block) = next_block(&mut unread) {
                    found.extend(event_data(&block));
                }
            }
            assert_eq!(found, ["{\"a\":\n1}", "2"]);
            assert_eq!(unread, b"data: cut");
        }
    }
}
