//! Reports of more than a return, and corrections: a session is what its reports as they stand make
//! of it, whatever was reported first.

use crate::support::values::number;
use crate::support::{App, specification};
use reqwest::StatusCode;
use serde_json::{Value, json};

const HORIZON: usize = 4;
/// The rate that the policies here were trained with.
const RATE: f64 = 0.002;

async fn opened() -> App {
    let mut app = App::start().await;
    let mut request = specification(HORIZON);
    request["problem"]["rate_per_step"] = json!(RATE);
    app.train(&request).await;
    app.open().await;
    app
}

/// Corrects the session; `correction` says everything but its number and the reason.
async fn correct(app: &App, number: usize, mut correction: Value) -> (StatusCode, Value) {
    (correction["correction"], correction["reason"]) = (json!(number), json!("the index was revised"));
    app.post(&format!("/sessions/{}/corrections", app.session), &correction).await
}

async fn report_all(app: &App, reports: &[Value]) {
    for (index, report) in reports.iter().enumerate() {
        let (status, observed) = app.report(index + 1, report.clone()).await;
        assert_eq!(status, 200, "{observed}");
    }
}

/// The session and what it is advised, without names and times.
async fn standing(app: &App) -> Value {
    let (_, mut session) = app.get(&format!("/sessions/{}", app.session)).await;
    let (status, mut action) = app.action().await;
    if status == 200 {
        action["session"] = json!(null);
    } else {
        action = json!(status.as_u16());
    }
    for field in ["session", "created_ms", "corrections"] {
        session[field] = json!(null);
    }
    json!({ "session": session, "action": action })
}

/// Without the bet on its returns, in which the name of a session parts equal returns.
fn without_bet(mut standing: Value) -> Value {
    standing["session"]["drift"] = json!(null);
    standing
}

#[tokio::test(flavor = "multi_thread")]
async fn a_corrected_session_is_one_that_was_reported_right() {
    let mut app = opened().await;
    let wrong = [
        json!({ "price": 102.0, "previous_price": 100.0, "executed_allocation": 0.4 }),
        json!({ "price": 10.3, "executed_allocation": 0.5, "date": "2020-02-28", "confirm": true }),
        json!({ "price": 104.0, "executed_allocation": 0.6, "confirm": true }),
    ];
    let at_start = standing(&app).await;
    app.restart().await;
    assert_eq!(standing(&app).await, at_start, "replayed before its first period");
    let at_start = at_start["action"]["radius"].clone();
    report_all(&app, &wrong).await;
    let before = standing(&app).await;
    // The price of the second period: with it change the returns of the second and of the third.
    let mut right = json!({ "price": 103.0, "executed_allocation": 0.5 });
    let mut correction = right.clone();
    correction["period"] = json!(2);
    let (status, corrected) = correct(&app, 1, correction).await;
    assert_eq!(status, 200, "{corrected}");
    assert_eq!(number(&corrected["log_return"]), (103.0_f64 / 102.0).ln());
    let apply_correction = standing(&app).await;
    assert_ne!(apply_correction["action"]["radius"], before["action"]["radius"]);
    assert_eq!(corrected["wealth"], apply_correction["session"]["wealth"]);
    assert_eq!(corrected["radius"], apply_correction["action"]["radius"]);
    app.restart().await;
    assert_eq!(standing(&app).await, apply_correction, "replayed");
    let (_, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
    assert_eq!(history["initial_radius"], at_start);
    let (second, third) = (&history["observations"][1], &history["observations"][2]);
    assert_eq!((&second["reported"]["price"], &second["now"]["reported"]["price"]), (&json!(10.3), &json!(103.0)));
    assert_eq!(number(&second["log_return"]), (10.3_f64 / 102.0).ln());
    assert_eq!(second["now"]["reported"]["date"], "2020-02-28", "what no correction names stays");
    assert_eq!((&third["now"]["reported"], &third["reported"]["price"]), (&json!(null), &json!(104.0)));
    assert_eq!(third["now"]["wealth"], apply_correction["session"]["wealth"]);
    assert_eq!(third["wealth"], before["session"]["wealth"]);
    assert_eq!(history["observations"][0].get("now"), None);
    assert_eq!(history["corrections"][0]["reason"], "the index was revised");

    app.open().await;
    right["date"] = json!("2020-02-28");
    report_all(&app, &[wrong[0].clone(), right, wrong[2].clone()]).await;
    assert_eq!(without_bet(standing(&app).await), without_bet(apply_correction), "as it was from the start");
    let (_, uncorrected) = app.get(&format!("/sessions/{}/history", app.session)).await;
    for period in [1, 2] {
        let now = &history["observations"][period]["now"];
        for field in ["log_return", "wealth", "holding", "radius", "advised_allocation"] {
            assert_eq!(now[field], uncorrected["observations"][period][field], "{field} of period {}", period + 1);
        }
    }
}

/// A random session against a formula of its own: wealth and the sorted record, after each of many observations and
/// corrections, in memory and replayed.
#[tokio::test(flavor = "multi_thread")]
async fn at_every_step_a_session_is_what_its_reports_as_they_stand_say() {
    let mut app = opened().await;
    let mut drawn: usize = 0;
    let mut uniform = |low: f64, high: f64| {
        drawn += 1;
        low + (high - low) * (drawn * 7919 % 10_007) as f64 / 10_007.0
    };
    for _ in 0..3 {
        app.open().await;
        let mut standing_reports: Vec<Value> = Vec::new();
        let mut corrections = 0;
        for step in 0..12 {
            let mut report = json!({ "executed_allocation": uniform(0.0, 1.0), "confirm": true });
            match step % 4 {
                0 => report["missing"] = json!(true),
                1 => report["simple_return"] = json!(uniform(-0.1, 0.1)),
                _ => report["log_return"] = json!(uniform(-0.1, 0.1)),
            }
            if step % 3 == 0 {
                (report["rate"], report["flow"]) = (json!(uniform(-0.01, 0.02)), json!(uniform(-5.0, 9.0)));
            }
            if step % 3 == 0 && standing_reports.len() < HORIZON {
                let answer = app.report(standing_reports.len() + 1, report.clone()).await;
                assert_eq!(answer.0, 200, "{}", answer.1);
                standing_reports.push(report);
            } else {
                let period = step % standing_reports.len();
                let mut correction = report.clone();
                correction["period"] = json!(period + 1);
                corrections += 1;
                let answer = correct(&app, corrections, correction).await;
                assert_eq!(answer.0, 200, "{}", answer.1);
                standing_reports[period] = report;
            }
            let now = standing(&app).await;
            let (wealth, learned) = expected(&standing_reports);
            let found = number(&now["session"]["wealth"]);
            assert!((found / wealth - 1.0).abs() < 1e-14, "{found} for {wealth}");
            assert_eq!(now["session"]["sample_size"], json!(10 + learned));
            app.restart().await;
            assert_eq!(standing(&app).await, now, "replayed at step {step}");
        }
        assert_eq!((standing_reports.len(), corrections), (4, 8));
    }
}

/// x' = x ((1-a)(1+r) + a e^z) + flow from 100 on, and the number of returns learned.
fn expected(reports: &[Value]) -> (f64, usize) {
    reports.iter().fold((100.0, 0), |(wealth, learned), report| {
        let grown = match (report["log_return"].as_f64(), report["simple_return"].as_f64()) {
            (Some(log_return), _) => log_return.exp(),
            (_, Some(simple_return)) => 1.0 + simple_return,
            _ => 1.0,
        };
        let (held, rate) = (number(&report["executed_allocation"]), report["rate"].as_f64().unwrap_or(RATE));
        let flow = report["flow"].as_f64().unwrap_or(0.0);
        let is_missing = report["missing"] == json!(true);
        (wealth * ((1.0 - held) * (1.0 + rate) + held * grown) + flow, learned + usize::from(!is_missing))
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn a_correction_is_made_once_and_in_its_turn() {
    let app = opened().await;
    let apply_correction = json!({ "period": 1, "log_return": 0.02 });
    let (status, refused) = correct(&app, 1, apply_correction.clone()).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("period")), "none was observed: {refused}");
    report_all(&app, &[json!({ "log_return": 0.01, "date": "2008-01-31" }), json!({ "log_return": 0.015 })]).await;
    let first = correct(&app, 1, apply_correction.clone()).await;
    assert_eq!(first.0, 200, "{}", first.1);
    assert_eq!(correct(&app, 1, apply_correction.clone()).await, first);
    for (number, correction, status, field) in [
        (1, json!({ "period": 1, "log_return": 0.03 }), 409, "correction"),
        (1, json!({ "period": 2, "log_return": 0.02 }), 409, "correction"),
        (3, apply_correction.clone(), 409, "correction"),
        (0, apply_correction.clone(), 422, "correction"),
        (2, json!({ "period": 3, "log_return": 0.02 }), 422, "period"),
        (2, json!({ "period": 0, "log_return": 0.02 }), 422, "period"),
        (2, json!({ "period": 1 }), 422, "log_return"),
        (2, json!({ "period": 1, "price": 3.0 }), 422, "previous_price"),
        (2, json!({ "period": 1, "log_return": 0.02, "flow": -101.0 }), 422, "flow"),
        (2, json!({ "period": 1, "log_return": 0.02, "price_now": 3.0 }), 422, "price_now"),
        (2, json!({ "period": 2, "log_return": 0.02, "date": "2008-01-30" }), 422, "date"),
        (2, json!({ "period": 2, "log_return": 0.02, "date": "2008-02-29" }), 200, ""),
        (3, json!({ "period": 1, "log_return": 0.02, "date": "2008-02-29" }), 422, "date"),
    ] {
        let (answered, answer) = correct(&app, number, correction.clone()).await;
        assert_eq!(answered.as_u16(), status, "{correction}: {answer}");
        assert!(status == 200 || answer["field"] == field, "{correction}: {answer}");
    }
    // What was put right in a later period is said to be of that period.
    let (_, refused) = correct(&app, 3, json!({ "period": 1, "log_return": 0.02, "date": "2008-02-29" })).await;
    assert!(
        refused["rule"].as_str().unwrap().starts_with("in period 2, after the correction of period 1"),
        "{refused}"
    );
    for reason in ["", "  ", "a\u{1}b", &"x".repeat(201)] {
        let body = json!({ "correction": 3, "period": 1, "log_return": 0.02, "reason": reason });
        let (status, refused) = app.post(&format!("/sessions/{}/corrections", app.session), &body).await;
        assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("reason")));
    }
    // A session that is over can be put right as well, and a report that was put right is still repeated.
    report_all(&app, &[json!({ "log_return": 0.01, "date": "2008-01-31" })]).await;
    for period in 3..=HORIZON {
        assert_eq!(app.observe(period, 0.01).await.0, 200);
    }
    assert_eq!(correct(&app, 3, json!({ "period": 4, "log_return": 0.02 })).await.0, 200);
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    assert_eq!((&session["state"], &session["corrections"]), (&json!("completed"), &json!(3)));
}

#[tokio::test(flavor = "multi_thread")]
async fn dates_follow_each_other_and_are_shown() {
    let app = opened().await;
    for (period, report, field) in [
        (1, json!({ "log_return": 0.01, "date": "2008-02-30" }), Some("date")),
        (1, json!({ "log_return": 0.01, "date": "31.01.2008" }), Some("date")),
        (1, json!({ "log_return": 0.01, "date": "2008-01-31" }), None),
        (2, json!({ "log_return": 0.01, "date": "2008-01-31" }), Some("date")),
        (2, json!({ "log_return": 0.01 }), None),
        (3, json!({ "log_return": 0.01, "date": "2007-12-31" }), Some("date")),
        (3, json!({ "log_return": 0.01, "date": "2008-03-31" }), None),
    ] {
        let (status, answer) = app.report(period, report.clone()).await;
        match field {
            None => assert_eq!(status, 200, "{report}: {answer}"),
            Some(field) => assert_eq!((status.as_u16(), &answer["field"]), (422, &json!(field)), "{report}: {answer}"),
        }
    }
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    assert_eq!(session["date"], "2008-03-31");
    let (_, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
    let dates: Vec<_> = history["observations"].as_array().unwrap().iter().map(|o| &o["reported"]["date"]).collect();
    assert_eq!(dates, [&json!("2008-01-31"), &json!(null), &json!("2008-03-31")]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_return_that_is_most_likely_a_slip_is_asked_about() {
    let app = opened().await;
    // The record deviates by 2.6 % from 0.5 %, and its best return is 4.5 %: a return is doubted beyond 0.5 % + 3 x 2.6 %.
    for (report, field, percent) in [
        (json!({ "simple_return": -0.3 }), "simple_return", "-30.00 %"),
        (json!({ "simple_return": 0.1 }), "simple_return", "10.00 %"),
        (json!({ "log_return": 1.2 }), "log_return", "232.01 %"),
        (json!({ "price": 10.2, "previous_price": 100.0 }), "price", "-89.80 %"),
    ] {
        let (status, refused) = app.report(1, report).await;
        let found = (status.as_u16(), &refused["type"], &refused["field"]);
        assert_eq!(found, (409, &json!("/problems/unconfirmed"), &json!(field)), "{refused}");
        // As it was reported, e^1.2 - 1, and 10.2 over 100 less 1.
        assert!(refused["rule"].as_str().unwrap().contains(&format!("a return of {percent} lies")), "{refused}");
    }
    assert_eq!(app.report(1, json!({ "simple_return": 0.07 })).await.0, 200, "within three deviations");
    let slip = json!({ "period": 1, "simple_return": 1.2 });
    assert_eq!(correct(&app, 1, slip.clone()).await.1["type"], "/problems/unconfirmed");
    let mut meant = slip;
    meant["confirm"] = json!(true);
    assert_eq!(correct(&app, 1, meant).await.0, 200);
}

/// The return of a corrected price may be usual, and the one after it not.
#[tokio::test(flavor = "multi_thread")]
async fn a_price_put_right_is_asked_about_where_the_next_return_becomes_unusual() {
    let app = opened().await;
    report_all(&app, &[json!({ "price": 102.0, "previous_price": 100.0 }), json!({ "price": 103.0 })]).await;
    let before = standing(&app).await;
    let slip = json!({ "period": 1, "price": 1.02, "previous_price": 1.0 });
    let (status, refused) = correct(&app, 1, slip).await;
    assert_eq!((status.as_u16(), &refused["type"]), (409, &json!("/problems/unconfirmed")), "{refused}");
    let sentence = refused["doubts"][0]["sentence"].as_str().unwrap();
    assert!(sentence.starts_with("in period 2, after the correction of period 1"), "{refused}");
    assert_eq!(standing(&app).await, before);
    let meant = json!({ "period": 1, "price": 1.02, "previous_price": 1.0, "confirm": true });
    assert_eq!(correct(&app, 1, meant).await.0, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_missing_period_passes_and_teaches_nothing() {
    let app = opened().await;
    let (_, before) = app.action().await;
    for both in [json!({ "missing": true, "log_return": 0.01 }), json!({ "missing": true, "price": 3.0 })] {
        let (status, refused) = app.report(1, both).await;
        assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("missing")), "{refused}");
    }
    let (status, observed) = app.report(1, json!({ "missing": true, "executed_allocation": 0.25 })).await;
    assert_eq!((status.as_u16(), &observed["log_return"]), (200, &json!(null)), "{observed}");
    assert_eq!(observed["radius"], before["radius"]);
    assert_eq!(observed["sample_size"], before["sample_size"]);
    assert!((number(&observed["wealth"]) - 100.0 * (0.75 * (1.0 + RATE) + 0.25)).abs() < 1e-12);
    let (status, action) = app.action().await;
    assert_eq!((status.as_u16(), &action["period"], &action["radius"]), (200, &json!(2), &before["radius"]));
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_bank_paid_and_what_was_added_count_in_their_period_alone() {
    let app = opened().await;
    let (_, first) =
        app.report(1, json!({ "log_return": 0.03, "executed_allocation": 0.5, "rate": 0.01, "flow": -20.0 })).await;
    let grown = 100.0 * (0.5 * 1.01 + 0.5 * 0.03_f64.exp());
    assert!((number(&first["wealth"]) - (grown - 20.0)).abs() < 1e-12, "{first}");
    let held = 100.0 * 0.5 * 0.03_f64.exp() / (grown - 20.0);
    assert!((number(&first["holding"]) - held).abs() < 1e-14, "money leaves the bank: {first}");
    let (_, second) = app.report(2, json!({ "log_return": 0.0, "executed_allocation": 0.0 })).await;
    assert!((number(&second["wealth"]) / number(&first["wealth"]) - 1.0 - RATE).abs() < 1e-14);
    let (status, refused) = app.report(3, json!({ "log_return": 0.0, "flow": -90.0 })).await;
    assert_eq!((status.as_u16(), &refused["field"], number(&refused["value"])), (422, &json!("flow"), -90.0));
    for (field, value) in [("rate", 0.6), ("rate", -0.6), ("flow", 2e15)] {
        let (status, refused) = app.report(3, json!({ "log_return": 0.0, field: value })).await;
        assert_eq!((status.as_u16(), &refused["field"]), (422, &json!(field)), "{refused}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_puts_right_what_is_not_his() {
    let mut app = opened().await;
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    let (stranger, reader) = (app.key("south", "read,operate").await, app.key("default", "read").await);
    // The key made last: once it is known, all are.
    let owner = app.key("default", "read,operate").await;
    app.enter(&owner).await;
    let apply_correction = json!({ "period": 1, "log_return": 0.02 });
    for (key, status) in [(&stranger, 404), (&reader, 403), (&owner, 200)] {
        app.hold(key);
        assert_eq!(correct(&app, 1, apply_correction.clone()).await.0.as_u16(), status);
    }
}

/// A report whose answer was lost may be sent again after another client removed a period. It must not count twice.
#[tokio::test(flavor = "multi_thread")]
async fn a_report_sent_again_after_a_removal_is_doubted() {
    let app = opened().await;
    let reports = [json!({ "log_return": 0.01 }), json!({ "log_return": 0.02 })];
    report_all(&app, &reports).await;
    assert_eq!(correct(&app, 1, json!({ "period": 1, "change": "remove" })).await.0, 200);
    let (status, problem) = app.report(2, reports[1].clone()).await;
    assert_eq!((status.as_u16(), &problem["doubts"][0]["reason"]), (409, &json!("repeated")), "{problem}");
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    assert_eq!(session["period"], 2);
    // It may be meant, and another report is a new one.
    assert_eq!(app.report(2, json!({ "log_return": 0.02, "confirm": true })).await.0, 200);
    assert_eq!(app.report(3, json!({ "log_return": 0.02 })).await.0, 200);
    assert_eq!(correct(&app, 2, json!({ "period": 3, "change": "remove" })).await.0, 200);
    // What was removed itself is new again.
    assert_eq!(app.report(3, json!({ "log_return": 0.02 })).await.0, 200);
}
