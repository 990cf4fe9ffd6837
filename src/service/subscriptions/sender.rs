//! Sends stored events, as webhooks or by e-mail, until their receivers have accepted them.
//!
//! Every process sends. A delivery is claimed for `LEASE`, sent, and then deleted, delayed or given up. The delay
//! grows fourfold with each attempt, up to `LONGEST_DELAY`. At most `AT_ONCE` deliveries of a process are under way,
//! of each subscription one, so slow receivers hold up themselves and not others.

use std::sync::Arc;
use std::time::Duration;

use futures_util::future::BoxFuture;
use tokio::task::JoinSet;

use crate::service::metrics::WEBHOOKS;
use crate::service::process::clock::Clock;
use crate::service::process::config::WebhookSettings;
use crate::service::process::shutdown::Shutdown;
use crate::service::subscriptions::mail_address::MailAddress;
use crate::service::subscriptions::mail_server::OutgoingMail;
use crate::service::subscriptions::mail_text::{MailText, MailedSession, StoredEvent};
use crate::service::subscriptions::outbox::Outbox;
use crate::service::subscriptions::signature::signatures;
use crate::store::{ClaimedDelivery, DeliveryEnd, DeliveryLease, Store, StoreError};

/// Time between two looks for due deliveries, if no signal comes.
const POLL: Duration = Duration::from_secs(1);
/// The longest time of an attempt, from the look-up of the host to the head of the answer.
pub const ATTEMPT_TIMEOUT: Duration = Duration::from_secs(10);
/// Another process may send a delivery again after this time. It is longer than an attempt and the write after it.
const LEASE: Duration = Duration::from_secs(60);
/// Deliveries of this process under way.
const AT_ONCE: usize = 256;
/// The longest time between two attempts.
const LONGEST_DELAY: Duration = Duration::from_secs(6 * 60 * 60);
/// The most characters of an error that are stored.
const LONGEST_ERROR: usize = 300;

/// A signed delivery.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutgoingWebhook {
    pub url: String,
    /// The headers of Standard Webhooks: identifier, time in seconds, signatures.
    pub id: String,
    pub timestamp: i64,
    pub signature: String,
    pub body: String,
}

/// Posts a delivery, and returns the status of the answer or why there was none.
pub type PostWebhook = Arc<dyn Fn(OutgoingWebhook) -> BoxFuture<'static, Result<u16, String>> + Send + Sync>;

/// The sender of one process.
#[derive(Clone)]
pub(in crate::service) struct WebhookSender {
    pub store: Store,
    pub clock: Clock,
    pub outbox: Outbox,
    pub settings: WebhookSettings,
    pub post: PostWebhook,
}

impl WebhookSender {
    /// Sends until the service ends. A delivery under way then is sent again after its lease.
    pub async fn run(self, shutdown: Shutdown) {
        let mut under_way = JoinSet::new();
        while !shutdown.has_begun() {
            let is_more = self.send_due(&mut under_way).await.unwrap_or_else(|error| {
                tracing::warn!(error = &error as &dyn std::error::Error, "sending webhooks failed");
                false
            });
            let pause = if is_more { Duration::ZERO } else { POLL };
            tokio::select! {
                () = shutdown.begun() => {}
                () = tokio::time::sleep(pause) => {}
                () = self.outbox.rung() => {}
                Some(_) = under_way.join_next() => {}
            }
            while under_way.try_join_next().is_some() {}
        }
    }

    /// Starts the deliveries that are due, as far as there is room; returns whether there were any.
    async fn send_due(&self, under_way: &mut JoinSet<()>) -> Result<bool, StoreError> {
        self.outbox.refresh(&self.store).await?;
        let now_ms = self.store.lease_time(self.clock.now_milliseconds()).await?;
        let room = AT_ONCE.saturating_sub(under_way.len());
        if room == 0 || !self.store.has_deliveries(now_ms).await? {
            return Ok(false);
        }
        let lease = DeliveryLease { now_ms, until_ms: now_ms.saturating_add(milliseconds(LEASE)) };
        let claimed = self.store.claim_deliveries(room, lease).await?;
        let is_more = !claimed.is_empty();
        for delivery in claimed {
            let sender = self.clone();
            under_way.spawn(async move { sender.attempt(delivery).await });
        }
        Ok(is_more)
    }

    async fn attempt(self, claimed: ClaimedDelivery) {
        let answer = match tokio::time::timeout(ATTEMPT_TIMEOUT, self.send(&claimed)).await {
            Ok(answer) => answer,
            Err(_) => Err(format!("no answer within {} s", ATTEMPT_TIMEOUT.as_secs())),
        };
        let error = answer.err().map(|error| error.chars().take(LONGEST_ERROR).collect());
        if let Err(error) = self.end(&claimed, error).await {
            // It is sent again after its lease.
            tracing::warn!(error = &error as &dyn std::error::Error, "the end of a delivery was not recorded");
        }
    }

    /// Sends a delivery once. The error says why it was not accepted.
    async fn send(&self, claimed: &ClaimedDelivery) -> Result<(), String> {
        if let Some(address) = MailAddress::of_url(&claimed.url) {
            return self.mail(address.map_err(|error| error.to_string())?, claimed).await;
        }
        let seconds = self.clock.now_milliseconds() / 1000;
        let outgoing = OutgoingWebhook {
            url: claimed.url.clone(),
            id: claimed.delivery.clone(),
            timestamp: seconds,
            signature: signatures(&claimed.secrets, &claimed.delivery, seconds, &claimed.body),
            body: claimed.body.clone(),
        };
        match (self.post)(outgoing).await? {
            200..=299 => Ok(()),
            status => Err(format!("the receiver answered {status}")),
        }
    }

    async fn mail(&self, to: MailAddress, claimed: &ClaimedDelivery) -> Result<(), String> {
        let server = self.settings.mail.as_ref().ok_or("the operator configures no mail server any more")?;
        let event: StoredEvent = serde_json::from_str(&claimed.body).map_err(|error| format!("no event: {error}"))?;
        let session = match event.session() {
            None => MailedSession::default(),
            Some(session) => {
                let unread = |error: StoreError| format!("the session cannot be read: {error}");
                let labels = self.store.labels(&claimed.tenant, session).await.map_err(unread)?;
                let row = self.store.session(&claimed.tenant, session).await.map_err(unread)?;
                MailedSession { name: labels.name, has_account: row.is_some_and(|row| row.account.is_some()) }
            }
        };
        let MailText { subject, text } = event.in_words(&session, &claimed.subscription);
        let id = claimed.delivery.clone();
        server.send(OutgoingMail { id, at: event.timestamp, to, subject, text }).await
    }

    async fn end(&self, claimed: &ClaimedDelivery, error: Option<String>) -> Result<(), StoreError> {
        let now_ms = self.store.lease_time(self.clock.now_milliseconds()).await?;
        let (delivery, subscription) = (claimed.delivery.as_str(), claimed.subscription.as_str());
        let (end, outcome) = match error {
            None => (DeliveryEnd::Delivered, "delivered"),
            Some(error) if claimed.attempt >= self.settings.attempts => {
                tracing::warn!(delivery, subscription, error, "a delivery was given up");
                (DeliveryEnd::Failed { error, next_ms: None }, "dead")
            }
            Some(error) => {
                let next_ms = now_ms.saturating_add(delay_ms(self.settings.first_delay, claimed.attempt));
                (DeliveryEnd::Failed { error, next_ms: Some(next_ms) }, "failed")
            }
        };
        metrics::counter!(WEBHOOKS, "outcome" => outcome).increment(1);
        self.store.end_delivery(claimed, end, now_ms).await.map(drop)
    }
}

/// Returns the delay after so many attempts.
fn delay_ms(first: Duration, attempts: usize) -> i64 {
    let fours = u32::try_from(attempts.saturating_sub(1)).unwrap_or(u32::MAX).min(15);
    milliseconds(first.saturating_mul(4_u32.pow(fours)).min(LONGEST_DELAY))
}

fn milliseconds(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attempts_follow_each_other_ever_more_slowly_up_to_six_hours() {
        let seconds: Vec<i64> =
            [1, 2, 3, 7, 8, 1_000].into_iter().map(|count| delay_ms(Duration::from_secs(5), count) / 1000).collect();
        assert_eq!(seconds, [5, 20, 80, 20_480, 21_600, 21_600]);
    }
}
