//! The turn to solve goes round the tenants: what one has queued is not what another waits for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::support::patience::until;
use crate::support::{App, specification};
use serde_json::json;

/// Explains of one tenant under way at a time, over a session of so many returns; and another's returns.
const EXPLAINS: usize = 32;
const LONG: usize = 20_000;
const SHORT: usize = 8_000;
/// Largest multiple of the time that another's call takes alone.
const AT_MOST: u32 = 3;
const ROUNDS: usize = 9;
/// Other tests may take the processors through one of so many tries; a queue would not grow short for one.
const TRIES: usize = 5;

fn returns(count: usize) -> Vec<f64> {
    (0..count).map(|index| 0.01 * (index as f64 * 0.7).sin() + 0.002).collect()
}

async fn open(app: &App, history: &[f64]) -> String {
    let (status, session) = app.post("/sessions", &json!({ "policy": app.policy, "history": history })).await;
    assert_eq!(status, 201, "{session}");
    session["session"].as_str().unwrap().to_owned()
}

/// The median time of a step solved on request, each answered.
async fn solved_within(app: &App, session: &str) -> Duration {
    let mut times = Vec::new();
    for _ in 0..ROUNDS {
        let started = Instant::now();
        let (status, answer) = app.get(&format!("/action?session={session}&mode=resolve")).await;
        assert_eq!(status, 200, "{answer}");
        times.push(started.elapsed());
    }
    times.sort();
    times[ROUNDS / 2]
}

#[tokio::test(flavor = "multi_thread")]
async fn explains_of_one_tenant_do_not_keep_anothers_solve_waiting() {
    let mut app = App::start().await;
    let (north, south) = (app.key("north", "admin").await, app.key("south", "admin").await);
    app.enter(&south).await;
    app.train(&specification(2)).await;
    let short = open(&app, &returns(SHORT)).await;
    // The first one makes ready what the others find.
    solved_within(&app, &short).await;
    let idle = solved_within(&app, &short).await;

    app.hold(&north);
    app.train(&specification(2)).await;
    let long = open(&app, &returns(LONG)).await;
    let (url, client, stop) = (
        format!("{}/action?session={long}&explain=worst_case", app.url),
        app.client.clone(),
        Arc::new(AtomicBool::new(false)),
    );
    let explains: Vec<_> = (0..EXPLAINS)
        .map(|_| {
            let (url, client, stop) = (url.clone(), client.clone(), stop.clone());
            tokio::spawn(async move {
                let mut answered = 0;
                while !stop.load(Ordering::Relaxed) {
                    let answer = client.get(&url).send().await.unwrap();
                    answered += usize::from(answer.status() == 200);
                    let _ = answer.bytes().await;
                }
                answered
            })
        })
        .collect();
    app.hold(&south);
    until("explains that wait for their turn", async || {
        let metrics = app.client.get(format!("{}/metrics", app.url)).send().await.unwrap().text().await.unwrap();
        let mut waiting =
            metrics.lines().filter_map(|line| line.strip_prefix(r#"ballast_turns_waiting{turn="solve"} "#));
        waiting.any(|waiting| waiting != "0").then_some(())
    })
    .await;
    let mut beside = Duration::MAX;
    for _ in 0..TRIES {
        beside = beside.min(solved_within(&app, &short).await);
        if beside < AT_MOST * idle {
            break;
        }
    }
    stop.store(true, Ordering::Relaxed);
    let mut answered = 0;
    for explain in explains {
        answered += explain.await.unwrap();
    }
    println!("alone {idle:?}, beside {EXPLAINS} explains {beside:?}, of which {answered} were answered");
    assert!(answered > 0 && beside < AT_MOST * idle, "alone {idle:?}, beside {EXPLAINS} explains {beside:?}");
}
