//! Work of one tenant, or of twenty, that others do not wait for: batches of reports, searches, and the largest questions.

use std::time::{Duration, Instant};

use futures_util::future::join_all;
use serde_json::{Value, json};

use crate::caller::Caller;
use crate::neighbours::{ANSWERED, Attack, attack_time, until};
use crate::scene::{Outcome, Tally, import};
use crate::server::Site;
use crate::support::patience::{patience, within};
use crate::support::{specification, trained};
use crate::tenants::{Pulse, Tenants};
use crate::unread::{imported, made_of};

pub async fn batches(trials: usize) -> Outcome {
    Tenants::attacked(Site::limited(&["--memory-limit", "256MB"]), trials, Attack::Batch).await
}

/// A client with batches of as many reports as one may have: threads and memory stay within what they may be.
pub async fn batch(tenants: &Tenants, tally: &mut Tally) -> Result<usize, String> {
    const SESSIONS: usize = 1000;
    const PATHS: usize = 20_000;
    const HORIZON: usize = 4;
    const MOST_THREADS: usize = 64;
    const MOST_MB: usize = 300;
    let caller = &tenants.neighbour;
    // After the first report of a period, the radius of the next one is work for another thread, for which all reports
    // of the batch wait.
    let mut training = specification(HORIZON);
    training["problem"]["radius"]["paths"] = json!(PATHS);
    let opening = json!({ "policy": imported(caller, &trained(&training)).await? });
    let sessions = open(caller, &opening, SESSIONS).await;
    let pulse = tenants.pulse("").await?;
    let (end, mut threads) = (Instant::now() + attack_time(), 0);
    let reporting = async {
        let (caller, mut reports) = (caller.another(), 0);
        for period in (1..=HORIZON).take_while(|_| Instant::now() < end) {
            let report = |session: &String| json!({ "session": session, "period": period, "log_return": 0.001 });
            let batch: Vec<Value> = sessions.iter().map(report).collect();
            caller.post("/observe", &Value::Array(batch)).await;
            reports += 1;
        }
        reports
    };
    let watching = async {
        while Instant::now() < end {
            threads = threads.max(tenants.server.threads());
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    let (calls, ()) = tokio::join!(reporting, watching);
    pulse.stop().await.report(within(ANSWERED), tally);
    let peak = tenants.server.peak_mb();
    tally.note += &format!(", {calls} batches, {threads} threads, {peak} MB resident at most");
    if threads >= MOST_THREADS || peak > MOST_MB {
        tally.complain(tally.note.clone());
    }
    Ok(calls)
}

/// Opens so many sessions, one after the other.
async fn open(caller: &Caller, opening: &Value, count: usize) -> Vec<String> {
    let (caller, mut sessions) = (caller.another(), Vec::new());
    for _ in 0..count {
        sessions.extend(made_of(caller.post("/sessions", opening).await, "session").ok());
    }
    sessions
}

pub async fn searches(trials: usize) -> Outcome {
    Tenants::attacked(Site::new(), trials, Attack::Search).await
}

/// Searches and lists in the order of wealth: the other's lists are answered as before.
pub async fn search(tenants: &Tenants, tally: &mut Tally) -> Result<usize, String> {
    const OPENING: usize = 8;
    const SESSIONS: usize = 500;
    let opening = json!({ "policy": import(&tenants.neighbour).await });
    join_all((0..OPENING).map(|_| open(&tenants.neighbour, &opening, SESSIONS))).await;
    let pulse = Pulse::of(tenants.owner.another(), "/sessions".to_owned());
    let end = Instant::now() + attack_time();
    let paths = ["/sessions?search=zz", "/sessions?sort=-wealth&count=care"];
    let asking = paths.map(|path| until(end, &tenants.neighbour, path));
    let calls = join_all(asking).await.into_iter().sum();
    pulse.stop().await.report(within(ANSWERED), tally);
    tally.note += &format!(", {calls} searches and lists of another");
    Ok(calls)
}

pub async fn questions(trials: usize) -> Outcome {
    Tenants::attacked(Site::new(), trials, Attack::Ask).await
}

/// Twenty tenants with the largest question there is: the owner's is answered nearly as soon as alone.
pub async fn ask(tenants: &Tenants, tally: &mut Tally) -> Result<usize, String> {
    const TENANTS: usize = 20;
    const DATES: usize = 2000;
    const ASSETS: usize = 30;
    // Few enough that it is answered within the first stage on a slow machine too.
    const SHORT: usize = 60;
    /// Times the answer to the owner's question when nobody else asks.
    const SLOWER: u32 = 3;
    /// As a refusal says.
    const RETRY_AFTER: Duration = Duration::from_secs(1);
    let log_return = |number: usize| 0.004 + 0.03 * (1.7 * number as f64).sin();
    let row = |date: usize| (0..ASSETS).map(|asset| log_return(date * (asset + 3) + asset)).collect::<Vec<_>>();
    let names: Vec<String> = (0..ASSETS).map(|number| format!("fund {number}")).collect();
    let rows: Vec<Vec<f64>> = (1..=DATES).map(row).collect();
    let largest = json!({ "problem": { "assets": names, "rate_per_step": 0.001, "history": rows } });
    let history: Vec<f64> = (0..SHORT).map(log_return).collect();
    let short = json!({ "problem": { "rate_per_step": 0.002, "history": history } });
    let others = tenants.others(TENANTS).await?;
    // What the first answer finds out about the record is kept for the others.
    median(&tenants.owner, &short, Duration::ZERO).await?;
    let alone = median(&tenants.owner, &short, Duration::from_secs(1)).await?;
    let end = Instant::now() + attack_time();
    let asking = join_all(others.iter().map(async |other| {
        let mut answers = Vec::new();
        while Instant::now() < end {
            let left = end.saturating_duration_since(Instant::now());
            let answer = tokio::time::timeout(left, other.post("/advise", &largest)).await;
            let status = answer.ok().flatten().map(|(status, _)| status);
            answers.extend(status);
            if status != Some(200) {
                tokio::time::sleep(RETRY_AFTER).await;
            }
        }
        answers
    }));
    // All of them begin first.
    let beside = async {
        tokio::time::sleep(attack_time() / 2).await;
        median(&tenants.owner, &short, attack_time() / 2).await
    };
    let (answers, beside) = tokio::join!(asking, beside);
    let (answers, beside) = (answers.concat(), beside?);
    tally.note = format!("{} ms alone, {} ms beside {TENANTS}", alone.as_millis(), beside.as_millis());
    if beside > within(ANSWERED).max(within(SLOWER * alone)) {
        tally.complain(tally.note.clone());
    }
    if let Some(status) = answers.iter().find(|status| !matches!(status, 200 | 429 | 503)) {
        tally.complain(format!("a question was answered with {status}"));
    }
    Ok(answers.len() + TENANTS)
}

/// After a refusal.
const AGAIN: Duration = Duration::from_millis(50);

/// The median time of an answer, asked for again and again.
async fn median(caller: &Caller, question: &Value, lasts: Duration) -> Result<Duration, String> {
    let (end, mut durations) = (Instant::now() + lasts, Vec::new());
    while durations.is_empty() || Instant::now() < end {
        let started = Instant::now();
        loop {
            match caller.post("/advise", question).await {
                Some((200, _)) => break durations.push(started.elapsed()),
                // The time until it is answered counts.
                Some((429 | 503, _)) if started.elapsed() < patience() => tokio::time::sleep(AGAIN).await,
                other => return Err(format!("the owner's question: {other:?}")),
            }
        }
    }
    durations.sort_unstable();
    Ok(durations[durations.len() / 2])
}
