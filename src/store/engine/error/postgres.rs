//! The classification of PostgreSQL errors.

use super::Cause;

/// Classifies an error; never as [`Cause::Fatal`], because this process's memory does not depend on the server's disk.
pub(super) fn cause(error: &sqlx::Error) -> Cause {
    match error {
        sqlx::Error::Database(database) => of_code(&database.code().unwrap_or_default()),
        sqlx::Error::Io(_)
        | sqlx::Error::Tls(_)
        | sqlx::Error::Protocol(_)
        | sqlx::Error::PoolTimedOut
        | sqlx::Error::PoolClosed
        | sqlx::Error::WorkerCrashed => Cause::Unavailable,
        sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_) => Cause::DamagedRow,
        _ => Cause::Refused,
    }
}

/// Classifies a code by its class, <https://www.postgresql.org/docs/current/errcodes-appendix.html>.
fn of_code(code: &str) -> Cause {
    match code {
        // disk_full
        "53100" => Cause::Full,
        // data_corrupted, index_corrupted
        "XX001" | "XX002" => Cause::DamagedRow,
        // serialization_failure, deadlock_detected, lock_not_available, query_canceled by its time limit
        "40001" | "40P01" | "55P03" | "57014"
        // read_only_sql_transaction: a standby; invalid_catalog_name: the database is gone
        | "25006" | "3D000"
        // idle_in_transaction_session_timeout
        | "25P03"
        // feature_not_supported: a statement prepared before another replica changed the schema
        | "0A000" => Cause::Unavailable,
        _ => match code.get(..2) {
            // connection, authorization, resources, operator intervention, system error
            Some("08" | "28" | "53" | "57" | "58") => Cause::Unavailable,
            _ => Cause::Refused,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_that_stops_or_is_busy_may_answer_later_and_a_broken_constraint_will_not() {
        for passing in ["57P01", "57P02", "57P03", "53300", "08006", "58030", "40P01", "25006"] {
            assert_eq!(of_code(passing), Cause::Unavailable, "{passing}");
        }
        assert_eq!(of_code("53100"), Cause::Full);
        assert_eq!(of_code("XX001"), Cause::DamagedRow);
        for ours in ["23505", "42P01", ""] {
            assert_eq!(of_code(ours), Cause::Refused, "{ours}");
        }
    }
}
