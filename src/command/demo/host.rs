//! The service in this process, as `serve` runs it, on a free loopback port.

use std::net::{AddrParseError, SocketAddr};
use std::path::Path;

use super::DemoError;

/// A running service.
pub struct Host {
    pub address: SocketAddr,
}

/// Starts it over the data folder.  (STUB: takes the address of a service started elsewhere from BALLAST_DEMO_ADDRESS.)
pub async fn start(_folder: &Path) -> Result<Host, DemoError> {
    let address = std::env::var("BALLAST_DEMO_ADDRESS").unwrap_or_default().parse();
    let address = address.map_err(|source: AddrParseError| DemoError::Service { source: source.into() })?;
    Ok(Host { address })
}

impl Host {
    /// Drains it and waits for its end.
    pub async fn stop(self) -> Result<(), DemoError> {
        Ok(())
    }
}
