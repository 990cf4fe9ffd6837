//! Deliveries as senders see them: claimed under a lease, then delivered, delayed or given up.
//!
//! One process at a time sends to a subscription, one delivery at a time, so a slow receiver holds up only itself. Every
//! claim raises `attempts`, and the end of an attempt names it. A sender that slept past its lease changes nothing, and
//! its delivery is sent again under the same identifier.

use futures_util::FutureExt;

use crate::store::engine::codec::{from_sql, to_sql};
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, StoreRow, query};
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// The most dead letters of a subscription; the oldest are dropped and counted.
const MOST_DEAD: i64 = 1_000;

/// The time of a claim, and the end of its lease.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeliveryLease {
    pub now_ms: i64,
    pub until_ms: i64,
}

/// A delivery to send.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimedDelivery {
    pub delivery: String,
    pub subscription: String,
    pub tenant: Tenant,
    pub url: String,
    pub body: String,
    /// The secrets that sign it: the present one first.
    pub secrets: Vec<Vec<u8>>,
    /// Counts from 1.
    pub attempt: usize,
}

/// The end of an attempt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DeliveryEnd {
    Delivered,
    /// It is sent again at `next_ms`; without that it is a dead letter.
    Failed {
        error: String,
        next_ms: Option<i64>,
    },
}

impl Store {
    /// Returns whether a delivery is due.
    pub async fn has_deliveries(&self, now_ms: i64) -> Result<bool, StoreError> {
        let due = query("SELECT 1 AS one FROM deliveries WHERE next_ms <= $1 LIMIT 1").bind(now_ms);
        self.probe("looking for deliveries", due, |rows| Ok(!rows.is_empty())).await
    }

    /// Claims at most `most` due deliveries, the oldest of each subscription, those first that were served longest ago.
    pub async fn claim_deliveries(
        &self,
        most: usize,
        lease: DeliveryLease,
    ) -> Result<Vec<ClaimedDelivery>, StoreError> {
        self.write("claiming deliveries", move |connection| claim(connection, most, lease).boxed()).await
    }

    /// Records the end of an attempt. Returns false if the delivery was claimed again or deleted meanwhile.
    pub async fn end_delivery(
        &self,
        claimed: &ClaimedDelivery,
        end: DeliveryEnd,
        now_ms: i64,
    ) -> Result<bool, StoreError> {
        let claimed = claimed.clone();
        self.write("ending a delivery", move |connection| record_end(connection, claimed, end, now_ms).boxed()).await
    }
}

async fn claim(
    mut connection: StoreConnection<'_>,
    most: usize,
    DeliveryLease { now_ms, until_ms }: DeliveryLease,
) -> Result<Vec<ClaimedDelivery>, Failure> {
    let connection = &mut connection;
    let due = query(
        "SELECT subscription, tenant, url, secret, previous_secret, previous_until_ms FROM subscriptions
         WHERE lease_until_ms <= $1 AND subscription IN (SELECT subscription FROM deliveries WHERE next_ms <= $1)
         ORDER BY last_attempt_ms, sequence LIMIT $2",
    );
    let mut claimed = Vec::new();
    for row in connection.rows(due.bind(now_ms).bind(to_sql(most)).for_update_of_free()).await? {
        let subscription: String = row.get("subscription")?;
        let oldest = query(
            "SELECT delivery, body, attempts FROM deliveries WHERE subscription = $1 AND next_ms <= $2
             ORDER BY next_ms, sequence LIMIT 1",
        );
        let oldest = oldest.bind(subscription.as_str()).bind(now_ms);
        let Some(delivery) = connection.row(oldest).await? else { continue };
        let lease = query("UPDATE subscriptions SET lease_until_ms = $1, last_attempt_ms = $2 WHERE subscription = $3");
        connection.execute(lease.bind(until_ms).bind(now_ms).bind(subscription.as_str())).await?;
        let next = next_of(&row, &delivery, now_ms)?;
        let take = query("UPDATE deliveries SET attempts = attempts + 1, next_ms = $1 WHERE delivery = $2");
        connection.execute(take.bind(until_ms).bind(next.delivery.as_str())).await?;
        claimed.push(next);
    }
    Ok(claimed)
}

fn next_of(subscription: &StoreRow, delivery: &StoreRow, now_ms: i64) -> Result<ClaimedDelivery, Failure> {
    let mut secrets = vec![subscription.get("secret")?];
    if subscription.get::<i64>("previous_until_ms")? > now_ms {
        secrets.push(subscription.get("previous_secret")?);
    }
    Ok(ClaimedDelivery {
        delivery: delivery.get("delivery")?,
        subscription: subscription.get("subscription")?,
        tenant: Tenant::stored(&subscription.get::<String>("tenant")?),
        url: subscription.get("url")?,
        body: delivery.get("body")?,
        secrets,
        attempt: from_sql(delivery.get::<i64>("attempts")? + 1)?,
    })
}

async fn record_end(
    mut connection: StoreConnection<'_>,
    claimed: ClaimedDelivery,
    end: DeliveryEnd,
    now_ms: i64,
) -> Result<bool, Failure> {
    let connection = &mut connection;
    let ClaimedDelivery { delivery, subscription, attempt, .. } = claimed;
    let held = query("SELECT subscription FROM subscriptions WHERE subscription = $1").bind(subscription.as_str());
    connection.lock(held.for_update()).await?;
    match end {
        DeliveryEnd::Delivered => {
            let remove = query("DELETE FROM deliveries WHERE delivery = $1 AND attempts = $2");
            if connection.execute(remove.bind(delivery).bind(to_sql(attempt))).await? == 0 {
                return Ok(false);
            }
            let count = query(
                "UPDATE subscriptions SET lease_until_ms = 0, last_delivered_ms = $1, last_error = '', failures = 0,
                                          delivered = delivered + 1 WHERE subscription = $2",
            );
            connection.execute(count.bind(now_ms).bind(subscription)).await?;
        }
        DeliveryEnd::Failed { error, next_ms } => {
            let delay = query("UPDATE deliveries SET next_ms = $1, error = $2 WHERE delivery = $3 AND attempts = $4");
            let delay = delay.bind(next_ms).bind(error.as_str()).bind(delivery).bind(to_sql(attempt));
            if connection.execute(delay).await? == 0 {
                return Ok(false);
            }
            let drop_oldest = query(
                "DELETE FROM deliveries WHERE subscription = $1 AND next_ms IS NULL AND sequence <=
                     (SELECT sequence FROM deliveries WHERE subscription = $1 AND next_ms IS NULL
                      ORDER BY sequence DESC LIMIT 1 OFFSET $2)",
            );
            let dropped = connection.execute(drop_oldest.bind(subscription.as_str()).bind(MOST_DEAD)).await?;
            let count = query(
                "UPDATE subscriptions SET lease_until_ms = 0, last_error = $1, failures = failures + 1,
                                          dropped = dropped + $2 WHERE subscription = $3",
            );
            let dropped = i64::try_from(dropped).unwrap_or(i64::MAX);
            connection.execute(count.bind(error).bind(dropped).bind(subscription)).await?;
        }
    }
    Ok(true)
}
