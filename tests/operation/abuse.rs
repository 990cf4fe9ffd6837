//! Clients that are slow, greedy or hostile: they are rejected, and other clients are not affected.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use crate::support::patience::{assert_within, patience, until, within};
use crate::support::process::{self, Process};
use crate::support::{App, read, specification, trained};
use ballast::service::callers::allowance::Limits;
use futures_util::future::join_all;
use reqwest::StatusCode;
use serde_json::{Value, json};

/// Eight clients send bodies of 4 MB, each of which takes far longer to decode than any client should wait.
#[tokio::test(flavor = "multi_thread")]
async fn large_bodies_are_decoded_in_nobodys_way() {
    let folder = tempfile::tempdir().unwrap();
    let (child, url) = process::serve(|command| {
        command.arg("--data").arg(folder.path());
    });
    let (_process, app) = (Process(child), App::at(url, folder));
    let report = r#"{"session":"session_0","period":1,"log_returns":{"one":0.1,"another":0.2}},"#;
    let body = format!("[{}{{}}]", report.repeat(4_000_000 / report.len()));
    let address = format!("{}/observe", app.url);
    let attack = join_all((0..8).map(|_| async {
        loop {
            let request = app.client.post(&address).header("content-type", "application/json").body(body.clone());
            assert!(request.send().await.unwrap().status().as_u16() >= 400);
        }
    }));
    let victim = async {
        let mut durations = Vec::new();
        for _ in 0..100 {
            let started = Instant::now();
            assert_eq!(app.get("/livez").await.0, 200);
            durations.push(started.elapsed());
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        durations.sort_unstable();
        durations
    };
    let durations = tokio::select! {
        _ = attack => unreachable!("it goes on until the victim is done"),
        durations = victim => durations,
    };
    assert!(durations[89] < within(Duration::from_millis(100)), "{durations:?}");
}

const SLOW_SOCKETS: usize = 1000;
/// The most time that a call may take while all of them are open, on a machine that builds something else meanwhile.
const ANSWERED_WITHIN: Duration = Duration::from_secs(2);

/// Sends `bytes` and leaves the connection open.
fn open_socket(address: &str, bytes: &str) -> TcpStream {
    let mut socket = TcpStream::connect(address).unwrap();
    socket.set_nonblocking(true).unwrap();
    // Bytes beyond the socket buffers stay unsent.
    let _ = socket.write(bytes.as_bytes());
    socket
}

/// Drains the socket and returns whether the other side has closed it.
fn is_closed(socket: &mut TcpStream) -> bool {
    let mut buffer = [0; 1024];
    loop {
        match socket.read(&mut buffer) {
            Ok(0) => return true,
            Ok(_) => {}
            Err(error) => return error.kind() != ErrorKind::WouldBlock,
        }
    }
}

/// Returns the slowest of 30 calls, each answered with 200.
async fn slowest(app: &App, first: usize) -> Duration {
    let mut slowest = Duration::ZERO;
    for round in 0..30 {
        let started = Instant::now();
        let (status, answer) = match round % 3 {
            0 => app.action().await,
            1 => app.observe(first + round / 3, 0.001).await,
            _ => app.post("/what-if", &json!({ "session": app.session, "wealth": 50.0 })).await,
        };
        assert_eq!(status, 200, "round {round}: {answer}");
        slowest = slowest.max(started.elapsed());
    }
    slowest
}

#[tokio::test(flavor = "multi_thread")]
async fn a_thousand_slow_sockets_harm_nobody_else() {
    let folder = tempfile::tempdir().unwrap();
    let (child, url) = process::serve(|command| {
        command.arg("--data").arg(folder.path());
    });
    let address = url.strip_prefix("http://").unwrap().to_owned();
    let (_process, mut app) = (Process(child), App::at(url, folder));
    app.train(&specification(21)).await;
    app.open().await;
    let before = slowest(&app, 1).await;

    let head = "GET /readyz HTTP/1.1\r\nHost: localhost\r\nX-Slow: ".to_owned();
    let body =
        "POST /train HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: 9999\r\n\r\n{";
    let reader = "GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n".repeat(100);
    let kinds = [head, body.to_owned(), reader];
    let mut sockets: Vec<TcpStream> =
        (0..SLOW_SOCKETS).map(|index| open_socket(&address, &kinds[index % kinds.len()])).collect();
    let opened = Instant::now();
    let under = slowest(&app, 11).await;
    let mut bodies = sockets.iter_mut().skip(1).step_by(kinds.len());
    assert!(bodies.all(|socket| !is_closed(socket)), "a slow body was cut off before its time");
    println!("slowest of 30 calls: {before:?} before, {under:?} with {SLOW_SOCKETS} slow sockets open");
    assert!(under < within(ANSWERED_WITHIN), "{under:?}");

    let deadline = opened + patience();
    for socket in sockets.iter_mut().step_by(kinds.len()) {
        while !is_closed(socket) {
            assert!(Instant::now() < deadline, "a client without headers is still connected");
            let _ = socket.write(b" ");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_does_not_come_is_not_waited_for() {
    let app = App::configured(|config| config.request_timeout = Duration::from_millis(300)).await;
    let address = app.url.strip_prefix("http://").unwrap();
    let head =
        "POST /train HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: 9\r\n\r\n{";
    let mut socket = TcpStream::connect(address).unwrap();
    socket.set_read_timeout(Some(patience())).unwrap();
    socket.write_all(head.as_bytes()).unwrap();
    let mut answer = String::new();
    tokio::task::block_in_place(|| socket.read_to_string(&mut answer)).unwrap();
    assert!(answer.starts_with("HTTP/1.1 503") && answer.contains("retry-after: 1"), "{answer}");
}

#[tokio::test(flavor = "multi_thread")]
async fn heads_and_depths_are_bounded() {
    let app = App::start().await;
    let many = (0..101).fold(app.client.get(format!("{}/readyz", app.url)), |request, index| {
        request.header(format!("x-{index}"), "1")
    });
    assert_eq!(many.send().await.unwrap().status(), StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE);
    let long = app.client.get(format!("{}/readyz", app.url)).header("x-long", "1".repeat(100_000));
    assert_eq!(long.send().await.unwrap().status(), StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE);
    for path in ["train", "evaluate", "backtest", "sessions", "observe", "what-if", "returns", "policies/import"] {
        for deep in [format!("{}{}", "[".repeat(200_000), "]".repeat(200_000)), r#"{"a":"#.repeat(100_000)] {
            let request = app.client.post(format!("{}/{path}", app.url)).header("content-type", "application/json");
            let (status, problem) = read(request.body(deep).send().await.unwrap()).await;
            assert!(status == 400 || status == 422, "{path}: {problem}");
        }
        let long = app.client.post(format!("{}/{path}", app.url)).header("content-type", "application/json");
        let (status, problem) = read(long.body("[".repeat((1 << 20) + 1)).send().await.unwrap()).await;
        assert_eq!((status.as_u16(), &problem["type"]), (413, &json!("/problems/body-too-large")), "{path}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tenant_that_calls_too_often_is_put_off_and_another_is_not() {
    let mut app = App::configured(|config| config.limits = Limits::new([0, 0, 20], 4)).await;
    let (north, south) = (app.key("north", "read").await, app.key("south", "read").await);
    app.enter(&south).await;
    app.hold(&north);
    let flood = join_all((0..200).map(|_| app.client.get(format!("{}/jobs", app.url)).send())).await;
    let flood: Vec<_> = flood.into_iter().map(Result::unwrap).collect();
    let answered = flood.iter().filter(|answer| answer.status() == 200).count();
    assert!((20..150).contains(&answered), "{answered} of 200 were answered");
    let refused = flood.into_iter().find(|answer| answer.status() != 200).unwrap();
    let pause: u64 = refused.headers()["retry-after"].to_str().unwrap().parse().unwrap();
    assert_eq!(pause, 1);
    let (status, problem) = read(refused).await;
    assert_eq!((status.as_u16(), &problem["type"]), (429, &json!("/problems/too-many-requests")));
    app.hold(&south);
    assert_eq!(app.get("/jobs").await.0, 200);
    app.hold(&north);
    // A rejected call uses up no allowance, so that repeated calls do not postpone the next one.
    let started = Instant::now();
    until("the allowance to come back", async || (app.get("/jobs").await.0 == 200).then_some(())).await;
    assert_within(Duration::from_secs(pause), started, "the allowance");
}

#[tokio::test(flavor = "multi_thread")]
async fn heavy_calls_past_the_bound_come_back_later_and_starve_nobody() {
    let mut app = App::configured(|config| config.limits = Limits::new([0; 3], 2)).await;
    app.train(&specification(21)).await;
    app.open().await;
    let sweep =
        json!({ "session": app.session, "sweep": { "radius_scale": { "from": 0.0, "to": 2.0, "points": 101 } } });
    let heavy = join_all((0..24).map(|_| app.client.post(format!("{}/what-if", app.url)).json(&sweep).send()));
    let live = async {
        let mut slowest = Duration::ZERO;
        // Returns like those of the record: advice outside the design would need a solve, which is heavy.
        for (period, log_return) in (1..=20).zip([0.031, -0.024, 0.012, -0.039, 0.04].into_iter().cycle()) {
            let started = Instant::now();
            let (status, advice) = app.action().await;
            assert_eq!(status, 200, "{advice}");
            assert_eq!(app.observe(period, log_return).await.0, 200);
            slowest = slowest.max(started.elapsed());
        }
        slowest
    };
    let (heavy, slowest) = tokio::join!(heavy, live);
    let statuses: Vec<u16> = heavy.iter().map(|answer| answer.as_ref().unwrap().status().as_u16()).collect();
    assert!(statuses.iter().all(|status| [200, 429].contains(status)), "{statuses:?}");
    assert!(statuses.contains(&200) && statuses.contains(&429), "{statuses:?}");
    let put_off = heavy.into_iter().map(Result::unwrap).find(|answer| answer.status() == 429).unwrap();
    assert_eq!(put_off.headers()["retry-after"], "1");
    assert!(slowest < within(ANSWERED_WITHIN), "{slowest:?}");
    // Every permit is released, also those of answers that were dropped unread.
    let free = async || (app.post("/what-if", &sweep).await.0 == 200).then_some(());
    until("the permits to be released", free).await;
}

/// A query counts by its decoded text, however it was encoded.
#[tokio::test(flavor = "multi_thread")]
async fn the_class_of_a_call_is_that_of_what_it_asks() {
    let mut app = App::configured(|config| config.limits = Limits::new([0, 2, 0], 4)).await;
    app.train(&specification(3)).await;
    app.open().await;
    let spellings =
        ["mode=resolve", "mode=%72esolve", "explain=worst_case", "explain=%77orst_case", "sensitivity=%74rue"];
    for question in spellings {
        let answers = join_all((0..20).map(|_| {
            let url = format!("{}/action?session={}&{question}", app.url, app.session);
            app.client.get(url).send()
        }));
        let statuses: Vec<u16> = answers.await.into_iter().map(|answer| answer.unwrap().status().as_u16()).collect();
        assert!(statuses.iter().all(|status| [200, 429, 503].contains(status)), "{question}: {statuses:?}");
        assert!(statuses.iter().filter(|status| **status == 429).count() >= 10, "{question}: {statuses:?}");
        assert_eq!(app.action().await.0, 200, "{question}");
    }
    // A word in the name of a session does not make a cheap query a heavy one.
    let session = app.get("/action?session=session_resolve_explain").await;
    assert_eq!(session.0, 404, "{}", session.1);
}

/// Advice for a state outside the design needs a solve, and counts as heavy once that is known. So does an observation
/// that needs such advice.
#[tokio::test(flavor = "multi_thread")]
async fn advice_that_must_solve_is_heavy_from_then_on() {
    let mut app = App::configured(|config| config.limits = Limits::new([0, 3, 0], 4)).await;
    app.train(&specification(3)).await;
    let far = json!({ "history": [0.3, -0.3, 0.25, -0.28, 0.31, -0.2], "wealth": 100.0 });
    let mut sessions = Vec::new();
    for _ in 0..12 {
        app.open_with(far.clone()).await;
        sessions.push(app.session.clone());
    }
    let mut statuses = Vec::new();
    for session in &sessions {
        app.session.clone_from(session);
        let (status, answer) = app.action().await;
        if status == 200 {
            assert_eq!(answer["source"], "resolved_outside_design", "{answer}");
        } else {
            assert_eq!((status.as_u16(), &answer["value"]), (429, &json!("heavy")), "{answer}");
        }
        statuses.push(status.as_u16());
    }
    assert!(statuses.contains(&200) && statuses.contains(&429), "{statuses:?}");
    // An observation that was rejected is recorded when its permit comes.
    until("its turn", async || (app.observe(1, 0.01).await.0 == 200).then_some(())).await;
    let deadline = Instant::now() + patience();
    let put_off = loop {
        app.open_with(far.clone()).await;
        let (status, answer) = app.observe(1, 0.01).await;
        if status == 429 {
            break answer;
        }
        assert_eq!(status, 200, "{answer}");
        assert!(Instant::now() < deadline, "no observation outside the design was ever put off");
    };
    assert_eq!(put_off["value"], "heavy", "{put_off}");
}

/// Opening, observing and correcting a session of several assets solves the one-step problem, and is heavy once that is
/// known. An invalid report is not heavy, nor is one for a fund whose shares are given.
#[tokio::test(flavor = "multi_thread")]
async fn what_several_assets_report_is_heavy_where_it_solves() {
    let mut app = App::configured(|config| config.limits = Limits::new([0, 4, 0], 4)).await;
    let rows: Vec<[f64; 2]> =
        (0..10).map(|k| [0.01 + 0.03 * f64::from(k * 7 % 10 - 4), 0.004 - 0.01 * f64::from(k * 3 % 10 - 5)]).collect();
    let request = |composition: serde_json::Value| {
        json!({ "problem": { "assets": ["stocks", "bonds"], "horizon": 2, "rate_per_step": 0.001, "history": rows,
            "radius": { "rule": "fixed", "radius": 0.01 }, "composition": composition }, "design": { "count": 20 } })
    };
    let report = json!({ "log_returns": { "stocks": 0.01, "bonds": 0.002 } });
    // Opens a session, reports a period and corrects it, again and again, until a call is rejected.
    let put_off = async |app: &mut App, rounds: usize| {
        for _ in 0..rounds {
            let (status, session) = app.post("/sessions", &json!({ "policy": app.policy })).await;
            if status == 429 {
                return Some(session);
            }
            app.session = session["session"].as_str().unwrap().to_owned();
            let wrong = app.report(1, json!({ "log_returns": { "stocks": 0.01 } })).await;
            assert_eq!(wrong.0, 422, "{}", wrong.1);
            let (status, observed) = app.report(1, report.clone()).await;
            if status == 429 {
                return Some(observed);
            }
            assert_eq!(status, 200, "{observed}");
            let mut right = json!({ "correction": 1, "period": 1, "reason": "the index was revised" });
            right["log_returns"] = json!({ "stocks": 0.012, "bonds": 0.002 });
            let (status, corrected) = app.post(&format!("/sessions/{}/corrections", app.session), &right).await;
            if status == 429 {
                return Some(corrected);
            }
            assert_eq!(status, 200, "{corrected}");
        }
        None
    };
    for (composition, is_heavy) in [(json!({ "given": [0.5, 0.5] }), false), (json!("one_step"), true)] {
        let job = until("a training", async || {
            let (status, job) = app.post("/train", &request(composition.clone())).await;
            (status == 202).then_some(job)
        })
        .await;
        let done = app.until(job["job"].as_str().unwrap(), |job| job["finished_ms"].is_i64()).await;
        app.policy = done["policy"].as_str().unwrap().to_owned();
        let deadline = Instant::now() + patience();
        let mut refused = put_off(&mut app, 12).await;
        while is_heavy && refused.is_none() && Instant::now() < deadline {
            refused = put_off(&mut app, 12).await;
        }
        assert_eq!(refused.map(|answer| answer["value"].clone()), is_heavy.then(|| json!("heavy")), "{composition}");
    }
}

/// Collects pointers to all parts of a document; of a list only to the ends, because its entries are alike.
fn pointers(value: &Value, at: String, found: &mut Vec<String>) {
    found.push(at.clone());
    match value {
        Value::Object(members) => {
            members.iter().for_each(|(name, value)| pointers(value, format!("{at}/{name}"), found));
        }
        Value::Array(entries) => {
            let ends = [0, entries.len().saturating_sub(1)];
            for index in ends.into_iter().take(entries.len().min(2)) {
                pointers(&entries[index], format!("{at}/{index}"), found);
            }
        }
        _ => {}
    }
}

/// Returns documents that differ from a sound one at one pointer.
fn mutations(sound: &Value) -> Vec<(String, Value)> {
    let mut places = Vec::new();
    pointers(sound, String::new(), &mut places);
    let mut mutations = Vec::new();
    for place in places.into_iter().skip(1) {
        let old = sound.pointer(&place).unwrap();
        let mut values =
            vec![Value::Null, json!("x"), json!([]), json!({}), json!(-1), json!(0), json!(1e308), json!(-1e-308)];
        if let Value::Array(entries) = old {
            values.push(entries[..entries.len().saturating_sub(1)].into());
            values.push([entries.as_slice(), entries.as_slice()].concat().into());
        }
        if let Value::Object(members) = old {
            let mut stranger = members.clone();
            stranger.insert("stranger".into(), json!(1));
            values.push(stranger.into());
        }
        for value in values.into_iter().filter(|value| value != old) {
            let mut document = sound.clone();
            *document.pointer_mut(&place).unwrap() = value.clone();
            mutations
                .push((format!("{place} = {}", &value.to_string().chars().take(40).collect::<String>()), document));
        }
        let (parent, name) = place.rsplit_once('/').unwrap();
        let mut document = sound.clone();
        if let Some(Value::Object(members)) = document.pointer_mut(parent) {
            members.remove(name);
            mutations.push((format!("{place} removed"), document));
        }
    }
    mutations
}

/// A mutated policy is rejected with the field named, or its advice is still within the bounds of an allocation.
#[tokio::test(flavor = "multi_thread")]
async fn a_mutated_policy_is_refused_or_advises_within_bounds() {
    // A fast machine sends more than the default allows in a second.
    let app = App::configured(|config| config.limits = Limits::new([0; 3], 16)).await;
    let mut request = specification(2);
    request["design"]["count"] = json!(10);
    let sound: Value = serde_json::from_slice(&trained(&request)).unwrap();
    assert_eq!(app.post("/policies/import", &sound).await.0, 201);
    let mutations = mutations(&sound);
    assert!(mutations.len() > 500, "{}", mutations.len());
    let mut accepted = 0;
    for (what, document) in mutations {
        let (status, answer) = app.post("/policies/import", &document).await;
        assert!([201, 400, 422].contains(&status.as_u16()), "{what}: {status} {answer}");
        if status != 201 {
            continue;
        }
        accepted += 1;
        let (status, session) = app.post("/sessions", &json!({ "policy": answer["policy"] })).await;
        assert_eq!(status, 201, "{what}: {session}");
        for _ in 0..2 {
            let (status, action) = app.get(&format!("/action?session={}", session["session"].as_str().unwrap())).await;
            let allocation = action["allocation"].as_f64();
            assert!(status == 200 && allocation.is_some_and(|a| (0.0..=1.0).contains(&a)), "{what}: {status} {action}");
            let report = json!({ "session": session["session"], "period": 1, "log_return": 0.01 });
            assert_eq!(app.post("/observe", &report).await.0, 200, "{what}");
        }
    }
    // Accepted mutations change diagnostics, or numbers that may have any value.
    assert!(accepted > 10, "{accepted}");
}
