//! Where a store under test keeps its facts: a folder, or a database.

use std::path::Path;

use ballast::store::{KeyRing, Store, StoreError};
use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::postgres::PgConnection;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{AssertSqlSafe, Connection, SqlSafeStr};
use tempfile::TempDir;

use super::postgres;

pub enum Place {
    Folder(TempDir),
    Database(String),
}

impl Place {
    pub fn folder() -> Place {
        Place::Folder(tempfile::tempdir().unwrap())
    }

    /// `None` where there is no PostgreSQL.
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

    /// Its keys, beside whoever has it open.
    pub async fn key_ring(&self) -> Result<KeyRing, StoreError> {
        match self {
            Place::Folder(folder) => KeyRing::open(&folder.path().join("data")).await,
            Place::Database(url) => KeyRing::connect(&url.parse().unwrap()).await,
        }
    }

    /// Makes what a release with the first migration alone left: a policy, and a job under an idempotency key.
    pub async fn create_of_schema_1(&self, policy: &str, json: &[u8]) {
        let migrator = |facts: &'static str| {
            let kind = MigrationType::Simple;
            Migrator::with_migrations(vec![Migration::new(1, "facts".into(), kind, facts.into_sql_str(), false)])
        };
        match self {
            Place::Folder(folder) => {
                std::fs::create_dir(folder.path().join("data")).unwrap();
                let file = folder.path().join("data/ballast.sqlite");
                let options = SqliteConnectOptions::new().filename(file).create_if_missing(true);
                let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
                migrator(include_str!("../../src/store/migrations/sqlite/0001_facts.sql"))
                    .run(&mut connection)
                    .await
                    .unwrap();
                connection.close().await.unwrap();
            }
            Place::Database(url) => {
                let mut connection = PgConnection::connect(url).await.unwrap();
                migrator(include_str!("../../src/store/migrations/postgres/0001_facts.sql"))
                    .run(&mut connection)
                    .await
                    .unwrap();
                connection.close().await.unwrap();
            }
        }
        let hex: String = json.iter().map(|byte| format!("{byte:02x}")).collect();
        let bytes = match self {
            Place::Folder(_) => format!("x'{hex}'"),
            Place::Database(_) => format!("decode('{hex}', 'hex')"),
        };
        self.tamper(&format!("INSERT INTO policies (policy, created_ms, json) VALUES ('{policy}', 1, {bytes})")).await;
        self.tamper(
            "INSERT INTO jobs (job, kind, state, request_json, steps_total, created_ms)
             VALUES ('old', 'train', 'queued', '{}', 1, 1)",
        )
        .await;
        self.tamper("INSERT INTO idempotency_keys VALUES ('old key', 'hash', 'old')").await;
    }

    pub async fn reopen(&self, store: Store) -> Store {
        store.close().await;
        self.open().await
    }

    /// What a second worker or client holds: of the same process over a folder, else of another.
    pub async fn second(&self, store: &Store) -> Store {
        match self {
            Place::Folder(_) => store.clone(),
            Place::Database(_) => self.open().await,
        }
    }

    /// Changes a database file without minding what refers to what.
    pub async fn break_references(file: &Path, statement: &'static str) {
        let options = SqliteConnectOptions::new().filename(file).foreign_keys(false);
        let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
        let changed = sqlx::query(statement).execute(&mut connection).await.unwrap();
        assert_eq!(changed.rows_affected(), 1, "{statement}");
        connection.close().await.unwrap();
    }

    /// Changes one row behind a closed store's back.
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
