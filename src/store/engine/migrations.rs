//! The schema of each engine, as a list of steps that only grows.

use std::sync::Arc;

use sqlx::SqlSafeStr;
use sqlx::migrate::{MigrateError, Migration, MigrationType, Migrator};

use crate::store::engine::error::{Failure, StoreError};

/// Version, description, statements.
type SchemaStep = (i64, &'static str, &'static str);

const SQLITE: [SchemaStep; 4] = [
    (1, "facts", include_str!("migrations/sqlite/0001_facts.sql")),
    (2, "subscriptions", include_str!("migrations/sqlite/0002_subscriptions.sql")),
    (3, "reminders", include_str!("migrations/sqlite/0003_reminders.sql")),
    (4, "links", include_str!("migrations/sqlite/0004_links.sql")),
];
const POSTGRES: [SchemaStep; 4] = [
    (1, "facts", include_str!("migrations/postgres/0001_facts.sql")),
    (2, "subscriptions", include_str!("migrations/postgres/0002_subscriptions.sql")),
    (3, "reminders", include_str!("migrations/postgres/0003_reminders.sql")),
    (4, "links", include_str!("migrations/postgres/0004_links.sql")),
];

pub(in crate::store) fn sqlite() -> Migrator {
    migrator(&SQLITE)
}

/// Returns the migrator for PostgreSQL. It runs under an advisory lock, so replicas that start together take turns.
pub(in crate::store) fn postgres() -> Migrator {
    migrator(&POSTGRES)
}

fn migrator(steps: &[SchemaStep]) -> Migrator {
    let migration = |&(version, description, statements): &SchemaStep| {
        Migration::new(version, description.into(), MigrationType::Simple, statements.into_sql_str(), false)
    };
    Migrator::with_migrations(steps.iter().map(migration).collect())
}

/// Rejects a schema that is newer than this binary's.
///
/// # Errors
/// [`StoreError::NewerSchema`] if `found` is newer than every step of `migrator`.
pub(super) fn refuse_newer(migrator: &Migrator, found: i64) -> Result<(), StoreError> {
    let known = newest(migrator);
    if found > known { Err(StoreError::NewerSchema { found, known }) } else { Ok(()) }
}

/// Rejects a schema that is not this binary's.
///
/// # Errors
/// [`StoreError::NewerSchema`] or [`StoreError::OlderSchema`] if `found` is not the last step of `migrator`.
pub(in crate::store) fn require_newest(migrator: &Migrator, found: i64) -> Result<i64, StoreError> {
    refuse_newer(migrator, found)?;
    let known = newest(migrator);
    if found < known { Err(StoreError::OlderSchema { found, known }) } else { Ok(found) }
}

/// Returns the version of the last step.
pub(in crate::store) fn newest(migrator: &Migrator) -> i64 {
    migrator.iter().map(|migration| migration.version).max().unwrap_or_default()
}

/// Converts a failed migration; if the cause is a database error, `engine` classifies it.
pub(in crate::store) fn failed(error: MigrateError, engine: fn(sqlx::Error) -> Failure) -> StoreError {
    match error {
        MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _) => {
            engine(error).during("bringing the schema up to date")
        }
        error => StoreError::Migration { source: Arc::new(error) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_a_step_of_its_engine() {
        for (engine, steps) in [("sqlite", SQLITE.as_slice()), ("postgres", POSTGRES.as_slice())] {
            let folder = format!("{}/src/store/engine/migrations/{engine}", env!("CARGO_MANIFEST_DIR"));
            let mut files: Vec<_> = std::fs::read_dir(folder)
                .unwrap()
                .map(|file| file.unwrap().file_name().into_string().unwrap())
                .collect();
            files.sort();
            let named: Vec<_> = steps.iter().map(|(version, name, _)| format!("{version:04}_{name}.sql")).collect();
            assert_eq!(files, named, "{engine}");
        }
    }
}
