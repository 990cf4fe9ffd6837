//! The calendar of due reports, read as RFC 5545 says.

use std::collections::BTreeMap;

use crate::support::{App, specification};
use reqwest::header::CONTENT_TYPE;
use serde_json::json;

/// The properties of each event, in order.
async fn events(app: &App) -> Vec<BTreeMap<String, String>> {
    let answer = app.client.get(format!("{}/reports.ics", app.url)).send().await.unwrap();
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()[CONTENT_TYPE], "text/calendar; charset=utf-8");
    let text = answer.text().await.unwrap();
    assert!(text.split_terminator("\r\n").all(|line| line.len() <= 75 && !line.contains(['\r', '\n'])), "{text}");
    let whole = text.replace("\r\n ", "");
    let begin = "BEGIN:VCALENDAR\r\nVERSION:2.0\r\nPRODID:-//Ballast//Reports//EN\r\n";
    let inside = whole.strip_prefix(begin).and_then(|rest| rest.strip_suffix("END:VCALENDAR\r\n")).expect(&text);
    let property = |line: &str| {
        let (name, value) = line.split_once(':').unwrap();
        let plain = value.replace("\\,", ",").replace("\\;", ";").replace("\\\\", "\\");
        (name.to_owned(), plain)
    };
    let event = |text: &str| {
        let lines = text.strip_prefix("BEGIN:VEVENT\r\n").expect(text);
        lines.split_terminator("\r\n").map(property).collect()
    };
    inside.split_terminator("END:VEVENT\r\n").map(event).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_next_report_of_each_active_session_is_in_the_calendar() {
    let mut app = App::start().await;
    assert_eq!(events(&app).await, []);
    let mut monthly = specification(2);
    monthly["problem"]["periods_per_year"] = json!(12);
    app.train(&monthly).await;
    let name = format!("Pension; with {}, a \\ and \u{e9}", "a long name, ".repeat(5));
    app.open_with(json!({ "name": name })).await;
    let session = app.session.clone();
    let observe = async |app: &App, period: usize, date: &str| {
        let report = json!({ "session": session, "period": period, "log_return": 0.01, "date": date });
        assert_eq!(app.post("/observe", &report).await.0, 200);
    };
    observe(&app, 1, "2008-01-31").await;
    app.open_with(json!({})).await;
    let unnamed = app.session.clone();
    let found = events(&app).await;
    let ids: Vec<&str> = found.iter().map(|event| event["UID"].as_str()).collect();
    assert_eq!(ids, [format!("{unnamed}@ballast"), format!("{session}@ballast")], "without a report comes first");
    assert_eq!(found[0]["SUMMARY"], format!("Report of period 1: {unnamed}"));
    assert_eq!(found[1]["SUMMARY"], format!("Report of period 2: {name}"));
    assert_eq!((found[1]["DTSTART;VALUE=DATE"].as_str(), found[1]["SEQUENCE"].as_str()), ("20080229", "1"));
    let rows = app.get("/sessions?state=active").await.1["sessions"].clone();
    let days: Vec<String> = found.iter().map(|event| event["DTSTART;VALUE=DATE"].clone()).collect();
    for row in rows.as_array().unwrap() {
        assert!(days.contains(&row["next"].as_str().unwrap().replace('-', "")), "{row} {days:?}");
    }
    let stamp = &found[0]["DTSTAMP"];
    assert!(stamp.len() == 16 && stamp.contains('T') && stamp.ends_with('Z'), "{stamp}");
    // A completed session has no next report, and neither has one whose policy gives no calendar.
    observe(&app, 2, "2008-02-29").await;
    app.train(&specification(2)).await;
    app.open().await;
    let ids: Vec<String> = events(&app).await.iter().map(|event| event["UID"].clone()).collect();
    assert_eq!(ids, [format!("{unnamed}@ballast")]);
    let key = app.key("another", "read").await;
    app.enter(&key).await;
    assert_eq!(events(&app).await, [], "those of another tenant are not shown");
}
