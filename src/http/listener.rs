//! A door: the address listened on, and who has come in by it.
//!
//! Whoever knocks is let in at once or told to come back: nobody waits in the kernel's queue behind somebody who says
//! nothing.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper_util::server::graceful::GracefulShutdown;
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsAcceptor;

use super::connections::{Connections, Held};
use super::conversation::{self, Stopping};
use super::patient::Patience;
use crate::service::metrics::CONNECTIONS_REFUSED;
use crate::service::shutdown::Shutdown;

/// Pause after a failed accept: out of descriptors, most likely.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);
/// For those who get no place: written once where it fits the empty buffer, as it does.
const NO_PLACE: &[u8] =
    b"HTTP/1.1 503 Service Unavailable\r\nretry-after: 1\r\nconnection: close\r\ncontent-length: 0\r\n\r\n";

pub struct Door {
    pub address: SocketAddr,
    listener: TcpListener,
}

/// How those who come in are treated.
#[derive(Clone)]
pub struct Manners {
    pub application: Router,
    pub connections: Arc<Connections>,
    pub patience: Patience,
    /// `None` where connections are not encrypted.
    pub encryption: Option<TlsAcceptor>,
}

impl Door {
    /// # Errors
    /// The address is taken, or none of this machine.
    pub async fn at(address: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address).await?;
        Ok(Door { address: listener.local_addr()?, listener })
    }

    /// Lets callers in until the shutdown begins.
    pub async fn open(&self, manners: Manners, shutdown: &Shutdown, stopping: &GracefulShutdown) {
        loop {
            let accepted = tokio::select! {
                accepted = self.listener.accept() => accepted,
                () = shutdown.begun() => return,
            };
            let Ok((stream, caller)) = accepted else {
                tokio::time::sleep(ACCEPT_PAUSE).await;
                continue;
            };
            match manners.connections.place(caller.ip()) {
                Some(held) => {
                    let stopping = Stopping { shutdown: shutdown.clone(), watcher: stopping.watcher() };
                    tokio::spawn(let_in(stream, held, manners.clone(), stopping));
                }
                None => {
                    metrics::counter!(CONNECTIONS_REFUSED).increment(1);
                    // Over TLS it would be noise; and whoever does not take it is gone.
                    if manners.encryption.is_none() {
                        let _ = stream.try_write(NO_PLACE);
                    }
                }
            }
        }
    }
}

async fn let_in(stream: TcpStream, held: Held, manners: Manners, stopping: Stopping) {
    let Manners { application, patience, encryption, .. } = manners;
    let Ok(local) = stream.local_addr() else { return };
    let Some(acceptor) = encryption else {
        return conversation::hold(stream, &held, local, patience, application, stopping).await;
    };
    let shaken = tokio::select! {
        shaken = tokio::time::timeout(patience.for_head, acceptor.accept(stream)) => shaken,
        () = held.connection.gave_way() => return,
    };
    match shaken {
        Ok(Ok(stream)) => conversation::hold(stream, &held, local, patience, application, stopping).await,
        Ok(Err(error)) => tracing::debug!(%error, "a connection was not encrypted"),
        Err(_) => tracing::debug!("a connection was not encrypted in time"),
    }
}
