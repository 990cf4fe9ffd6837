//! TLS as a client: for the health check, which calls its own service and sends no secret, and for the load test.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::ring::default_provider;
use rustls::crypto::{CryptoProvider, verify_tls12_signature, verify_tls13_signature};
use rustls::pki_types::pem::{Error as PemError, PemObject};
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::{ClientConfig, DigitallySignedStruct, Error, RootCertStore, SignatureScheme};
use thiserror::Error as ThisError;

#[derive(Debug, ThisError)]
pub enum TlsClientError {
    #[error("reading the certificates in {}", path.display())]
    Authority { path: PathBuf, source: PemError },
    #[error("TLS cannot be set up")]
    Setup { source: Error },
}

/// Returns a configuration that trusts only the authorities in the PEM file.
///
/// # Errors
/// The file cannot be read, or contains something that is no certificate.
pub fn trusting(authorities: &Path) -> Result<Arc<ClientConfig>, TlsClientError> {
    let failed = |source| TlsClientError::Authority { path: authorities.to_owned(), source };
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_file_iter(authorities).map_err(failed)? {
        roots.add(certificate.map_err(failed)?).map_err(|source| TlsClientError::Setup { source })?;
    }
    let builder =
        ClientConfig::builder_with_provider(Arc::new(default_provider())).with_safe_default_protocol_versions();
    let builder = builder.map_err(|source| TlsClientError::Setup { source })?;
    Ok(Arc::new(builder.with_root_certificates(roots).with_no_client_auth()))
}

/// Returns a configuration that verifies no certificate. It is for a readiness check of one's own service on one's own
/// machine, which sends nothing that others could use. A certificate for the service's public name would not match the
/// local address either.
///
/// # Errors
/// Never with the provider built in.
pub fn unjudging() -> Result<Arc<ClientConfig>, TlsClientError> {
    let provider = Arc::new(default_provider());
    let builder = ClientConfig::builder_with_provider(provider.clone()).with_safe_default_protocol_versions();
    let builder = builder.map_err(|source| TlsClientError::Setup { source })?;
    let verifier = Arc::new(Unjudging(provider));
    Ok(Arc::new(builder.dangerous().with_custom_certificate_verifier(verifier).with_no_client_auth()))
}

#[derive(Debug)]
struct Unjudging(Arc<CryptoProvider>);

impl ServerCertVerifier for Unjudging {
    fn verify_server_cert(
        &self,
        _: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: &ServerName<'_>,
        _: &[u8],
        _: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        Ok(ServerCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls12_signature(message, certificate, signed, &self.0.signature_verification_algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls13_signature(message, certificate, signed, &self.0.signature_verification_algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.0.signature_verification_algorithms.supported_schemes()
    }
}
