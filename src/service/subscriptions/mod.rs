//! Subscriptions: who is told of which events, by signed webhooks or by e-mail.

pub mod destination;
pub mod mail_address;
pub mod mail_server;
mod mail_text;
pub(in crate::service) mod missing_reports;
pub mod outbox;
pub mod sender;
pub mod signature;

use std::collections::HashSet;

use serde::Deserialize;
use sha2::{Digest, Sha256};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds, within};
use crate::service::callers::identity;
use crate::service::callers::keys::Caller;
use crate::service::error::ServiceError;
use crate::service::process::clock::Clock;
use crate::service::process::config::WebhookSettings;
use crate::service::subscriptions::destination::{Destination, LONGEST_URL};
use crate::service::subscriptions::mail_address::MailAddress;
use crate::service::subscriptions::outbox::Outbox;
use crate::service::subscriptions::signature::SigningSecret;
use crate::store::{
    EventKind, MOST_SUBSCRIPTIONS, NewSecret, NewSubscription, Store, Subscribing, SubscriptionRow, Tenant,
};

/// The most sessions that a subscription names.
const MOST_SESSIONS: usize = 100;
/// The range of `least_change`: any change of a share, and of the actions of declared problems.
const LEAST_CHANGE: (f64, f64) = (0.0, 1e15);
/// The change of the advice that is an event by default, a share of wealth.
pub const USUAL_CHANGE: f64 = 0.05;
/// How long a replaced secret still signs: a day for receivers to take the new one.
pub const OVERLAP_MS: i64 = 24 * 60 * 60 * 1000;

/// A request to be told of events.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Subscribe {
    /// The address that each event is sent to, by POST. It begins with https:// and leads to public addresses, unless
    /// the operator allows the host by `--webhook-allow`. If the operator configured a mail server, it may be `mailto:`
    /// and one address instead, such as `mailto:someone@example.com`: each event is then an e-mail in plain words.
    pub url: String,
    /// The kinds of events.
    pub events: Vec<EventKind>,
    /// The sessions whose events are sent; every session of the tenant if left out. `job_ended` is about no session.
    #[serde(default)]
    pub sessions: Vec<String>,
    /// `advice_changed` is sent if a report changes the advised share of some asset by more than this share of wealth,
    /// or an action of a declared problem by more than this number.
    #[serde(default = "usual_change")]
    #[schema(default = json!(0.05))]
    pub least_change: f64,
}

fn usual_change() -> f64 {
    USUAL_CHANGE
}

impl Bounded for Subscribe {
    const BOUNDS: &'static [FieldBounds] = &[
        ("url", ValueBounds::Text(1, LONGEST_URL)),
        ("events", ValueBounds::Set(1, EventKind::ALL.len(), &ValueBounds::Any)),
        ("sessions", ValueBounds::Set(0, MOST_SESSIONS, &ValueBounds::Text(1, usize::MAX))),
        ("least_change", ValueBounds::number(LEAST_CHANGE)),
    ];
}

/// The subscriptions of the store.
pub struct Subscriptions {
    store: Store,
    clock: Clock,
    outbox: Outbox,
    settings: WebhookSettings,
}

impl Subscriptions {
    pub(in crate::service) fn new(store: Store, clock: Clock, outbox: Outbox, settings: WebhookSettings) -> Self {
        Subscriptions { store, clock, outbox, settings }
    }

    /// Makes a subscription, and returns its identifier and its secret. The same key and request again return the same.
    ///
    /// # Errors
    /// A field breaks a rule, the tenant has as many subscriptions as it may, or the key was used with another request.
    pub async fn create(
        &self,
        caller: &Caller,
        new: Subscribe,
        key: Option<String>,
    ) -> Result<(String, SigningSecret), ServiceError> {
        self.check(&caller.tenant, &new).await?;
        let secret = SigningSecret::new()?;
        let subscription = match &key {
            Some(key) => keyed(&caller.tenant, key),
            None => identity::new_id("subscription")?,
        };
        let Subscribe { url, events, sessions, least_change } = new;
        let row = NewSubscription {
            subscription: subscription.clone(),
            tenant: caller.tenant.clone(),
            url,
            events,
            sessions,
            least_change,
            secret: secret.bytes(),
            created_ms: self.clock.now_milliseconds(),
        };
        match self.store.by(caller.actor()).subscribe(row).await? {
            Subscribing::Created => {
                self.outbox.refresh(&self.store).await?;
                Ok((subscription, secret))
            }
            Subscribing::Repeated { secret } => Ok((subscription, SigningSecret::stored(secret))),
            Subscribing::Conflict => Err(ServiceError::KeyConflict { key: key.unwrap_or_default() }),
            Subscribing::Full => {
                let rule = format!("must be at most {MOST_SUBSCRIPTIONS} of a tenant; delete one first");
                Err(FieldError::new("subscriptions", MOST_SUBSCRIPTIONS + 1, rule).into())
            }
        }
    }

    async fn check(&self, tenant: &Tenant, new: &Subscribe) -> Result<(), ServiceError> {
        self.check_url(&new.url)?;
        distinct("events", &new.events.iter().map(|kind| kind.as_str()).collect::<Vec<_>>(), EventKind::ALL.len())?;
        if new.events.is_empty() {
            return Err(FieldError::new("events", "[]", "must name at least one kind of event").into());
        }
        within("least_change", new.least_change, LEAST_CHANGE.0, LEAST_CHANGE.1)?;
        distinct("sessions", &new.sessions, MOST_SESSIONS)?;
        for session in &new.sessions {
            if self.store.session(tenant, session).await?.is_none() {
                return Err(FieldError::new("sessions", session, "must name sessions of the tenant").into());
            }
        }
        Ok(())
    }

    fn check_url(&self, url: &str) -> Result<(), FieldError> {
        match MailAddress::of_url(url) {
            None => Destination::read(url, &self.settings.allowed).map(drop),
            Some(_) if self.settings.mail.is_none() => {
                let rule = "must begin with https:// because the operator configured no mail server (--smtp)";
                Err(FieldError::new("url", url, rule))
            }
            Some(address) => address.map(drop),
        }
    }

    /// Lists the subscriptions of a tenant.
    ///
    /// # Errors
    /// The store does not answer.
    pub async fn list(&self, tenant: &Tenant) -> Result<Vec<SubscriptionRow>, ServiceError> {
        Ok(self.store.subscriptions(tenant).await?)
    }

    /// Replaces the secret of a subscription. The one before signs for [`OVERLAP_MS`] more. The same key again returns
    /// the secret that its first request made.
    ///
    /// # Errors
    /// There is no such subscription.
    pub async fn rotate(
        &self,
        caller: &Caller,
        subscription: &str,
        key: Option<String>,
    ) -> Result<(SigningSecret, i64), ServiceError> {
        let secret = SigningSecret::new()?;
        // Senders compare it with the time of the store.
        let now_ms = self.store.lease_time(self.clock.now_milliseconds()).await?;
        let until_ms = now_ms.saturating_add(OVERLAP_MS);
        let new = NewSecret { secret: secret.bytes(), key: key.unwrap_or_default(), until_ms };
        let rotated = self.store.by(caller.actor()).rotate_secret(&caller.tenant, subscription, new).await?;
        let (secret, until_ms) = rotated.ok_or_else(|| ServiceError::unknown("subscription", subscription))?;
        Ok((SigningSecret::stored(secret), until_ms))
    }

    /// Sends the dead letters of a subscription again, and returns how many.
    ///
    /// # Errors
    /// There is no such subscription.
    pub async fn resend(&self, caller: &Caller, subscription: &str) -> Result<usize, ServiceError> {
        let queued = self.store.by(caller.actor()).resend(&caller.tenant, subscription).await?;
        self.outbox.ring();
        queued.ok_or_else(|| ServiceError::unknown("subscription", subscription))
    }

    /// Deletes a subscription with its deliveries.
    ///
    /// # Errors
    /// There is no such subscription.
    pub async fn delete(&self, caller: &Caller, subscription: &str) -> Result<(), ServiceError> {
        let is_deleted = self.store.by(caller.actor()).unsubscribe(&caller.tenant, subscription).await?;
        if is_deleted { Ok(()) } else { Err(ServiceError::unknown("subscription", subscription)) }
    }
}

/// Returns the identifier of the subscription that a tenant's idempotency key makes.
fn keyed(tenant: &Tenant, key: &str) -> String {
    let digest = Sha256::new().chain_update(tenant.as_str()).chain_update([0]).chain_update(key).finalize();
    let digits: String = digest.iter().take(16).map(|byte| format!("{byte:02x}")).collect();
    format!("subscription_{digits}")
}

/// Checks that at most `most` names are given, each once.
fn distinct(field: &str, names: &[impl AsRef<str>], most: usize) -> Result<(), FieldError> {
    if names.len() > most {
        return Err(FieldError::new(field, names.len(), format!("must name at most {most}")));
    }
    let mut seen = HashSet::new();
    match names.iter().map(AsRef::as_ref).find(|name| !seen.insert(*name)) {
        Some(twice) => Err(FieldError::new(field, twice, "must be named once")),
        None => Ok(()),
    }
}
