//! Many callers ask for the largest answers, and half of them read nothing; or all ask for sessions that a restarted
//! process must replay first. The process stays within its memory, and other callers do not wait.

use std::time::{Duration, Instant};

use futures_util::future::join_all;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpSocket;

use crate::caller::{Answer, Caller};
use crate::neighbours::{ANSWERED, Attack, attack_time};
use crate::scene::{Outcome, Tally, large_specification, specification, undisturbed};
use crate::server::Site;
use crate::support::patience::within;
use crate::support::{labelled, trained};
use crate::tenants::{Pulse, Tenants};

/// Callers of each large question; every second one reads nothing.
const CALLERS: usize = 50;
/// Resident memory at most, under a limit of 1 GB.
const MOST_MB: usize = 1200;
/// Periods of a session for each second of an attack.
const PERIODS: usize = 150;
const MOST_PERIODS: usize = 5000;
const SESSIONS: usize = 300;
const JOBS: usize = 20;
/// Returns of a session, each of which a worst law explains.
const RETURNS: usize = 2000;
/// Bytes of a body that is not a policy.
const NO_POLICY: usize = 8 << 20;
const READ_AT_ONCE: usize = 64 << 10;

pub async fn unread(trials: usize) -> Outcome {
    Tenants::attacked(Site::limited(&["--memory-limit", "1GB"]), trials, Attack::LeaveUnread).await
}

/// A question with a large answer or a large body.
struct LargeQuestion {
    name: &'static str,
    request: String,
}

pub async fn leave(tenants: &Tenants, tally: &mut Tally) -> Result<usize, String> {
    let (mut calls, mut notes) = (0, Vec::new());
    for LargeQuestion { name, request } in questions(&tenants.neighbour).await? {
        let alive = Pulse::of(tenants.owner.another(), "/livez".to_owned());
        let advice = tenants.pulse("").await?;
        calls += call(&tenants.server.url, &request).await;
        let [alive, advice] = [alive.stop().await, advice.stop().await];
        for pace in [&alive, &advice] {
            pace.report(within(ANSWERED), tally);
        }
        let peak = tenants.server.peak_mb();
        if peak > MOST_MB {
            tally.complain(format!("{name}: {peak} MB resident"));
        }
        notes.push(format!("{name} {peak} MB, {} and {} ms", alive.p99(), advice.p99()));
    }
    tally.note = format!("resident at most, p99 of /livez and /action: {}", notes.join("; "));
    Ok(calls)
}

async fn questions(caller: &Caller) -> Result<Vec<LargeQuestion>, String> {
    let question = |name, request| LargeQuestion { name, request };
    let long = long(caller).await?;
    let sweep = sweep(caller).await?;
    label(caller).await?;
    queue(caller).await?;
    let no_policy = format!("{{\"steps\":[{}0]}}", "0,".repeat(NO_POLICY / 2));
    Ok(vec![
        question("history", caller.request("GET", &format!("/sessions/{long}/history"))),
        question("sessions", caller.request("GET", "/sessions?limit=1000")),
        question("jobs", caller.request("GET", "/jobs?limit=1000")),
        question("what-if", caller.request_with("POST", "/what-if", &sweep)),
        question("import", caller.request_with("POST", "/policies/import", &no_policy)),
    ])
}

pub fn made_of(answer: Option<Answer>, name: &str) -> Result<String, String> {
    match answer {
        Some((201, made)) => made[name].as_str().map(str::to_owned).ok_or(format!("no {name} in {made}")),
        other => Err(format!("no {name}: {other:?}")),
    }
}

/// Bridge paths of a small training.
const PATHS: usize = 200;

/// Sessions that are replayed after a restart.
const REPLAYED: usize = 20;

/// Callers ask for sessions that a new process must replay, at the same time.
pub async fn replayed(trials: usize) -> Outcome {
    let (site, mut tally) = (Site::limited(&["--memory-limit", "1GB"]), Tally::default());
    let mut server = site.start().await?;
    let mut caller = Caller::new(&[&server.url]);
    let opening = json!({ "policy": imported(&caller, &trained(&unending(PATHS))).await?, "rolling": true });
    let mut sessions = Vec::new();
    for _ in 0..REPLAYED {
        sessions.push(made_of(caller.post("/sessions", &opening).await, "session")?);
    }
    let mut period = 0;
    for _ in 0..trials {
        let last = period + MOST_PERIODS.min(PERIODS * attack_time().as_secs() as usize);
        while period < last {
            period += 1;
            tally.audit.acknowledged += report_all(&caller, &sessions, period).await?;
        }
        let before = advice(&caller, &sessions[0]).await?;
        server.signal("-KILL");
        server.ended().await;
        server = site.start().await?;
        tally.started(&server);
        caller = Caller::new(&[&server.url]);
        let alive = Pulse::of(caller.another(), "/livez".to_owned());
        let replaying = join_all((0..CALLERS).map(async |number| {
            let path = format!("/action?session={}", sessions[number % REPLAYED]);
            let started = Instant::now();
            let answer = ask(server.url.trim_start_matches("http://"), &caller.request("GET", &path), true).await;
            answer.map(|()| started.elapsed()).map_err(|error| error.to_string())
        }));
        let slowest = replaying.await.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().max().unwrap_or_default();
        let alive = alive.stop().await;
        alive.report(within(ANSWERED), &mut tally);
        let peak = server.peak_mb();
        tally.note = format!(
            "{REPLAYED} sessions of {period} periods: {} ms at most, {peak} MB resident, p99 of /livez {} ms",
            slowest.as_millis(),
            alive.p99()
        );
        if peak > MOST_MB {
            tally.complain(tally.note.clone());
        }
        tally.stale += usize::from(before != advice(&caller, &sessions[0]).await?);
        (tally.trials, tally.faults) = (tally.trials + 1, tally.faults + 1);
    }
    tally.inspect(&site).await;
    tally.listen(&site);
    Ok(Some(tally))
}

/// Reports a period of every session; returns how many reports were acknowledged.
async fn report_all(caller: &Caller, sessions: &[String], period: usize) -> Result<usize, String> {
    let report = |session| json!({ "session": session, "period": period, "log_return": log_return(period) });
    let reports: Value = sessions.iter().map(report).collect();
    match caller.post("/observe", &reports).await {
        Some((200, answers)) if answers.as_array().is_some_and(|answers| answers.len() == sessions.len()) => {
            let refused = answers.as_array().into_iter().flatten().find(|answer| answer["status"] != json!(200));
            refused.map_or(Ok(sessions.len()), |answer| Err(format!("period {period}: {answer}")))
        }
        other => Err(format!("period {period}: {other:?}")),
    }
}

async fn advice(caller: &Caller, session: &str) -> Result<Value, String> {
    match caller.get(&format!("/action?session={session}")).await {
        Some((200, advice)) => Ok(advice),
        other => Err(format!("no advice: {other:?}")),
    }
}

/// Imports a policy; returns its name.
pub async fn imported(caller: &Caller, policy: &[u8]) -> Result<String, String> {
    let policy: Value = serde_json::from_slice(policy).map_err(|error| error.to_string())?;
    made_of(caller.post("/policies/import", &policy).await, "policy")
}

pub fn log_return(number: usize) -> f64 {
    0.004 + 0.02 * (1.7 * number as f64).sin()
}

/// A training whose sessions may go on without an end, with so many bridge paths.
fn unending(paths: usize) -> Value {
    let mut training = specification(2);
    training["problem"]["radius"]["paths"] = json!(paths);
    training["problem"]["learning"] = json!({ "kind": "decay", "half_life": 1 });
    training["problem"]["utility"] = json!({ "kind": "power", "risk_aversion": 3 });
    training["design"]["initial_laws"] = json!("resampled");
    training
}

/// Opens a rolling session and reports periods in proportion to the length of the attack.
async fn long(caller: &Caller) -> Result<String, String> {
    let policy = imported(caller, &trained(&unending(PATHS))).await?;
    let opened = caller.post("/sessions", &json!({ "policy": policy, "rolling": true })).await;
    let session = made_of(opened, "session")?;
    for period in 1..=MOST_PERIODS.min(PERIODS * attack_time().as_secs() as usize) {
        let report = json!({ "session": session, "period": period, "log_return": log_return(period) });
        let answer = caller.post("/observe", &report).await;
        if !matches!(answer, Some((200, _))) {
            return Err(format!("period {period}: {answer:?}"));
        }
    }
    Ok(session)
}

/// Returns a sweep whose points each carry the worst law of a session of many returns.
async fn sweep(caller: &Caller) -> Result<String, String> {
    let policy = imported(caller, &undisturbed(2)).await?;
    let history: Vec<f64> = (0..RETURNS).map(log_return).collect();
    let session = made_of(caller.post("/sessions", &json!({ "policy": policy, "history": history })).await, "session")?;
    let range = json!({ "from": 0.5, "to": 1.5, "points": 50 });
    Ok(json!({ "session": session, "explain": "worst_case", "sweep": { "radius_scale": range } }).to_string())
}

/// Opens sessions with labels at their limits.
async fn label(caller: &Caller) -> Result<(), String> {
    let policy = imported(caller, &undisturbed(2)).await?;
    let opening = labelled(json!({ "policy": policy }));
    for _ in 0..SESSIONS {
        made_of(caller.post("/sessions", &opening).await, "session")?;
    }
    Ok(())
}

/// Queues jobs of large requests.
async fn queue(caller: &Caller) -> Result<(), String> {
    let mut large = large_specification();
    for number in 0..JOBS {
        large["seed"] = json!(number);
        let answer = caller.train(&format!("unread-{number}"), &large).await;
        if !matches!(answer, Some((202, _))) {
            return Err(format!("a job: {answer:?}"));
        }
    }
    Ok(())
}

/// Asks from all callers until the attack ends; returns the number of calls.
async fn call(url: &str, request: &str) -> usize {
    let (address, end) = (url.trim_start_matches("http://"), Instant::now() + attack_time());
    let calling = (0..CALLERS).map(async |number| {
        let mut calls = 0;
        while Instant::now() < end {
            let call = ask(address, request, number % 2 == 0);
            let left = end.saturating_duration_since(Instant::now());
            // A caller that is refused or cut off asks again soon.
            if !matches!(tokio::time::timeout(left, call).await, Ok(Ok(()))) {
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
            calls += 1;
        }
        calls
    });
    join_all(calling).await.into_iter().sum()
}

/// Asks once. The answer is read to its end, or not at all until the server gives up.
async fn ask(address: &str, request: &str, reads: bool) -> std::io::Result<()> {
    let socket = TcpSocket::new_v4()?;
    if !reads {
        socket.set_recv_buffer_size(4096)?;
    }
    let mut stream = socket.connect(address.parse().expect("an address")).await?;
    stream.write_all(request.replacen("\r\n", "\r\nconnection: close\r\n", 1).as_bytes()).await?;
    if !reads {
        while stream.write_all(b" ").await.is_ok() {
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
        return Ok(());
    }
    let mut buffer = vec![0; READ_AT_ONCE];
    while stream.read(&mut buffer).await? > 0 {}
    Ok(())
}
