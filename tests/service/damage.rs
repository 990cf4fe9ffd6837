//! One damaged row costs one row: lists go on without it, it is named, and it is put back from a backup.

use std::path::Path;

use crate::support::{App, process, specification};
use serde_json::Value;

/// Runs `ballast`; whether it succeeded, and what it printed and said.
fn ballast(arguments: &[&str]) -> (bool, String) {
    let output = process::ballast(arguments);
    let printed = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8(printed).unwrap())
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Sessions of a page, and those that it names as damaged.
fn names(page: &Value) -> (Vec<&str>, Vec<&str>) {
    let sessions = page["sessions"].as_array().unwrap().iter().map(|row| row["session"].as_str().unwrap());
    let damaged = page["damaged"].as_array().unwrap().iter().map(|name| name.as_str().unwrap());
    (sessions.collect(), damaged.collect())
}

/// A service with so many sessions, each after one period; the sessions in the order they were opened.
async fn with_sessions(count: usize) -> (App, Vec<String>) {
    let mut app = App::start().await;
    app.train(&specification(3)).await;
    let mut sessions = Vec::new();
    for _ in 0..count {
        app.open().await;
        assert_eq!(app.observe(1, 0.01).await.0, 200);
        sessions.push(app.session.clone());
    }
    (app, sessions)
}

async fn corrupt_failures(app: &App) -> u64 {
    let metrics = app.client.get(format!("{}/metrics", app.url)).send().await.unwrap().text().await.unwrap();
    let corrupt = "ballast_store_failures_total{cause=\"corrupt\"} ";
    metrics.lines().find_map(|line| line.strip_prefix(corrupt)).unwrap().parse().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_list_leaves_out_what_is_damaged_and_names_it() {
    let (mut app, sessions) = with_sessions(5).await;
    app.restart_after("UPDATE sessions SET initial_wealth = 99999999.0 WHERE sequence = 1").await;
    app.restart_after(
        "UPDATE entries SET answer_json = json_set(answer_json, '$.wealth', 99999999.0)
         WHERE session = (SELECT session FROM sessions WHERE sequence = 2)",
    )
    .await;
    app.restart_after(
        "UPDATE entries SET answer_json = 'no json' WHERE session = (SELECT session FROM sessions WHERE sequence = 3)",
    )
    .await;
    let before = corrupt_failures(&app).await;
    for query in ["", "?sort=wealth", "?sort=-last_report", "?state=active", "?limit=1000"] {
        let (status, page) = app.get(&format!("/sessions{query}")).await;
        assert_eq!(status, 200, "{query}: {page}");
        let (mut shown, mut damaged) = names(&page);
        for names in [&mut shown, &mut damaged] {
            names.sort_by_key(|name| sessions.iter().position(|one| one == name));
        }
        assert_eq!(
            (shown, damaged),
            (vec![sessions[3].as_str(), &sessions[4]], sessions[..3].iter().map(String::as_str).collect()),
            "{query}"
        );
        assert!(!page.to_string().contains("99999999"), "{page}");
    }
    assert!(corrupt_failures(&app).await >= before + 15, "each is counted");
    // Pages of one go through all of them.
    let (mut seen, mut after) = (0, String::new());
    loop {
        let (_, page) = app.get(&format!("/sessions?limit=1{after}")).await;
        let (shown, damaged) = names(&page);
        seen += shown.len() + damaged.len();
        match page["next"].as_str() {
            Some(next) => after = format!("&after={next}"),
            None => break,
        }
    }
    assert_eq!(seen, 5);
    // Each is 500 by itself, and the others are served.
    for (number, session) in sessions.iter().enumerate() {
        let expected = if number < 3 { 500 } else { 200 };
        assert_eq!(app.get(&format!("/action?session={session}")).await.0.as_u16(), expected, "{number}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_key_closes_alone_and_others_come_and_go() {
    let mut app = App::start().await;
    let (north, south) = (app.key("north", "read").await, app.key("south", "read").await);
    app.restart_after("UPDATE access_keys SET roles = 'admin' WHERE tenant = 'north'").await;
    let status = async |app: &mut App, key: &str| {
        app.hold(key);
        app.get("/jobs").await.0.as_u16()
    };
    assert_eq!((status(&mut app, &north).await, status(&mut app, "").await), (401, 401));
    assert_eq!(status(&mut app, &south).await, 200);
    let east = app.key("east", "read").await;
    app.enter(&east).await;
    let (_, listed) = ballast(&["keys", "list", "--data", text(app.folder())]);
    let row = listed.lines().find(|line| line.contains("\tsouth\t")).unwrap();
    assert!(listed.contains("is damaged and gives no access"), "{listed}");
    let name = row.split('\t').next().unwrap();
    assert!(ballast(&["keys", "revoke", name, "--data", text(app.folder())]).0);
    app.hold(&south);
    crate::support::patience::until("the key to be revoked", async || (app.get("/jobs").await.0 == 401).then_some(()))
        .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_damaged_is_listed_copied_and_put_back() {
    let (mut app, sessions) = with_sessions(3).await;
    let key = app.key("default", "admin").await;
    app.key("north", "read").await;
    app.enter(&key).await;
    let places = tempfile::tempdir().unwrap();
    let [sound, copy, restored] = ["sound", "copy", "restored"].map(|name| places.path().join(name));
    let data = app.folder().to_owned();
    let data = text(&data);
    assert!(ballast(&["backup", "--data", data, "--out", text(&sound)]).0);
    // After the backup: what is sound of it stays.
    app.session.clone_from(&sessions[0]);
    assert_eq!(app.observe(2, 0.02).await.0, 200);
    for damage in [
        "UPDATE entries SET content_json = '{}'
         WHERE entry = 1 AND session = (SELECT session FROM sessions WHERE sequence = 1)",
        "UPDATE sessions SET initial_wealth = 7.0 WHERE sequence = 2",
        "UPDATE access_keys SET tenant = 'south' WHERE tenant = 'north'",
        "UPDATE usage SET bytes = bytes + 1 WHERE tenant = 'default'",
    ] {
        app.restart_after(damage).await;
    }

    let (is_sound, printed) = ballast(&["check", "--data", data]);
    let damaged: Vec<_> = printed.lines().filter_map(|line| line.strip_prefix("damaged: ")).collect();
    let starts = [format!("entry 1 of session {}", sessions[0]), format!("the start of session {}", sessions[1])];
    assert!(!is_sound && damaged.len() == 4 && starts.iter().all(|what| damaged.contains(&what.as_str())), "{printed}");
    let name = damaged.iter().find_map(|what| what.strip_prefix("key ")).unwrap();
    assert!(!ballast(&["backup", "--data", data, "--out", text(&copy)]).0 && !copy.exists());
    let (is_made, printed) = ballast(&["backup", "--skip-damaged", "--data", data, "--out", text(&copy)]);
    assert!(is_made && printed.contains("with 4 damaged things"), "{printed}");
    let restore = ["restore", "--from", text(&copy), "--data", text(&restored)];
    assert!(!ballast(&restore).0);
    assert!(ballast(&[&restore[..], &["--skip-damaged"]].concat()).0);

    let repair = |thing: &str, data: &str| ballast(&["repair", thing, "--from", text(&sound), "--data", data]);
    let (is_repaired, printed) = repair(&sessions[0], data);
    assert!(!is_repaired && printed.contains("locked by another process"), "{printed}");
    let folder = text(&restored);
    assert!(repair("nobody", folder).1.contains("the backup has no session, policy or key 'nobody'"));
    for thing in sessions.iter().map(String::as_str).chain([name]) {
        let (is_repaired, printed) = repair(thing, folder);
        assert!(is_repaired && printed.contains("is sound"), "{printed}");
    }
    // The total was put right with the sessions.
    let (is_sound, printed) = ballast(&["check", "--data", folder]);
    assert!(is_sound, "{printed}");
    let (_, audit) = ballast(&["audit", "--data", folder]);
    assert_eq!(audit.lines().filter(|line| line.contains("store.repair")).count(), 3, "{audit}");
    app.move_to(folder).await;
    app.hold(&key);
    let (_, session) = app.get(&format!("/sessions/{}", sessions[0])).await;
    assert_eq!(session["period"], 3, "{session}");

    // What was ended after the backup does not come back.
    assert_eq!(app.delete(&format!("/sessions/{}", sessions[1])).await, 204);
    assert!(ballast(&["keys", "revoke", name, "--data", folder]).0);
    app.move_to("elsewhere").await;
    for (thing, reason) in [(sessions[1].as_str(), "was deleted"), (name, "was changed after the backup")] {
        let (is_repaired, printed) = repair(thing, folder);
        assert!(!is_repaired && printed.contains("nothing is repaired") && printed.contains(reason), "{printed}");
    }
    // What the backup has not cannot be made sound, and then nothing is changed.
    crate::support::execute(&restored, "UPDATE entries SET content_json = '{}' WHERE entry = 2").await;
    let (is_repaired, printed) = repair(&sessions[0], folder);
    assert!(!is_repaired && printed.contains(&format!("entry 2 of session {} is damaged", sessions[0])), "{printed}");
}
