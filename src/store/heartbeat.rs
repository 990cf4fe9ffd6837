//! The latest time that a folder's process stored, used to detect a clock that jumped. A folder has no clock but its
//! machine's; a database has its own.

use futures_util::FutureExt;

use crate::store::engine::query::{StoreRow, query};
use crate::store::{Engine, Store, StoreError};

impl Store {
    /// Returns the clock of the database, in milliseconds; `None` for a folder, which has none.
    pub async fn database_time(&self) -> Result<Option<i64>, StoreError> {
        match &self.engine {
            Engine::Sqlite(_) => Ok(None),
            Engine::Postgres(database) => database.time().await.map(Some),
        }
    }

    /// Returns the time that was stored last.
    pub async fn heartbeat(&self) -> Result<Option<i64>, StoreError> {
        let found = |rows: &[StoreRow]| rows.first().map(|row| row.get("at_ms")).transpose();
        self.probe("reading the last heartbeat", query("SELECT at_ms FROM heartbeat"), found).await
    }

    pub async fn beat(&self, at_ms: i64) -> Result<(), StoreError> {
        self.write("storing a heartbeat", move |mut connection| {
            async move {
                let beat = query(
                    "INSERT INTO heartbeat (row_id, at_ms) VALUES (1, $1)
                     ON CONFLICT (row_id) DO UPDATE SET at_ms = excluded.at_ms",
                );
                connection.execute(beat.bind(at_ms)).await.map(drop)
            }
            .boxed()
        })
        .await
    }
}
