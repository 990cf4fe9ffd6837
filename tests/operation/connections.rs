//! Clients that hold many connections do not keep other clients from being answered.
//!
//! The tests open as many connections as the service's table holds, or more. They need as many descriptors, which they
//! request, and they print a message if they do not get them.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::support::patience::{assert_within, patience, until, within};
use crate::support::process::{self, Process};
use crate::support::{App, specification};
use reqwest::header::AUTHORIZATION;
use serde_json::{Value, json};

/// More than the service holds at a time.
const CROWD: usize = 4300;
/// The most time that a call may take beside them, on a machine that builds something else meanwhile.
const ANSWERED_WITHIN: Duration = Duration::from_secs(2);

/// Returns how long the connections are held; in full 15 s by `BALLAST_TEST_CROWD_SECONDS=15`.
fn held_for() -> Duration {
    let seconds_given = std::env::var("BALLAST_TEST_CROWD_SECONDS").ok().and_then(|seconds| seconds.parse().ok());
    Duration::from_secs(seconds_given.unwrap_or(4))
}

/// Returns whether this process may open that many connections. If not, the test runs again in a process that may, or
/// prints that it did not run at all.
fn may_open_a_crowd(test: &str) -> bool {
    const ENOUGH: usize = 2 * CROWD;
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let line = limits.lines().find_map(|line| line.strip_prefix("Max open files")).unwrap_or_default();
    let mut numbers = line.split_whitespace().map(|number| number.parse().unwrap_or(usize::MAX));
    let (soft, hard) = (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0));
    if soft >= ENOUGH {
        return true;
    }
    if hard >= ENOUGH {
        let raised = format!("ulimit -n {ENOUGH} && exec \"$0\" \"$@\"");
        let program = std::env::current_exe().unwrap();
        let child =
            Command::new("sh").args(["-c", &raised]).arg(program).args([test, "--exact", "--nocapture"]).status();
        assert!(child.unwrap().success(), "{test} failed with more descriptors");
    } else {
        // This bypasses the capture of test output: a suite that ran only half must not look complete.
        let _ = writeln!(std::io::stderr(), "SKIPPED, TOO FEW DESCRIPTORS ({hard} of {ENOUGH}): {test} did not run");
    }
    false
}

/// Starts a service with a separate listener for the operator, and returns the addresses of both.
fn serve(folder: &std::path::Path) -> (Process, String, String) {
    let operations = free_address();
    let (child, url) = process::serve(|command| {
        command.arg("--data").arg(folder).args(["--operations-listen", &operations]);
    });
    (Process(child), url, operations)
}

fn free_address() -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().to_string()
}

fn health_check(address: &str) -> bool {
    let check = Command::new(env!("CARGO_BIN_EXE_ballast")).args(["healthcheck", "--listen", address]).output();
    check.unwrap().status.success()
}

/// Calls both listeners and another tenant's advice, each over a connection of its own, until `until`; returns the
/// slowest time.
async fn answered_throughout(
    url: &str,
    operations: &str,
    action: &str,
    key: &str,
    until: Instant,
) -> (usize, Duration) {
    let (mut rounds, mut slowest) = (0, Duration::ZERO);
    let address = url.strip_prefix("http://").unwrap().to_owned();
    while Instant::now() < until || rounds == 0 {
        for target in [format!("{url}/readyz"), format!("http://{operations}/readyz"), format!("{url}{action}")] {
            let fresh = reqwest::Client::builder().timeout(4 * within(ANSWERED_WITHIN)).build().unwrap();
            let begun = Instant::now();
            let request = fresh.get(&target).header(AUTHORIZATION, format!("Bearer {key}"));
            let answer = request.send().await.unwrap_or_else(|error| panic!("{target} in round {rounds}: {error:?}"));
            assert_eq!(answer.status(), 200, "{target} in round {rounds}");
            slowest = slowest.max(begun.elapsed());
        }
        for address in [&address, operations] {
            let (begun, address) = (Instant::now(), address.to_string());
            let healthy = tokio::task::spawn_blocking(move || health_check(&address)).await.unwrap();
            assert!(healthy, "the health check failed in round {rounds}");
            slowest = slowest.max(begun.elapsed());
        }
        rounds += 1;
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    (rounds, slowest)
}

/// Opens a session of the tenant `north`, and returns the path of its advice and the key to use.
async fn another_tenant(app: &mut App) -> (String, String) {
    let key = app.key("north", "read,operate,train").await;
    app.enter(&key).await;
    app.train(&specification(3)).await;
    app.open().await;
    assert_eq!(app.action().await.0, 200);
    (format!("/action?session={}", app.session), key)
}

/// Connections of a client without a key that sends occasional valid requests on each.
struct Polite {
    address: String,
    sockets: Vec<Option<TcpStream>>,
    opened: usize,
}

impl Polite {
    fn ask(&mut self, index: usize) {
        const REQUEST: &[u8] = b"GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n";
        let mut buffer = [0; 4096];
        let gone = self.sockets[index].as_mut().is_none_or(|socket| {
            let answered = loop {
                match socket.read(&mut buffer) {
                    Ok(0) => break true,
                    Ok(_) => {}
                    Err(error) => break error.kind() != ErrorKind::WouldBlock,
                }
            };
            answered || socket.write_all(REQUEST).is_err()
        });
        if gone {
            let socket = TcpStream::connect(&self.address).ok().and_then(|mut socket| {
                socket.set_nonblocking(true).ok()?;
                socket.write_all(REQUEST).ok()?;
                Some(socket)
            });
            self.opened += 1;
            self.sockets[index] = socket;
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn a_polite_crowd_without_a_key_keeps_nobody_out() {
    if !may_open_a_crowd("a_polite_crowd_without_a_key_keeps_nobody_out") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (_process, url, operations) = serve(folder.path());
    let mut app = App::at(url.clone(), folder);
    let (action, key) = another_tenant(&mut app).await;
    let address = url.strip_prefix("http://").unwrap().to_owned();
    let until = Instant::now() + Duration::from_secs(3) + held_for();
    let crowd = std::thread::spawn(move || {
        let mut crowd = Polite { address, sockets: (0..CROWD).map(|_| None).collect(), opened: 0 };
        while Instant::now() < until {
            let round = Instant::now();
            (0..CROWD).for_each(|index| crowd.ask(index));
            std::thread::sleep(
                Duration::from_millis(3500).saturating_sub(round.elapsed()).min(until - Instant::now().min(until)),
            );
        }
        crowd.opened
    });
    let (rounds, slowest) = answered_throughout(&url, &operations, &action, &key, until).await;
    let opened = crowd.join().unwrap();
    println!(
        "{opened} connections opened by {CROWD} polite clients; {rounds} rounds answered, the slowest call in {slowest:?}"
    );
    assert!(opened >= CROWD && slowest < within(ANSWERED_WITHIN), "{slowest:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn a_crowd_of_streams_of_one_key_keeps_nobody_out() {
    if !may_open_a_crowd("a_crowd_of_streams_of_one_key_keeps_nobody_out") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (_process, url, operations) = serve(folder.path());
    let mut app = App::at(url.clone(), folder);
    let (action, key) = another_tenant(&mut app).await;
    let trains = app.key("south", "read,train").await;
    app.enter(&trains).await;
    let mut long = specification(200);
    long["design"]["count"] = json!(400);
    let job = app.queue(&long).await;
    let request =
        format!("GET /jobs/{job}/events HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {trains}\r\n\r\n");
    let address = url.strip_prefix("http://").unwrap().to_owned();
    let until = Instant::now() + Duration::from_secs(4) + held_for();
    let crowd = std::thread::spawn(move || {
        let sockets: Vec<TcpStream> = (0..CROWD)
            .filter_map(|_| {
                let mut socket = TcpStream::connect(&address).ok()?;
                socket.set_nonblocking(true).ok()?;
                socket.write_all(request.as_bytes()).ok()?;
                Some(socket)
            })
            .collect();
        std::thread::sleep(until.saturating_duration_since(Instant::now()));
        let heads = sockets.into_iter().map(|mut socket| {
            let mut head = [0; 12];
            match socket.read(&mut head) {
                Ok(12) => String::from_utf8_lossy(&head[9..]).into_owned(),
                _ => "none".to_owned(),
            }
        });
        let mut by_status = std::collections::BTreeMap::<String, usize>::new();
        heads.for_each(|status| *by_status.entry(status).or_default() += 1);
        by_status
    });
    let (rounds, slowest) = answered_throughout(&url, &operations, &action, &key, until).await;
    let statuses = crowd.join().unwrap();
    println!(
        "{CROWD} streams were answered {statuses:?}; {rounds} rounds beside them, the slowest call in {slowest:?}"
    );
    // A stream that is closed for a new caller frees its slot for another. So there are more than 256 in all, but never
    // at a time.
    assert!(statuses.get("200").copied().unwrap_or(0) <= 2 * 256 && statuses.contains_key("429"), "{statuses:?}");
    assert!(slowest < within(ANSWERED_WITHIN), "{slowest:?}");
    assert_eq!(app.cancel(&job).await, 202);
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_are_bounded_in_number_and_age_and_go_on_where_they_were() {
    let app = App::configured(|config| {
        (config.limits.streams_of_one, config.limits.stream_age) = (2, Duration::from_secs(2));
    })
    .await;
    let mut long = specification(200);
    long["design"]["count"] = json!(400);
    let job = app.queue(&long).await;
    let url = format!("{}/jobs/{job}/events", app.url);
    let (first, second) = (app.client.get(&url).send().await.unwrap(), app.client.get(&url).send().await.unwrap());
    assert_eq!(first.headers()["x-accel-buffering"], "no", "a proxy would keep events back");
    let third = app.client.get(&url).send().await.unwrap();
    assert_eq!((second.status().as_u16(), third.headers()["retry-after"].to_str().unwrap()), (200, "1"));
    let (status, problem) = crate::support::read(third).await;
    assert_eq!((status.as_u16(), &problem["field"]), (429, &json!("streams")), "{problem}");
    let opened = Instant::now();
    let seen = tokio::time::timeout(patience(), first.text()).await.unwrap().unwrap();
    assert_within(Duration::from_secs(10), opened, "a stream of 2 s");
    drop(second);
    let last = seen.lines().filter_map(|line| line.strip_prefix("id: ")).next_back().unwrap();
    assert_eq!(app.cancel(&job).await, 202);
    let again = app.client.get(&url).header("last-event-id", last).send().await.unwrap();
    assert_eq!(again.status(), 200);
    let rest = again.text().await.unwrap();
    assert!(rest.contains("cancelled") && !rest.contains(&format!("id: {last}\n")), "{rest}");
}

/// Reads the answer until the other side closes; returns `None` if the connection broke.
fn whole_answer(mut socket: TcpStream) -> Option<String> {
    let mut answer = Vec::new();
    socket.set_read_timeout(Some(patience())).unwrap();
    socket.read_to_end(&mut answer).ok()?;
    Some(String::from_utf8_lossy(&answer).into_owned())
}

/// Sends the whole body before it reads the answer, as most clients do.
fn send_all(address: &str, path: &str, headers: &str, length: usize) -> Option<String> {
    let mut socket = TcpStream::connect(address).unwrap();
    let head = format!("POST {path} HTTP/1.1\r\nHost: localhost\r\n{headers}Content-Length: {length}\r\n\r\n");
    socket.write_all(head.as_bytes()).ok()?;
    let chunk = vec![b'['; 64 << 10];
    let mut left = length;
    while left > 0 {
        let now = left.min(chunk.len());
        socket.write_all(&chunk[..now]).ok()?;
        left -= now;
    }
    whole_answer(socket)
}

#[tokio::test(flavor = "multi_thread")]
async fn who_is_refused_early_reads_why() {
    let mut app = App::configured(|config| config.body_limit_bytes = 64 << 20).await;
    let key = app.key("north", "train").await;
    app.enter(&key).await;
    let address = app.url.strip_prefix("http://").unwrap().to_owned();
    let json = "Content-Type: application/json\r\n";
    let shown = format!("{json}Authorization: Bearer {key}\r\n");
    let text = format!("Content-Type: text/plain\r\nAuthorization: Bearer {key}\r\n");
    let packed = format!("{shown}Content-Encoding: gzip\r\n");
    for (path, headers, length, status) in [
        ("/train", shown.as_str(), 20 << 20, "413"),
        ("/policies/import", json, 60 << 20, "401"),
        ("/train", json, 3 << 20, "401"),
        ("/train", &text, 3 << 20, "415"),
        ("/train", &packed, 3 << 20, "415"),
    ] {
        for _ in 0..10 {
            let (address, headers) = (address.clone(), headers.to_owned());
            let sent = tokio::task::spawn_blocking(move || send_all(&address, path, &headers, length)).await.unwrap();
            let answer = sent.unwrap_or_else(|| panic!("{path} {length} {status}: the connection broke"));
            assert!(answer.starts_with(&format!("HTTP/1.1 {status}")), "{answer}");
            assert!(answer.contains("connection: close") && answer.ends_with('}'), "{answer}");
        }
    }
    // A small body is read even so, and the connection stays open.
    let small = tokio::task::spawn_blocking(move || {
        let mut socket = TcpStream::connect(address).unwrap();
        let refused = "POST /train HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2\r\n\r\n{}";
        socket.write_all(refused.as_bytes()).unwrap();
        socket.write_all(b"GET /livez HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
        whole_answer(socket).unwrap()
    });
    let small = small.await.unwrap();
    assert!(small.starts_with("HTTP/1.1 401") && small.contains("HTTP/1.1 200"), "{small}");
    assert!(small.contains("keep-alive: timeout="), "{small}");
}

/// Returns the status of the answer to these header lines.
async fn status(url: &str, lines: &str) -> String {
    let address = url.strip_prefix("http://").unwrap().to_owned();
    let request = format!("GET /jobs HTTP/1.1\r\n{lines}Connection: close\r\n\r\n");
    let answer = tokio::task::spawn_blocking(move || {
        let mut socket = TcpStream::connect(address).unwrap();
        socket.write_all(request.as_bytes()).unwrap();
        whole_answer(socket).unwrap()
    });
    answer.await.unwrap().split(' ').nth(1).unwrap_or_default().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn without_keys_only_own_names_are_answered_to() {
    let app = App::configured(|config| config.hosts = vec!["ballast.internal".into()]).await;
    let own = app.url.strip_prefix("http://").unwrap().to_owned();
    for host in [own.as_str(), "localhost", "127.0.0.1", "[::1]:8080", "ballast.internal:80", "LOCALHOST:1"] {
        assert_eq!(status(&app.url, &format!("Host: {host}\r\n")).await, "200", "{host}");
    }
    for host in ["evil.example", "evil.example:8080", "localhost.evil.example", ""] {
        assert_eq!(status(&app.url, &format!("Host: {host}\r\n")).await, "421", "{host}");
    }
    assert_eq!(status(&app.url, "").await, "400");
    assert_eq!(status(&app.url, "Host: localhost\r\nHost: evil.example\r\n").await, "400");
    let keys = "Authorization: Bearer a\r\nAuthorization: Bearer b\r\n";
    assert_eq!(status(&app.url, &format!("Host: localhost\r\n{keys}")).await, "400");
    let problem = app.client.get(format!("{}/jobs", app.url)).header("host", "evil.example").send().await.unwrap();
    let (_, problem): (_, Value) = crate::support::read(problem).await;
    assert_eq!((&problem["field"], &problem["value"]), (&json!("Host"), &json!("evil.example")), "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn without_keys_pages_of_other_origins_change_nothing_and_answers_are_not_stored() {
    let app = App::start().await;
    let cancel = app.client.post(format!("{}/jobs/job_0/cancel", app.url));
    let of_page = |site| cancel.try_clone().unwrap().header("sec-fetch-site", site).send();
    for (site, status) in [("cross-site", 400), ("same-site", 400), ("same-origin", 404), ("none", 404)] {
        let answer = of_page(site).await.unwrap();
        assert_eq!(answer.status(), status, "{site}");
        assert_eq!(answer.headers()["x-content-type-options"], "nosniff");
        assert_eq!(answer.headers()["cache-control"], "no-store");
    }
    assert_eq!(cancel.send().await.unwrap().status(), 404, "a program says nothing of pages");
    let listed =
        app.client.get(format!("{}/jobs", app.url)).header("sec-fetch-site", "cross-site").send().await.unwrap();
    assert_eq!(listed.status(), 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_log_is_not_filled_by_who_shows_no_key() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let file = std::fs::File::create(&log).unwrap();
    let (child, url) = process::serve(|command| {
        command.arg("--data").arg(folder.path()).env("RUST_LOG", "info").stderr(file);
    });
    let process = Process(child);
    let client = reqwest::Client::new();
    let long = "x".repeat(30_000);
    for _ in 0..600 {
        let answer = client.get(format!("{url}/{long}")).send().await.unwrap();
        assert_eq!(answer.status(), 404);
        assert!(answer.text().await.unwrap().len() < 2000, "the path was shown back whole");
    }
    drop(process);
    let written = std::fs::read_to_string(&log).unwrap();
    assert!(written.len() < 100_000, "{} bytes", written.len());
    assert!(written.lines().any(|line| line.contains("/xxx")), "{written}");
    let longest = written.lines().map(str::len).max().unwrap_or(0);
    assert!(longest < 1000, "{longest}");
}

/// If work uses every connection slot, only the probes are answered.
#[tokio::test(flavor = "multi_thread")]
async fn places_are_kept_for_the_probes() {
    let app = App::configured(|config| {
        (config.connection_limit, config.connections_of_address) = (2, Some(2));
    })
    .await;
    let lock = crate::support::lock_out(app.folder()).await;
    // A call that comes while a poll below has the second slot is rejected, perhaps before its body is sent, and
    // retries.
    let train = async || loop {
        match app.client.post(format!("{}/train", app.url)).json(&specification(3)).send().await {
            Ok(answer) if answer.status() != 503 => return answer.status(),
            _ => tokio::task::yield_now().await,
        }
    };
    let calls = futures_util::future::join(train(), train());
    let probes = async {
        let fresh = reqwest::Client::builder().pool_max_idle_per_host(0).build().unwrap();
        let jobs = async || fresh.get(format!("{}/jobs", app.url)).send().await;
        until("both places to be taken", async || jobs().await.ok().filter(|answer| answer.status() == 503)).await;
        for _ in 0..20 {
            assert_eq!(fresh.get(format!("{}/livez", app.url)).send().await.unwrap().status(), 200);
            let other = jobs().await.unwrap();
            assert_eq!((other.status().as_u16(), other.headers()["connection"].to_str().unwrap()), (503, "close"));
        }
        lock.give_up().await;
    };
    let (calls, ()) = tokio::join!(calls, probes);
    assert_eq!(calls, (reqwest::StatusCode::ACCEPTED, reqwest::StatusCode::ACCEPTED));
}
