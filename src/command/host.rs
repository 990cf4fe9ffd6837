//! The service in this process, as `serve` runs it, on a free loopback port with its own data folder.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use ballast::http::{RunningServer, serve};
use ballast::service::process::config::Config;
use ballast::service::process::shutdown::Shutdown;
use thiserror::Error;

#[derive(Debug, Error)]
pub enum HostError {
    #[error("making the data folder {}", path.display())]
    Folder { path: PathBuf, source: std::io::Error },
    #[error("starting the service")]
    Start { source: Box<dyn std::error::Error + Send + Sync> },
}

/// A data folder that is removed with all its contents.
struct DataFolder(PathBuf);

impl DataFolder {
    /// Makes a temporary folder named after `purpose`.
    fn make(purpose: &str) -> Result<Self, HostError> {
        let path = std::env::temp_dir().join(format!("ballast-{purpose}-{}", std::process::id()));
        std::fs::create_dir(&path).map_err(|source| HostError::Folder { path: path.clone(), source })?;
        Ok(DataFolder(path))
    }
}

impl Drop for DataFolder {
    fn drop(&mut self) {
        // A folder that cannot be removed stays behind in the system's temporary folder.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A running service.
pub struct Host {
    pub address: SocketAddr,
    running: RunningServer,
    // Declared last: the service releases the folder before it is removed.
    folder: DataFolder,
}

impl Host {
    /// Starts the service over a new folder named after `purpose`.
    pub async fn start(purpose: &str) -> Result<Self, HostError> {
        let folder = DataFolder::make(purpose)?;
        let mut config = Config::new(&folder.0);
        config.listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let started = serve(config, Shutdown::new()).await;
        let running = started.map_err(|source| HostError::Start { source: source.into() })?;
        Ok(Host { address: running.address, running, folder })
    }

    pub fn folder(&self) -> &Path {
        &self.folder.0
    }

    /// Drains the service and waits for its end.
    pub async fn stop(self) {
        if let Err(error) = self.running.stop().await {
            tracing::error!(error = &error as &dyn std::error::Error, "the store failed at the end");
        }
    }
}
