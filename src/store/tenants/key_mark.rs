//! A marker file beside a folder's database that says that the store had keys. If the database is lost, or rolled back
//! to before its first key, the service then does not answer calls without a key. PostgreSQL has no folder for such a
//! file; there `--require-keys` has the same effect.

use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::store::engine::error::unusable;
use crate::store::{Engine, Store, StoreError};

const MARK: &str = "ballast.keys";
const CONTENT: &[u8] = b"The database next to this file has access keys. While this file exists, the service does not start on a database without keys.\n";

impl Store {
    /// Returns the path of the marker file, if it exists.
    pub fn key_mark(&self) -> Option<PathBuf> {
        self.mark().filter(|mark| mark.exists())
    }

    /// Creates the marker file; does nothing if it exists or the store has no folder.
    pub fn mark_keys(&self) -> Result<(), StoreError> {
        self.mark().map_or(Ok(()), |mark| make(&mark).map_err(|error| unusable(&mark, error)))
    }

    fn mark(&self) -> Option<PathBuf> {
        match &self.engine {
            Engine::Sqlite(folder) => Some(folder.dir().join(MARK)),
            Engine::Postgres(_) => None,
        }
    }
}

fn make(mark: &Path) -> std::io::Result<()> {
    let mut file = match File::create_new(mark) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => return Ok(()),
        made => made?,
    };
    file.write_all(CONTENT)?;
    file.sync_all()?;
    mark.parent().map_or(Ok(()), |folder| File::open(folder)?.sync_all())
}
