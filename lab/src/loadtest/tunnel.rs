//! A plain address on loopback in front of an encrypted service, so that the generator's connections stay cheap. The
//! encryption on this side also costs processor time, on the generator's own thread.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustls::crypto::ring::default_provider;
use rustls::pki_types::pem::{Error as PemError, PemObject};
use rustls::pki_types::{CertificateDer, InvalidDnsNameError, ServerName};
use rustls::{ClientConfig, RootCertStore};
use thiserror::Error;
use tokio::io::copy_bidirectional;
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsConnector;

#[derive(Debug, Error)]
pub enum TunnelError {
    #[error("reading the certificates in {}", path.display())]
    Authority { path: PathBuf, source: PemError },
    #[error("TLS cannot be set up")]
    Setup { source: rustls::Error },
    #[error("the host name cannot be the name of a certificate")]
    Name { source: InvalidDnsNameError },
    #[error("opening a tunnel to it")]
    Listen { source: std::io::Error },
}

/// Opens a tunnel to `target`, whose certificate must be for `name` and issued by an authority in the file.
pub async fn open(target: SocketAddr, name: &str, authorities: &Path) -> Result<SocketAddr, TunnelError> {
    let connector = TlsConnector::from(trusting(authorities)?);
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

/// Returns a configuration that trusts only the authorities in the PEM file.
fn trusting(authorities: &Path) -> Result<Arc<ClientConfig>, TunnelError> {
    let failed = |source| TunnelError::Authority { path: authorities.to_owned(), source };
    let setup = |source| TunnelError::Setup { source };
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_file_iter(authorities).map_err(failed)? {
        roots.add(certificate.map_err(failed)?).map_err(setup)?;
    }
    let builder = ClientConfig::builder_with_provider(Arc::new(default_provider()));
    let builder = builder.with_safe_default_protocol_versions().map_err(setup)?;
    Ok(Arc::new(builder.with_root_certificates(roots).with_no_client_auth()))
}
