//! A mark beside a folder's database that it had keys: a database that was lost, or rolled back to before its first key, is
//! then not answered to everybody. PostgreSQL has no such place; there `--require-keys` says so.

use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use super::error::unusable;
use super::{Engine, Store, StoreError};

const MARK: &str = "ballast.keys";
const CONTENT: &[u8] = b"The database beside this file has keys. Without a key in it the service does not start while this file is here.\n";

impl Store {
    /// The mark that there were keys, if it was made.
    pub fn key_mark(&self) -> Option<PathBuf> {
        self.mark().filter(|mark| mark.exists())
    }

    /// Makes the mark; nothing where it is made or has no place.
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
