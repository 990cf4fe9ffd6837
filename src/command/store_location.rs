//! The location of the durable data, from the command line.

use std::path::PathBuf;

use ballast::service::process::config::StoreLocation;
use ballast::store::{PostgresUrl, UrlError};
use clap::Args;

#[derive(Debug, Args)]
pub struct StoreArgs {
    /// Folder of the SQLite database, unless there is a `--store`.
    #[arg(long, env = "BALLAST_DATA", default_value = "ballast-data")]
    data: PathBuf,
    /// PostgreSQL database that replicas share: postgres://user:password@host:port/database.
    #[arg(long, env = "BALLAST_STORE", hide_env_values = true)]
    store: Option<Password>,
}

/// An address that may hold a password, so it does not print.
#[derive(Clone)]
pub(super) struct Password(pub(super) String);

impl std::fmt::Debug for Password {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("..")
    }
}

impl Password {
    /// Parses the address.
    ///
    /// # Errors
    /// The address cannot be read.
    pub fn url(&self) -> Result<PostgresUrl, UrlError> {
        self.0.parse()
    }
}

impl From<&str> for Password {
    fn from(address: &str) -> Self {
        Password(address.to_owned())
    }
}

impl StoreArgs {
    /// Returns the location of the store.
    ///
    /// # Errors
    /// The address of the database cannot be read.
    pub fn location(self) -> Result<StoreLocation, UrlError> {
        match self.store.filter(|store| !store.0.is_empty()) {
            Some(store) => Ok(StoreLocation::Postgres(store.url()?)),
            None => Ok(StoreLocation::Folder(self.data)),
        }
    }
}
