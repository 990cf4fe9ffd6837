//! A service at an address, as a program of its user calls it: over TLS if the address says so, and with a key.

use std::time::Duration;

use ballast::http::webhooks::trusting_the_system;
use http_body_util::{BodyExt, Full};
use hyper::body::Bytes;
use hyper::client::conn::http1;
use hyper::{HeaderMap, Method, Request, StatusCode, header};
use hyper_util::rt::TokioIo;
use rustls::pki_types::ServerName;
use serde_json::Value;
use thiserror::Error;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::task::JoinSet;
use tokio_rustls::TlsConnector;

/// Longest wait for an answer: what would change an advice takes about a hundred robust steps.
const TIMEOUT: Duration = Duration::from_secs(120);

/// A service, and the key for it.
pub struct RemoteService {
    /// The host and the port, as the `Host` header has them.
    authority: String,
    host: String,
    port: u16,
    encryption: Option<TlsConnector>,
    key: Option<String>,
}

/// An answer, whatever its status.
pub struct RemoteAnswer {
    pub status: StatusCode,
    pub headers: HeaderMap,
    pub text: String,
}

/// A call that got no answer.
#[derive(Debug, Error)]
pub enum RemoteError {
    #[error("{url:?} is not http://host:port or https://host:port")]
    Address { url: String },
    #[error("the certificates of the system cannot be read: {reason}")]
    Certificates { reason: String },
    #[error("{call} got no answer: {reason}")]
    NoAnswer { call: String, reason: String },
}

impl RemoteService {
    /// Prepares the calls of the service at `url`.
    ///
    /// # Errors
    /// The address is none, or the certificates of the system cannot be read.
    pub fn at(url: &str, key: Option<String>) -> Result<Self, RemoteError> {
        let of_address = || RemoteError::Address { url: url.to_owned() };
        let (is_encrypted, rest) = match (url.strip_prefix("https://"), url.strip_prefix("http://")) {
            (Some(rest), _) => (true, rest),
            (None, Some(rest)) => (false, rest),
            (None, None) => return Err(of_address()),
        };
        let authority = rest.trim_end_matches('/').to_owned();
        if authority.is_empty() || authority.contains(['/', '@', ' ']) {
            return Err(of_address());
        }
        let (host, port) = match authority.rsplit_once(':').filter(|(_, port)| !port.ends_with(']')) {
            Some((host, port)) => (host, port.parse().map_err(|_| of_address())?),
            None => (authority.as_str(), if is_encrypted { 443 } else { 80 }),
        };
        let host = host.trim_matches(['[', ']']).to_owned();
        let encryption = is_encrypted.then(trusting_the_system).transpose();
        let encryption = encryption.map_err(|reason| RemoteError::Certificates { reason })?.map(TlsConnector::from);
        Ok(RemoteService { host, port, authority, encryption, key })
    }

    /// Sends a call and reads its answer to the end.
    ///
    /// # Errors
    /// The service is not reached, or does not answer in time.
    pub async fn call(&self, method: Method, path: &str, body: Option<&Value>) -> Result<RemoteAnswer, RemoteError> {
        let call = format!("{method} {path}");
        let answering = tokio::time::timeout(TIMEOUT, self.answer(method, path, body)).await;
        let answer = answering.unwrap_or_else(|_| Err(format!("nothing came within {} s", TIMEOUT.as_secs())));
        answer.map_err(|reason| RemoteError::NoAnswer { call, reason })
    }

    async fn answer(&self, method: Method, path: &str, body: Option<&Value>) -> Result<RemoteAnswer, String> {
        let stream = TcpStream::connect((self.host.as_str(), self.port)).await;
        let stream = stream.map_err(|error| format!("no connection to {}: {error}", self.authority))?;
        let mut request = Request::builder().method(method).uri(path).header(header::HOST, &self.authority);
        request = request.header(header::CONNECTION, "close");
        if let Some(key) = &self.key {
            request = request.header(header::AUTHORIZATION, format!("Bearer {key}"));
        }
        if body.is_some() {
            request = request.header(header::CONTENT_TYPE, "application/json");
        }
        let bytes = body.map_or_else(Bytes::new, |body| body.to_string().into());
        let request = request.body(Full::new(bytes)).map_err(|error| format!("no request: {error}"))?;
        let Some(connector) = &self.encryption else { return exchange(stream, request).await };
        let name = ServerName::try_from(self.host.clone()).map_err(|error| error.to_string())?;
        let stream = connector.connect(name, stream).await.map_err(|error| format!("no encryption: {error}"))?;
        exchange(stream, request).await
    }
}

async fn exchange(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    request: Request<Full<Bytes>>,
) -> Result<RemoteAnswer, String> {
    let of_error = |error: hyper::Error| error.to_string();
    let (mut sender, connection) = http1::handshake(TokioIo::new(stream)).await.map_err(of_error)?;
    // Ends with this call.
    let mut driving = JoinSet::new();
    driving.spawn(connection);
    let (head, body) = sender.send_request(request).await.map_err(of_error)?.into_parts();
    let bytes = body.collect().await.map_err(of_error)?.to_bytes();
    let text = String::from_utf8_lossy(&bytes).into_owned();
    Ok(RemoteAnswer { status: head.status, headers: head.headers, text })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_a_host_and_a_port() {
        let read = |url: &str| RemoteService::at(url, None).map(|service| (service.host, service.port)).ok();
        assert_eq!(read("http://127.0.0.1:8080"), Some(("127.0.0.1".into(), 8080)));
        assert_eq!(read("http://advice.example/"), Some(("advice.example".into(), 80)));
        assert_eq!(read("http://[::1]:8080"), Some(("::1".into(), 8080)));
        assert_eq!(read("http://[::1]"), Some(("::1".into(), 80)));
        for wrong in ["advice.example", "ftp://x", "http://", "http://x/y", "http://a@x", "http://x:port"] {
            assert_eq!(read(wrong), None, "{wrong}");
        }
    }
}
