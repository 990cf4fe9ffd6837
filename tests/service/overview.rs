//! The list of sessions that an overview is drawn from: each row where its session stands, found and put in order.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use crate::support::patience::within;
use crate::support::{App, execute, postgres, specification};
use ballast::service::process::config::StoreLocation;
use futures_util::{StreamExt, stream};
use reqwest::Method;
use serde_json::{Value, json};

async fn list(app: &App, query: &str) -> Value {
    let (status, page) = app.get(&format!("/sessions?count=care&{query}")).await;
    assert_eq!(status, 200, "{query}: {page}");
    page
}

fn names(page: &Value) -> Vec<&str> {
    page["sessions"].as_array().unwrap().iter().map(|row| row["name"].as_str().unwrap()).collect()
}

/// The names of all pages of two.
async fn walk(app: &App, query: &str) -> Vec<String> {
    let (mut found, mut after) = (Vec::new(), String::new());
    loop {
        let page = list(app, &format!("limit=2&{query}{after}")).await;
        found.extend(names(&page).into_iter().map(str::to_owned));
        match page["next"].as_str() {
            Some(next) => after = format!("&after={next}"),
            None => return found,
        }
    }
}

/// A row says what the session itself and its history say.
async fn in_step(app: &App, row: &Value) {
    let id = row["session"].as_str().unwrap();
    let (_, session) = app.get(&format!("/sessions/{id}")).await;
    for field in
        ["name", "notes", "tags", "policy", "period", "horizon", "state", "wealth", "holding", "date", "created_ms"]
    {
        assert_eq!(row[field], session[field], "{field}: {row} {session}");
    }
    assert_eq!(row["drift"], session["drift"]["level"]);
    assert_eq!(row["state"] == "waiting", !session["renewal"].is_null(), "{row} {session}");
    let (_, history) = app.get(&format!("/sessions/{id}/history")).await;
    let observations = history["observations"].as_array().unwrap();
    let now = |index: usize| {
        let observation = &observations[index];
        if observation["now"].is_null() { &observation["wealth"] } else { &observation["now"]["wealth"] }
            .as_f64()
            .unwrap()
    };
    let change = match observations.len() {
        0 => None,
        1 => Some(now(0) - history["initial_wealth"].as_f64().unwrap()),
        count => Some(now(count - 1) - now(count - 2)),
    };
    assert_eq!(row["wealth_change"].as_f64(), change, "{row} {history}");
    assert_eq!(row["last_report_ms"].is_null(), observations.is_empty(), "{row}");
}

async fn put_right_and_renewed(app: &App, session: &str) {
    for (period, date) in [(1, json!("2020-01-31")), (2, Value::Null)] {
        let report = json!({ "session": session, "period": period, "log_return": 0.02, "executed_allocation": 0.5, "date": date });
        assert_eq!(app.post("/observe", &report).await.0, 200);
        let row = list(app, &format!("search={session}")).await["sessions"][0].clone();
        in_step(app, &row).await;
        assert_eq!((&row["log_return"], &row["log_returns"]), (&json!(0.02), &Value::Null));
    }
    let right = json!({ "correction": 1, "period": 1, "log_return": 0.05, "executed_allocation": 0.5, "reason": "revised",
                        "date": "2020-02-01" });
    assert_eq!(app.post(&format!("/sessions/{session}/corrections"), &right).await.0, 200);
    let row = list(app, &format!("search={session}")).await["sessions"][0].clone();
    in_step(app, &row).await;
    assert_eq!(
        row["log_return"],
        Value::Null,
        "the answer to a correction of an earlier period does not tell the last"
    );
    let renewal = json!({ "renewal": 1, "policy": app.policy });
    assert_eq!(app.post(&format!("/sessions/{session}/renewals"), &renewal).await.0, 200);
    let row = list(app, &format!("search={session}")).await["sessions"][0].clone();
    in_step(app, &row).await;
    assert_eq!((&row["date"], &row["period"], &row["horizon"]), (&json!("2020-03-01"), &json!(3), &json!(5)));
}

async fn story(mut app: App) {
    let mut request = specification(3);
    request["problem"]["periods_per_year"] = json!(12);
    app.train(&request).await;
    assert_eq!(
        list(&app, "").await,
        json!({ "sessions": [], "damaged": [], "total": 0, "next": null,
            "care": { "sessions": 0, "any": 0, "overdue": 0, "renewal": 0, "alarm": 0, "ending": 0 } })
    );
    let path = format!("/policies/{}", app.policy);
    app.send(Method::PATCH, &path, Some(&json!({ "name": "World" }))).await;
    let mut ids = Vec::new();
    for (name, tags, wealth) in [
        ("beta", json!(["x"]), 300.0),
        ("Alpha", json!(["x", "50%"]), 100.0),
        ("gamma_1", json!([]), 200.0),
        ("ÉTÉ", json!(["X"]), 200.0),
        ("", json!(["x y"]), 50.0),
    ] {
        app.open_with(json!({ "name": name, "tags": tags, "wealth": wealth })).await;
        ids.push(app.session.clone());
    }
    let all = list(&app, "").await;
    assert_eq!((names(&all), &all["total"]), (vec!["", "ÉTÉ", "gamma_1", "Alpha", "beta"], &json!(5)));
    for row in all["sessions"].as_array().unwrap() {
        in_step(&app, row).await;
        assert_eq!((&row["policy_name"], &row["periods_per_year"]), (&json!("World"), &json!(12.0)), "{row}");
    }
    put_right_and_renewed(&app, &ids[1]).await;
    for period in 1..=3 {
        assert_eq!(
            app.post("/observe", &json!({ "session": ids[0], "period": period, "log_return": 0.01 })).await.0,
            200
        );
    }
    // Of several reports in one millisecond the order would be that of opening.
    tokio::time::sleep(std::time::Duration::from_millis(5)).await;
    assert_eq!(app.post("/observe", &json!({ "session": ids[3], "period": 1, "log_return": 0.0 })).await.0, 200);

    for (query, expected) in [
        ("sort=created", vec!["beta", "Alpha", "gamma_1", "ÉTÉ", ""]),
        ("sort=name", vec!["", "Alpha", "beta", "gamma_1", "ÉTÉ"]),
        ("sort=-name", vec!["ÉTÉ", "gamma_1", "beta", "Alpha", ""]),
        ("sort=wealth", vec!["", "Alpha", "gamma_1", "ÉTÉ", "beta"]),
        ("sort=-wealth", vec!["beta", "ÉTÉ", "gamma_1", "Alpha", ""]),
        ("sort=-last_report", vec!["ÉTÉ", "beta", "Alpha", "", "gamma_1"]),
        ("search=ALPHA", vec!["Alpha"]),
        ("search=%C3%A9t", vec!["ÉTÉ"]),
        ("search=gamma_1", vec!["gamma_1"]),
        ("search=50%25", vec!["Alpha"]),
        ("search=x%20y", vec![""]),
        ("search=wOrL&sort=name&tag=x", vec!["Alpha", "beta"]),
        ("tag=X", vec!["ÉTÉ"]),
        ("tag=x%20y", vec![""]),
        ("state=completed", vec!["beta"]),
        ("state=active&sort=name", vec!["", "Alpha", "gamma_1", "ÉTÉ"]),
        ("state=waiting", vec![]),
        ("search=nothing", vec![]),
        ("search=%27%22%5C", vec![]),
    ] {
        assert_eq!(walk(&app, query).await, expected, "{query}");
        let page = list(&app, &format!("limit=1&{query}")).await;
        assert_eq!(page["total"], json!(expected.len()), "{query}");
    }
    assert_eq!(list(&app, &format!("search={}", app.policy)).await["total"], 5);
    a_page_goes_on_where_it_was(&app, &ids).await;
    a_session_that_is_due(&mut app).await;
}

/// Each session that needs care is counted by its reasons and found by each of them, and its row tells them.
async fn who_needs_care(mut app: App, database: Option<&str>) {
    let mut request = specification(3);
    request["problem"]["periods_per_year"] = json!(12);
    app.train(&request).await;
    let mut ids = Vec::new();
    for name in ["late", "in time", "undated", "alarmed", "stuck", "ended", "last"] {
        app.open_with(json!({ "name": name, "tags": [if name == "late" { "x" } else { "y" }] })).await;
        ids.push(app.session.clone());
    }
    let report = async |session: &str, period: usize, date: Value| {
        let report = json!({ "session": session, "period": period, "log_return": 0.01, "date": date });
        assert_eq!(app.post("/observe", &report).await.0, 200);
    };
    let today = jiff::Timestamp::now().to_zoned(jiff::tz::TimeZone::UTC).date();
    report(&ids[0], 1, json!("2020-01-31")).await;
    report(&ids[1], 1, json!(today.to_string())).await;
    for session in &ids[3..5] {
        report(session, 1, Value::Null).await;
    }
    for period in 1..=3 {
        report(&ids[5], period, json!(format!("2020-0{period}-28"))).await;
    }
    for _ in 1..=2 {
        let (_, shown) = app.get(&format!("/sessions/{}", ids[6])).await;
        report(&ids[6], shown["period"].as_u64().unwrap() as usize, Value::Null).await;
    }
    // An alarm and a renewal that waits take long to come about: they are written as they would stand.
    for session in [&ids[3], &ids[5]] {
        app.retell(session, database, |answer| answer.replace(r#""level":"none""#, r#""level":"alarm""#)).await;
    }
    let stuck = "UPDATE sessions SET due = 1 WHERE session = (SELECT object FROM labels WHERE name = 'stuck')";
    match database {
        None => execute(app.folder(), stuck).await,
        Some(url) => assert!(postgres::execute(url, stuck).await > 0),
    }
    let page = list(&app, "sort=name").await;
    let counts = |[sessions, any, overdue, renewal, alarm, ending]: [usize; 6]| json!({ "sessions": sessions, "any": any, "overdue": overdue, "renewal": renewal, "alarm": alarm, "ending": ending });
    let all = counts([7, 5, 1, 1, 1, 2]);
    assert_eq!(page["care"], all);
    let why = |row: &Value| (row["name"].as_str().unwrap().to_owned(), row["care"].clone(), row["next"].clone());
    let found: Vec<_> = page["sessions"].as_array().unwrap().iter().map(why).collect();
    let of = |name: &str| found.iter().find(|(other, ..)| other == name).unwrap();
    assert_eq!((&of("late").1, &of("late").2), (&json!(["overdue"]), &json!("2020-02-29")));
    assert_eq!((&of("alarmed").1, &of("stuck").1), (&json!(["alarm"]), &json!(["renewal"])));
    assert_eq!((&of("ended").1, &of("ended").2), (&json!(["ending"]), &Value::Null));
    assert_eq!(of("last").1, json!(["ending"]));
    assert_eq!((&of("in time").1, &of("undated").1), (&json!([]), &json!([])));
    for (query, expected, care) in [
        ("state=care&sort=name", vec!["alarmed", "ended", "last", "late", "stuck"], all.clone()),
        ("state=overdue", vec!["late"], all.clone()),
        ("state=renewal", vec!["stuck"], all.clone()),
        ("state=alarm", vec!["alarmed"], all.clone()),
        ("state=ending&sort=name", vec!["ended", "last"], all.clone()),
        ("state=care&tag=x", vec!["late"], counts([1, 1, 1, 0, 0, 0])),
        ("search=stuck", vec!["stuck"], counts([1, 1, 0, 1, 0, 0])),
    ] {
        let page = list(&app, query).await;
        assert_eq!(
            (names(&page), &page["total"], &page["care"]),
            (expected.clone(), &json!(expected.len()), &care),
            "{query}"
        );
    }
    let page = list(&app, "state=care&sort=name&limit=2").await;
    let next = list(&app, &format!("state=care&sort=name&limit=2&after={}", page["next"].as_str().unwrap())).await;
    assert_eq!((names(&next), &next["care"]), (vec!["last", "late"], &all));
}

/// A session whose wealth changes between two pages changes no other's place.
async fn a_page_goes_on_where_it_was(app: &App, ids: &[String]) {
    let first = list(app, "sort=-wealth&limit=2").await;
    assert_eq!(names(&first), ["beta", "ÉTÉ"]);
    let rich = json!({ "session": ids[3], "period": 2, "log_return": 0.0, "wealth": 1000.0 });
    assert_eq!(app.post("/observe", &rich).await.0, 200);
    let second = list(app, &format!("sort=-wealth&limit=9&after={}", first["next"].as_str().unwrap())).await;
    assert_eq!(names(&second), ["gamma_1", "Alpha", ""]);
    let (status, problem) = app.get(&format!("/sessions?sort=name&after={}", first["next"].as_str().unwrap())).await;
    assert_eq!((status.as_u16(), &problem["field"]), (400, &json!("after")));
}

async fn a_session_that_is_due(app: &mut App) {
    app.open_with(json!({ "name": "renewing", "renew": { "every": 1 } })).await;
    assert_eq!(list(app, "state=waiting").await["total"], 0);
    // A training under way keeps it due, however quick the machine is: this one cannot be trained.
    assert_eq!(app.post("/observe", &json!({ "session": app.session, "period": 1, "log_return": 0.01 })).await.0, 200);
    let due = list(app, "search=renewing").await["sessions"][0].clone();
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    // It may be renewed between the two.
    assert!(due["state"] == "waiting" || session["renewals"] == json!(1), "{due} {session}");
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_are_found_and_in_order_over_a_folder() {
    story(App::start().await).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_are_found_and_in_order_over_a_database() {
    let Some(app) = App::over_a_database().await else { return };
    story(app).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn who_needs_care_is_counted_and_found_over_a_folder() {
    who_needs_care(App::start().await, None).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn who_needs_care_is_counted_and_found_over_a_database() {
    let Some(url) = postgres::database().await else { return };
    let location = StoreLocation::Postgres(url.parse().unwrap());
    who_needs_care(App::configured(|config| config.store = location).await, Some(&url)).await;
}

#[tokio::test]
async fn what_cannot_be_asked_is_named() {
    let app = App::start().await;
    let long = format!("search={}", "x".repeat(101));
    let mut fields = BTreeSet::new();
    for (query, field) in [
        (long.as_str(), "search"),
        ("state=gone", "state"),
        ("sort=age", "sort"),
        ("sort=--name", "sort"),
        ("limit=1001", "limit"),
        ("after=7", "after"),
        ("after=ca.1.", "after"),
        ("sort=name&after=na.1.zz", "after"),
        ("sort=name&after=na.1.%C3%A9", "after"),
        ("sort=wealth&after=wa.1.7ff8000000000000", "after"),
    ] {
        let (status, problem) = app.get(&format!("/sessions?{query}")).await;
        assert_eq!((status.as_u16(), problem["field"].as_str()), (400, Some(field)), "{query}: {problem}");
        fields.insert(field);
    }
    assert_eq!(fields.len(), 5);
    assert_eq!(list(&app, "search=&tag=").await["total"], 0);
}

const SESSIONS: usize = 10_000;
/// Every hundredth has reported a period, of long ago.
const LATE: usize = 100;
/// Limit on the time of an overview of so many sessions.
const OVERVIEW: Duration = Duration::from_millis(300);

/// Ten thousand sessions with a name and a tag each.
#[tokio::test(flavor = "multi_thread")]
async fn ten_thousand_sessions_are_listed_searched_and_put_in_order_quickly() {
    let mut app = App::start().await;
    // Not in their last period, where each would need care.
    let mut request = specification(3);
    request["problem"]["periods_per_year"] = json!(12);
    app.train(&request).await;
    let numbers = stream::iter(1..=SESSIONS);
    let opened: Vec<Value> = numbers
        .map(async |number| {
            let wealth = 100.0 + (number % 997) as f64;
            let labels =
                json!({ "policy": app.policy, "name": format!("Client {number}"), "tags": ["x"], "wealth": wealth });
            app.post("/sessions", &labels).await.1["session"].clone()
        })
        .buffered(32)
        .collect()
        .await;
    for session in opened.iter().step_by(SESSIONS / LATE) {
        let report =
            json!({ "session": session, "period": 1, "log_return": 0.01, "date": "2020-01-31", "confirm": true });
        let (status, answer) = app.post("/observe", &report).await;
        assert_eq!(status, 200, "{answer}");
    }
    for (query, total) in [
        ("limit=50", SESSIONS),
        ("limit=1000", SESSIONS),
        ("sort=name&limit=1000", SESSIONS),
        ("sort=-wealth&limit=1000", SESSIONS),
        ("sort=-last_report&limit=1000", SESSIONS),
        ("search=client%2099&sort=-wealth", 111),
        ("tag=x&state=active&sort=wealth", SESSIONS),
        ("state=waiting", 0),
        ("state=care", LATE),
        ("state=overdue&sort=name", LATE),
        ("state=alarm&search=client", 0),
    ] {
        let url = format!("{}/sessions?count=care&{query}", app.url);
        let mut quickest = Duration::MAX;
        for _ in 0..5 {
            let started = Instant::now();
            let page: Value = app.client.get(&url).send().await.unwrap().json().await.unwrap();
            quickest = quickest.min(started.elapsed());
            assert_eq!(page["total"], json!(total), "{query}");
            let all = if query.starts_with("search") { total } else { SESSIONS };
            assert_eq!(page["care"]["sessions"], json!(all), "{query}");
        }
        println!("{query}: {quickest:?} of {SESSIONS} sessions");
        assert!(quickest < within(OVERVIEW), "{query}: {quickest:?}");
    }
}
