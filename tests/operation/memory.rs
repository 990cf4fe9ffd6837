//! No job and no policy exhausts the memory of the process. A request that cannot fit is rejected by name, the caches
//! stay within their bytes, and freed memory is returned.

use std::fs;
use std::process::{Child, Command};
use std::time::Duration;

use crate::support::App;
use ballast::control::cache::Cache;
use ballast::service::process::memory::MemoryLimit;
use reqwest::StatusCode;
use serde_json::{Value, json};
use tokio::io::AsyncWriteExt;
use tokio::net::{TcpSocket, TcpStream};

/// The address space of the process under attack, in kibibytes: 900 MB.
const ADDRESS_SPACE_KIB: usize = 900_000;

/// Monthly returns of three years.
fn monthly_returns() -> Vec<f64> {
    (0..36).map(|k| 0.002 + 0.02 * ((k * 7919 % 1013) as f64 / 506.5 - 1.0)).collect()
}

/// Starts a process that may not address more than 900 MB; `arguments` are added to its command line.
fn confined(arguments: &[&str]) -> (Child, App) {
    let folder = tempfile::tempdir().unwrap();
    let (child, url) = start_confined(folder.path(), arguments);
    (child, App::at(url, folder))
}

fn start_confined(folder: &std::path::Path, arguments: &[&str]) -> (Child, String) {
    let binary = env!("CARGO_BIN_EXE_ballast");
    let script = format!(
        "ulimit -v {ADDRESS_SPACE_KIB}; exec {binary} serve --data {} {}",
        folder.display(),
        arguments.join(" ")
    );
    let mut command = Command::new("sh");
    command.args(["-c", &script]);
    crate::support::process::serve_by(command)
}

fn larger_than_memory() -> Value {
    let history = [0.0131, -0.0442, 0.021, 0.033, -0.012, 0.008];
    let problem = json!({ "horizon": 2, "rate_per_step": 0.002,
            "utility": { "kind": "exponential", "risk_aversion": 0.01 }, "history": history, "radius": { "rule": "fixed", "radius": 0.001 } });
    json!({ "problem": problem, "design": { "count": 9000 } })
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_larger_than_memory_is_refused_and_the_service_lives() {
    let (mut child, mut app) = confined(&[]);
    let (status, refused) = app.post("/train", &larger_than_memory()).await;
    assert_eq!((status, &refused["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!("design.count")), "{refused}");
    let rule = refused["rule"].as_str().unwrap();
    assert!(rule.contains("would take about") && rule.contains("the limit here is"), "{rule}");
    let mut evaluation = larger_than_memory();
    evaluation["frameworks"] = json!(["adaptive"]);
    let (status, refused) = app.post("/evaluate", &evaluation).await;
    assert_eq!((status, &refused["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!("design.count")), "{refused}");
    let returns: Vec<f64> = (0..40).map(|k| 0.02 + 0.03 * (1.7 * f64::from(k)).sin()).collect();
    let walk = json!({ "log_returns": returns, "rate": 0.002, "periods_per_year": 4, "window": 20, "count": 9000 });
    let (status, refused) = app.post("/backtest", &walk).await;
    assert_eq!((status, &refused["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!("count")), "{refused}");
    app.train(&crate::support::specification(2)).await;
    app.open().await;
    assert_eq!(app.action().await.0, StatusCode::OK);
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Bridges of 25,000 paths for 1,000 returns take 50 MB, and the cache holds a quarter of 160 MiB.
#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_kept_ready_is_refused_wherever_it_is_asked_for() {
    let (mut child, mut app) = confined(&["--memory-limit", "160MiB"]);
    let radius = json!({ "rule": "bridge", "alpha": 0.1, "paths": 25_000 });
    let long: Vec<f64> = (0..1000).map(|k| 0.002 + 0.02 * (1.7 * f64::from(k)).sin()).collect();
    let problem = json!({ "rate_per_step": 0.002, "history": long, "radius": radius });
    for (path, field) in [("/frontier", "problem.radius.paths"), ("/advise", "problem.history")] {
        let (status, refused) = app.post(path, &json!({ "problem": problem })).await;
        assert_eq!((status, &refused["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!(field)), "{refused}");
        assert!(refused["rule"].as_str().unwrap().contains("would take about"), "{refused}");
    }
    let mut short = crate::support::specification(2);
    short["problem"]["radius"] = radius;
    app.train(&short).await;
    let (status, refused) = app.post("/sessions", &json!({ "policy": app.policy, "history": long })).await;
    assert_eq!((status, &refused["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!("history")), "{refused}");
    app.open().await;
    assert_eq!(app.action().await.0, StatusCode::OK);
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Returns the policy of [`crate::support::specification`] with `points` design points of noise in every step but the
/// first.
fn inflated(policy: &[u8], points: usize, seed: u64) -> Value {
    let mut policy: Value = serde_json::from_slice(policy).unwrap();
    policy["specification"]["seed"] = json!(seed);
    let noise = |salt: usize| -> Vec<f64> {
        (0..points).map(|k| ((k * 7919 + salt * 104_729 + seed as usize) % 10_007) as f64 / 5003.5 - 1.0).collect()
    };
    for step in policy["steps"].as_array_mut().unwrap().iter_mut().skip(1) {
        let solution = &mut step["solution"];
        let inputs = solution["inputs"].as_array().unwrap().len();
        solution["inputs"] = json!((0..inputs).map(noise).collect::<Vec<_>>());
        for surrogate in ["value", "policy"] {
            solution[surrogate]["weights"] = json!([noise(inputs)]);
            solution[surrogate]["hyperparameters"]["noise_variance"] = json!(0.1);
        }
    }
    policy
}

/// Returns the bytes of a part, as `/metrics` shows them.
async fn part(app: &App, part: &str) -> usize {
    let (_, metrics) = app.get("/metrics").await;
    let start = format!("ballast_memory_bytes{{part=\"{part}\"}} ");
    let line = metrics.as_str().unwrap().lines().find_map(|line| line.strip_prefix(&start)).expect(&start);
    line.parse::<f64>().unwrap() as usize
}

/// Returns a figure of a process, as `/proc` shows it.
fn figure(child: &Child, name: &str) -> usize {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix(name)).unwrap();
    line.split_whitespace().next().unwrap().parse().unwrap()
}

/// Returns the resident bytes of a process.
fn resident(child: &Child) -> usize {
    figure(child, "VmRSS:") * 1024
}

#[tokio::test(flavor = "multi_thread")]
async fn imported_policies_asked_once_each_stay_within_the_budget() {
    let limit = 160 << 20;
    let (mut child, mut app) = confined(&["--memory-limit", "160MiB"]);
    app.train(&crate::support::specification(2)).await;
    let small = app.export().await;
    let (status, refused) = app.post("/policies/import", &inflated(&small, 1700, 1)).await;
    assert_eq!((status, &refused["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!("steps")), "{refused}");
    // 40 factors of 8 MB: twice the limit.
    for seed in 1..=40 {
        let (status, imported) = app.post("/policies/import", &inflated(&small, 1000, seed)).await;
        assert_eq!(status, StatusCode::CREATED, "{imported}");
        app.policy = imported["policy"].as_str().unwrap().to_owned();
        app.open().await;
        assert_eq!(app.observe(1, 0.01).await.0, StatusCode::OK);
        assert_eq!(app.action().await.0, StatusCode::OK);
        let kept = part(&app, "factors").await + part(&app, "bridges").await + part(&app, "prepared_policies").await;
        assert!(kept <= limit / 4, "{kept}");
    }
    assert!(part(&app, "factors").await > 8_000_000);
    assert!(resident(&child) < limit, "{} bytes resident", resident(&child));
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Opens clients that send a request and read almost nothing of the answer.
async fn slow_readers(app: &App, count: usize, request: &str) -> Vec<TcpStream> {
    let address = app.url.strip_prefix("http://").unwrap().parse().unwrap();
    let mut held = Vec::new();
    for _ in 0..count {
        let socket = TcpSocket::new_v4().unwrap();
        socket.set_recv_buffer_size(4096).unwrap();
        let mut stream = socket.connect(address).await.unwrap();
        stream.write_all(request.as_bytes()).await.unwrap();
        held.push(stream);
    }
    held
}

/// Thirty clients request a sweep whose laws are some 10 MB, and read almost nothing of it. A wider sweep is rejected
/// with the numbers.
#[tokio::test(flavor = "multi_thread")]
async fn sweeps_that_explain_are_bounded_and_take_no_more_than_their_part() {
    const RETURNS: usize = 2000;
    let (mut child, mut app) = confined(&["--memory-limit", "400MiB"]);
    app.train(&crate::support::specification(2)).await;
    let history: Vec<f64> = (0..RETURNS).map(|k| 0.002 + 0.02 * f64::sin(k as f64)).collect();
    let (status, opened) = app.post("/sessions", &json!({ "policy": app.policy, "history": history })).await;
    assert_eq!(status, StatusCode::CREATED, "{opened}");
    let sweep = |points: usize| {
        let range = json!({ "from": 0.5, "to": 1.5, "points": points });
        json!({ "session": opened["session"], "explain": "worst_case", "sweep": { "radius_scale": range } })
    };
    let (status, refused) = app.post("/what-if", &sweep(51)).await;
    assert_eq!((status, &refused["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!("explain")), "{refused}");
    assert!(refused["rule"].as_str().unwrap().contains("51 times 2000"), "{refused}");
    let (status, answer) = app.post("/what-if", &sweep(50)).await;
    assert_eq!(status, StatusCode::OK, "{answer}");
    let written = answer.to_string().len();
    assert!((4 << 20..=10 << 20).contains(&written), "{written} bytes");
    let (before, body) = (resident(&child), sweep(50).to_string());
    let head = format!(
        "POST /what-if HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n",
        body.len()
    );
    let held = slow_readers(&app, 30, &(head + &body)).await;
    tokio::time::sleep(Duration::from_secs(4)).await;
    let added = resident(&child).saturating_sub(before);
    assert!(added < 60 << 20, "{added} bytes for thirty slow readers");
    drop(held);
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Forty clients request a document of some 10 MB and read almost nothing of it: none keeps all of it in memory.
#[tokio::test(flavor = "multi_thread")]
async fn answers_that_are_read_slowly_take_no_more_than_their_part() {
    let (mut child, mut app) = confined(&["--memory-limit", "400MiB"]);
    app.train(&crate::support::specification(40)).await;
    let large = inflated(&app.export().await, 1500, 1);
    let (status, imported) = app.post("/policies/import", &large).await;
    assert_eq!(status, StatusCode::CREATED, "{imported}");
    let path = format!("/policies/{}/export", imported["policy"].as_str().unwrap());
    let before = resident(&child);
    let held = slow_readers(&app, 40, &format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n")).await;
    tokio::time::sleep(Duration::from_secs(2)).await;
    // One document at a time, twice while it is read, and the memory of forty connections.
    let added = resident(&child).saturating_sub(before);
    assert!(added < 60 << 20, "{added} bytes for forty slow readers");
    assert!(part(&app, "large_answers").await > 0);
    app.open().await;
    assert_eq!(app.observe(1, 0.01).await.0, StatusCode::OK);
    assert_eq!(app.action().await.0, StatusCode::OK);
    drop(held);
    let (status, document) = app.get(&path).await;
    assert_eq!(status, StatusCode::OK, "{document}");
    assert!(document == large, "the document came whole");
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Two clients report for 200 sessions at a time. No period finds its bridges in the cache, so each report is prepared
/// on a blocking thread. If these threads waited for one another, there would be as many as reports.
#[tokio::test(flavor = "multi_thread")]
async fn batches_of_reports_take_few_threads_and_little_memory() {
    const SESSIONS: usize = 200;
    const PERIODS: usize = 3;
    let (mut child, mut app) = confined(&["--memory-limit", "256MB"]);
    let mut long = crate::support::specification(PERIODS);
    long["problem"]["radius"]["paths"] = json!(10_000);
    long["problem"]["history"] = json!(monthly_returns());
    app.train(&long).await;
    let mut sessions = [const { Vec::new() }; 2];
    for _ in 0..SESSIONS {
        for client in &mut sessions {
            app.open().await;
            client.push(app.session.clone());
        }
    }
    for period in 1..=PERIODS {
        let batch = |client: &Vec<String>| {
            let report = |session: &String| json!({ "session": session, "period": period, "log_return": 0.01 });
            json!(client.iter().map(report).collect::<Vec<_>>())
        };
        let [first, second] = [&sessions[0], &sessions[1]].map(batch);
        let ((status, _), (other, _)) = tokio::join!(app.post("/observe", &first), app.post("/observe", &second));
        assert_eq!((status, other), (StatusCode::OK, StatusCode::OK));
        // Threads for blocking work live on for ten seconds.
        let (threads, resident) = (figure(&child, "Threads:"), resident(&child));
        assert!(threads < 64 && resident < 300 << 20, "{threads} threads, {resident} bytes resident");
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn policies_of_one_seed_share_their_bridges() {
    const PERIODS: usize = 4;
    let limit = MemoryLimit::chosen(4 << 30);
    let mut app = App::configured(|config| config.memory_limit = limit).await;
    let mut kept = Vec::new();
    for risk_aversion in [3.0, 5.0, 8.0] {
        let utility = json!({ "kind": "power", "risk_aversion": risk_aversion });
        let radius = json!({ "rule": "bridge", "alpha": 0.1, "paths": 200 });
        let history = monthly_returns();
        let problem = json!({ "horizon": PERIODS, "rate_per_step": 0.002, "history": history, "utility": utility, "radius": radius });
        app.train(&json!({ "problem": problem, "design": { "count": 20 } })).await;
        app.open().await;
        for period in 1..=PERIODS {
            assert_eq!(app.action().await.0, StatusCode::OK);
            assert_eq!(app.observe(period, 0.01).await.0, StatusCode::OK);
        }
        kept.push(part(&app, "bridges").await);
    }
    // 200 paths, which take a block of 256, at each of the sample sizes 36 to 40, in two bytes each, and the positions
    // where gaps count.
    let sizes = (36..=36 + PERIODS).map(|size| size * (256 * 2 + 128));
    assert_eq!(kept, vec![sizes.sum::<usize>(); 3]);
    assert_eq!(part(&app, "jobs_reserved").await, 0);
}

#[test]
fn what_is_kept_for_the_library_holds_the_factor_of_the_largest_design() {
    assert!(Cache::default().heaviest() >= 10_000 * 10_000 * 8);
}
