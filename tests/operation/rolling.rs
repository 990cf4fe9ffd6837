//! A rolling restart of two replicas behind a plain TCP balancer, seen by clients that never retry.
//!
//! The balancer forwards bytes to the replicas in turn, and checks the `/readyz` of each every 200 ms, as orchestrators
//! do. `BALLAST_ROLLING_RESTARTS` sets more restarts than the short form makes.

use std::collections::BTreeMap;
use std::process::{Child, Command};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::support::patience::until;
use crate::support::postgres::database;
use crate::support::process::{Process, serve};
use crate::support::{App, specification};
use tokio::io::{AsyncReadExt, AsyncWriteExt, copy_bidirectional};
use tokio::net::{TcpListener, TcpStream};

const RESTARTS: usize = 2;
/// The interval between the balancer's checks, and the delay of a replica between the signal and the end of accepting.
const LOOK: Duration = Duration::from_millis(200);
const DRAIN_DELAY: &str = "2";
/// The number of clients of each kind: one connection for every call, or one for many.
const CLIENTS: usize = 4;
/// The number of calls that may fail, of ten thousand.
const MAY_FAIL: usize = 1;

type Backends = Arc<Mutex<Vec<String>>>;

fn start(store: &str) -> (Process, String) {
    let (child, url) = serve(|command| {
        command.args(["--drain-delay", DRAIN_DELAY, "--store", store]);
    });
    (Process(child), url.strip_prefix("http://").unwrap().to_owned())
}

async fn is_ready(address: &str) -> bool {
    let answer = reqwest::get(format!("http://{address}/readyz")).await;
    answer.is_ok_and(|answer| answer.status() == 200)
}

/// Forwards connections to the replicas that were ready at the last check, in turn, and returns the balancer's address.
async fn balance(all: Backends) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let (address, ready) = (listener.local_addr().unwrap().to_string(), Backends::default());
    let seen = ready.clone();
    tokio::spawn(async move {
        loop {
            let addresses = all.lock().unwrap().clone();
            let mut found = Vec::new();
            for address in addresses {
                if is_ready(&address).await {
                    found.push(address);
                }
            }
            *seen.lock().unwrap() = found;
            tokio::time::sleep(LOOK).await;
        }
    });
    tokio::spawn(async move {
        for turn in 0.. {
            let (mut client, _) = listener.accept().await.unwrap();
            let ready = ready.lock().unwrap().clone();
            tokio::spawn(async move {
                // A replica that refuses the connection is skipped.
                for place in 0..ready.len() {
                    let address = &ready[(turn + place) % ready.len()];
                    if let Ok(mut server) = TcpStream::connect(address).await {
                        let _ = copy_bidirectional(&mut client, &mut server).await;
                        return;
                    }
                }
            });
        }
    });
    address
}

/// Makes one call over a connection, and returns whether the connection may be used again.
async fn call(stream: &mut TcpStream, path: &str, keep: bool) -> Result<bool, String> {
    let connection = if keep { "keep-alive" } else { "close" };
    let request = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: {connection}\r\n\r\n");
    stream.write_all(request.as_bytes()).await.map_err(|error| format!("sending: {error}"))?;
    let (mut answer, mut buffer) = (Vec::new(), [0; 4096]);
    loop {
        if let Some(end) = answer.windows(4).position(|four| four == b"\r\n\r\n") {
            let head = String::from_utf8_lossy(&answer[..end]).to_lowercase();
            let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
            let length: usize = length.and_then(|length| length.parse().ok()).ok_or("an answer without a length")?;
            if answer.len() >= end + 4 + length {
                let status = head.split(' ').nth(1).unwrap_or_default().to_owned();
                let is_closing = head.lines().any(|line| line == "connection: close");
                return if status == "200" { Ok(keep && !is_closing) } else { Err(format!("status {status}")) };
            }
        }
        match stream.read(&mut buffer).await {
            Ok(0) => return Err(format!("closed after {} bytes", answer.len())),
            Ok(count) => answer.extend_from_slice(&buffer[..count]),
            Err(error) => return Err(format!("reading: {error}")),
        }
    }
}

/// Calls until `stop` is set, and returns the failures, each with its cause.
async fn client(
    address: String,
    path: String,
    keep: bool,
    stop: Arc<AtomicBool>,
    calls: Arc<AtomicUsize>,
) -> Vec<String> {
    let (mut failed, mut kept) = (Vec::new(), None);
    while !stop.load(Ordering::Relaxed) {
        let called = async {
            let mut stream = match kept.take() {
                Some(stream) => stream,
                None => TcpStream::connect(&address).await.map_err(|error| format!("connecting: {error}"))?,
            };
            if call(&mut stream, &path, keep).await? {
                kept = Some(stream);
            }
            Ok::<_, String>(())
        };
        if let Err(how) = called.await {
            failed.push(format!("{}: {how}", if keep { "kept" } else { "fresh" }));
        }
        calls.fetch_add(1, Ordering::Relaxed);
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
    failed
}

fn terminate(child: &Child) {
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
}

#[tokio::test(flavor = "multi_thread")]
async fn no_call_fails_while_replicas_are_restarted_in_turn() {
    let Some(store) = database().await else { return };
    let restarts = std::env::var("BALLAST_ROLLING_RESTARTS").map_or(RESTARTS, |count| count.parse().expect("a number"));
    let (first, second) = (start(&store), start(&store));
    let mut app = App::at(format!("http://{}", first.1), tempfile::tempdir().unwrap());
    app.train(&specification(2)).await;
    app.open().await;
    let path = format!("/action?session={}", app.session);
    let backends: Backends = Arc::new(Mutex::new(vec![first.1.clone(), second.1.clone()]));
    let address = balance(backends.clone()).await;
    until("the balancer to serve", async || {
        reqwest::get(format!("http://{address}{path}")).await.is_ok().then_some(())
    })
    .await;
    let (stop, calls) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
    let clients: Vec<_> = (0..2 * CLIENTS)
        .map(|number| tokio::spawn(client(address.clone(), path.clone(), number % 2 == 0, stop.clone(), calls.clone())))
        .collect();
    let mut replicas = [first, second];
    for restart in 0..restarts {
        let replica = &mut replicas[restart % 2];
        terminate(&replica.0.0);
        let ended = async || replica.0.0.try_wait().unwrap();
        assert!(until("the replica to end", ended).await.success());
        let next = start(&store);
        {
            let mut backends = backends.lock().unwrap();
            backends.retain(|address| *address != replica.1);
            backends.push(next.1.clone());
        }
        until("the new replica to be ready", async || is_ready(&next.1).await.then_some(())).await;
        // The balancer has seen it.
        tokio::time::sleep(2 * LOOK).await;
        *replica = next;
    }
    stop.store(true, Ordering::Relaxed);
    let mut failed: BTreeMap<String, usize> = BTreeMap::new();
    for client in clients {
        for how in client.await.unwrap() {
            *failed.entry(how).or_default() += 1;
        }
    }
    let (calls, count) = (calls.load(Ordering::Relaxed), failed.values().sum::<usize>());
    println!("{restarts} restarts, {calls} calls, {count} failed: {failed:?}");
    assert!(calls > 100 * restarts, "{calls} calls");
    assert!(10_000 * count <= MAY_FAIL * calls, "{failed:?} of {calls}");
}
