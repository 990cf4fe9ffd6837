//! From a configuration to a service that answers: one listener for callers, one for the operator, and a drain at the
//! end.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use futures_util::future::LocalBoxFuture;
use hyper_util::server::graceful::GracefulShutdown;
use thiserror::Error;
use tokio::task::JoinHandle;
use tokio_rustls::TlsAcceptor;

use crate::http::connection::connection_table::{ConnectionLimits, Connections};
use crate::http::connection::listener::{ConnectionSettings, Listener};
use crate::http::connection::timed_stream::ClientLimits;
use crate::http::connection::tls::{Certificate, TlsError};
use crate::http::gate::telemetry;
use crate::http::{router, webhooks};
use crate::service::Service;
use crate::service::error::ServiceError;
use crate::service::process::clock::Clock;
use crate::service::process::config::Config;
use crate::service::process::shutdown::Shutdown;
use crate::store::StoreError;

/// Time within which a client must send its request head.
const HEADER_TIMEOUT: Duration = Duration::from_secs(5);
/// Time within which a client must read some of its answer.
const READER_TIMEOUT: Duration = Duration::from_secs(30);
/// Time after which an idle connection is closed. It is longer than common proxies keep theirs (60 s), so that they
/// close it first and no request meets a closing connection. If its slot is needed, an idle connection is closed long
/// before.
const BETWEEN_REQUESTS: Duration = Duration::from_secs(75);
/// Time for which the rest of a refused body is read, so that its sender can read the refusal.
const REFUSED_BODY_TIME: Duration = Duration::from_secs(10);
/// Connections of the operator's listener: probes, a scrape, a person, and as many again.
const OPERATORS: usize = 64;
/// Extra connections for probes at each listener, for when calls under way fill it.
const PROBES: usize = 16;
/// Descriptors that are not connections: the store's files, the runtime, the standard streams.
const OTHER_DESCRIPTORS: usize = 128;

#[derive(Debug, Error)]
pub enum ServeError {
    #[error("cannot listen on {address}")]
    Listen { address: SocketAddr, source: std::io::Error },
    #[error(
        "{address} can be reached from other machines, and its traffic would not be encrypted: give --tls-cert and --tls-key, listen on loopback, or give --allow-plaintext if a proxy in front of it encrypts"
    )]
    Plaintext { address: SocketAddr },
    #[error("cannot encrypt connections")]
    Encryption(#[from] TlsError),
    #[error("cannot start the service")]
    Start(#[from] ServiceError),
    #[error("the service was stopped before it had started")]
    Stopped,
}

/// A running server.
pub struct RunningServer {
    /// The bound address.
    pub address: SocketAddr,
    /// The bound address of the operator's own listener, if there is one.
    pub operations: Option<SocketAddr>,
    /// `http` or `https`.
    pub scheme: &'static str,
    service: Arc<Service>,
    task: JoinHandle<()>,
}

impl RunningServer {
    /// Waits until the server has ended by its own shutdown signal: connections drained, job requeued, store closed.
    ///
    /// # Errors
    /// The store failed past recovery, and the process must end at once.
    pub async fn ended(self) -> Result<(), StoreError> {
        tokio::select! {
            biased;
            ended = self.task => {
                if let Err(error) = ended {
                    tracing::error!(%error, "the server panicked");
                }
                Ok(())
            }
            error = self.service.store_failed() => Err(error),
        }
    }

    /// Stops the server, and waits for its end.
    ///
    /// # Errors
    /// The store failed past recovery.
    pub async fn stop(self) -> Result<(), StoreError> {
        self.service.shutdown.begin();
        self.ended().await
    }
}

/// Starts the service and serves it until `shutdown` begins.
///
/// # Errors
/// An address is in use, or is public without encryption; the certificate cannot be used; the service cannot start.
pub fn serve(config: Config, shutdown: Shutdown) -> LocalBoxFuture<'static, Result<RunningServer, ServeError>> {
    // Boxed, so that the whole application is compiled once in the library and not again in every program that serves
    // it.
    Box::pin(start(config, shutdown))
}

async fn start(config: Config, shutdown: Shutdown) -> Result<RunningServer, ServeError> {
    telemetry::install_recorder();
    let exposed = std::iter::once(config.listen).chain(config.operations_listen).find(|at| !at.ip().is_loopback());
    if let (Some(address), None, false) = (exposed, &config.tls, config.allow_plaintext) {
        return Err(ServeError::Plaintext { address });
    }
    let certificate = config.tls.clone().map(Certificate::load).transpose()?;
    let encryption = certificate.as_ref().map(Certificate::acceptor).transpose()?;
    let listen_at =
        async |address| Listener::at(address).await.map_err(|source| ServeError::Listen { address, source });
    let listener = listen_at(config.listen).await?;
    let operators = match config.operations_listen {
        Some(address) => Some(listen_at(address).await?),
        None => None,
    };
    let (address, operations) = (listener.address, operators.as_ref().map(|listener| listener.address));
    let starting = settings(router::starting(), bounds(&config), &config, &encryption);
    let service = tokio::select! {
        service = Service::start(&config, Clock::system(), shutdown.clone()) => service?,
        // Another process's migration may take minutes, and probes come in meanwhile.
        _ = open((&listener, starting.clone()), operators.as_ref().map(|listener| (listener, starting)), &shutdown) => {
            return Err(ServeError::Stopped);
        }
    };
    service.send_webhooks(config.webhooks.clone(), webhooks::post(config.webhooks.allowed.clone()));
    let scheme = if encryption.is_some() { "https" } else { "http" };
    tracing::info!(%address, scheme, store = %config.store, role = ?config.role, "listening");
    let front = settings(router::application(service.clone(), &config), bounds(&config), &config, &encryption);
    let back = settings(router::for_operators(service.clone(), &config), OPERATORS_BOUNDS, &config, &encryption);
    let listeners =
        Listeners { front: (listener, front), back: operators.map(|listener| (listener, back)), certificate };
    let task = tokio::spawn(listeners.run(service.clone(), config.drain));
    Ok(RunningServer { address, operations, scheme, service, task })
}

/// Number of requests and age after which a connection closes with the next answer. Load balancers can then distribute
/// its client anew, and nothing accumulates with a connection for ever.
const LARGEST_REQUESTS: u64 = 100_000;
const LARGEST_AGE: Duration = Duration::from_secs(60 * 60);
const OPERATORS_BOUNDS: ConnectionLimits =
    ConnectionLimits { all: OPERATORS, of_address: OPERATORS, for_probes: PROBES };

fn bounds(config: &Config) -> ConnectionLimits {
    let all = connection_limit(config.connection_limit);
    let of_address = config.connections_of_address.unwrap_or(all.div_ceil(4)).clamp(1, all);
    ConnectionLimits { all, of_address, for_probes: PROBES }
}

fn settings(
    application: Router,
    bounds: ConnectionLimits,
    config: &Config,
    encryption: &Option<TlsAcceptor>,
) -> ConnectionSettings {
    let limits = ClientLimits {
        to_read: READER_TIMEOUT,
        for_head: HEADER_TIMEOUT,
        between: BETWEEN_REQUESTS,
        to_finish: REFUSED_BODY_TIME,
        // The largest body accepted anywhere: a larger one would be refused at every address.
        left_bytes: config.body_limit_bytes,
        requests: LARGEST_REQUESTS,
        age: LARGEST_AGE,
    };
    ConnectionSettings { application, connections: Connections::new(bounds), limits, encryption: encryption.clone() }
}

/// Accepts connections on both listeners until the shutdown begins, and returns the handle that ends them.
async fn open(
    front: (&Listener, ConnectionSettings),
    back: Option<(&Listener, ConnectionSettings)>,
    shutdown: &Shutdown,
) -> GracefulShutdown {
    let stopping = GracefulShutdown::new();
    let behind = async {
        if let Some((listener, settings)) = back {
            listener.open(settings, shutdown, &stopping).await;
        }
    };
    tokio::join!(front.0.open(front.1, shutdown, &stopping), behind);
    stopping
}

/// The listeners and the certificate of the server.
struct Listeners {
    front: (Listener, ConnectionSettings),
    back: Option<(Listener, ConnectionSettings)>,
    certificate: Option<Arc<Certificate>>,
}

impl Listeners {
    async fn run(self, service: Arc<Service>, drain: Duration) {
        let upkeep = tokio::spawn(telemetry::keep_up(self.front.1.connections.clone()));
        let fresh = self.certificate.map(|certificate| tokio::spawn(certificate.keep_fresh()));
        let ((front, settings), back) = (self.front, self.back);
        let stopping = open(
            (&front, settings),
            back.as_ref().map(|(listener, settings)| (listener, settings.clone())),
            &service.shutdown,
        )
        .await;
        drop((front, back));
        tracing::info!("stopping: draining connections");
        if tokio::time::timeout(drain, stopping.shutdown()).await.is_err() {
            tracing::warn!("some connections were still open at the end of the drain");
        }
        service.close().await;
        fresh.inspect(JoinHandle::abort);
        upkeep.abort();
        tracing::info!("stopped");
    }
}

/// Returns the requested limit, or less if the store would otherwise find no descriptor for its files.
fn connection_limit(requested: usize) -> usize {
    let others = OTHER_DESCRIPTORS + OPERATORS + 2 * PROBES;
    match descriptors() {
        Some(descriptors) => requested.min(descriptors.saturating_sub(others).max(1)),
        None => requested,
    }
}

/// Returns how many files and sockets this process may open, if the system reports it (Linux).
fn descriptors() -> Option<usize> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix("Max open files"))?;
    line.split_whitespace().next()?.parse().ok()
}
