//! Traces leave where a collector is named, and nothing is started where none is.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use crate::support::patience::patience;
use crate::support::process::{self, Process};
use crate::support::{App, specification};

/// A collector: its address, and what was posted to it, path and body.
fn collector() -> (String, Receiver<(String, Vec<u8>)>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let (posted, received) = mpsc::channel();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let (mut stream, posted) = (stream.unwrap(), posted.clone());
            std::thread::spawn(move || {
                let mut reader = BufReader::new(stream.try_clone().unwrap());
                loop {
                    let (mut line, mut head, mut length) = (String::new(), String::new(), 0);
                    while reader.read_line(&mut line).is_ok_and(|read| read > 2) {
                        if let Some(bytes) = line.to_ascii_lowercase().strip_prefix("content-length:") {
                            length = bytes.trim().parse().unwrap();
                        }
                        head.push_str(&line);
                        line.clear();
                    }
                    if head.is_empty() {
                        return;
                    }
                    let mut body = vec![0; length];
                    reader.read_exact(&mut body).unwrap();
                    let path = head.split(' ').nth(1).unwrap().to_owned();
                    let _ = posted.send((path, body));
                    stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n").unwrap();
                }
            });
        }
    });
    (address, received)
}

/// The names of the threads of a process, as far as the kernel keeps them.
fn threads(process: &Process) -> Vec<String> {
    let tasks = std::fs::read_dir(format!("/proc/{}/task", process.0.id())).unwrap();
    tasks.filter_map(|task| std::fs::read_to_string(task.ok()?.path().join("comm")).ok()).collect()
}

fn holds(body: &[u8], text: &str) -> bool {
    body.windows(text.len()).any(|window| window == text.as_bytes())
}

async fn used(endpoint: Option<&str>) -> (Process, App, String) {
    let folder = tempfile::tempdir().unwrap();
    let (child, url) = process::serve(|command| {
        command.arg("--data").arg(folder.path()).env("OTEL_BSP_SCHEDULE_DELAY", "100");
        command
            .env_remove("OTEL_EXPORTER_OTLP_ENDPOINT")
            .envs(endpoint.map(|url| ("OTEL_EXPORTER_OTLP_ENDPOINT", url)));
    });
    let (process, mut app) = (Process(child), App::at(url, folder));
    let key = app.key("north", "admin").await;
    app.enter(&key).await;
    app.train(&specification(2)).await;
    app.open().await;
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    assert_eq!(app.get(&format!("/action?session={}&mode=resolve", app.session)).await.0, 200);
    (process, app, key)
}

#[tokio::test(flavor = "multi_thread")]
async fn spans_name_routes_tenants_writes_and_solves_and_no_key() {
    let (endpoint, received) = collector();
    let (process, app, key) = used(Some(&endpoint)).await;
    assert!(threads(&process).iter().any(|name| name.starts_with("OpenTelemetry")), "{:?}", threads(&process));
    let wanted = [
        "GET /action",
        "POST /observe",
        "/observe",
        "north",
        "append an entry",
        "open a session",
        "solve",
        "wait for a turn",
        "service.name",
        "ballast",
        "http.response.status_code",
    ];
    let (mut all, deadline) = (Vec::new(), Instant::now() + patience());
    while !wanted.iter().all(|text| holds(&all, text)) {
        let missing: Vec<_> = wanted.iter().filter(|text| !holds(&all, text)).collect();
        assert!(Instant::now() < deadline, "never told of {missing:?}");
        if let Ok((path, body)) = received.recv_timeout(Duration::from_millis(100)) {
            assert_eq!(path, "/v1/traces");
            all.extend(body);
        }
    }
    for secret in [&key[8..], &app.session] {
        assert!(!holds(&all, secret), "a trace tells {secret}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_started_where_no_collector_is_named() {
    let (process, ..) = used(None).await;
    assert!(!threads(&process).iter().any(|name| name.starts_with("OpenTelemetry")), "{:?}", threads(&process));
}
