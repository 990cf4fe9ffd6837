//! Subscriptions: who is told of which events.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::gate::access::{CallerOf, LiveCalls, ReadCalls};
use crate::http::gate::extract::{Id, JsonBody};
use crate::http::problem::ProblemDocument;
use crate::http::routes::jobs::idempotency_key;
use crate::service::Service;
use crate::service::subscriptions::Subscribe;
use crate::store::{DeadLetter, EventKind, SubscriptionRow};

/// A new subscription.
#[derive(Debug, Serialize, ToSchema)]
pub struct Subscribed {
    pub subscription: String,
    /// Signs every delivery as Standard Webhooks defines it. It is shown again only to a repeat of the request. E-mails
    /// are not signed.
    #[schema(example = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw")]
    pub secret: String,
}

/// The new secret of a subscription.
#[derive(Debug, Serialize, ToSchema)]
pub struct RotatedSecret {
    /// Signs every delivery from now on. It is shown again only to a repeat of the request.
    pub secret: String,
    /// Until this time, in milliseconds since 1970, the secret before signs too.
    pub previous_until_ms: i64,
}

/// The number of dead letters that were queued again.
#[derive(Debug, Serialize, ToSchema)]
pub struct Resent {
    pub queued: usize,
}

/// A delivery that was given up.
#[derive(Debug, Serialize, ToSchema)]
pub struct GivenUpDelivery {
    /// The identifier under which every attempt was sent, in the header `webhook-id`, or of an e-mail in `Message-ID`.
    pub delivery: String,
    pub event: EventKind,
    /// Time of the event, in milliseconds since 1970.
    pub created_ms: i64,
    pub attempts: usize,
    /// Why the last attempt failed.
    pub error: String,
    /// The body that was sent.
    pub body: String,
}

/// A subscription and the state of its deliveries.
#[derive(Debug, Serialize, ToSchema)]
pub struct SubscriptionState {
    pub subscription: String,
    pub url: String,
    pub events: Vec<EventKind>,
    /// Empty for every session of the tenant.
    pub sessions: Vec<String>,
    pub least_change: f64,
    /// In milliseconds since 1970.
    pub created_ms: i64,
    /// Time of the last event that the receiver accepted, in milliseconds since 1970.
    pub last_delivered_ms: Option<i64>,
    /// Why the last attempt failed; null if it succeeded.
    pub last_error: Option<String>,
    /// Attempts that failed since the last delivery.
    pub failures: usize,
    /// Events that the receiver accepted.
    pub delivered: usize,
    /// Events that are still to be delivered; at most 1,000.
    pub waiting: usize,
    /// Deliveries given up after ten attempts; at most 1,000.
    pub dead: usize,
    /// Events and dead letters that were lost because as many were kept already.
    pub dropped: usize,
    /// The newest ten dead letters.
    pub dead_letters: Vec<GivenUpDelivery>,
}

/// The subscriptions of the tenant, oldest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct SubscriptionList {
    pub subscriptions: Vec<SubscriptionState>,
}

impl From<DeadLetter> for GivenUpDelivery {
    fn from(letter: DeadLetter) -> Self {
        let DeadLetter { delivery, event, created_ms, attempts, error, body } = letter;
        GivenUpDelivery { delivery, event, created_ms, attempts, error, body }
    }
}

impl From<SubscriptionRow> for SubscriptionState {
    fn from(row: SubscriptionRow) -> Self {
        SubscriptionState {
            subscription: row.subscription,
            url: row.url,
            events: row.events,
            sessions: row.sessions,
            least_change: row.least_change,
            created_ms: row.created_ms,
            last_delivered_ms: row.last_delivered_ms,
            last_error: Some(row.last_error).filter(|error| !error.is_empty()),
            failures: row.failures,
            delivered: row.delivered,
            waiting: row.waiting,
            dead: row.dead,
            dropped: row.dropped,
            dead_letters: row.dead_letters.into_iter().map(Into::into).collect(),
        }
    }
}

/// Subscribes to events. Each event is stored with its fact and then posted to the URL until the receiver answers with
/// 2xx: at least once, always under the same `webhook-id`, up to ten times within 20 hours. To a URL `mailto:` it is sent
/// as an e-mail, in plain words and always under the same `Message-ID`. A tenant has at most ten subscriptions.
#[utoipa::path(post, path = "/subscriptions", tag = "subscriptions",
    request_body(content = Subscribe, example = json!({
        "url": "https://example.com/ballast", "events": ["advice_changed", "job_ended"], "least_change": 0.1
    })),
    params(("Idempotency-Key" = Option<String>, Header,
            description = "Repeating the key with the same body returns the same subscription and its secret, until it is deleted.")),
    responses(
        (status = 201, description = "Subscribed.", body = Subscribed, headers(("Location" = String, description = "The subscription."))),
        (status = 409, description = "The key was used with another body.", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "A field breaks a rule.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn create(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    headers: HeaderMap,
    JsonBody(new): JsonBody<Subscribe>,
) -> Result<Response, ProblemDocument> {
    let (subscription, secret) = service.subscriptions.create(&caller, new, idempotency_key(&headers)?).await?;
    let location = [(header::LOCATION, format!("/subscriptions/{subscription}"))];
    Ok((StatusCode::CREATED, location, Json(Subscribed { subscription, secret: secret.reveal() })).into_response())
}

/// Lists the subscriptions of the tenant with the state of their deliveries.
#[utoipa::path(get, path = "/subscriptions", tag = "subscriptions",
    responses((status = 200, description = "The subscriptions.", body = SubscriptionList)))]
pub async fn list(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<ReadCalls>,
) -> Result<Json<SubscriptionList>, ProblemDocument> {
    let rows = service.subscriptions.list(&caller.tenant).await?;
    Ok(Json(SubscriptionList { subscriptions: rows.into_iter().map(Into::into).collect() }))
}

/// Replaces the secret of a subscription. For a day both secrets sign, so that the receiver can change over.
#[utoipa::path(post, path = "/subscriptions/{id}/secret", tag = "subscriptions",
    params(("id" = String, Path, description = "The subscription."),
           ("Idempotency-Key" = Option<String>, Header,
            description = "Repeating the key of the last rotation returns the same secret.")),
    responses(
        (status = 200, description = "Rotated.", body = RotatedSecret),
        (status = 404, description = "There is no such subscription.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn rotate(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
    headers: HeaderMap,
) -> Result<Json<RotatedSecret>, ProblemDocument> {
    let (secret, previous_until_ms) = service.subscriptions.rotate(&caller, &id, idempotency_key(&headers)?).await?;
    Ok(Json(RotatedSecret { secret: secret.reveal(), previous_until_ms }))
}

/// Sends the dead letters of a subscription again, under their identifiers.
#[utoipa::path(post, path = "/subscriptions/{id}/resend", tag = "subscriptions",
    params(("id" = String, Path, description = "The subscription.")),
    responses(
        (status = 200, description = "Queued.", body = Resent),
        (status = 404, description = "There is no such subscription.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn resend(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
) -> Result<Json<Resent>, ProblemDocument> {
    Ok(Json(Resent { queued: service.subscriptions.resend(&caller, &id).await? }))
}

/// Deletes a subscription with everything that is still to be delivered to it.
#[utoipa::path(delete, path = "/subscriptions/{id}", tag = "subscriptions",
    params(("id" = String, Path, description = "The subscription.")),
    responses(
        (status = 204, description = "Deleted."),
        (status = 404, description = "There is no such subscription.", body = ProblemDocument, content_type = "application/problem+json")))]
pub async fn delete(
    State(service): State<Arc<Service>>,
    CallerOf(caller, _): CallerOf<LiveCalls>,
    Id(id): Id,
) -> Result<StatusCode, ProblemDocument> {
    service.subscriptions.delete(&caller, &id).await?;
    Ok(StatusCode::NO_CONTENT)
}
