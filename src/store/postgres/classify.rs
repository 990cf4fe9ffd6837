//! What an error of PostgreSQL means.

use std::sync::Arc;

use crate::store::error::StoreError;

/// Never [`StoreError::Fatal`]: what this process holds in memory does not depend on the server's disk.
pub(in crate::store) fn classify(doing: &'static str, error: sqlx::Error) -> StoreError {
    let source = Arc::new(error);
    match &*source {
        sqlx::Error::Database(database) => {
            let code = database.code().unwrap_or_default().into_owned();
            classify_code(&code, doing, source)
        }
        sqlx::Error::Io(_)
        | sqlx::Error::Tls(_)
        | sqlx::Error::Protocol(_)
        | sqlx::Error::PoolTimedOut
        | sqlx::Error::PoolClosed
        | sqlx::Error::WorkerCrashed => StoreError::Unavailable { doing, source: Some(source) },
        sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_) => {
            StoreError::Corrupt { what: format!("a row read while {doing}: {source}") }
        }
        _ => StoreError::Refused { doing, source },
    }
}

/// Codes by class, https://www.postgresql.org/docs/current/errcodes-appendix.html.
fn classify_code(code: &str, doing: &'static str, source: Arc<sqlx::Error>) -> StoreError {
    match code {
        // disk_full
        "53100" => StoreError::Full { source },
        // data_corrupted, index_corrupted
        "XX001" | "XX002" => StoreError::Corrupt { what: format!("a row read while {doing}: {source}") },
        // serialization_failure, deadlock_detected, lock_not_available, query_canceled by its time limit
        "40001" | "40P01" | "55P03" | "57014"
        // read_only_sql_transaction: a standby; invalid_catalog_name: the database is gone
        | "25006" | "3D000"
        // idle_in_transaction_session_timeout
        | "25P03"
        // feature_not_supported: a statement prepared before another replica changed the schema
        | "0A000" => StoreError::Unavailable { doing, source: Some(source) },
        _ => match code.get(..2) {
            // connection, authorization, resources, operator intervention, system error
            Some("08" | "28" | "53" | "57" | "58") => StoreError::Unavailable { doing, source: Some(source) },
            _ => StoreError::Refused { doing, source },
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_code(code: &str) -> StoreError {
        classify_code(code, "testing", Arc::new(sqlx::Error::RowNotFound))
    }

    #[test]
    fn a_server_that_stops_or_is_busy_may_answer_later_and_a_broken_constraint_will_not() {
        for passing in ["57P01", "57P02", "57P03", "53300", "08006", "58030", "40P01", "25006"] {
            assert!(matches!(of_code(passing), StoreError::Unavailable { .. }), "{passing}");
        }
        assert!(matches!(of_code("53100"), StoreError::Full { .. }));
        assert!(matches!(of_code("XX001"), StoreError::Corrupt { .. }));
        for ours in ["23505", "42P01", ""] {
            assert!(matches!(of_code(ours), StoreError::Refused { .. }), "{ours}");
        }
    }
}
