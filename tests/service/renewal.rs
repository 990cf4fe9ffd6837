//! A session goes on by one policy after the other: by hand, and by itself. Its law is made of the returns seen, and what it is
//! advised is what the next policy advises, as if a session were opened on the record that there is by then.

use std::time::Duration;

use crate::support::patience::until;
use crate::support::values::number;
use crate::support::{App, specification};
use ballast::control::evaluation::account::keep;
use ballast::control::evaluation::walk_forward::{ActualPeriod, Strategy, WalkForward};
use ballast::control::policy::advisor::{AdviceMode, Advisor};
use ballast::control::pool::TrainingPool;
use ballast::control::problem::state::State;
use ballast::control::progress::Watch;
use ballast::control::request::caution::CautionLevel;
use ballast::control::request::centre::CentreSpecification;
use ballast::control::request::framework::Framework;
use ballast::control::request::learning::Learning;
use ballast::control::request::support::Support;
use reqwest::StatusCode;
use serde_json::{Value, json};

const HISTORY: [f64; 10] = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008, 0.045, -0.027, 0.016, 0.002];
const RETURNS: [f64; 6] = [0.012, -0.031, 0.027, 0.004, -0.016, 0.038];

/// Power utility, under which no design depends on wealth.
fn request(horizon: usize) -> Value {
    let mut request = specification(horizon);
    request["problem"]["utility"] = json!({ "kind": "power", "risk_aversion": 3.0 });
    request
}

async fn renew(app: &App, number: usize, mut renewal: Value) -> (StatusCode, Value) {
    renewal["renewal"] = json!(number);
    app.post(&format!("/sessions/{}/renewals", app.session), &renewal).await
}

async fn observe(app: &App, periods: std::ops::RangeInclusive<usize>) {
    for period in periods {
        let (status, observed) = app.observe(period, RETURNS[period - 1]).await;
        assert_eq!(status, 200, "{observed}");
    }
}

async fn session(app: &App) -> Value {
    app.get(&format!("/sessions/{}", app.session)).await.1
}

/// The returns seen after so many periods, the last `window` of them.
fn record(observed: usize, window: usize) -> Vec<f64> {
    let seen: Vec<f64> = HISTORY.into_iter().chain(RETURNS.into_iter().take(observed)).collect();
    seen[seen.len().saturating_sub(window)..].to_vec()
}

/// Returns the advice of the library's policy of `request`, trained on `history` alone, in a state that has seen `lived` since.
fn advised(request: &Value, history: &[f64], lived: &[f64], wealth: f64) -> f64 {
    let mut request = request.clone();
    request["problem"]["history"] = json!(history);
    let advisor = Advisor::new(crate::support::policies::train(request));
    let mut state = State::new(history, wealth, Learning::default()).unwrap();
    lived.iter().for_each(|&seen| state.law.push(seen));
    advisor.advise(lived.len(), &state, AdviceMode::Surrogate).allocation
}

/// Waits until the session was renewed so many times.
async fn until_renewed(app: &App, renewals: usize) -> Value {
    for _ in 0..600 {
        let session = session(app).await;
        if session["renewals"] == renewals {
            return session;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    panic!("not renewed: {}", session(app).await);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_goes_on_by_another_policy_as_one_that_is_opened_there_does() {
    let mut app = App::start().await;
    let (short, mut long) = (request(2), request(4));
    long["problem"]["learning"] = json!({ "kind": "decay", "half_life": 6.0 });
    app.train(&long).await;
    let next = app.policy.clone();
    app.train(&short).await;
    app.open().await;
    observe(&app, 1..=2).await;
    assert_eq!(session(&app).await["state"], "completed");
    assert_eq!(app.action().await.0, 409);

    let (status, renewed) = renew(&app, 1, json!({ "policy": next, "window": 8 })).await;
    assert_eq!(status, 200, "{renewed}");
    assert_eq!(renewed["period"], 3);
    assert_eq!(renewed["horizon"], 6);
    assert_eq!(
        renewed["terms"],
        json!({ "horizon": 4, "rate_per_step": 0.002, "trading_cost": 0.0, "contributions": 0.0, "learning": { "kind": "decay", "half_life": 6.0 } })
    );
    assert_eq!(renewed["sample_size"], 8);
    let now = session(&app).await;
    let shown = json!([now["policy"], now["horizon"], now["period"], now["state"], now["renewals"], now["renew"]]);
    assert_eq!(shown, json!([next, 6, 3, "active", 1, null]));
    let listed = app.get("/sessions").await.1["sessions"][0].clone();
    assert_eq!(json!([listed["policy"], listed["horizon"], listed["state"]]), json!([next, 6, "active"]));

    // The next policy at the law of the window, by the library.
    let wealth = number(&now["wealth"]);
    let advisor = Advisor::new(crate::support::policies::train(long));
    let mut state = State::new(&record(2, 8), wealth, Learning::Decay { half_life: 6.0 }).unwrap();
    for period in 3..=6 {
        let expected = advisor.advise(period - 3, &state, AdviceMode::Surrogate);
        let (status, action) = app.action().await;
        assert_eq!(status, 200, "{action}");
        assert_eq!(number(&action["allocation"]), expected.allocation);
        assert_eq!(number(&action["radius"]), expected.radius);
        observe(&app, period..=period).await;
        state.wealth = number(&session(&app).await["wealth"]);
        state.law.push(RETURNS[period - 1]);
        // Replayed from its entries it is the same.
        if period == 4 {
            let before = app.action().await.1;
            app.restart().await;
            assert_eq!(app.action().await.1, before);
        }
    }
    let (status, past) = app.observe(7, 0.01).await;
    assert_eq!(
        (status, past["type"].as_str().unwrap().ends_with("session-completed")),
        (StatusCode::CONFLICT, true),
        "{past}"
    );

    // What was renewed stays on record, and the policy with it.
    let history = app.get(&format!("/sessions/{}/history", app.session)).await.1;
    assert_eq!(history["policy"], app.policy);
    assert_eq!(history["renewals"][0]["policy"], next);
    assert_eq!(history["renewals"][0]["window"], 8);
    assert_eq!(app.delete(&format!("/policies/{next}")).await, 409);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_renewal_is_made_once_and_refused_by_name() {
    let mut app = App::start().await;
    app.train(&request(2)).await;
    let policy = app.policy.clone();
    app.open().await;
    observe(&app, 1..=1).await;
    let (status, refused) = renew(&app, 2, json!({ "policy": policy })).await;
    assert_eq!(
        (status, refused["detail"].as_str().unwrap().contains("report renewal 1")),
        (StatusCode::CONFLICT, true)
    );
    for (renewal, field) in
        [(json!({ "policy": policy, "window": 1 }), "window"), (json!({ "policy": policy, "renewal": 0 }), "renewal")]
    {
        let (status, refused) = app
            .post(&format!("/sessions/{}/renewals", app.session), &{
                let mut renewal = renewal;
                renewal["renewal"] = renewal.get("renewal").cloned().unwrap_or(json!(1));
                renewal
            })
            .await;
        assert_eq!((status, refused["field"].as_str()), (StatusCode::UNPROCESSABLE_ENTITY, Some(field)), "{refused}");
    }
    let (status, refused) = renew(&app, 1, json!({ "policy": "none" })).await;
    assert_eq!((status, refused["detail"].as_str().unwrap().contains("policy 'none'")), (StatusCode::NOT_FOUND, true));
    let (status, first) = renew(&app, 1, json!({ "policy": policy })).await;
    assert_eq!(status, 200, "{first}");
    assert_eq!(renew(&app, 1, json!({ "policy": policy })).await, (StatusCode::OK, first));
    assert_eq!(renew(&app, 1, json!({ "policy": policy, "window": 5 })).await.0, 409);
    // By one who may not, and by one to whom there is no such session.
    let [owner, reader, stranger] = [("default", "operate"), ("default", "read"), ("other", "operate")];
    let owner = app.key(owner.0, owner.1).await;
    for ((tenant, roles), expected) in [(reader, 403), (stranger, 404)] {
        let key = app.key(tenant, roles).await;
        app.enter(&key).await;
        assert_eq!(renew(&app, 2, json!({ "policy": policy })).await.0, expected);
    }
    app.enter(&owner).await;
    assert_eq!(renew(&app, 2, json!({ "policy": policy })).await.0, 200);
}

/// A policy of a static framework holds for its own history alone.
#[tokio::test(flavor = "multi_thread")]
async fn a_frozen_policy_takes_over_its_own_record_and_no_other() {
    let mut app = App::start().await;
    app.train(&request(3)).await;
    app.open().await;
    observe(&app, 1..=2).await;
    for (history, expected) in [(record(2, 100), 200), (record(1, 100), 422)] {
        let mut frozen = request(3);
        (frozen["problem"]["framework"], frozen["problem"]["history"]) = (json!("static"), json!(history));
        app.train(&frozen).await;
        let number = 1 + session(&app).await["renewals"].as_u64().unwrap() as usize;
        let (status, answer) = renew(&app, number, json!({ "policy": app.policy })).await;
        assert_eq!(status, expected, "{answer}");
    }
    // Its set would not follow.
    let correction = json!({ "correction": 1, "period": 2, "log_return": 0.01, "reason": "revised" });
    let (status, refused) = app.post(&format!("/sessions/{}/corrections", app.session), &correction).await;
    assert_eq!((status, refused["field"].as_str()), (StatusCode::UNPROCESSABLE_ENTITY, Some("period")), "{refused}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_renews_itself_on_what_it_has_seen() {
    let mut app = App::start().await;
    let spec = request(3);
    app.train(&spec).await;
    app.open_with(json!({ "renew": { "every": 2, "window": 9 } })).await;
    assert_eq!(session(&app).await["renew"], json!({ "every": 2, "window": 9 }));
    for (renewals, due) in [(1, 2), (2, 4), (3, 6)] {
        observe(&app, due - 1..=due).await;
        let renewed = until_renewed(&app, renewals).await;
        assert_eq!(renewed["horizon"], due + 3);
        assert_eq!(renewed["renewal"], json!(null));
        let (status, action) = app.action().await;
        assert_eq!(status, 200, "{action}");
        let wealth = number(&renewed["wealth"]);
        assert_eq!(number(&action["allocation"]), advised(&spec, &record(due, 9), &[], wealth));
        assert_eq!(action["sample_size"], 9);
    }
    let audit = app.get(&format!("/audit?object={}", app.session)).await.1;
    let entries = audit["entries"].as_array().unwrap();
    assert_eq!(
        entries.iter().filter(|entry| entry["action"] == "session.renew" && entry["roles"] == "service").count(),
        3
    );
}

/// Sessions that became due while nobody looked are found when the service starts.
#[tokio::test(flavor = "multi_thread")]
async fn a_renewal_goes_on_after_a_stop_between_any_two_steps() {
    let mut app = App::start().await;
    app.train(&request(3)).await;
    app.open_with(json!({ "renew": { "every": 1 } })).await;
    observe(&app, 1..=1).await;
    // At whatever step it is by now.
    app.restart().await;
    until_renewed(&app, 1).await;
    // Trained already, and nobody renewed the session.
    observe(&app, 2..=2).await;
    until_renewed(&app, 2).await;
    app.restart_after(
        "DELETE FROM entries WHERE kind = 'renewal' AND number = 2; DELETE FROM renewals WHERE number = 2;
         UPDATE sessions SET due = 2, room = room - 2;
         UPDATE usage SET bytes = bytes - 3072",
    )
    .await;
    let jobs = app.get("/jobs").await.1["jobs"].as_array().unwrap().len();
    let renewed = until_renewed(&app, 2).await;
    assert_eq!(app.get("/jobs").await.1["jobs"].as_array().unwrap().len(), jobs, "{renewed}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_renewal_that_fails_is_told_of_and_leaves_the_session_as_it_is() {
    let mut app = App::start().await;
    app.train(&request(3)).await;
    app.open_with(json!({ "renew": { "every": 1 } })).await;
    let first = app.policy.clone();
    // The trainer is busy for longer than the test takes.
    let mut busy = request(12);
    busy["design"]["count"] = json!(1500);
    let busy = app.queue(&busy).await;
    app.until(&busy, |job| job["state"] == "running").await;
    observe(&app, 1..=1).await;
    let job = loop {
        let due = session(&app).await["renewal"].clone();
        assert_eq!(due["renewal"], 1);
        if let Some(job) = due["job"].as_str() {
            break job.to_owned();
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    app.cancel(&job).await;
    let due = session(&app).await["renewal"].clone();
    assert_eq!(due, json!({ "renewal": 1, "state": "failed", "job": job, "error": null, "attempts": 1 }));
    let (status, action) = app.action().await;
    assert_eq!(status, 200, "{action}");
    assert_eq!(session(&app).await["policy"], first);
    let mut failed = false;
    for _ in 0..100 {
        let metrics = app.get("/metrics").await.1;
        failed = failed || metrics.as_str().unwrap().contains("ballast_renewals_total{outcome=\"failed\"} 1");
        tokio::time::sleep(Duration::from_millis(if failed { 0 } else { 50 })).await;
    }
    assert!(failed);
    app.cancel(&busy).await;
    // By hand it goes on at once.
    let (status, renewed) = renew(&app, 1, json!({ "policy": first })).await;
    assert_eq!(status, 200, "{renewed}");
    assert_eq!(session(&app).await["renewal"], json!(null));
}

/// The second attempt comes a minute after the first one ended, and no sooner.
#[tokio::test(flavor = "multi_thread")]
async fn a_renewal_that_failed_is_tried_again_after_a_while() {
    let mut app = App::start().await;
    app.train(&request(3)).await;
    app.open_with(json!({ "renew": { "every": 1 } })).await;
    let mut busy = request(12);
    busy["design"]["count"] = json!(1500);
    let busy = app.queue(&busy).await;
    app.until(&busy, |job| job["state"] == "running").await;
    observe(&app, 1..=1).await;
    let training = async || session(&app).await["renewal"]["job"].as_str().map(str::to_owned);
    let job = until("the job of the renewal", training).await;
    app.cancel(&job).await;
    app.cancel(&busy).await;
    app.until(&busy, |job| job["state"] == "cancelled").await;
    app.restart_after("UPDATE jobs SET finished_ms = finished_ms - 30000 WHERE state = 'cancelled'").await;
    // All that are due were looked at when the service started: another session that becomes due now is looked at after them.
    let waiting = app.session.clone();
    app.open_with(json!({ "renew": { "every": 1 } })).await;
    observe(&app, 1..=1).await;
    until_renewed(&app, 1).await;
    app.session = waiting;
    assert_eq!(session(&app).await["renewal"]["attempts"], 1);
    app.restart_after("UPDATE jobs SET finished_ms = finished_ms - 31000 WHERE state = 'cancelled'").await;
    until_renewed(&app, 1).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_renewed_by_itself_is_refused_by_name() {
    let mut app = App::start().await;
    app.train(&request(3)).await;
    let plain = app.policy.clone();
    let mut listed = request(3);
    listed["problem"]["contributions"] = json!([1.0, 2.0, 3.0]);
    app.train(&listed).await;
    for (policy, renew, field) in [
        (&plain, json!({ "every": 0 }), "renew.every"),
        (&plain, json!({ "every": 3 }), "renew.every"),
        (&plain, json!({ "every": 2, "window": 1 }), "renew.window"),
        (&app.policy, json!({ "every": 2 }), "renew"),
    ] {
        let (status, refused) = app.post("/sessions", &json!({ "policy": policy, "renew": renew })).await;
        assert_eq!((status, refused["field"].as_str()), (StatusCode::UNPROCESSABLE_ENTITY, Some(field)), "{refused}");
    }
}

/// The bundled months from the start of `year`, the window before it among them.
fn months(year: u32, window: usize, lived: usize) -> Vec<ActualPeriod> {
    let file = include_str!("../../data/us_market_monthly.csv");
    let rows: Vec<&str> = file.lines().skip(1).collect();
    let first = rows.iter().position(|row| row.starts_with(&format!("{year}-01"))).unwrap();
    let period = |row: &&str| {
        let cells: Vec<f64> = row.split(',').skip(1).map(|cell| cell.parse().unwrap()).collect();
        ActualPeriod { log_return: cells[0].ln_1p(), bank_return: cells[1] }
    };
    rows[first - window..first + lived].iter().map(period).collect()
}

/// Ten years through HTTP, renewed by itself every year, with the rates that the bank paid, and a correction made and undone:
/// at a level of caution that is found anew every year. What was advised and what became of wealth are those of the walk-forward, bit for bit.
#[tokio::test(flavor = "multi_thread")]
async fn ten_years_of_a_live_session_equal_the_backtest() {
    const LIVED: usize = 120;
    let walk = WalkForward {
        window: 36,
        every: 12,
        horizon: 13,
        scale: 1.0,
        caution: CautionLevel::Balanced,
        support: Support::WorstSeen { factor: 2.0 },
        centre: CentreSpecification::Empirical {},
        risk_aversion: 3.0,
        trading_cost: 0.0,
        count: 12,
        seed: 5,
    };
    let (alpha, months) = (0.5, months(1991, walk.window, LIVED));
    let pool = TrainingPool::new(2).unwrap();
    let watch = Watch::unwatched();
    let decided = pool.install(|| walk.decide(&[Strategy::Adaptive { alpha }], &months, &watch, &|| {})).unwrap();
    let lived = &months[walk.window..];
    let account = keep(decided[0].iter().map(|decision| decision.band), lived, 0.0, 100.0);

    let mut app = App::start().await;
    let first = walk.specification(Framework::Adaptive, alpha, &months[..walk.window]);
    app.train(&serde_json::to_value(&first).unwrap()).await;
    app.open_with(json!({ "wealth": 100.0, "renew": { "every": walk.every, "window": walk.window } })).await;
    for (period, (month, decision)) in (1..).zip(lived.iter().zip(&decided[0])) {
        if period > 1 && (period - 1) % walk.every == 0 {
            until_renewed(&app, (period - 1) / walk.every).await;
        }
        let (status, action) = app.action().await;
        assert_eq!(status, 200, "{action}");
        assert_eq!(number(&action["allocation"]), decision.band.low, "period {period}");
        assert_eq!(number(&action["radius"]), decision.radius, "period {period}");
        let right = json!({ "log_return": month.log_return, "rate": month.bank_return, "confirm": true });
        let (status, observed) = app.report(period, right.clone()).await;
        assert_eq!(status, 200, "{observed}");
        assert_eq!(number(&observed["wealth"]), account.wealth[period], "period {period}");
        if period == 30 {
            let wrong = json!({ "log_return": 0.1, "rate": 0.0 });
            for (number, mut correction) in [(1, wrong), (2, right)] {
                (correction["correction"], correction["reason"]) = (json!(number), json!("read wrong"));
                correction["period"] = json!(period);
                let path = format!("/sessions/{}/corrections", app.session);
                let (status, corrected) = app.post(&path, &correction).await;
                assert_eq!(status, 200, "{corrected}");
            }
        }
    }
    assert!(account.allocations.iter().any(|&held| held > 0.0), "nothing is ever held");
    assert_eq!(number(&session(&app).await["wealth"]), *account.wealth.last().unwrap());
}
