//! Names and descriptions of the metrics; base units, `_total` for counters.

use std::fmt::Write;

use metrics::{Unit, counter, describe_counter, describe_gauge, describe_histogram, gauge};

use crate::service::callers::keys::KeyFigures;
use crate::store::StoreError;

use crate::store::{OldestJobs, StoreSpace};

pub const TRAINING_STEP_SECONDS: &str = "ballast_training_step_duration_seconds";
pub const OBSERVE_SECONDS: &str = "ballast_observe_duration_seconds";
pub const ACTION_SECONDS: &str = "ballast_action_duration_seconds";
pub const HTTP_REQUEST_SECONDS: &str = "ballast_http_request_duration_seconds";
pub const HTTP_REQUESTS: &str = "ballast_http_requests_total";
pub const JOBS: &str = "ballast_jobs";
/// Open connections, by phase.
pub const CONNECTIONS: &str = "ballast_connections";
pub const CONNECTIONS_REFUSED: &str = "ballast_connections_refused_total";
pub const CERTIFICATE_LOADS: &str = "ballast_certificate_loads_total";
/// Time at which the certificate in force, or one of its chain, expires.
pub const CERTIFICATE_EXPIRES: &str = "ballast_certificate_expiry_timestamp_seconds";
pub const SESSIONS: &str = "ballast_sessions";
pub const TURNS_WAITING: &str = "ballast_turns_waiting";
pub const MEMORY: &str = "ballast_memory_bytes";
pub const MEMORY_LIMIT: &str = "ballast_memory_limit_bytes";
/// By tenant and status. Tenants are those that have or had a key; a call without a key has no tenant.
pub const REFUSALS: &str = "ballast_refusals_total";
pub const PROBLEMS: &str = "ballast_problems_total";
pub const STORE_FAILURES: &str = "ballast_store_failures_total";
pub const KEY_EXPIRES: &str = "ballast_key_expiry_timestamp_seconds";
pub const KEY_USED: &str = "ballast_key_last_use_timestamp_seconds";
pub const OLDEST_JOB_SECONDS: &str = "ballast_oldest_job_age_seconds";
pub const DRIFT_ALARMS: &str = "ballast_drift_alarms_total";
pub const RENEWALS: &str = "ballast_renewals_total";
/// Attempts to deliver an event, by outcome.
pub const WEBHOOKS: &str = "ballast_webhooks_total";
pub const JOBS_EXPIRED: &str = "ballast_jobs_expired_total";
pub const STORE_BYTES: &str = "ballast_store_bytes";
pub const STORE_FREE_BYTES: &str = "ballast_store_free_bytes";
pub const STORE_LOG_BYTES: &str = "ballast_store_log_bytes";
pub const CLOCK_SKEW_SECONDS: &str = "ballast_clock_skew_seconds";
pub const DISK_LEFT_BYTES: &str = "ballast_disk_left_bytes";

/// Upper bounds of the buckets of training steps, in seconds: milliseconds to an hour.
pub const STEP_BUCKETS: [f64; 10] = [0.01, 0.1, 0.5, 1.0, 5.0, 15.0, 60.0, 300.0, 900.0, 3600.0];
/// Upper bounds of the buckets of requests, in seconds: the target of `/action` is a millisecond.
pub const REQUEST_BUCKETS: [f64; 11] = [1e-4, 2.5e-4, 5e-4, 1e-3, 2.5e-3, 5e-3, 1e-2, 5e-2, 0.25, 1.0, 10.0];

/// Returns the figures of keys in the text exposition format. They bypass the recorder, which would show a key for ever
/// after it ended.
pub fn of_keys(keys: &[KeyFigures]) -> String {
    let mut text = String::new();
    let mut family = |name: &str, help: &str, figure: fn(&KeyFigures) -> Option<i64>| {
        // Writing to a string cannot fail.
        let _ = write!(text, "# HELP {name} {help}\n# TYPE {name} gauge\n");
        for (key, milliseconds) in keys.iter().filter_map(|key| Some((key, figure(key)?))) {
            let seconds = milliseconds as f64 / 1000.0;
            let _ = writeln!(text, "{name}{{tenant=\"{}\",key=\"{}\"}} {seconds}", key.tenant, key.key);
        }
    };
    family(KEY_EXPIRES, "When a key in force expires, in seconds since 1970.", |key| key.expires_ms);
    family(KEY_USED, "When a key in force last called this replica, in seconds since 1970.", |key| key.used_ms);
    text
}

/// Causes of [`STORE_FAILURES`]: damaged rows, no room, no connection, and the rest, which are defects or end the
/// process.
const CAUSES: [&str; 4] = ["corrupt", "full", "unavailable", "other"];

/// Counts a failure of the store by its cause.
pub fn count_failure(error: &StoreError) {
    let cause = match error {
        StoreError::Corrupt { .. } => "corrupt",
        StoreError::Full { .. } => "full",
        StoreError::Unavailable { .. } => "unavailable",
        _ => "other",
    };
    counter!(STORE_FAILURES, "cause" => cause).increment(1);
}

/// Describes each metric to the recorder.
pub fn describe() {
    // Each cause starts at 0, so that the first failure shows as an increase.
    for cause in CAUSES {
        counter!(STORE_FAILURES, "cause" => cause).increment(0);
    }
    describe_histogram!(TRAINING_STEP_SECONDS, Unit::Seconds, "Duration of one backward step of a training.");
    describe_histogram!(OBSERVE_SECONDS, Unit::Seconds, "Duration of recording one observation durably.");
    describe_histogram!(ACTION_SECONDS, Unit::Seconds, "Duration of finding one allocation, by mode.");
    describe_histogram!(HTTP_REQUEST_SECONDS, Unit::Seconds, "Duration of one request, by method and route.");
    describe_counter!(HTTP_REQUESTS, "Requests answered, by method, route and status.");
    describe_gauge!(
        CONNECTIONS,
        "Open connections, by phase. Waiting and receiving ones are closed if a new connection needs room."
    );
    describe_counter!(CONNECTIONS_REFUSED, "Connections refused because all open ones were being answered.");
    describe_counter!(
        CERTIFICATE_LOADS,
        "Certificate reloads, by outcome: taken, or refused, which keeps the previous certificate."
    );
    for outcome in ["taken", "refused"] {
        counter!(CERTIFICATE_LOADS, "outcome" => outcome).increment(0);
    }
    describe_gauge!(
        CERTIFICATE_EXPIRES,
        Unit::Seconds,
        "When the certificate in force, or one of its chain, expires, in seconds since 1970."
    );
    describe_gauge!(JOBS, "Jobs in the store, by state.");
    describe_gauge!(SESSIONS, "Sessions in the store.");
    describe_counter!(
        REFUSALS,
        "Calls answered 401, 403 or 429, by tenant and status. A key that has ended counts for its tenant."
    );
    describe_counter!(PROBLEMS, "Problem documents answered, by kind.");
    describe_counter!(STORE_FAILURES, "Failures of the store met by a request or a job, by cause.");
    describe_gauge!(TURNS_WAITING, "Requests that wait to be advised or to have a step solved.");
    describe_gauge!(
        MEMORY,
        Unit::Bytes,
        "Memory by part: prepared policies, factors and bridges kept ready, live sessions, and what running jobs have reserved."
    );
    describe_gauge!(MEMORY_LIMIT, Unit::Bytes, "The memory limit, which the parts share.");
    describe_gauge!(
        OLDEST_JOB_SECONDS,
        Unit::Seconds,
        "Time since the oldest queued job was made and since the oldest running job began, by state; 0 if there is none."
    );
    describe_outcomes();
    describe_counter!(JOBS_EXPIRED, "Ended jobs deleted by age.");
    describe_gauge!(STORE_BYTES, Unit::Bytes, "Size of the database.");
    describe_gauge!(STORE_FREE_BYTES, Unit::Bytes, "Size of the empty pages in the database; only for a folder.");
    describe_gauge!(STORE_LOG_BYTES, Unit::Bytes, "Size of the write-ahead log; only for a folder.");
    describe_gauge!(DISK_LEFT_BYTES, Unit::Bytes, "Free space on the disk of the database; only for a folder.");
    describe_gauge!(
        CLOCK_SKEW_SECONDS,
        Unit::Seconds,
        "How far this machine's clock is ahead of the database's; 0 within a minute. For a folder, how far it is ahead of the newest time stored; 0 within a day."
    );
    gauge!(CLOCK_SKEW_SECONDS).set(0.0);
    metrics::counter!(JOBS_EXPIRED).absolute(0);
}

/// Describes the counters by level or outcome, each of which starts at 0.
fn describe_outcomes() {
    describe_counter!(DRIFT_ALARMS, "Sessions whose drift test rose to a level, by level.");
    for level in ["warning", "alarm"] {
        counter!(DRIFT_ALARMS, "level" => level).increment(0);
    }
    describe_counter!(WEBHOOKS, "Attempts to deliver an event, by outcome; dead ones were given up.");
    for outcome in ["delivered", "failed", "dead"] {
        counter!(WEBHOOKS, "outcome" => outcome).increment(0);
    }
    describe_counter!(RENEWALS, "Renewals of sessions that renew themselves, by outcome.");
    for outcome in ["renewed", "failed"] {
        counter!(RENEWALS, "outcome" => outcome).increment(0);
    }
}

/// Records how far the clock is ahead of its reference.
pub fn record_skew(seconds: i64) {
    gauge!(CLOCK_SKEW_SECONDS).set(seconds as f64);
}

/// Records the age of the oldest jobs at `now_ms` and the space that the store takes.
pub fn record_store(oldest: OldestJobs, room: StoreSpace, now_ms: i64) {
    for (state, since) in [("queued", oldest.queued_ms), ("running", oldest.running_ms)] {
        let age_ms = since.map_or(0, |since| now_ms.saturating_sub(since).max(0));
        metrics::gauge!(OLDEST_JOB_SECONDS, "state" => state).set(age_ms as f64 / 1000.0);
    }
    let parts = [
        (STORE_BYTES, Some(room.database)),
        (STORE_FREE_BYTES, room.free),
        (STORE_LOG_BYTES, room.log),
        (DISK_LEFT_BYTES, room.disk_left),
    ];
    for (name, bytes) in parts {
        if let Some(bytes) = bytes {
            metrics::gauge!(name).set(bytes as f64);
        }
    }
}
