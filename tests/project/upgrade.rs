//! A store of every schema is opened, and the service over it advises as it did when the store was made.
//!
//! `tests/data/store/schema_N.sqlite` is a backup of a store whose newest migration is the N-th, `schema_N.json` what the
//! service over it answered. Whoever adds a migration, or changes one that is in no release yet, writes the pair of the
//! newest schema anew:
//!
//! ```sh
//! cargo test --test project upgrade:: -- --ignored
//! ```

use std::path::PathBuf;

use crate::support::{App, specification};
use ballast::store::{Damage, Inspection, Store, backup, restore};
use serde_json::{Value, json};

const RETURNS: [[f64; 2]; 2] = [[0.021, -0.034], [-0.012, 0.055]];

fn fixtures() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/store")
}

/// The number of migrations.
fn newest_schema() -> usize {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src/store/engine/migrations/sqlite");
    std::fs::read_dir(folder).unwrap().count()
}

/// A policy whose advice depends on what was observed, and is neither all nor nothing.
fn problem() -> Value {
    let mut specification = specification(4);
    specification["problem"]["utility"] = json!({ "kind": "power", "risk_aversion": 8.0 });
    specification["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.001 });
    specification["design"] = json!({ "count": 12 });
    specification
}

/// Everything the service says of its sessions: what they observed, and what to do.
async fn answers(app: &App, sessions: &[String]) -> Vec<Value> {
    let mut answers = Vec::new();
    for session in sessions {
        let (status, history) = app.get(&format!("/sessions/{session}/history")).await;
        assert_eq!(status, 200, "{history}");
        let (status, advice) = app.get(&format!("/action?session={session}")).await;
        assert_eq!(status, 200, "{advice}");
        answers.push(json!({ "session": session, "history": history, "advice": advice }));
    }
    answers
}

#[tokio::test]
#[ignore = "writes the fixture of the newest schema"]
async fn write_the_fixture_of_the_newest_schema() {
    let name = format!("schema_{}", newest_schema());
    let (database, recorded) =
        (fixtures().join(&name).with_extension("sqlite"), fixtures().join(&name).with_extension("json"));
    let mut app = App::start().await;
    app.train(&problem()).await;
    let mut sessions = Vec::new();
    for returns in RETURNS {
        app.open().await;
        for (log_return, period) in returns.into_iter().zip(1..) {
            assert_eq!(app.observe(period, log_return).await.0, 200);
        }
        sessions.push(app.session.clone());
    }
    let key = app.key("default", "admin").await;
    app.hold(&key);
    let answers = answers(&app, &sessions).await;
    for answer in &answers {
        let allocation = answer["advice"]["allocation"].as_f64().unwrap();
        assert!(allocation > 0.02 && allocation < 0.98, "{answer}");
    }
    assert_ne!(answers[0]["advice"]["allocation"], answers[1]["advice"]["allocation"]);
    std::fs::create_dir_all(fixtures()).unwrap();
    if database.exists() {
        std::fs::remove_file(&database).unwrap();
    }
    backup(app.folder(), &database, Damage::Refused, &mut |_| {}).await.unwrap();
    let recording = json!({ "key": key, "policy": app.policy, "answers": answers });
    std::fs::write(recorded, serde_json::to_string_pretty(&recording).unwrap() + "\n").unwrap();
}

/// Equal but for the last digits of what the surrogates say, which depend on the processor.
fn assert_alike(path: &str, found: &Value, recorded: &Value) {
    match (found, recorded) {
        (Value::Object(found), Value::Object(recorded)) => {
            for (field, recorded) in recorded {
                assert_alike(&format!("{path}.{field}"), found.get(field).unwrap_or(&Value::Null), recorded);
            }
        }
        (Value::Number(found), Value::Number(recorded)) => {
            let (found, recorded) = (found.as_f64().unwrap(), recorded.as_f64().unwrap());
            assert!((found - recorded).abs() <= 1e-9 * recorded.abs().max(1.0), "{path}: {found}, not {recorded}");
        }
        _ => assert_eq!(found, recorded, "{path}"),
    }
}

#[tokio::test]
async fn every_schema_is_opened_and_advises_as_it_did() {
    for schema in 1..=newest_schema() {
        let name = fixtures().join(format!("schema_{schema}"));
        let recorded = std::fs::read(name.with_extension("json"));
        let recorded =
            recorded.unwrap_or_else(|error| panic!("schema {schema} has no fixture ({error}): see the head"));
        let recorded: Value = serde_json::from_slice(&recorded).unwrap();

        let mut app = App::start().await;
        // As it was left: opened, brought up to date, checked.
        let left = tempfile::tempdir().unwrap();
        std::fs::copy(name.with_extension("sqlite"), left.path().join("ballast.sqlite")).unwrap();
        Store::open(left.path()).await.unwrap().close().await;
        Inspection::of_folder(left.path()).await.unwrap().run(&mut |_| {}).await.unwrap();
        // As its backup: restored, then served.
        let mut printed = String::new();
        let restored = app.folder().join("restored");
        let mut tell = |line: String| printed += &(line + "\n");
        restore(&name.with_extension("sqlite"), &restored, Damage::Refused, &mut tell).await.unwrap();
        assert!(printed.contains("sessions: 2, with 4 entries") && printed.contains("keys: 1"), "{printed}");
        app.move_to("restored").await;

        app.hold("");
        assert_eq!(app.get("/sessions").await.0, 401, "its key is in force");
        app.hold(recorded["key"].as_str().unwrap());
        let answers_recorded = recorded["answers"].as_array().unwrap();
        let sessions: Vec<_> = answers_recorded.iter().map(|a| a["session"].as_str().unwrap().to_owned()).collect();
        for (found, recorded) in answers(&app, &sessions).await.iter().zip(answers_recorded) {
            assert_eq!(found["history"], recorded["history"], "facts come back bit for bit");
            assert_alike("", found, recorded);
        }
        let (status, job) = app.get("/jobs").await;
        assert_eq!((status, &job["jobs"][0]["policy"]), (reqwest::StatusCode::OK, &recorded["policy"]));
    }
}
