//! A report names all its doubts at once and is recorded only with `confirm`; a skipped period is put in, and a wrong one
//! taken out, by a correction. Over either store.

use crate::support::{App, several_assets, specification};
use reqwest::StatusCode;
use serde_json::{Value, json};

const HORIZON: usize = 12;
/// Mean and standard deviation of the record are 0.0055 and 0.0261.
const DEVIATION: f64 = 0.0261;

async fn opened(app: &mut App, periods_per_year: Option<f64>) {
    let mut request = specification(HORIZON);
    if let Some(periods) = periods_per_year {
        request["problem"]["periods_per_year"] = json!(periods);
    }
    request["design"] = json!({ "count": 12 });
    app.train(&request).await;
    app.open().await;
}

async fn recorded(app: &App, period: usize, report: Value) -> Value {
    let (status, observed) = app.report(period, report).await;
    assert_eq!(status, 200, "{observed}");
    observed
}

/// The doubts about a report: the reasons, and the answer.
async fn doubted(app: &App, period: usize, report: Value) -> (Vec<String>, Value) {
    let (status, problem) = app.report(period, report).await;
    assert_eq!((status, &problem["type"]), (StatusCode::CONFLICT, &json!("/problems/unconfirmed")), "{problem}");
    let doubts = problem["doubts"].as_array().expect("doubts");
    let reasons = doubts.iter().map(|doubt| doubt["reason"].as_str().expect("a reason").to_owned()).collect();
    (reasons, problem)
}

async fn session(app: &App) -> Value {
    app.get(&format!("/sessions/{}", app.session)).await.1
}

async fn history(app: &App) -> Value {
    let (status, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
    assert_eq!(status, 200, "{history}");
    history
}

async fn correct(app: &App, number: usize, mut correction: Value) -> (StatusCode, Value) {
    (correction["correction"], correction["reason"]) = (json!(number), json!("a month was skipped"));
    app.post(&format!("/sessions/{}/corrections", app.session), &correction).await
}

/// The session and what it is advised, without what names it and counts its corrections.
async fn standing(app: &App) -> Value {
    let (mut session, (status, mut action)) = (session(app).await, app.action().await);
    assert_eq!(status, 200, "{action}");
    for field in ["session", "created_ms", "corrections"] {
        session[field] = json!(null);
    }
    action["session"] = json!(null);
    json!([session, action])
}

/// Without the bet on its returns, in which the name of a session parts equal returns.
fn without_bet(mut standing: Value) -> Value {
    standing[0]["drift"] = json!(null);
    standing
}

async fn a_skipped_period_is_asked_about_and_reported_as_missing(mut app: App) {
    opened(&mut app, Some(12.0)).await;
    recorded(&app, 1, json!({ "simple_return": 0.01, "date": "2019-05-31" })).await;
    let november = json!({ "simple_return": 0.02, "date": "2019-11-30" });
    let (reasons, problem) = doubted(&app, 2, november.clone()).await;
    assert_eq!(reasons, ["missing_periods"], "{problem}");
    let missing = ["2019-06-30", "2019-07-31", "2019-08-31", "2019-09-30", "2019-10-31"];
    assert_eq!(problem["doubts"][0]["missing"], json!(missing));
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.starts_with("5 periods, which end 2019-06-30 to 2019-10-31, are missing"), "{detail}");
    assert!(detail.contains("report them as missing") && detail.contains("\"confirm\": true"), "{detail}");
    assert_eq!((&problem["field"], &problem["value"]), (&json!("date"), &json!("2019-11-30")));
    assert_eq!(session(&app).await["period"], 2, "nothing is recorded");
    for (period, date) in (2..).zip(missing) {
        recorded(&app, period, json!({ "missing": true, "date": date })).await;
    }
    let first = recorded(&app, 7, november.clone()).await;
    assert_eq!(recorded(&app, 7, november).await, first, "the same again");
    // Half a month early or late is the same month.
    recorded(&app, 8, json!({ "simple_return": 0.0, "date": "2019-12-20" })).await;
    let (reasons, _) = doubted(&app, 9, json!({ "simple_return": 0.0, "date": "2019-12-31" })).await;
    assert_eq!(reasons, ["early_day"]);
    let confirmed = recorded(&app, 9, json!({ "simple_return": 0.0, "date": "2019-12-31", "confirm": true })).await;
    assert_eq!(confirmed["date"], "2019-12-31");
}

async fn one_answer_names_every_doubt(mut app: App) {
    opened(&mut app, Some(12.0)).await;
    let (reasons, problem) = doubted(&app, 1, json!({ "simple_return": 0.21, "date": "2262-12-31" })).await;
    assert_eq!(reasons, ["future_day", "unusual_return"]);
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("2262-12-31 is in the future") && detail.contains("standard deviations"), "{detail}");
    let today = jiff::Timestamp::now().to_zoned(jiff::tz::TimeZone::UTC).date();
    let tomorrow = today.tomorrow().unwrap();
    recorded(&app, 1, json!({ "simple_return": 0.01, "date": tomorrow.to_string() })).await;
    // Without a day it takes the next one due, which is a month ahead.
    let (reasons, problem) = doubted(&app, 2, json!({ "simple_return": 0.01 })).await;
    assert_eq!(reasons, ["future_day"]);
    assert!(problem["detail"].as_str().unwrap().starts_with("No day is given, and the next one due"), "{problem}");
}

async fn a_report_without_a_day_takes_the_next_one_due(mut app: App) {
    opened(&mut app, Some(12.0)).await;
    assert_eq!(session(&app).await["next"], json!(null), "no day is known");
    assert_eq!(recorded(&app, 1, json!({ "simple_return": 0.01, "date": "2019-10-31" })).await["date"], "2019-10-31");
    assert_eq!(recorded(&app, 2, json!({ "simple_return": 0.01 })).await["date"], "2019-11-30");
    let (_, list) = app.get("/sessions").await;
    let (listed, session) = (&list["sessions"][0], session(&app).await);
    assert_eq!([&listed["date"], &session["date"]], [&json!("2019-11-30"); 2]);
    assert_eq!([&listed["next"], &session["next"]], [&json!("2019-12-31"); 2]);
    let (status, refused) = app.report(3, json!({ "simple_return": 0.01, "date": "2019-11-30" })).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("date")), "November is reported");
    app.restart().await;
    let (reread, again) = (self::session(&app).await, recorded(&app, 3, json!({ "simple_return": 0.01 })).await);
    assert_eq!((reread, &again["date"]), (session, &json!("2019-12-31")));
    // Where the policy says no calendar, the days of the session keep one.
    opened(&mut app, None).await;
    for (period, date) in [(1, "2019-01-31"), (2, "2019-02-28")] {
        recorded(&app, period, json!({ "simple_return": 0.01, "date": date })).await;
    }
    let (reasons, problem) = doubted(&app, 3, json!({ "simple_return": 0.01, "date": "2019-05-31" })).await;
    assert_eq!(
        (&reasons[..], &problem["doubts"][0]["missing"]),
        (&["missing_periods".to_owned()][..], &json!(["2019-03-31", "2019-04-30"]))
    );
}

async fn a_return_far_from_the_record_is_doubted_at_any_size(mut app: App) {
    // A bond fund: a hundredth of the record of stocks.
    let mut request = specification(HORIZON);
    for value in request["problem"]["history"].as_array_mut().unwrap() {
        *value = json!(value.as_f64().unwrap() / 10.0);
    }
    request["design"] = json!({ "count": 12 });
    app.train(&request).await;
    app.open().await;
    let mean = 0.00055;
    let (reasons, problem) = doubted(&app, 1, json!({ "log_return": mean + 0.42 * DEVIATION })).await;
    assert_eq!(reasons, ["unusual_return"], "{problem}");
    assert!(problem["rule"].as_str().unwrap().contains("a return of 1.16 % lies 4.3 standard deviations"), "{problem}");
    // More than three deviations, and half as far again as any loss or gain of the record.
    for beyond in [-0.38, 0.38] {
        assert_eq!(doubted(&app, 1, json!({ "log_return": mean + beyond * DEVIATION })).await.0, ["unusual_return"]);
    }
    recorded(&app, 1, json!({ "log_return": mean - 0.29 * DEVIATION })).await;
    let meant = recorded(&app, 2, json!({ "log_return": -0.05, "confirm": true })).await;
    assert_eq!(recorded(&app, 2, json!({ "log_return": -0.05 })).await, meant, "recorded, so nothing to confirm");
}

async fn a_report_that_differs_from_its_peers_is_asked_about(mut app: App) {
    opened(&mut app, Some(12.0)).await;
    let mut sessions = vec![app.session.clone()];
    for _ in 0..4 {
        app.open().await;
        sessions.push(app.session.clone());
    }
    let list = |period: usize, returns: &[f64], date: &str| {
        let report = |(session, simple_return)| json!({ "session": session, "period": period, "simple_return": simple_return, "date": date });
        Value::Array(sessions.iter().zip(returns).map(report).collect())
    };
    let first = list(1, &[0.0167, 0.0167, 0.05, 0.0167, 0.01671], "2019-10-31");
    let (_, answers) = app.post("/observe", &first).await;
    let statuses = |answers: &Value| {
        answers.as_array().unwrap().iter().map(|one| one["status"].as_u64().unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(statuses(&answers), [200, 200, 409, 200, 200], "{answers}");
    let problem = &answers[2]["problem"];
    assert_eq!(problem["doubts"][0]["reason"], "differs_from_peers");
    let sentence = problem["doubts"][0]["sentence"].as_str().unwrap();
    assert_eq!(sentence, "4 of the 5 reports for this policy and day give 1.67 %, but this one gives 5.00 %");
    let (_, again) = app.post("/observe", &first).await;
    assert_eq!(again, answers, "the same list again");
    let mut meant = first;
    meant[2]["confirm"] = json!(true);
    assert_eq!(statuses(&app.post("/observe", &meant).await.1), [200; 5]);
    // Of another day nobody is a peer.
    let mut second = list(2, &[0.01, 0.01, 0.01, 0.01, 0.03], "2019-11-30");
    second[4]["date"] = json!("2019-11-28");
    assert_eq!(statuses(&app.post("/observe", &second).await.1), [200; 5]);
}

/// A session in which a month was skipped and put in stands as one in which it was reported as missing, to the last bit.
async fn a_skipped_period_is_put_in(mut app: App) {
    opened(&mut app, Some(12.0)).await;
    let held = |report: Value| {
        let mut report = report;
        report["executed_allocation"] = json!(0.5);
        report
    };
    let reports = [
        held(json!({ "simple_return": 0.03, "date": "2019-01-31" })),
        json!({ "missing": true, "date": "2019-02-28" }),
        held(json!({ "simple_return": -0.02, "date": "2019-03-31" })),
        held(json!({ "simple_return": 0.01, "date": "2019-04-30", "flow": 5.0 })),
    ];
    let skipping = app.session.clone();
    for (period, report) in [(1, &reports[0]), (2, &reports[2]), (3, &reports[3])] {
        let mut report = report.clone();
        report["confirm"] = json!(true);
        recorded(&app, period, report).await;
    }
    let inserted = json!({ "period": 2, "change": "insert", "missing": true, "date": "2019-02-28" });
    let (status, answer) = correct(&app, 1, inserted.clone()).await;
    assert_eq!(status, 200, "{answer}");
    assert_eq!((&answer["observed"], &answer["period"], &answer["date"]), (&json!(4), &json!(2), &json!("2019-04-30")));
    assert_eq!(correct(&app, 1, inserted).await.1, answer, "the same again");
    let put_in = standing(&app).await;
    let rows = history(&app).await["observations"].clone();
    let periods: Vec<_> =
        rows.as_array().unwrap().iter().map(|row| (&row["period"], &row["reported"]["date"])).collect();
    let dates = ["2019-01-31", "2019-02-28", "2019-03-31", "2019-04-30"].map(|date| json!(date));
    assert_eq!(periods, (1..=4).map(|n| json!(n)).collect::<Vec<_>>().iter().zip(&dates).collect::<Vec<_>>());
    assert_eq!((&rows[1]["log_return"], &rows[1]["corrections"]), (&json!(null), &json!([1])));
    // What was held through it is what January left.
    assert_eq!(rows[1]["now"]["executed_allocation"], rows[0]["holding"]);
    let (_, list) = app.get("/sessions").await;
    assert_eq!(list["sessions"][0]["period"], 5);

    app.open().await;
    recorded(&app, 1, reports[0].clone()).await;
    let mut missing = reports[1].clone();
    missing["executed_allocation"] = rows[0]["holding"].clone();
    recorded(&app, 2, missing).await;
    for (period, report) in [(3, &reports[2]), (4, &reports[3])] {
        recorded(&app, period, report.clone()).await;
    }
    assert_eq!(without_bet(standing(&app).await), without_bet(put_in.clone()));

    app.session = skipping;
    app.restart().await;
    assert_eq!(standing(&app).await, put_in, "read from the store again");
    recorded(&app, 5, json!({ "simple_return": 0.01 })).await;
    // What was sent before it was put in is answered as it was then, under the number that it had.
    let mut march = reports[2].clone();
    march["confirm"] = json!(true);
    assert_eq!(recorded(&app, 2, march).await["period"], 2);
    assert_eq!(app.report(4, json!({ "simple_return": 0.5 })).await.0, 409);
    assert_eq!(session(&app).await["period"], 6);
}

async fn a_wrong_period_is_taken_out(mut app: App) {
    opened(&mut app, Some(12.0)).await;
    let report = |date: &str, simple_return: f64| json!({ "simple_return": simple_return, "date": date, "executed_allocation": 0.4 });
    recorded(&app, 1, report("2019-01-31", 0.01)).await;
    let before = standing(&app).await;
    let wrong = report("2019-02-28", 0.05);
    let observed = recorded(&app, 2, wrong.clone()).await;
    let (status, refused) = correct(&app, 1, json!({ "period": 2, "change": "remove", "missing": true })).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("change")), "{refused}");
    let (status, answer) = correct(&app, 1, json!({ "period": 2, "change": "remove" })).await;
    assert_eq!(
        (status.as_u16(), &answer["observed"], &answer["log_return"]),
        (200, &json!(1), &json!(null)),
        "{answer}"
    );
    assert_eq!(standing(&app).await, before, "as if it had never been");
    app.restart().await;
    assert_eq!(standing(&app).await, before);
    let (_, list) = app.get("/sessions").await;
    assert_eq!((&list["sessions"][0]["period"], &list["sessions"][0]["wealth"]), (&json!(2), &before[0]["wealth"]));
    // The period is observed anew, once.
    let right = recorded(&app, 2, report("2019-02-28", 0.02)).await;
    assert_ne!(right["wealth"], observed["wealth"]);
    assert_eq!(recorded(&app, 2, report("2019-02-28", 0.02)).await, right);
    assert_eq!(app.report(2, wrong).await.0, 409);
    recorded(&app, 3, report("2019-03-31", 0.0)).await;
    // One in the middle: those after it move up.
    assert_eq!(correct(&app, 2, json!({ "period": 2, "change": "remove" })).await.0, 200);
    let rows = history(&app).await["observations"].clone();
    let dates: Vec<_> = rows.as_array().unwrap().iter().map(|row| &row["reported"]["date"]).collect();
    assert_eq!(dates, [&json!("2019-01-31"), &json!("2019-03-31")]);
    assert_eq!((&rows[1]["period"], &session(&app).await["period"]), (&json!(2), &json!(3)));
    for number in [3, 4] {
        assert_eq!(correct(&app, number, json!({ "period": 1, "change": "remove" })).await.0, 200);
    }
    let empty = session(&app).await;
    assert_eq!((&empty["period"], &empty["wealth"], &empty["date"]), (&json!(1), &json!(100.0), &json!(null)));
    assert_eq!(history(&app).await["observations"], json!([]));
    assert_eq!(app.get("/sessions").await.1["sessions"][0]["period"], 1);
}

async fn a_session_at_its_end_takes_no_period_more(mut app: App) {
    let mut request = specification(2);
    request["design"] = json!({ "count": 12 });
    app.train(&request).await;
    app.open().await;
    for period in 1..=2 {
        recorded(&app, period, json!({ "simple_return": 0.01 })).await;
    }
    let (status, refused) = correct(&app, 1, json!({ "period": 1, "change": "insert", "missing": true })).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("change")), "{refused}");
    // One that is taken out at the end makes it go on.
    assert_eq!(correct(&app, 1, json!({ "period": 2, "change": "remove" })).await.0, 200);
    assert_eq!(session(&app).await["state"], "active");
    assert_eq!(app.get("/sessions?state=active&count=total").await.1["total"], 1);
    // Under the next policy, periods by the one before it stay where they are.
    assert_eq!(
        app.post(&format!("/sessions/{}/renewals", app.session), &json!({ "renewal": 1, "policy": app.policy }))
            .await
            .0,
        200
    );
    let (status, refused) = correct(&app, 2, json!({ "period": 1, "change": "remove" })).await;
    assert_eq!((status.as_u16(), &refused["field"]), (422, &json!("period")), "{refused}");
}

async fn a_period_that_is_put_in_makes_a_session_due(mut app: App) {
    let mut request = specification(4);
    request["design"] = json!({ "count": 12 });
    app.train(&request).await;
    app.open_with(json!({ "renew": { "every": 2 } })).await;
    recorded(&app, 1, json!({ "simple_return": 0.01 })).await;
    assert_eq!(app.get("/sessions?state=waiting&count=total").await.1["total"], 0);
    assert_eq!(correct(&app, 1, json!({ "period": 1, "change": "insert", "missing": true })).await.0, 200);
    let renewed = async || (session(&app).await["renewals"] == 1).then_some(());
    crate::support::patience::until("the renewal", renewed).await;
    // The periods by the first policy stay, and the next one is the third.
    assert_eq!(session(&app).await["period"], 3);
    recorded(&app, 3, json!({ "simple_return": 0.01 })).await;
}

async fn periods_of_several_assets_are_put_in_and_taken_out(mut app: App) {
    app.train(&several_assets(6)).await;
    app.open().await;
    let returns = |stocks: f64| json!({ "simple_returns": { "stocks": stocks, "bonds": 0.002, "gold": 0.001 } });
    recorded(&app, 1, returns(0.01)).await;
    let before = standing(&app).await;
    recorded(&app, 2, returns(0.03)).await;
    assert_eq!(correct(&app, 1, json!({ "period": 2, "change": "insert", "missing": true })).await.0, 200);
    let put_in = standing(&app).await;
    let rows = history(&app).await["observations"].clone();
    assert_eq!(rows[1]["assets"]["executed_allocations"], rows[0]["assets"]["holdings"]);
    app.restart().await;
    assert_eq!(standing(&app).await, put_in);
    for number in [2, 3] {
        assert_eq!(correct(&app, number, json!({ "period": 2, "change": "remove" })).await.0, 200);
    }
    let after = standing(&app).await;
    assert_eq!(after, before);
    app.restart().await;
    assert_eq!(standing(&app).await, after);
    recorded(&app, 2, returns(0.03)).await;
}

over_either_store!(
    a_skipped_period_is_asked_about_and_reported_as_missing,
    one_answer_names_every_doubt,
    a_report_without_a_day_takes_the_next_one_due,
    a_return_far_from_the_record_is_doubted_at_any_size,
    a_report_that_differs_from_its_peers_is_asked_about,
    a_skipped_period_is_put_in,
    a_wrong_period_is_taken_out,
    a_session_at_its_end_takes_no_period_more,
    a_period_that_is_put_in_makes_a_session_due,
    periods_of_several_assets_are_put_in_and_taken_out,
);
