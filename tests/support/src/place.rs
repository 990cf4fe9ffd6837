//! The location of a store under test: a folder, or a database.

use std::path::Path;

use ballast::store::{KeyRing, Store, StoreError};
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{AssertSqlSafe, Connection};
use tempfile::TempDir;

use super::patience::until;
use super::postgres;

/// Runs each test over either engine, each with a store of its own.
#[macro_export]
macro_rules! on_both_engines {
    ($($name:ident),* $(,)?) => {
        mod sqlite {
            $(#[tokio::test(flavor = "multi_thread")]
            async fn $name() {
                super::$name(&$crate::place::Place::folder()).await;
            })*
        }
        mod postgres {
            $(#[tokio::test(flavor = "multi_thread")]
            async fn $name() {
                if let Some(place) = $crate::place::Place::database().await {
                    super::$name(&place).await;
                }
            })*
        }
    };
}

pub enum Place {
    Folder(TempDir),
    Database(String),
}

impl Place {
    pub fn folder() -> Place {
        Place::Folder(tempfile::tempdir().unwrap())
    }

    /// Returns `None` if there is no PostgreSQL.
    pub async fn database() -> Option<Place> {
        postgres::database().await.map(Place::Database)
    }

    pub async fn open(&self) -> Store {
        self.try_open().await.unwrap()
    }

    pub async fn try_open(&self) -> Result<Store, StoreError> {
        match self {
            Place::Folder(folder) => Store::open(&folder.path().join("data")).await,
            Place::Database(url) => Store::connect(&url.parse().unwrap()).await,
        }
    }

    /// Opens the keys, even while a process has the store open.
    pub async fn key_ring(&self) -> Result<KeyRing, StoreError> {
        match self {
            Place::Folder(folder) => KeyRing::open(&folder.path().join("data")).await,
            Place::Database(url) => KeyRing::connect(&url.parse().unwrap()).await,
        }
    }

    /// Reopens a closed store. Waits for the lock, because a program that another test starts inherits it until it
    /// executes.
    pub async fn reopen(&self, store: Store) -> Store {
        store.close().await;
        let opened = async || match self.try_open().await {
            Err(StoreError::Locked { .. }) => None,
            opened => Some(opened.unwrap()),
        };
        until("the lock of a folder that was closed", opened).await
    }

    /// Returns the store of a second worker or client: in the same process over a folder, else in another.
    pub async fn second(&self, store: &Store) -> Store {
        match self {
            Place::Folder(_) => store.clone(),
            Place::Database(_) => self.open().await,
        }
    }

    /// Changes a database file without checking foreign keys.
    pub async fn break_references(file: &Path, statement: &'static str) {
        let options = SqliteConnectOptions::new().filename(file).foreign_keys(false);
        let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
        let changed = sqlx::query(statement).execute(&mut connection).await.unwrap();
        assert_eq!(changed.rows_affected(), 1, "{statement}");
        connection.close().await.unwrap();
    }

    /// Changes one row while the store is closed.
    pub async fn tamper(&self, statement: &str) {
        let changed = match self {
            Place::Folder(folder) => {
                let options = SqliteConnectOptions::new().filename(folder.path().join("data/ballast.sqlite"));
                let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
                let changed = sqlx::query(AssertSqlSafe(statement)).execute(&mut connection).await.unwrap();
                connection.close().await.unwrap();
                changed.rows_affected()
            }
            Place::Database(url) => postgres::execute(url, statement).await,
        };
        assert_eq!(changed, 1, "{statement}");
    }
}
