//! Posts webhooks to their receivers.
//!
//! The host is looked up here, and the connection goes to an address that was checked, so a name that changes its
//! address between the check and the connection gains nothing. Redirects are not followed, proxies are not used, and no
//! more than the head of the answer is read.

use std::net::SocketAddr;
use std::sync::{Arc, OnceLock};

use futures_util::FutureExt;
use http_body_util::Full;
use hyper::body::Bytes;
use hyper::client::conn::http1;
use hyper::{Request, header};
use hyper_util::rt::TokioIo;
use rustls::crypto::ring::default_provider;
use rustls::pki_types::ServerName;
use rustls::{ClientConfig, RootCertStore};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::task::JoinSet;
use tokio_rustls::TlsConnector;

use crate::service::subscriptions::destination::{Destination, is_allowed, is_public};
use crate::service::subscriptions::sender::{OutgoingWebhook, PostWebhook};

/// The addresses of a host that are tried.
const MOST_ADDRESSES: usize = 4;
/// The largest head of an answer, in bytes.
const LARGEST_HEAD: usize = 16 << 10;

/// Returns the function that posts webhooks; hosts in `allowed` may have private addresses.
pub fn post(allowed: Vec<String>) -> PostWebhook {
    let client = Arc::new(WebhookClient { allowed, encryption: OnceLock::new() });
    Arc::new(move |outgoing| {
        let client = client.clone();
        async move { client.post(outgoing).await }.boxed()
    })
}

struct WebhookClient {
    allowed: Vec<String>,
    /// Reads the certificates of the system when it is first needed.
    encryption: OnceLock<Result<Arc<ClientConfig>, String>>,
}

impl WebhookClient {
    async fn post(&self, outgoing: OutgoingWebhook) -> Result<u16, String> {
        // The operator may have allowed another host since it was stored.
        let destination = Destination::read(&outgoing.url, &self.allowed).map_err(|error| error.to_string())?;
        let stream = connect(&self.addresses(&destination).await?).await?;
        if !destination.is_encrypted {
            return exchange(stream, &destination, outgoing).await;
        }
        let name = ServerName::try_from(destination.host.clone()).map_err(|error| error.to_string())?;
        let connector = TlsConnector::from(self.encryption.get_or_init(trusting_the_system).clone()?);
        let stream = connector.connect(name, stream).await.map_err(|error| format!("no encryption: {error}"))?;
        exchange(stream, &destination, outgoing).await
    }

    /// Returns the addresses of the host that a webhook may go to.
    async fn addresses(&self, destination: &Destination) -> Result<Vec<SocketAddr>, String> {
        let found = tokio::net::lookup_host((destination.host.as_str(), destination.port)).await;
        let found = found.map_err(|error| format!("the host cannot be looked up: {error}"))?;
        let is_allowed = is_allowed(&destination.host, &self.allowed);
        let usable: Vec<_> = found.filter(|at| is_allowed || is_public(at.ip())).take(MOST_ADDRESSES).collect();
        if usable.is_empty() {
            return Err("the host has no public address, and the operator does not allow it by name".to_owned());
        }
        Ok(usable)
    }
}

async fn connect(addresses: &[SocketAddr]) -> Result<TcpStream, String> {
    TcpStream::connect(addresses).await.map_err(|error| format!("no connection: {error}"))
}

/// Sends the webhook and returns the status of the answer.
async fn exchange(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    destination: &Destination,
    outgoing: OutgoingWebhook,
) -> Result<u16, String> {
    let request = Request::post(&destination.path)
        .header(header::HOST, destination.authority())
        .header(header::USER_AGENT, concat!("ballast/", env!("CARGO_PKG_VERSION")))
        .header(header::CONTENT_TYPE, "application/json")
        .header(header::CONNECTION, "close")
        .header("webhook-id", outgoing.id)
        .header("webhook-timestamp", outgoing.timestamp)
        .header("webhook-signature", outgoing.signature)
        .body(Full::new(Bytes::from(outgoing.body)))
        .map_err(|error| format!("no request: {error}"))?;
    let handshake = http1::Builder::new().max_buf_size(LARGEST_HEAD).handshake(TokioIo::new(stream)).await;
    let (mut sender, connection) = handshake.map_err(|error| format!("no connection: {error}"))?;
    // Ends with the head of the answer, or once nobody waits for that any more.
    let mut driving = JoinSet::new();
    driving.spawn(connection);
    let answer = sender.send_request(request).await;
    answer.map(|answer| answer.status().as_u16()).map_err(|error| format!("no answer: {error}"))
}

/// Builds the configuration that trusts the certificates of the system.
///
/// # Errors
/// Never with the provider built in.
pub fn trusting_the_system() -> Result<Arc<ClientConfig>, String> {
    let mut roots = RootCertStore::empty();
    roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
    let builder =
        ClientConfig::builder_with_provider(Arc::new(default_provider())).with_safe_default_protocol_versions();
    let builder = builder.map_err(|error| error.to_string())?;
    Ok(Arc::new(builder.with_root_certificates(roots).with_no_client_auth()))
}
