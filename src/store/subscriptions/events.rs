//! Events: facts that subscriptions ask for, each stored as one delivery to every subscription in the transaction of
//! the fact.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use utoipa::ToSchema;

use crate::store::engine::codec::hexadecimal;
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, query};
use crate::store::jobs::job::JobRow;
use crate::store::jobs::state::JobState;
use crate::store::jobs::training_names::OF_SESSION;
use crate::store::tenants::tenant::Tenant;

/// The most deliveries that wait for one subscription; a further event is dropped and counted.
const MOST_WAITING: i64 = 1_000;

/// The kind of an event: `job_ended`, `advice_changed`, `left_band`, `drift_alarm`, `renewal_failed`, `report_due` or
/// `report_late`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// A job succeeded, failed or was cancelled.
    JobEnded,
    /// A report changed the advice of a session by more than `least_change`.
    AdviceChanged,
    /// A report moved the holding of a session out of the range in which it is best kept.
    LeftBand,
    /// The drift test of a session raised its alarm.
    DriftAlarm,
    /// The training of the next policy of a session failed or was cancelled.
    RenewalFailed,
    /// The next report of a session is due today, by the calendar of its policy.
    ReportDue,
    /// It was due before today.
    ReportLate,
}

impl EventKind {
    pub const ALL: [EventKind; 7] = [
        EventKind::JobEnded,
        EventKind::AdviceChanged,
        EventKind::LeftBand,
        EventKind::DriftAlarm,
        EventKind::RenewalFailed,
        EventKind::ReportDue,
        EventKind::ReportLate,
    ];

    /// The name on the wire and in SQL.
    pub fn as_str(self) -> &'static str {
        match self {
            EventKind::JobEnded => "job_ended",
            EventKind::AdviceChanged => "advice_changed",
            EventKind::LeftBand => "left_band",
            EventKind::DriftAlarm => "drift_alarm",
            EventKind::RenewalFailed => "renewal_failed",
            EventKind::ReportDue => "report_due",
            EventKind::ReportLate => "report_late",
        }
    }

    pub(in crate::store) fn parse(name: &str) -> Option<EventKind> {
        EventKind::ALL.into_iter().find(|kind| kind.as_str() == name)
    }
}

/// An event to deliver.
#[derive(Debug, Clone, PartialEq)]
pub struct NewEvent {
    pub kind: EventKind,
    /// The session that it is about; empty if it is about none.
    pub session: String,
    /// Names the fact. The identifier of a delivery follows from it and the subscription.
    pub fact: String,
    /// How much the advice changed; infinite for other kinds, which no threshold holds back.
    pub change: f64,
    pub data: Value,
    pub at_ms: i64,
}

impl NewEvent {
    /// Returns the body that is sent.
    fn body(&self) -> String {
        let at = Timestamp::from_millisecond(self.at_ms).unwrap_or_default();
        json!({ "type": self.kind.as_str(), "timestamp": format!("{at:.3}"), "data": self.data }).to_string()
    }

    /// Returns the identifier of the delivery to a subscription, by which a receiver recognises a repeat.
    fn delivery(&self, subscription: &str) -> String {
        let digest = Sha256::new()
            .chain_update(subscription)
            .chain_update([0])
            .chain_update(self.kind.as_str())
            .chain_update([0])
            .chain_update(&self.fact)
            .finalize();
        format!("msg_{}", &hexadecimal(&digest)[..32])
    }
}

/// Stores the deliveries of an event in the transaction of its fact. A full queue drops the event and counts it, because
/// no receiver may stop a fact from being recorded.
pub(in crate::store) async fn publish(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    event: &NewEvent,
) -> Result<(), Failure> {
    let line = |name: &str| if name.is_empty() { String::new() } else { format!("\n{name}\n") };
    // Shared locks: a subscription cannot be deleted before its delivery is stored.
    let matching = query(
        "SELECT subscription FROM subscriptions WHERE tenant = $1 AND replace(events, $2, '') <> events
             AND ($3 = '' OR sessions = '' OR replace(sessions, $3, '') <> sessions) AND least_change < $4
         ORDER BY sequence",
    );
    let matching = matching.bind(tenant.as_str()).bind(line(event.kind.as_str())).bind(line(&event.session));
    for row in connection.rows(matching.bind(event.change).for_share()).await? {
        let subscription: String = row.get("subscription")?;
        let store = query(
            "INSERT INTO deliveries (delivery, subscription, event, body, created_ms, next_ms)
             SELECT $1, $2, $3, $4, $5, 0 WHERE (SELECT count(*) FROM deliveries
                 WHERE subscription = $2 AND next_ms IS NOT NULL) < $6
             ON CONFLICT (delivery) DO NOTHING",
        );
        let store = store
            .bind(event.delivery(&subscription))
            .bind(subscription.as_str())
            .bind(event.kind.as_str())
            .bind(event.body())
            .bind(event.at_ms)
            .bind(MOST_WAITING);
        if connection.execute(store).await? == 0 {
            let count = query("UPDATE subscriptions SET dropped = dropped + 1 WHERE subscription = $1");
            connection.execute(count.bind(subscription)).await?;
        }
    }
    Ok(())
}

/// Stores the events of a job that reached its terminal state, in the transaction in which it did.
pub(in crate::store) async fn publish_job(
    connection: &mut StoreConnection<'_>,
    row: &JobRow,
    state: JobState,
    at_ms: i64,
) -> Result<(), Failure> {
    let followed = query("SELECT 1 AS one FROM subscriptions WHERE tenant = $1 LIMIT 1").bind(row.tenant.as_str());
    if connection.row(followed).await?.is_none() {
        return Ok(());
    }
    let result = connection.row(query("SELECT policy, error FROM jobs WHERE job = $1").bind(row.job.as_str())).await?;
    let result = result.ok_or_else(|| Failure::Corrupt(format!("the row of job {}", row.job)))?;
    let (policy, error): (Option<String>, Option<String>) = (result.get("policy")?, result.get("error")?);
    let (kind, job, outcome) = (row.kind.as_str(), row.job.as_str(), state.as_str());
    let ended = NewEvent {
        kind: EventKind::JobEnded,
        session: String::new(),
        fact: row.job.clone(),
        change: f64::INFINITY,
        data: json!({ "job": job, "kind": kind, "state": outcome, "policy": policy, "error": error }),
        at_ms,
    };
    publish(connection, &row.tenant, &ended).await?;
    if !matches!(state, JobState::Failed | JobState::Cancelled) {
        return Ok(());
    }
    let requests = query("SELECT idempotency_key FROM idempotency_keys WHERE job = $1 ORDER BY idempotency_key");
    for request in connection.rows(requests.bind(job)).await? {
        let key: String = request.get("idempotency_key")?;
        let Some(request) = key.strip_prefix(OF_SESSION) else { continue };
        let [session, renewal, _] = request.split('\n').collect::<Vec<_>>()[..] else { continue };
        let renewal: usize = renewal.parse().map_err(|_| Failure::Corrupt(format!("a request of job {job}")))?;
        let failed = NewEvent {
            kind: EventKind::RenewalFailed,
            session: session.to_owned(),
            fact: key.clone(),
            change: f64::INFINITY,
            data: json!({ "session": session, "renewal": renewal, "job": job, "state": outcome, "error": error }),
            at_ms,
        };
        publish(connection, &row.tenant, &failed).await?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delivery_is_named_by_its_fact_and_its_subscription() {
        let event = NewEvent {
            kind: EventKind::DriftAlarm,
            session: "session_1".into(),
            fact: "session_1\n3".into(),
            change: f64::INFINITY,
            data: json!({ "period": 3 }),
            at_ms: 1_700_000_000_000,
        };
        let later = NewEvent { at_ms: 1_800_000_000_000, ..event.clone() };
        assert_eq!(event.delivery("one"), later.delivery("one"));
        assert_ne!(event.delivery("one"), event.delivery("two"));
        assert_ne!(event.delivery("one"), NewEvent { fact: "session_1\n4".into(), ..event.clone() }.delivery("one"));
        let body: Value = serde_json::from_str(&event.body()).unwrap();
        assert_eq!(body["timestamp"], "2023-11-14T22:13:20.000Z");
    }

    #[test]
    fn names_parse_back() {
        for kind in EventKind::ALL {
            assert_eq!(EventKind::parse(kind.as_str()), Some(kind));
        }
        assert_eq!(EventKind::parse("job"), None);
    }
}
