//! Encrypted connections: TLS 1.2 and 1.3, with a certificate that is reloaded when its files change.
//!
//! The files are read every [`POLL`], in full. They are small, and neither a time stamp nor an event of the file system
//! reliably shows that a link has a new target. Unusable files are logged and counted, and the previous certificate
//! stays; a pair that was half written is complete at the next poll.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use rustls::crypto::CryptoProvider;
use rustls::crypto::ring::default_provider;
use rustls::pki_types::pem::{Error as PemError, PemObject};
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::{ClientHello, ResolvesServerCert};
use rustls::sign::CertifiedKey;
use rustls::version::{TLS12, TLS13};
use thiserror::Error;
use tokio_rustls::TlsAcceptor;

use crate::http::connection::certificate_expiry::expiry;
use crate::service::metrics::{CERTIFICATE_EXPIRES, CERTIFICATE_LOADS};
use crate::service::process::config::TlsFiles;

/// Interval within which a new certificate takes effect.
const POLL: Duration = Duration::from_secs(2);

/// The reason why files cannot be used as a certificate and its key.
#[derive(Debug, Error)]
pub enum TlsError {
    #[error("reading {}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{} is not PEM", path.display())]
    Pem { path: PathBuf, source: PemError },
    #[error("{} holds no certificate", path.display())]
    NoCertificate { path: PathBuf },
    #[error("{} holds no private key", path.display())]
    NoKey { path: PathBuf, source: PemError },
    #[error("the certificate in {} and the key in {} do not form a usable pair", certificate.display(), key.display())]
    Pair { certificate: PathBuf, key: PathBuf, source: rustls::Error },
    #[error("this build of the TLS library lacks a required protocol version")]
    Version { source: rustls::Error },
}

/// The certificate in use.
pub struct Certificate {
    files: TlsFiles,
    provider: Arc<CryptoProvider>,
    current: RwLock<Arc<CertifiedKey>>,
}

impl fmt::Debug for Certificate {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "Certificate({})", self.files.certificate.display())
    }
}

impl ResolvesServerCert for Certificate {
    fn resolve(&self, _: ClientHello<'_>) -> Option<Arc<CertifiedKey>> {
        Some(self.current.read().unwrap_or_else(PoisonError::into_inner).clone())
    }
}

impl Certificate {
    /// Loads the certificate.
    ///
    /// # Errors
    /// The files cannot be read, or are not a certificate with its key.
    pub fn load(files: TlsFiles) -> Result<Arc<Self>, TlsError> {
        let provider = Arc::new(default_provider());
        let current = RwLock::new(Arc::new(Pair::read(&files)?.certified(&files, &provider)?));
        Ok(Arc::new(Certificate { files, provider, current }))
    }

    /// Returns an acceptor that encrypts connections with this certificate.
    ///
    /// # Errors
    /// Never with the provider built in.
    pub fn acceptor(self: &Arc<Self>) -> Result<TlsAcceptor, TlsError> {
        let builder = rustls::ServerConfig::builder_with_provider(self.provider.clone());
        let builder =
            builder.with_protocol_versions(&[&TLS13, &TLS12]).map_err(|source| TlsError::Version { source })?;
        let mut config = builder.with_no_client_auth().with_cert_resolver(self.clone());
        config.alpn_protocols = vec![b"http/1.1".to_vec()];
        Ok(Arc::new(config).into())
    }

    /// Checks the files at every poll, for ever.
    pub async fn keep_fresh(self: Arc<Self>) {
        let mut seen = None;
        loop {
            let certificate = self.clone();
            let looked = tokio::task::spawn_blocking(move || certificate.look(seen)).await;
            seen = looked.unwrap_or_default();
            tokio::time::sleep(POLL).await;
        }
    }

    /// Loads the files if their content differs from what was `seen` last.
    fn look(&self, seen: Option<Pair>) -> Option<Pair> {
        let found = Pair::read(&self.files);
        if let (Ok(found), Some(seen)) = (&found, &seen)
            && found == seen
        {
            return Some(found.clone());
        }
        let loaded = found.and_then(|pair| pair.certified(&self.files, &self.provider).map(|key| (pair, key)));
        match loaded {
            Ok((pair, key)) => {
                let mut current = self.current.write().unwrap_or_else(PoisonError::into_inner);
                if current.cert != key.cert {
                    metrics::counter!(CERTIFICATE_LOADS, "outcome" => "taken").increment(1);
                    tracing::info!(file = %self.files.certificate.display(), "a new certificate is in use");
                }
                if let Some(expires) = key.cert.iter().filter_map(|certificate| expiry(certificate)).min() {
                    metrics::gauge!(CERTIFICATE_EXPIRES).set(expires as f64);
                }
                *current = Arc::new(key);
                Some(pair)
            }
            Err(error) => {
                metrics::counter!(CERTIFICATE_LOADS, "outcome" => "refused").increment(1);
                let error = &error as &dyn std::error::Error;
                tracing::error!(error, "the certificate files cannot be used; the previous certificate stays in use");
                Pair::read(&self.files).ok()
            }
        }
    }
}

/// The content of the two files.
#[derive(Clone, PartialEq, Eq)]
struct Pair {
    certificate: Vec<u8>,
    key: Vec<u8>,
}

impl Pair {
    fn read(files: &TlsFiles) -> Result<Self, TlsError> {
        let read = |path: &Path| std::fs::read(path).map_err(|source| TlsError::Read { path: path.to_owned(), source });
        Ok(Pair { certificate: read(&files.certificate)?, key: read(&files.key)? })
    }

    fn certified(&self, files: &TlsFiles, provider: &CryptoProvider) -> Result<CertifiedKey, TlsError> {
        let (certificate, key) = (files.certificate.clone(), files.key.clone());
        let chain: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&self.certificate).collect();
        let chain = chain.map_err(|source| TlsError::Pem { path: certificate.clone(), source })?;
        if chain.is_empty() {
            return Err(TlsError::NoCertificate { path: certificate });
        }
        let private = PrivateKeyDer::from_pem_slice(&self.key);
        let private = private.map_err(|source| TlsError::NoKey { path: key.clone(), source })?;
        CertifiedKey::from_der(chain, private, provider).map_err(|source| TlsError::Pair { certificate, key, source })
    }
}
