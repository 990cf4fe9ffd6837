//! The service in this process, as `serve` runs it, on a free loopback port.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;

use ballast::http::{Running, serve};
use ballast::service::config::Config;
use ballast::service::shutdown::Shutdown;

use super::DemoError;

/// A running service.
pub struct Host {
    pub address: SocketAddr,
    running: Running,
}

/// Starts it over the data folder, training on every core: nobody else is being served.
pub async fn start(folder: &Path) -> Result<Host, DemoError> {
    let mut config = Config::new(folder);
    config.listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    config.training_threads = std::thread::available_parallelism().map_or(1, usize::from);
    let started = serve(config, Shutdown::new()).await;
    let running = started.map_err(|source| DemoError::Service { source: source.into() })?;
    Ok(Host { address: running.address, running })
}

impl Host {
    /// Drains it and waits for its end.
    pub async fn stop(self) -> Result<(), DemoError> {
        self.running.stop().await;
        Ok(())
    }
}
