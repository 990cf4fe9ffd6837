//! Subscriptions as tenants see them: made, listed, rotated and deleted, and their dead letters sent again.
//!
//! An event is stored as a delivery in the transaction of its fact, so it exists if and only if the fact does. It is
//! sent afterwards, at least once, always under the same identifier. Delivered ones are deleted.

pub(super) mod deliveries;
pub(super) mod events;
pub(super) mod reminders;

use futures_util::FutureExt;

use crate::store::engine::codec::{from_sql, to_sql};
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, StoreRow, query};
use crate::store::jobs::turns;
use crate::store::subscriptions::events::EventKind;
use crate::store::tenants::audit::{Actor, AuditAction};
use crate::store::tenants::audit_chain;
use crate::store::tenants::quotas::Quotas;
use crate::store::tenants::tenant::Tenant;
use crate::store::{Store, StoreError};

/// The most subscriptions of a tenant.
pub const MOST_SUBSCRIPTIONS: usize = 10;
/// The dead letters of each subscription that a list shows, the newest.
const DEAD_SHOWN: i64 = 10;

/// A subscription to make.
#[derive(Debug, Clone, PartialEq)]
pub struct NewSubscription {
    pub subscription: String,
    pub tenant: Tenant,
    pub url: String,
    pub events: Vec<EventKind>,
    /// Empty for every session of the tenant.
    pub sessions: Vec<String>,
    pub least_change: f64,
    pub secret: Vec<u8>,
    pub created_ms: i64,
}

/// The outcome of making a subscription.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Subscribing {
    Created,
    /// An identical request made it before; this is its secret.
    Repeated {
        secret: Vec<u8>,
    },
    /// Another request made one of this name.
    Conflict,
    /// The tenant has [`MOST_SUBSCRIPTIONS`] already.
    Full,
}

/// A secret to replace the present one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewSecret {
    pub secret: Vec<u8>,
    /// The idempotency key of the request; empty if it has none.
    pub key: String,
    /// The present secret signs too until then.
    pub until_ms: i64,
}

/// A subscription as stored, without its secrets, and the state of its deliveries.
#[derive(Debug, Clone, PartialEq)]
pub struct SubscriptionRow {
    pub subscription: String,
    pub url: String,
    pub events: Vec<EventKind>,
    pub sessions: Vec<String>,
    pub least_change: f64,
    pub created_ms: i64,
    pub last_delivered_ms: Option<i64>,
    /// Why the last attempt failed; empty if it did not.
    pub last_error: String,
    /// Attempts that failed since the last delivery.
    pub failures: usize,
    pub delivered: usize,
    /// Events and dead letters that found no room.
    pub dropped: usize,
    pub waiting: usize,
    pub dead: usize,
    /// The newest dead letters.
    pub dead_letters: Vec<DeadLetter>,
}

/// A delivery that was given up.
#[derive(Debug, Clone, PartialEq)]
pub struct DeadLetter {
    pub delivery: String,
    pub event: EventKind,
    pub created_ms: i64,
    pub attempts: usize,
    pub error: String,
    pub body: String,
}

impl Store {
    /// Makes a subscription.
    pub async fn subscribe(&self, new: NewSubscription) -> Result<Subscribing, StoreError> {
        let by = (self.quotas, self.actor.clone());
        self.write("making a subscription", move |connection| create(connection, new, by).boxed()).await
    }

    /// Lists the subscriptions of a tenant, oldest first.
    pub async fn subscriptions(&self, tenant: &Tenant) -> Result<Vec<SubscriptionRow>, StoreError> {
        let all = query(
            "SELECT subscriptions.*,
                 (SELECT count(*) FROM deliveries WHERE deliveries.subscription = subscriptions.subscription
                      AND next_ms IS NOT NULL) AS waiting,
                 (SELECT count(*) FROM deliveries WHERE deliveries.subscription = subscriptions.subscription
                      AND next_ms IS NULL) AS dead
             FROM subscriptions WHERE tenant = $1 ORDER BY sequence",
        );
        let decode = |rows: &[StoreRow]| rows.iter().map(SubscriptionRow::from_row).collect::<Result<Vec<_>, _>>();
        let mut rows = self.list("listing subscriptions", all.bind(tenant.as_str()), decode).await?;
        for row in rows.iter_mut().filter(|row| row.dead > 0) {
            let dead = query(
                "SELECT delivery, event, created_ms, attempts, error, body FROM deliveries
                 WHERE subscription = $1 AND next_ms IS NULL ORDER BY sequence DESC LIMIT $2",
            );
            let dead = dead.bind(row.subscription.as_str()).bind(DEAD_SHOWN);
            let decode = |rows: &[StoreRow]| rows.iter().map(DeadLetter::from_row).collect();
            row.dead_letters = self.list("listing dead letters", dead, decode).await?;
        }
        Ok(rows)
    }

    /// Lists the tenants with a subscription to one of these kinds of events.
    pub async fn subscribed(&self, kinds: [EventKind; 2]) -> Result<Vec<Tenant>, StoreError> {
        let tenants = query(
            "SELECT DISTINCT tenant FROM subscriptions
             WHERE replace(events, $1, '') <> events OR replace(events, $2, '') <> events",
        );
        let tenants = kinds.iter().fold(tenants, |tenants, kind| tenants.bind(format!("\n{}\n", kind.as_str())));
        let decode = |row: &StoreRow| Ok(Tenant::stored(&row.get::<String>("tenant")?));
        self.probe("listing subscribed tenants", tenants, |rows| rows.iter().map(decode).collect()).await
    }

    /// Replaces the secret, once for each idempotency key. Returns the secret and until when the one before signs too;
    /// `None` if there is no such subscription.
    pub async fn rotate_secret(
        &self,
        tenant: &Tenant,
        subscription: &str,
        new: NewSecret,
    ) -> Result<Option<(Vec<u8>, i64)>, StoreError> {
        let of = (tenant.clone(), subscription.to_owned(), self.actor.clone());
        self.write("rotating a secret", move |connection| rotate(connection, of, new).boxed()).await
    }

    /// Queues the dead letters of a subscription again, and returns how many; `None` if there is no such subscription.
    pub async fn resend(&self, tenant: &Tenant, subscription: &str) -> Result<Option<usize>, StoreError> {
        let of = (tenant.clone(), subscription.to_owned(), self.actor.clone());
        self.write("queueing dead letters", move |connection| requeue(connection, of).boxed()).await
    }

    /// Deletes a subscription with its deliveries. Returns false if there is none.
    pub async fn unsubscribe(&self, tenant: &Tenant, subscription: &str) -> Result<bool, StoreError> {
        let delete = query("DELETE FROM subscriptions WHERE subscription = $1 AND tenant = $2");
        let delete = delete.bind(subscription).bind(tenant.as_str());
        let of = (tenant.clone(), subscription.to_owned(), self.actor.clone());
        self.write("deleting a subscription", move |connection| {
            async move {
                let mut connection = connection;
                let is_deleted = connection.execute(delete).await? > 0;
                if is_deleted {
                    audited(&mut connection, of, AuditAction::Unsubscribe, "deleted").await?;
                }
                Ok(is_deleted)
            }
            .boxed()
        })
        .await
    }
}

/// Makes a subscription while the tenant's turn is locked, so that no two are counted past the most.
async fn create(
    mut connection: StoreConnection<'_>,
    new: NewSubscription,
    (quotas, actor): (Quotas, Actor),
) -> Result<Subscribing, Failure> {
    let connection = &mut connection;
    turns::enter(connection, &new.tenant).await?;
    let (events, sessions) =
        (lines(new.events.iter().map(|kind| kind.as_str())), lines(new.sessions.iter().map(String::as_str)));
    let earlier = query("SELECT * FROM subscriptions WHERE subscription = $1").bind(new.subscription.as_str());
    if let Some(row) = connection.row(earlier).await? {
        let is_same = row.get::<String>("url")? == new.url
            && row.get::<String>("events")? == events
            && row.get::<String>("sessions")? == sessions
            && row.get::<f64>("least_change")? == new.least_change;
        return Ok(if is_same { Subscribing::Repeated { secret: row.get("secret")? } } else { Subscribing::Conflict });
    }
    let count = query("SELECT count(*) AS made FROM subscriptions WHERE tenant = $1").bind(new.tenant.as_str());
    let made: i64 = connection.row(count).await?.map_or(Ok(0), |row| row.get("made"))?;
    if made >= to_sql(MOST_SUBSCRIPTIONS) {
        return Ok(Subscribing::Full);
    }
    let insert = query(
        "INSERT INTO subscriptions (subscription, tenant, url, events, sessions, least_change, secret, previous_secret,
                                    previous_until_ms, created_ms)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, 0, $9)",
    );
    let insert = insert
        .bind(new.subscription.as_str())
        .bind(new.tenant.as_str())
        .bind(new.url)
        .bind(events)
        .bind(sessions)
        .bind(new.least_change)
        .bind(new.secret)
        .bind(Vec::new())
        .bind(new.created_ms);
    connection.execute(insert).await?;
    let by = (quotas, &actor);
    audit_chain::record(connection, by, &new.tenant, AuditAction::Subscribe, &new.subscription, "created").await?;
    Ok(Subscribing::Created)
}

async fn rotate(
    mut connection: StoreConnection<'_>,
    (tenant, subscription, actor): (Tenant, String, Actor),
    new: NewSecret,
) -> Result<Option<(Vec<u8>, i64)>, Failure> {
    let connection = &mut connection;
    let held = query(
        "SELECT secret, rotation_key, previous_until_ms FROM subscriptions WHERE subscription = $1 AND tenant = $2",
    );
    let held = held.bind(subscription.as_str()).bind(tenant.as_str()).for_update();
    let Some(row) = connection.row(held).await? else { return Ok(None) };
    if !new.key.is_empty() && row.get::<String>("rotation_key")? == new.key {
        return Ok(Some((row.get("secret")?, row.get("previous_until_ms")?)));
    }
    let rotate = query(
        "UPDATE subscriptions SET previous_secret = secret, previous_until_ms = $1, secret = $2, rotation_key = $3
         WHERE subscription = $4",
    );
    let rotate = rotate.bind(new.until_ms).bind(new.secret.clone()).bind(new.key).bind(subscription.as_str());
    connection.execute(rotate).await?;
    audited(connection, (tenant, subscription, actor), AuditAction::RotateSecret, "rotated").await?;
    Ok(Some((new.secret, new.until_ms)))
}

async fn requeue(
    mut connection: StoreConnection<'_>,
    (tenant, subscription, actor): (Tenant, String, Actor),
) -> Result<Option<usize>, Failure> {
    let connection = &mut connection;
    let held = query("SELECT subscription FROM subscriptions WHERE subscription = $1 AND tenant = $2");
    let held = held.bind(subscription.as_str()).bind(tenant.as_str()).for_update();
    if connection.row(held).await?.is_none() {
        return Ok(None);
    }
    let requeue = query("UPDATE deliveries SET next_ms = 0, attempts = 0 WHERE subscription = $1 AND next_ms IS NULL");
    let queued = connection.execute(requeue.bind(subscription.as_str())).await?;
    let outcome = format!("{queued} dead letters queued");
    audited(connection, (tenant, subscription, actor), AuditAction::Resend, &outcome).await?;
    Ok(Some(usize::try_from(queued).unwrap_or(usize::MAX)))
}

async fn audited(
    connection: &mut StoreConnection<'_>,
    (tenant, subscription, actor): (Tenant, String, Actor),
    action: AuditAction,
    outcome: &str,
) -> Result<(), Failure> {
    audit_chain::record(connection, (Quotas::NONE, &actor), &tenant, action, &subscription, outcome).await
}

/// Encodes names for their column, each between line breaks.
fn lines<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("\n{name}\n")).collect()
}

impl SubscriptionRow {
    fn from_row(row: &StoreRow) -> Result<Self, Failure> {
        let names = |column: &str| -> Result<Vec<String>, Failure> {
            Ok(row.get::<String>(column)?.split('\n').filter(|name| !name.is_empty()).map(str::to_owned).collect())
        };
        Ok(SubscriptionRow {
            subscription: row.get("subscription")?,
            url: row.get("url")?,
            events: names("events")?.iter().map(|name| known(name)).collect::<Result<_, _>>()?,
            sessions: names("sessions")?,
            least_change: row.get("least_change")?,
            created_ms: row.get("created_ms")?,
            last_delivered_ms: row.get("last_delivered_ms")?,
            last_error: row.get("last_error")?,
            failures: from_sql(row.get("failures")?)?,
            delivered: from_sql(row.get("delivered")?)?,
            dropped: from_sql(row.get("dropped")?)?,
            waiting: from_sql(row.get("waiting")?)?,
            dead: from_sql(row.get("dead")?)?,
            dead_letters: Vec::new(),
        })
    }
}

impl DeadLetter {
    fn from_row(row: &StoreRow) -> Result<Self, Failure> {
        Ok(DeadLetter {
            delivery: row.get("delivery")?,
            event: known(&row.get::<String>("event")?)?,
            created_ms: row.get("created_ms")?,
            attempts: from_sql(row.get("attempts")?)?,
            error: row.get("error")?,
            body: row.get("body")?,
        })
    }
}

fn known(name: &str) -> Result<EventKind, Failure> {
    EventKind::parse(name).ok_or_else(|| Failure::Corrupt(format!("an event of the kind {name}")))
}
