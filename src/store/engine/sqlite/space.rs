//! The space a folder's database takes, and the return of free pages to the file system.

use std::path::Path;

use futures_util::FutureExt;

use super::Folder;
use super::opening::LOG;
use crate::store::engine::error::{Failure, StoreError, unusable};
use crate::store::engine::query::{Purpose, StoreConnection, query};
use crate::store::jobs::retention::StoreSpace;

const DOING: &str = "measuring the store";

impl Folder {
    pub(in crate::store) async fn room(&self) -> Result<StoreSpace, StoreError> {
        let pages = query(
            "SELECT page_count, freelist_count, page_size
             FROM pragma_page_count, pragma_freelist_count, pragma_page_size",
        );
        let rows = self.read(Purpose::Probes, DOING, pages).await?;
        let row = rows.first().ok_or_else(|| Failure::sqlite(sqlx::Error::RowNotFound).during(DOING))?;
        let number = |column| row.get::<i64>(column).map(i64::unsigned_abs).map_err(|failure| failure.during(DOING));
        let page_size = number("page_size")?;
        Ok(StoreSpace {
            database: number("page_count")? * page_size,
            free: Some(number("freelist_count")? * page_size),
            log: Some(self.dir.join(LOG).metadata().map_or(0, |log| log.len())),
            disk_left: Some(disk_left(&self.dir)?),
        })
    }

    pub(in crate::store) async fn give_back_pages(&self, pages: u32) -> Result<(), StoreError> {
        self.write("giving back free pages", move |connection| {
            async move {
                let StoreConnection::Sqlite(connection) = connection else { return Ok(()) };
                let give_back = sqlx::AssertSqlSafe(format!("PRAGMA incremental_vacuum({pages})"));
                sqlx::query(give_back).fetch_all(connection).await.map(drop).map_err(Failure::sqlite)
            }
            .boxed()
        })
        .await
    }
}

/// Returns how many bytes an unprivileged process may still write to the file system of `dir`.
fn disk_left(dir: &Path) -> Result<u64, StoreError> {
    let found = rustix::fs::statvfs(dir).map_err(|error| unusable(dir, error.into()))?;
    Ok(found.f_bavail.saturating_mul(found.f_frsize))
}
