//! A plain address on loopback in front of an encrypted service, so that the generator's connections stay cheap. The
//! encryption on this side also costs processor time, on the generator's own thread.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;

use rustls::pki_types::{InvalidDnsNameError, ServerName};
use thiserror::Error;
use tokio::io::copy_bidirectional;
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsConnector;

use crate::command::tls_client::{self, TlsClientError};

#[derive(Debug, Error)]
pub enum TunnelError {
    #[error(transparent)]
    Tls(#[from] TlsClientError),
    #[error("the host name cannot be the name of a certificate")]
    Name { source: InvalidDnsNameError },
    #[error("opening a tunnel to it")]
    Listen { source: std::io::Error },
}

/// Opens a tunnel to `target`, whose certificate must be for `name` and issued by an authority in the file.
pub async fn open(target: SocketAddr, name: &str, authorities: &Path) -> Result<SocketAddr, TunnelError> {
    let connector = TlsConnector::from(tls_client::trusting(authorities)?);
    let name = ServerName::try_from(name.trim_matches(['[', ']']).to_owned());
    let name = name.map_err(|source| TunnelError::Name { source })?;
    let failed = |source| TunnelError::Listen { source };
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    tokio::spawn(async move {
        while let Ok((mut near, _)) = listener.accept().await {
            let (connector, name) = (connector.clone(), name.clone());
            tokio::spawn(async move {
                let through = async {
                    let far = TcpStream::connect(target).await?;
                    far.set_nodelay(true)?;
                    near.set_nodelay(true)?;
                    let mut far = connector.connect(name, far).await?;
                    copy_bidirectional(&mut near, &mut far).await
                };
                if let Err(error) = through.await {
                    eprintln!("a tunnelled connection ended: {error}");
                }
            });
        }
    });
    Ok(address)
}
