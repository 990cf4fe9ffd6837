//! Attacks of one tenant on another: calls for his sessions while reads fail, jobs larger than memory, more policies than it
//! holds, connections and streams held, lists of large jobs, queues filled, answers that nobody reads, batches, searches and
//! questions of many. What was acknowledged to him stays, no advice of his is stale, and he is answered throughout.

use std::time::{Duration, Instant};

use futures_util::future::join_all;
use serde_json::{Value, json};
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{ConnectOptions, Connection};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::caller::Caller;
use crate::scene::{HORIZON, Outcome, Tally, import, large_specification, specification, undisturbed};
use crate::server::Site;
use crate::support::patience::{patience, within};
use crate::tenants::{Tenants, sessions};
use crate::{unread, work};

/// How long an attack lasts; `BALLAST_ATTACK_SECONDS` asks for another time.
const ATTACK: Duration = Duration::from_secs(2);
/// Calls under way at a time.
const AT_ONCE: usize = 16;
/// On a machine that does nothing else advice takes a millisecond; one that builds beside it gets this much.
pub const ANSWERED: Duration = Duration::from_millis(500);

pub fn attack_time() -> Duration {
    let seconds = std::env::var("BALLAST_ATTACK_SECONDS").ok();
    seconds.map_or(ATTACK, |seconds| Duration::from_secs(seconds.parse().expect("a number of seconds")))
}

#[derive(Debug, Clone, Copy)]
pub enum Attack {
    Intrude,
    Overreach,
    Hoard,
    Hold,
    List,
    Crowd,
    LeaveUnread,
    Batch,
    Search,
    Ask,
}

impl Attack {
    /// Returns true if calls fail under the attack although nobody refused them.
    pub fn fails_reads(self) -> bool {
        matches!(self, Attack::Intrude)
    }

    /// The calls made.
    pub async fn run(self, tenants: &mut Tenants, tally: &mut Tally) -> Result<usize, String> {
        match self {
            Attack::Intrude => intrude(tenants, tally).await,
            Attack::Overreach => overreach(tenants, tally).await,
            Attack::Hoard => hoard(tenants, tally).await,
            Attack::Hold => hold(tenants, tally).await,
            Attack::List => list(tenants, tally).await,
            Attack::Crowd => crowd(tenants, tally).await,
            Attack::LeaveUnread => unread::leave(tenants, tally).await,
            Attack::Batch => work::batch(tenants, tally).await,
            Attack::Search => work::search(tenants, tally).await,
            Attack::Ask => work::ask(tenants, tally).await,
        }
    }
}

pub async fn strangers(trials: usize) -> Outcome {
    Tenants::attacked(Site::new(), trials, Attack::Intrude).await
}

/// Every route of sessions by the owner's names, while the table of entries is away now and again.
async fn intrude(tenants: &Tenants, tally: &mut Tally) -> Result<usize, String> {
    let end = Instant::now() + attack_time();
    let strangers = (0..4).map(|_| intruder(tenants, end));
    let file = tenants.site.data().join("ballast.sqlite");
    let (found, hidden) = tokio::join!(join_all(strangers), hide(&file, end));
    let (calls, answered): (Vec<usize>, Vec<Vec<String>>) = found.into_iter().unzip();
    tally.complaints.extend(answered.concat());
    Ok(calls.into_iter().sum::<usize>() + hidden.map_err(|error| error.to_string())?)
}

/// Calls made until `end`, and those that were answered.
async fn intruder(tenants: &Tenants, end: Instant) -> (usize, Vec<String>) {
    let (stranger, mut calls, mut answered) = (tenants.neighbour.another(), 0, Vec::new());
    while Instant::now() < end {
        for name in sessions(&tenants.owner).await {
            let report = json!({ "session": name, "period": 1, "log_return": 0.5 });
            let correction = json!({ "correction": 1, "period": 1, "log_return": 0.5, "reason": "not theirs" });
            let answers = [
                stranger.get(&format!("/action?session={name}")).await,
                stranger.get(&format!("/sessions/{name}")).await,
                stranger.get(&format!("/sessions/{name}/history")).await,
                stranger.post("/observe", &report).await,
                stranger.post(&format!("/sessions/{name}/corrections"), &correction).await,
                stranger.post("/what-if", &json!({ "session": name, "wealth": 1.0 })).await,
                stranger.delete(&format!("/sessions/{name}")).await,
            ];
            calls += answers.len();
            let served = answers.into_iter().flatten().filter(|(status, _)| *status < 300);
            answered.extend(served.map(|(status, body)| format!("a stranger got {status} {body}")));
        }
    }
    (calls, answered)
}

/// Takes the table of entries away for a moment, again and again; how often.
async fn hide(file: &std::path::Path, end: Instant) -> Result<usize, sqlx::Error> {
    let options = SqliteConnectOptions::new().filename(file).busy_timeout(Duration::from_secs(5));
    let mut times = 0;
    while Instant::now() < end {
        tokio::time::sleep(Duration::from_millis(50)).await;
        let mut connection: SqliteConnection = options.clone().disable_statement_logging().connect().await?;
        sqlx::query("ALTER TABLE entries RENAME TO hidden").execute(&mut connection).await?;
        tokio::time::sleep(Duration::from_millis(3)).await;
        sqlx::query("ALTER TABLE hidden RENAME TO entries").execute(&mut connection).await?;
        connection.close().await?;
        times += 1;
    }
    Ok(times)
}

pub async fn overreachers(trials: usize) -> Outcome {
    Tenants::attacked(Site::limited(&["--memory-limit", "700MB"]), trials, Attack::Overreach).await
}

/// Jobs that take more than the process may are refused.
async fn overreach(tenants: &Tenants, tally: &mut Tally) -> Result<usize, String> {
    const MOST_MB: usize = 900;
    const JOBS: usize = 4;
    let mut large = specification(2);
    large["problem"]["radius"] = json!({ "rule": "fixed", "radius": 0.001 });
    for count in (0..JOBS).map(|number| 7000 + 1000 * number) {
        large["design"]["count"] = json!(count);
        let answer = tenants.neighbour.train(&format!("large-{}-{count}", tally.trials), &large).await;
        if !matches!(answer, Some((422, _))) {
            tally.complain(format!("a job of {count} design points: {answer:?}"));
        }
    }
    tokio::time::sleep(attack_time()).await;
    tally.note = format!("{} MB resident at most", tenants.server.peak_mb());
    if tenants.server.peak_mb() > MOST_MB {
        tally.complain(tally.note.clone());
    }
    Ok(JOBS)
}

pub async fn hoarders(trials: usize) -> Outcome {
    Tenants::attacked(Site::limited(&["--memory-limit", "400MB"]), trials, Attack::Hoard).await
}

/// Policies that each want bridges of their own: resident memory stays within the limit.
async fn hoard(tenants: &Tenants, tally: &mut Tally) -> Result<usize, String> {
    const LIMIT_MB: usize = 400;
    const POLICIES: u64 = 12;
    let neighbour = &tenants.neighbour;
    let returns: Vec<f64> = (0..260).map(|index| 0.02 * f64::from(index).sin()).collect();
    let mut policy: Value = serde_json::from_slice(&undisturbed(HORIZON)).map_err(|error| error.to_string())?;
    policy["specification"]["problem"]["radius"]["paths"] = json!(5000);
    let mut answered = 0;
    for number in 0..POLICIES {
        policy["specification"]["seed"] = json!(1000 * tally.trials as u64 + number);
        let Some((201, imported)) = neighbour.post("/policies/import", &policy).await else { continue };
        let opening = json!({ "policy": imported["policy"], "history": returns });
        let Some((201, session)) = neighbour.post("/sessions", &opening).await else { continue };
        let path = format!("/action?session={}", session["session"].as_str().unwrap_or_default());
        answered += usize::from(matches!(neighbour.get(&path).await, Some((200, _))));
    }
    let peak = tenants.server.peak_mb();
    tally.note = format!("{peak} MB resident at most, {answered} policies asked");
    if peak > LIMIT_MB || answered == 0 {
        tally.complain(tally.note.clone());
    }
    Ok(POLICIES as usize)
}

pub async fn holders(trials: usize) -> Outcome {
    Tenants::attacked(Site::new(), trials, Attack::Hold).await
}

/// Connections that say nothing more after a first polite question, and streams of a job that does not end.
async fn hold(tenants: &Tenants, tally: &mut Tally) -> Result<usize, String> {
    const HELD: usize = 2000;
    let address = tenants.server.url.trim_start_matches("http://").to_owned();
    let job = tenants.neighbour.train("held", &specification(HORIZON)).await;
    let job = job.and_then(|(_, job)| job["job"].as_str().map(str::to_owned)).ok_or("no job")?;
    let follow = tenants.neighbour.request("GET", &format!("/jobs/{job}/events"));
    let polite = "GET /livez HTTP/1.1\r\nhost: localhost\r\n\r\n".to_owned();
    let pulse = tenants.pulse("").await?;
    let mut held = Vec::new();
    for number in 0..HELD {
        let question = if number % 2 == 0 { &polite } else { &follow };
        // One that is refused is an attack that failed.
        held.extend(open_connection(&address, question).await);
    }
    let end = Instant::now() + attack_time();
    while Instant::now() < end {
        let ready = reqwest::get(format!("{}/readyz", tenants.server.url)).await.map(|answer| answer.status().as_u16());
        if ready.as_ref().ok() != Some(&200) {
            tally.complain(format!("/readyz: {ready:?}"));
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    pulse.stop().await.report(within(ANSWERED), tally);
    Ok(held.len())
}

async fn open_connection(address: &str, question: &str) -> Option<TcpStream> {
    let asking = async {
        let mut stream = TcpStream::connect(address).await.ok()?;
        stream.write_all(question.as_bytes()).await.ok()?;
        (stream.read(&mut [0; 64]).await.ok()? > 0).then_some(stream)
    };
    tokio::time::timeout(Duration::from_millis(200), asking).await.ok()?
}

pub async fn listers(trials: usize) -> Outcome {
    Tenants::attacked(Site::new(), trials, Attack::List).await
}

/// Lists of as many large jobs as a tenant may queue.
async fn list(tenants: &Tenants, tally: &mut Tally) -> Result<usize, String> {
    const JOBS: usize = 100;
    let large = large_specification();
    let mut queued = 0;
    // Keeps the worker from what is queued behind it.
    tenants.neighbour.train(&format!("long-{}", tally.trials), &specification(HORIZON)).await;
    for number in 0..JOBS {
        match tenants.neighbour.train(&format!("{}-{number}", tally.trials), &large).await {
            Some((202, _)) => queued += 1,
            // As many as may be.
            Some((429 | 413, _)) => break,
            other => return Err(format!("a large job: {other:?}")),
        }
    }
    let pulse = tenants.pulse("").await?;
    let calls = until(Instant::now() + attack_time(), &tenants.neighbour, "/jobs?limit=1000").await;
    pulse.stop().await.report(within(ANSWERED), tally);
    tally.note += &format!(", {queued} large jobs listed {calls} times");
    Ok(calls)
}

/// Asks for `path` from many connections until `end`; how often.
pub async fn until(end: Instant, caller: &Caller, path: &str) -> usize {
    let asking = (0..AT_ONCE).map(async |_| {
        let (caller, mut calls) = (caller.another(), 0);
        while Instant::now() < end {
            caller.get(path).await;
            calls += 1;
        }
        calls
    });
    join_all(asking).await.into_iter().sum()
}

pub async fn crowds(trials: usize) -> Outcome {
    Tenants::attacked(Site::new(), trials, Attack::Crowd).await
}

/// Trainings and explanations of one tenant, as many as it may: the other's trainings take turns with them, and his
/// questions that must be solved are never turned away.
async fn crowd(tenants: &mut Tenants, tally: &mut Tally) -> Result<usize, String> {
    const TRAININGS: usize = 30;
    const CROWD_STEPS: usize = 10;
    let neighbour = &tenants.neighbour.clone();
    let policy = import(neighbour).await;
    let session = neighbour.open(&policy).await.ok_or("no session")?;
    for number in 0..TRAININGS {
        neighbour.train(&format!("crowd-{}-{number}", tally.trials), &specification(CROWD_STEPS)).await;
    }
    let own = tenants.owner.train(&format!("own-{}", tally.trials), &specification(2)).await;
    tenants.trainings += 1;
    let own = own.and_then(|(_, job)| job["job"].as_str().map(str::to_owned)).ok_or("no job of the owner's")?;
    let pulse = tenants.pulse("&mode=resolve").await?;
    let path = format!("/action?session={session}&explain=worst_case");
    let calls = until(Instant::now() + attack_time(), neighbour, &path).await;
    pulse.stop().await.report(2 * within(ANSWERED), tally);
    until_ended(&tenants.owner, &own, tally).await;
    let ahead = neighbour.jobs().await.ok_or("no jobs of the neighbour's")?.iter().filter(has_succeeded).count();
    let turns = tenants.owner.jobs().await.ok_or("no jobs of the owner's")?.iter().filter(has_succeeded).count();
    // In each trial the one that ran when the first of the owner's came, and one for each of the owner's.
    if ahead > turns + tally.trials + 1 {
        tally.complain(format!("{ahead} trainings of the neighbour's ended before {turns} of the owner's"));
    }
    for job in neighbour.jobs().await.unwrap_or_default() {
        let path = format!("/jobs/{}/cancel", job["job"].as_str().unwrap_or_default());
        neighbour.post(&path, &Value::Null).await;
    }
    Ok(calls + TRAININGS)
}

fn has_succeeded(job: &&Value) -> bool {
    job["state"] == "succeeded"
}

/// Waits for a job: a training gets what the load leaves of the processors, and may take long.
async fn until_ended(caller: &Caller, job: &str, tally: &mut Tally) {
    let started = Instant::now();
    while !matches!(caller.get(&format!("/jobs/{job}")).await, Some((200, job)) if job["finished_ms"].is_i64()) {
        if started.elapsed() > patience() {
            return tally.complain(format!("job {job} has not ended"));
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}
