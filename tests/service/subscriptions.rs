//! Subscribers are told of events by signed webhooks: at least once, under one identifier, and nothing goes to private
//! addresses that the operator did not name.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::support::{App, patience, postgres, specification};
use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::IntoResponse;
use axum::routing::post;
use ballast::service::process::config::{Config, StoreLocation};
use ballast::store::{
    Append, DeliveryEnd, DeliveryLease, EntryKind, EntryRow, EventKind, NewEvent, NewSubscription, Store, Subscribing,
    Tenant,
};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use reqwest::Method;
use ring::hmac;
use serde_json::{Value, json};

/// A real receiver: it stores what comes and answers with a status that the test sets.
#[derive(Clone)]
struct Receiver {
    url: String,
    state: Arc<Mutex<ReceiverState>>,
}

#[derive(Default)]
struct ReceiverState {
    received: Vec<(HeaderMap, String)>,
    status: StatusCode,
    delay: Duration,
}

impl Receiver {
    async fn start() -> Receiver {
        let state = Arc::new(Mutex::new(ReceiverState::default()));
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}/hook?for=ballast", listener.local_addr().unwrap());
        let receiver = Receiver { url, state };
        let router = Router::new().route("/hook", post(Receiver::receive)).with_state(receiver.clone());
        tokio::spawn(async move { axum::serve(listener, router).await });
        receiver
    }

    async fn receive(State(receiver): State<Receiver>, headers: HeaderMap, body: Bytes) -> axum::response::Response {
        let (status, delay) = {
            let mut state = receiver.state.lock().unwrap();
            state.received.push((headers, String::from_utf8(body.to_vec()).unwrap()));
            (state.status, state.delay)
        };
        tokio::time::sleep(delay).await;
        // A redirect leads to the receiver itself, so that following it would be seen.
        (status, [(header::LOCATION, "/hook")]).into_response()
    }

    fn answer(&self, status: StatusCode) {
        self.state.lock().unwrap().status = status;
    }

    fn delay(&self, delay: Duration) {
        self.state.lock().unwrap().delay = delay;
    }

    /// The identifier, the signatures and the body of everything received.
    fn received(&self) -> Vec<(String, HeaderMap, Value)> {
        let state = self.state.lock().unwrap();
        let read = |(headers, body): &(HeaderMap, String)| {
            (headers["webhook-id"].to_str().unwrap().to_owned(), headers.clone(), serde_json::from_str(body).unwrap())
        };
        state.received.iter().map(read).collect()
    }

    /// The bodies of one kind of event.
    fn of(&self, kind: &str) -> Vec<Value> {
        self.received().into_iter().map(|(.., body)| body).filter(|body| body["type"] == kind).collect()
    }

    /// Checks the signatures of the last delivery under these secrets, as a receiver would.
    fn verify_last(&self, secrets: &[&str]) {
        let state = self.state.lock().unwrap();
        let (headers, body) = state.received.last().unwrap();
        let text = |name: &str| headers[name].to_str().unwrap();
        let signed = format!("{}.{}.{body}", text("webhook-id"), text("webhook-timestamp"));
        let sent: Vec<&str> = text("webhook-signature").split(' ').collect();
        assert_eq!(sent.len(), secrets.len(), "{sent:?}");
        for (secret, signature) in secrets.iter().zip(sent) {
            let key = STANDARD.decode(secret.strip_prefix("whsec_").unwrap()).unwrap();
            let tag = STANDARD.decode(signature.strip_prefix("v1,").unwrap()).unwrap();
            hmac::verify(&hmac::Key::new(hmac::HMAC_SHA256, &key), signed.as_bytes(), &tag).unwrap();
        }
    }
}

fn quickly(config: &mut Config) {
    config.webhooks.allowed = vec!["127.0.0.1".into()];
    (config.webhooks.first_delay, config.webhooks.attempts) = (Duration::from_millis(50), 3);
    config.webhooks.look = Duration::from_millis(50);
}

async fn subscribe(app: &App, request: Value) -> (String, String) {
    let (status, made) = app.post("/subscriptions", &request).await;
    assert_eq!(status, 201, "{made}");
    (made["subscription"].as_str().unwrap().to_owned(), made["secret"].as_str().unwrap().to_owned())
}

pub(crate) async fn listed(app: &App) -> Value {
    app.get("/subscriptions").await.1["subscriptions"].clone()
}

async fn over_either(story: impl AsyncFn(App)) {
    story(App::configured(quickly).await).await;
    let Some(database) = postgres::database().await else { return };
    let store = StoreLocation::Postgres(database.parse().unwrap());
    let shared = |config: &mut Config| {
        quickly(config);
        config.store = store;
    };
    story(App::configured(shared).await).await;
}

pub(crate) async fn until(what: &str, mut reached: impl AsyncFnMut() -> bool) {
    patience::until(what, async || reached().await.then_some(())).await;
}

/// A training that ends at once.
pub(crate) async fn a_job_ends(app: &App, seed: usize) -> String {
    let mut small = specification(1);
    small["seed"] = json!(seed);
    let job = app.queue(&small).await;
    app.until(&job, |job| job["state"] == "succeeded").await;
    job
}

#[tokio::test(flavor = "multi_thread")]
async fn a_receiver_that_fails_and_recovers_gets_each_event_under_one_identifier() {
    over_either(async |app| {
        let receiver = Receiver::start().await;
        receiver.answer(StatusCode::INTERNAL_SERVER_ERROR);
        let (_, secret) = subscribe(&app, json!({ "url": receiver.url, "events": ["job_ended"] })).await;
        let job = a_job_ends(&app, 1).await;
        until("an attempt fails", async || receiver.received().len() >= 2).await;
        until("the failure is listed", async || listed(&app).await[0]["failures"].as_u64() >= Some(2)).await;
        let state = listed(&app).await[0].clone();
        assert_eq!((&state["last_error"], &state["delivered"]), (&json!("the receiver answered 500"), &json!(0)));
        receiver.answer(StatusCode::NO_CONTENT);
        until("it is delivered", async || listed(&app).await[0]["delivered"] == 1).await;
        let received = receiver.received();
        assert_eq!(received.len(), 3, "three attempts, the last of which succeeds");
        assert!(received.iter().all(|(id, ..)| *id == received[0].0), "one identifier");
        receiver.verify_last(&[&secret]);
        let (_, headers, body) = &received[2];
        assert_eq!(headers["content-type"], "application/json");
        let data = json!({ "job": job, "kind": "train", "state": "succeeded", "policy": body["data"]["policy"], "error": null });
        assert_eq!((&body["type"], &body["data"]), (&json!("job_ended"), &data));
        assert!(body["data"]["policy"].is_string() && body["timestamp"].as_str().unwrap().ends_with('Z'), "{body}");
        let state = listed(&app).await[0].clone();
        assert_eq!([&state["waiting"], &state["failures"], &state["dead"]], [&json!(0), &json!(0), &json!(0)]);
        assert!(state["last_delivered_ms"].is_i64() && state["last_error"].is_null(), "{state}");
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_given_up_is_a_dead_letter_and_can_be_sent_again() {
    over_either(async |app| {
        let receiver = Receiver::start().await;
        // A redirect is not followed: it counts as a failure.
        receiver.answer(StatusCode::TEMPORARY_REDIRECT);
        let (id, _) = subscribe(&app, json!({ "url": receiver.url, "events": ["job_ended"] })).await;
        let job = a_job_ends(&app, 1).await;
        until("it is given up", async || listed(&app).await[0]["dead"] == 1).await;
        let received = receiver.received();
        assert_eq!(received.len(), 3, "as many attempts as are set");
        let state = listed(&app).await[0].clone();
        let letter = &state["dead_letters"][0];
        assert_eq!((&letter["delivery"], &letter["attempts"]), (&json!(received[0].0), &json!(3)), "{state}");
        assert_eq!((&letter["event"], &state["waiting"]), (&json!("job_ended"), &json!(0)));
        assert!(letter["body"].as_str().unwrap().contains(&job) && letter["error"].as_str().unwrap().contains("307"));
        receiver.answer(StatusCode::OK);
        let (status, resent) = app.send(Method::POST, &format!("/subscriptions/{id}/resend"), None).await;
        assert_eq!((status.as_u16(), &resent), (200, &json!({ "queued": 1 })));
        until("it is delivered", async || listed(&app).await[0]["delivered"] == 1).await;
        assert_eq!(receiver.received().last().unwrap().0, received[0].0, "under the same identifier");
        assert_eq!(listed(&app).await[0]["dead"], 0);
        assert_eq!(app.delete(&format!("/subscriptions/{id}")).await, 204);
        assert_eq!(listed(&app).await, json!([]));
        let (_, audit) = app.get(&format!("/audit?object={id}")).await;
        let actions: Vec<&str> =
            audit["entries"].as_array().unwrap().iter().map(|entry| entry["action"].as_str().unwrap()).collect();
        assert_eq!(actions, ["subscription.delete", "subscription.resend", "subscription.create"]);
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn both_secrets_sign_after_a_rotation() {
    let app = App::configured(quickly).await;
    let receiver = Receiver::start().await;
    let (id, first) = subscribe(&app, json!({ "url": receiver.url, "events": ["job_ended"] })).await;
    let (status, rotated) = app.send(Method::POST, &format!("/subscriptions/{id}/secret"), None).await;
    assert_eq!(status, 200, "{rotated}");
    let second = rotated["secret"].as_str().unwrap().to_owned();
    assert_ne!(first, second);
    a_job_ends(&app, 1).await;
    until("it is delivered", async || listed(&app).await[0]["delivered"] == 1).await;
    receiver.verify_last(&[&second, &first]);
    let again = async |path: &str, body: Value| {
        let request = app.client.post(format!("{}{path}", app.url)).header("idempotency-key", "once").json(&body);
        crate::support::read(request.send().await.unwrap()).await
    };
    let path = format!("/subscriptions/{id}/secret");
    let keyed = again(&path, json!({})).await.1;
    assert_eq!(again(&path, json!({})).await.1, keyed, "rotated once for each key");
    let request = json!({ "url": receiver.url, "events": ["drift_alarm"] });
    let made = again("/subscriptions", request.clone()).await;
    assert_eq!((made.0.as_u16(), &again("/subscriptions", request).await.1), (201, &made.1));
    assert_eq!(listed(&app).await.as_array().unwrap().len(), 2);
    let other = json!({ "url": receiver.url, "events": ["job_ended"] });
    assert_eq!(again("/subscriptions", other).await.0, 409);
    let shown = listed(&app).await.to_string();
    assert!(!shown.contains("whsec_") && !shown.contains("secret"), "a secret is shown once: {shown}");
    for path in [format!("/subscriptions/{id}x/secret"), format!("/subscriptions/{id}x/resend")] {
        assert_eq!(app.send(Method::POST, &path, None).await.0, 404);
    }
    assert_eq!(app.delete(&format!("/subscriptions/{id}x")).await, 404);
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_goes_to_a_private_address_that_was_not_allowed() {
    let app = App::start().await;
    let receiver = Receiver::start().await;
    let port = receiver.url.split([':', '/']).nth(4).unwrap().to_owned();
    for url in
        [&*receiver.url, "https://127.0.0.1/", "https://[::1]/", "https://169.254.169.254/latest", "https://10.1.2.3"]
    {
        let (status, refused) = app.post("/subscriptions", &json!({ "url": url, "events": ["job_ended"] })).await;
        assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("url")), "{url}: {refused}");
    }
    // The name is no address, and leads to one that is not public: found out when it is looked up.
    let url = format!("https://localhost:{port}/hook");
    subscribe(&app, json!({ "url": url, "events": ["job_ended"] })).await;
    a_job_ends(&app, 1).await;
    until("the attempt fails", async || listed(&app).await[0]["failures"] == 1).await;
    let error = listed(&app).await[0]["last_error"].as_str().unwrap().to_owned();
    assert_eq!(error, "the host has no public address, and the operator does not allow it by name");
    assert!(receiver.received().is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_out_of_range_is_named() {
    let app = App::start().await;
    let many: Vec<String> = (0..101).map(|k| format!("session_{k}")).collect();
    for (field, value) in [
        ("url", json!("")),
        ("url", json!("example.com")),
        ("url", json!(format!("https://example.com/{}", "a".repeat(2_000)))),
        ("url", json!(1)),
        ("events", json!([])),
        ("events", json!(["job_ended", "job_ended"])),
        ("events[0]", json!(["job"])),
        ("least_change", json!(-0.1)),
        ("least_change", json!(1e16)),
        ("sessions", json!(["session_of_nobody"])),
        ("sessions", json!(many)),
        ("colour", json!(1)),
    ] {
        let mut request = json!({ "url": "https://example.com/", "events": ["job_ended"] });
        request[field.split('[').next().unwrap()] = value;
        let (status, refused) = app.post("/subscriptions", &request).await;
        assert_eq!((status.as_u16(), &refused["field"]), (422, &json!(field)), "{request}: {refused}");
    }
    assert_eq!(listed(&app).await, json!([]));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_slow_receiver_holds_up_only_itself() {
    let mut app = App::configured(quickly).await;
    let [slow, prompt] = [Receiver::start().await, Receiver::start().await];
    slow.delay(Duration::from_secs(600));
    let [north, south] = [app.key("north", "operate,train,read").await, app.key("south", "operate,train,read").await];
    app.enter(&north).await;
    for _ in 0..10 {
        subscribe(&app, json!({ "url": slow.url, "events": ["job_ended"] })).await;
    }
    let more = json!({ "url": slow.url, "events": ["job_ended"] });
    let (status, refused) = app.post("/subscriptions", &more).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("subscriptions")), "{refused}");
    for seed in 0..3 {
        a_job_ends(&app, seed).await;
    }
    until("each is being sent to", async || slow.received().len() == 10).await;
    app.enter(&south).await;
    assert_eq!(listed(&app).await, json!([]), "those of another tenant are not shown");
    subscribe(&app, json!({ "url": prompt.url, "events": ["job_ended"] })).await;
    a_job_ends(&app, 1).await;
    until("it is delivered", async || prompt.received().len() == 1).await;
    assert_eq!(slow.received().len(), 10, "one delivery at a time of each subscription");
}

#[tokio::test(flavor = "multi_thread")]
async fn reports_tell_of_advice_that_changed_and_of_holdings_out_of_their_band() {
    over_either(async |mut app| {
        let [changes, all, other] = [Receiver::start().await, Receiver::start().await, Receiver::start().await];
        let mut costly = specification(6);
        costly["problem"]["utility"] = json!({ "kind": "power", "risk_aversion": 8.0 });
        costly["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.001 });
        costly["problem"]["trading_cost"] = json!(0.001);
        costly["design"] = json!({ "count": 40 });
        app.train(&costly).await;
        app.open().await;
        let another = app.post("/sessions", &json!({ "policy": app.policy })).await.1["session"].clone();
        subscribe(&app, json!({ "url": changes.url, "events": ["advice_changed"], "least_change": 0.9 })).await;
        let both = json!(["advice_changed", "left_band"]);
        subscribe(&app, json!({ "url": all.url, "events": both, "sessions": [app.session], "least_change": 0 })).await;
        subscribe(&app, json!({ "url": other.url, "events": both, "sessions": [another], "least_change": 0 })).await;
        let (mut advised, mut changed, mut left) = (Vec::new(), 0, 0);
        for (period, log_return) in [-0.03, 0.04, -0.02, 0.05].into_iter().enumerate() {
            advised.push(app.action().await.1["allocation"].as_f64().unwrap());
            let (status, observed) = app.report(period + 1, json!({ "log_return": log_return, "confirm": true })).await;
            assert_eq!(status, 200, "{observed}");
            let next = app.action().await.1;
            let (low, high) = (next["band"][0].as_f64().unwrap(), next["band"][1].as_f64().unwrap());
            let holding = next["holding"].as_f64().unwrap();
            left += usize::from(holding < low - 1e-9 || holding > high + 1e-9);
            changed += usize::from(next["allocation"].as_f64().unwrap() != advised[period]);
        }
        advised.push(app.action().await.1["allocation"].as_f64().unwrap());
        assert!(changed > 0 && left > 0, "{changed} {left}");
        until("all are delivered", async || all.received().len() == changed + left).await;
        let found = all.of("advice_changed");
        assert_eq!((found.len(), all.of("left_band").len()), (changed, left));
        for event in found {
            let data = &event["data"];
            let period = data["period"].as_u64().unwrap() as usize;
            let [before, after] =
                [&data["before"]["allocation"], &data["after"]["allocation"]].map(|share| share.as_f64().unwrap());
            assert_eq!((before, after), (advised[period - 2], advised[period - 1]), "{data}");
            assert_eq!(data["change"].as_f64().unwrap(), (after - before).abs());
        }
        assert!(changes.received().is_empty() && other.received().is_empty());
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_drift_alarm_is_told_once() {
    let mut app = App::configured(quickly).await;
    let receiver = Receiver::start().await;
    let mut long = specification(24);
    long["problem"]["history"] = json!((0..60).map(|k| 0.01 * (1.7 * f64::from(k)).sin()).collect::<Vec<_>>());
    app.train(&long).await;
    app.open().await;
    subscribe(&app, json!({ "url": receiver.url, "events": ["drift_alarm"] })).await;
    let mut alarmed = None;
    for period in 1..=20 {
        let growing = 0.02 * period as f64 * if period % 2 == 0 { 1.0 } else { -1.0 };
        let (status, observed) = app.report(period, json!({ "log_return": growing, "confirm": true })).await;
        assert_eq!(status, 200, "{observed}");
        if observed["drift"]["level"] == "alarm" && alarmed.is_none() {
            alarmed = Some(period);
        }
    }
    let period = alarmed.expect("an alarm");
    assert!(period < 20, "reports follow the alarm");
    until("it is delivered", async || listed(&app).await[0]["delivered"] == 1).await;
    let received = receiver.received();
    assert_eq!(received.len(), 1);
    assert_eq!(
        (&received[0].2["data"]["session"], &received[0].2["data"]["period"]),
        (&json!(app.session), &json!(period))
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_renewal_that_failed_is_told() {
    let mut app = App::configured(quickly).await;
    let receiver = Receiver::start().await;
    let mut renewing = specification(3);
    renewing["problem"]["utility"] = json!({ "kind": "power", "risk_aversion": 3.0 });
    app.train(&renewing).await;
    app.open_with(json!({ "renew": { "every": 1 } })).await;
    subscribe(&app, json!({ "url": receiver.url, "events": ["renewal_failed"], "sessions": [app.session] })).await;
    // The trainer is busy for longer than the test takes.
    renewing["problem"]["horizon"] = json!(12);
    renewing["design"]["count"] = json!(1500);
    let busy = app.queue(&renewing).await;
    app.until(&busy, |job| job["state"] == "running").await;
    assert_eq!(app.observe(1, 0.012).await.0, 200);
    let path = format!("/sessions/{}", app.session);
    until("its training is queued", async || app.get(&path).await.1["renewal"]["job"].is_string()).await;
    let job = app.get(&path).await.1["renewal"]["job"].as_str().unwrap().to_owned();
    app.cancel(&job).await;
    until("it is told", async || receiver.received().len() == 1).await;
    let data = json!({ "session": app.session, "renewal": 1, "job": job, "state": "cancelled", "error": null });
    assert_eq!(receiver.of("renewal_failed")[0]["data"], data);
    app.cancel(&busy).await;
}

fn subscription(name: &str) -> NewSubscription {
    NewSubscription {
        subscription: name.to_owned(),
        tenant: Tenant::default(),
        url: "https://example.com/".to_owned(),
        events: vec![EventKind::DriftAlarm],
        sessions: Vec::new(),
        least_change: 0.0,
        secret: vec![7; 32],
        created_ms: 0,
    }
}

/// An observation of the session, and its alarm.
fn alarmed(session: &str, entry: usize) -> (EntryRow, Vec<NewEvent>) {
    let row = EntryRow {
        session: session.to_owned(),
        entry,
        kind: EntryKind::Observation,
        number: entry,
        content_json: "{}".into(),
        answer_json: "{}".into(),
        numbers: Vec::new(),
        created_ms: 0,
        key: String::new(),
    };
    let event = NewEvent {
        kind: EventKind::DriftAlarm,
        session: session.to_owned(),
        fact: format!("{session}\n{entry}"),
        change: f64::INFINITY,
        data: json!({ "period": entry }),
        at_ms: 0,
    };
    (row, vec![event])
}

/// An event is stored if and only if its entry is; a lease keeps others away, and its end fences its holder.
#[tokio::test(flavor = "multi_thread")]
async fn events_are_stored_with_their_facts_and_claimed_by_one() {
    over_either(async |mut app| {
        app.train(&specification(3)).await;
        app.open().await;
        let session = app.session.clone();
        app.between(async |store: &Store| {
            assert_eq!(store.subscribe(subscription("one")).await.unwrap(), Subscribing::Created);
            let (row, events) = alarmed(&session, 2);
            assert_eq!(store.append_with(row, events).await.unwrap(), Append::NotNext);
            assert!(!store.has_deliveries(0).await.unwrap(), "the entry was not appended");
            for entry in 1..=2 {
                let (row, events) = alarmed(&session, entry);
                assert_eq!(store.append_with(row, events).await.unwrap(), Append::Appended);
            }
            let at = |now_ms| DeliveryLease { now_ms, until_ms: now_ms + 100 };
            let first = store.claim_deliveries(9, at(1_000)).await.unwrap();
            assert_eq!((first.len(), first[0].attempt), (1, 1), "one of a subscription at a time");
            assert!(first[0].body.contains(r#""period":1"#), "the oldest first: {}", first[0].body);
            assert_eq!(store.claim_deliveries(9, at(1_099)).await.unwrap(), []);
            let second = store.claim_deliveries(9, at(1_100)).await.unwrap();
            let taken_over = second.iter().find(|claimed| claimed.delivery == first[0].delivery);
            if let Some(taken_over) = taken_over {
                assert_eq!(taken_over.attempt, 2);
                assert!(!store.end_delivery(&first[0], DeliveryEnd::Delivered, 1_101).await.unwrap(), "fenced");
            }
            assert!(store.end_delivery(&second[0], DeliveryEnd::Delivered, 1_102).await.unwrap());
            assert!(!store.end_delivery(&second[0], DeliveryEnd::Delivered, 1_103).await.unwrap());
            let rest = store.claim_deliveries(9, at(2_000)).await.unwrap();
            assert_eq!(rest.len(), 1);
            let failed = DeliveryEnd::Failed { error: "no".into(), next_ms: None };
            assert!(store.end_delivery(&rest[0], failed, 2_001).await.unwrap());
            let listed = store.subscriptions(&Tenant::default()).await.unwrap();
            assert_eq!((listed[0].dead, listed[0].waiting, listed[0].delivered, listed[0].failures), (1, 0, 1, 1));
            assert_eq!(store.resend(&"another".parse().unwrap(), "one").await.unwrap(), None);
            assert!(store.unsubscribe(&Tenant::default(), "one").await.unwrap());
            assert!(!store.has_deliveries(i64::MAX).await.unwrap());
        })
        .await;
    })
    .await;
}

/// Two processes share a database: each event is sent once, whichever of them sends it.
#[tokio::test(flavor = "multi_thread")]
async fn two_processes_share_the_sending() {
    let Some(database) = postgres::database().await else { return };
    let store = StoreLocation::Postgres(database.parse().unwrap());
    let share = |config: &mut Config| {
        quickly(config);
        config.store = store.clone();
    };
    let [one, _other] = [App::configured(share).await, App::configured(share).await];
    let receiver = Receiver::start().await;
    for _ in 0..5 {
        subscribe(&one, json!({ "url": receiver.url, "events": ["job_ended"] })).await;
    }
    for seed in 0..4 {
        a_job_ends(&one, seed).await;
    }
    until("all are delivered", async || {
        let listed = listed(&one).await;
        listed.as_array().unwrap().iter().all(|subscription| subscription["delivered"] == 4)
    })
    .await;
    let mut ids: Vec<String> = receiver.received().into_iter().map(|(id, ..)| id).collect();
    ids.sort();
    let sent = ids.len();
    ids.dedup();
    assert_eq!((sent, ids.len()), (20, 20), "each was sent once");
}

/// A report that is missing is told once when it is due and once when it is late, whoever looks how often, also after a
/// restart; a session whose next report lies ahead is not told of.
#[tokio::test(flavor = "multi_thread")]
async fn a_missing_report_is_told_once() {
    over_either(async |mut app| {
        let receiver = Receiver::start().await;
        subscribe(&app, json!({ "url": receiver.url, "events": ["report_due", "report_late"] })).await;
        let mut monthly = specification(4);
        monthly["problem"]["periods_per_year"] = json!(12);
        app.train(&monthly).await;
        app.open().await;
        let (late, policy) = (app.session.clone(), app.policy.clone());
        let (status, ahead) = app.post("/sessions", &json!({ "policy": policy })).await;
        assert_eq!(status, 201, "{ahead}");
        let observe = async |app: &App, period: usize, date: &str| {
            let report = json!({ "session": late, "period": period, "log_return": 0.01, "date": date });
            let (status, answer) = app.post("/observe", &report).await;
            assert_eq!(status, 200, "{answer}");
        };
        let told = |kind: &str, expected: &[(usize, &str)]| {
            let data = |(period, due): &(usize, &str)| json!({ "session": late, "period": period, "due": due });
            let found: Vec<Value> = receiver.of(kind).iter().map(|body| body["data"].clone()).collect();
            found == expected.iter().map(data).collect::<Vec<_>>()
        };
        let both = |expected: &[(usize, &str)]| told("report_due", expected) && told("report_late", expected);
        // Opened today, neither of them lacks a report.
        tokio::time::sleep(Duration::from_millis(300)).await;
        assert!(both(&[]));
        observe(&app, 1, "2008-01-31").await;
        until("both are told", async || both(&[(2, "2008-02-29")])).await;
        // A delivery that is not yet recorded would be sent once more after the restart, under its identifier.
        until("both are recorded", async || listed(&app).await[0]["delivered"] == 2).await;
        app.restart().await;
        tokio::time::sleep(Duration::from_millis(300)).await;
        assert!(both(&[(2, "2008-02-29")]), "told again: {:?}", receiver.received());
        observe(&app, 2, "2008-02-29").await;
        until("the next is told", async || both(&[(2, "2008-02-29"), (3, "2008-03-31")])).await;
    })
    .await;
}
