//! Long computations: they stop once no client waits for them, do not delay other calls, and do not outlive the
//! process.

use std::os::unix::process::ExitStatusExt;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::support::App;
use crate::support::patience::{until, within};
use crate::support::process::{self, Process};
use serde_json::{Value, json};

/// Returns the largest request of several assets that is accepted: some minutes of work.
fn largest() -> Value {
    let (dates, assets) = (2000, 30);
    let mut state = 7_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let history: Vec<Vec<f64>> = (0..dates).map(|_| (0..assets).map(|_| 0.006 + 0.12 * uniform()).collect()).collect();
    let names: Vec<String> = (0..assets).map(|asset| format!("asset {asset}")).collect();
    json!({ "problem": { "assets": names, "history": history, "rate_per_step": 0.002 } })
}

fn service() -> (Process, App) {
    let folder = tempfile::tempdir().unwrap();
    let (child, url) = process::serve(|command| {
        command.arg("--data").arg(folder.path());
    });
    (Process(child), App::at(url, folder))
}

/// Returns the seconds of processor time that the process has used.
fn processor_seconds(process: &Process) -> f64 {
    const TICKS_A_SECOND: f64 = 100.0;
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", process.0.id())).unwrap();
    let after_name = stat.rsplit(')').next().unwrap();
    let ticks = after_name.split_whitespace().skip(11).take(2).map(|ticks| ticks.parse::<f64>().unwrap());
    ticks.sum::<f64>() / TICKS_A_SECOND
}

fn terminate(process: &Process) {
    assert!(Command::new("kill").args(["-TERM", &process.0.id().to_string()]).status().unwrap().success());
}

/// A call in progress.
type Call = tokio::task::JoinHandle<reqwest::Result<reqwest::Response>>;

/// Sends `count` of the largest requests, and returns once all are being solved.
async fn start_calls(app: &App, process: &Process, count: usize) -> Vec<Call> {
    let (question, before) = (largest(), processor_seconds(process));
    let calls: Vec<_> = (0..count)
        .map(|_| tokio::spawn(app.client.post(format!("{}/advise", app.url)).json(&question).send()))
        .collect();
    while processor_seconds(process) < before + 0.3 * count as f64 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    calls
}

#[cfg_attr(not(target_os = "linux"), ignore = "reads /proc")]
#[tokio::test(flavor = "multi_thread")]
async fn what_nobody_waits_for_stops() {
    let (mut process, app) = service();
    let calls = start_calls(&app, &process, 1).await;
    calls.iter().for_each(Call::abort);
    let mut used = processor_seconds(&process);
    until("the work to stop", async || {
        tokio::time::sleep(Duration::from_millis(500)).await;
        let before = std::mem::replace(&mut used, processor_seconds(&process));
        (used - before < 0.05).then_some(())
    })
    .await;
    terminate(&process);
    assert!(process.0.wait().unwrap().success());
}

#[cfg_attr(not(target_os = "linux"), ignore = "reads /proc")]
#[tokio::test(flavor = "multi_thread")]
async fn long_questions_keep_no_short_one_waiting() {
    let (process, app) = service();
    let history: Vec<f64> = (0..120).map(|k| 0.006 + 0.03 * f64::sin(7.0 * f64::from(k))).collect();
    let short = json!({ "problem": { "history": history, "rate_per_step": 0.002 } });
    let time = async || {
        let started = Instant::now();
        let (status, advised) = app.post("/advise", &short).await;
        assert_eq!(status, 200, "{advised}");
        started.elapsed()
    };
    time().await;
    let idle = time().await.max(time().await);
    let calls = start_calls(&app, &process, 6).await;
    let mut busy: Vec<Duration> = Vec::new();
    for _ in 0..9 {
        busy.push(time().await);
    }
    busy.sort();
    // There are two cores, and the long computations have one of them; the factor of three allows for a slow machine.
    assert!(busy[4] < within(3 * idle + Duration::from_millis(100)), "{busy:?}, idle {idle:?}");
    calls.iter().for_each(Call::abort);
}

#[cfg_attr(not(target_os = "linux"), ignore = "reads /proc")]
#[tokio::test(flavor = "multi_thread")]
async fn a_second_signal_ends_the_process_at_once() {
    let (mut process, app) = service();
    let _calls = start_calls(&app, &process, 1).await;
    terminate(&process);
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert!(process.0.try_wait().unwrap().is_none(), "the caller is given the time of the drain");
    terminate(&process);
    let started = Instant::now();
    let status = process.0.wait().unwrap();
    assert!(started.elapsed() < within(Duration::from_secs(1)), "{:?}", started.elapsed());
    assert_eq!((status.code(), status.signal()), (Some(143), None));
}
