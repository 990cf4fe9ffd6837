//! The accept loop: bounded connections, bounded headers, bounded silence, a drain at the end.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use thiserror::Error;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::task::JoinHandle;

use super::patient::Patient;
use super::{router, telemetry};
use crate::service::Service;
use crate::service::clock::Clock;
use crate::service::config::Config;
use crate::service::error::ServiceError;
use crate::service::shutdown::Shutdown;

/// A client that has not sent its headers by then is cut off.
const HEADER_TIMEOUT: Duration = Duration::from_secs(5);
/// A head that is not whole after so many bytes, and one read of as many, is refused; hyper takes 100 lines at most.
const HEAD_BYTES: usize = 32 << 10;
/// A client that takes nothing of its answer for so long is cut off.
const READER_TIMEOUT: Duration = Duration::from_secs(30);
/// Descriptors that are not connections: the store's files, the runtime, the standard streams.
const OTHER_DESCRIPTORS: usize = 128;
/// Pause after a failed accept: out of descriptors, most likely.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

#[derive(Debug, Error)]
pub enum ServeError {
    #[error("cannot listen on {address}")]
    Listen { address: SocketAddr, source: std::io::Error },
    #[error("cannot start the service")]
    Start(#[from] ServiceError),
}

/// A server at work.
pub struct Running {
    /// The address bound.
    pub address: SocketAddr,
    shutdown: Shutdown,
    task: JoinHandle<()>,
}

impl Running {
    /// Waits until the server has ended by its own shutdown signal: drained, job requeued, store closed.
    pub async fn ended(self) {
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the server ended by a panic");
        }
    }

    /// Asks the server to end, and waits for it.
    pub async fn stop(self) {
        self.shutdown.begin();
        self.ended().await;
    }
}

/// Starts the service and serves it until `shutdown` begins.
///
/// # Errors
/// The address is taken, or the service cannot start.
pub async fn serve(config: Config, shutdown: Shutdown) -> Result<Running, ServeError> {
    telemetry::install_recorder();
    let failed = |source| ServeError::Listen { address: config.listen, source };
    let listener = TcpListener::bind(config.listen).await.map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    let service = Service::start(&config, Clock::system(), shutdown.clone()).await?;
    tracing::info!(%address, store = %config.store, role = ?config.role, "listening");
    let application = router::application(service.clone(), &config);
    let task = tokio::spawn(run(listener, application, service, config));
    Ok(Running { address, shutdown, task })
}

async fn run(listener: TcpListener, application: Router, service: Arc<Service>, config: Config) {
    let upkeep = tokio::spawn(telemetry::keep_up());
    let connections = GracefulShutdown::new();
    let permits = Arc::new(Semaphore::new(connection_limit(config.connection_limit)));
    loop {
        let accepted = async {
            let permit = permits.clone().acquire_owned().await;
            (permit, listener.accept().await)
        };
        let (permit, accepted) = tokio::select! {
            accepted = accepted => accepted,
            () = service.shutdown.begun() => break,
        };
        let Ok((stream, _)) = accepted else {
            tokio::time::sleep(ACCEPT_PAUSE).await;
            continue;
        };
        let handler = TowerToHyperService::new(application.clone());
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEADER_TIMEOUT)
            .max_buf_size(HEAD_BYTES)
            .serve_connection(TokioIo::new(Patient::new(stream, READER_TIMEOUT)), handler);
        let connection = connections.watch(connection);
        tokio::spawn(async move {
            if let Err(error) = connection.await {
                tracing::debug!(%error, "connection ended");
            }
            drop(permit);
        });
    }
    drop(listener);
    tracing::info!("stopping: draining connections");
    if tokio::time::timeout(config.drain, connections.shutdown()).await.is_err() {
        tracing::warn!("some connections were still open at the end of the drain");
    }
    service.close().await;
    upkeep.abort();
    tracing::info!("stopped");
}

/// As many as asked for, but never so many that the store finds no descriptor for its files.
fn connection_limit(asked: usize) -> usize {
    match descriptors() {
        Some(descriptors) => asked.min(descriptors.saturating_sub(OTHER_DESCRIPTORS).max(1)),
        None => asked,
    }
}

/// Files and sockets this process may open, where the system tells (Linux).
fn descriptors() -> Option<usize> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix("Max open files"))?;
    line.split_whitespace().next()?.parse().ok()
}
