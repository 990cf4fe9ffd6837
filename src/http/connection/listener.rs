//! A listener: the address that it listens on, and the connections that it accepts.
//!
//! A client is accepted or asked to retry at once: nobody waits in the kernel's queue behind an idle connection.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper_util::server::graceful::GracefulShutdown;
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsAcceptor;

use crate::http::connection::connection_table::{ConnectionGuard, Connections};
use crate::http::connection::exchanges::{self, Stopping};
use crate::http::connection::timed_stream::ClientLimits;
use crate::service::metrics::CONNECTIONS_REFUSED;
use crate::service::process::shutdown::Shutdown;

/// Pause after a failed accept; most likely the process is out of descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);
/// The answer to clients that get no connection. It is written once, because it fits the empty socket buffer.
const NO_PLACE: &[u8] =
    b"HTTP/1.1 503 Service Unavailable\r\nretry-after: 1\r\nconnection: close\r\ncontent-length: 0\r\n\r\n";

pub struct Listener {
    pub address: SocketAddr,
    socket: TcpListener,
}

/// Settings for accepted connections.
#[derive(Clone)]
pub struct ConnectionSettings {
    pub application: Router,
    pub connections: Arc<Connections>,
    pub limits: ClientLimits,
    /// `None` if connections are not encrypted.
    pub encryption: Option<TlsAcceptor>,
}

impl Listener {
    /// Binds to the address.
    ///
    /// # Errors
    /// The address is in use, or is not one of this machine.
    pub async fn at(address: SocketAddr) -> io::Result<Self> {
        let socket = TcpListener::bind(address).await?;
        Ok(Listener { address: socket.local_addr()?, socket })
    }

    /// Accepts connections until the shutdown begins.
    pub async fn open(&self, settings: ConnectionSettings, shutdown: &Shutdown, stopping: &GracefulShutdown) {
        loop {
            let accepted = tokio::select! {
                accepted = self.socket.accept() => accepted,
                () = shutdown.begun() => return,
            };
            let Ok((stream, caller)) = accepted else {
                tokio::time::sleep(ACCEPT_PAUSE).await;
                continue;
            };
            match settings.connections.place(caller.ip()) {
                Some(held) => {
                    let stopping = Stopping { shutdown: shutdown.clone(), watcher: stopping.watcher() };
                    tokio::spawn(serve_connection(stream, held, settings.clone(), stopping));
                }
                None => {
                    metrics::counter!(CONNECTIONS_REFUSED).increment(1);
                    // A TLS client could not read it. If the write fails, the client is gone.
                    if settings.encryption.is_none() {
                        let _ = stream.try_write(NO_PLACE);
                    }
                }
            }
        }
    }
}

async fn serve_connection(stream: TcpStream, held: ConnectionGuard, settings: ConnectionSettings, stopping: Stopping) {
    let ConnectionSettings { application, limits, encryption, .. } = settings;
    let Ok(local) = stream.local_addr() else { return };
    let Some(acceptor) = encryption else {
        return exchanges::hold(stream, &held, local, limits, application, stopping).await;
    };
    let handshake = tokio::select! {
        handshake = tokio::time::timeout(limits.for_head, acceptor.accept(stream)) => handshake,
        () = held.connection.gave_way() => return,
    };
    match handshake {
        Ok(Ok(stream)) => exchanges::hold(stream, &held, local, limits, application, stopping).await,
        Ok(Err(error)) => tracing::debug!(%error, "a TLS handshake failed"),
        Err(_) => tracing::debug!("a TLS handshake timed out"),
    }
}
