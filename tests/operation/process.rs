//! The real binary, killed and stopped: nothing acknowledged is lost, and no finished step is computed again.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::support::patience::{assert_within, patience, until, within};
use crate::support::{App, specification};
use ballast::store::{JobRow, JobState, Store};
use reqwest::Client;
use serde_json::{Value, json};
use sqlx::Connection;

/// `Config::drain`: the time an operator gives the process to end.
const DRAIN: Duration = Duration::from_secs(25);
const STEPS: usize = 40;

struct Process {
    child: Child,
    app: App,
}

fn spawn(folder: &std::path::Path) -> (Child, String) {
    crate::support::process::serve(|command| {
        command.arg("--data").arg(folder);
    })
}

impl Process {
    fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (child, url) = spawn(folder.path());
        Process { child, app: App::at(url, folder) }
    }

    /// SIGKILL.
    fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    fn terminate(&mut self) -> ExitStatus {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args(["-TERM", &pid]).status().unwrap().success());
        let started = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(started.elapsed() < within(DRAIN), "still running");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    fn start_again(&mut self) {
        let (child, url) = spawn(self.app.folder());
        (self.child, self.app.url, self.app.client) = (child, url, Client::new());
    }

    /// Returns the job as the dead process left it.
    async fn left(&self, job: &str) -> JobRow {
        let store = Store::open(self.app.folder()).await.unwrap();
        let row = store.job(job).await.unwrap().unwrap();
        assert_eq!(store.checkpoints(job).await.unwrap().len(), row.steps_done);
        store.close().await;
        row
    }

    /// Waits for the job and checks that this process solved exactly the steps that `left` lacked, to the same policy.
    async fn finishes(&mut self, job: &str, left: &JobRow) {
        let done = self.app.until(job, |job| job["finished_ms"].is_i64()).await;
        assert_eq!(done["state"], "succeeded", "{done}");
        assert_eq!(self.steps_solved().await, STEPS - left.steps_done);
        self.app.policy = done["policy"].as_str().unwrap().to_owned();
        assert!(self.app.export().await == crate::support::trained(&specification(STEPS)), "the policies differ");
    }

    /// Returns the number of backward steps solved since this process started.
    async fn steps_solved(&self) -> usize {
        let (_, metrics) = self.app.get("/metrics").await;
        let count = "ballast_training_step_duration_seconds_count ";
        metrics.as_str().unwrap().lines().find_map(|line| line.strip_prefix(count)).map_or(0, |n| n.parse().unwrap())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn some_steps(job: &Value) -> bool {
    job["progress"]["steps_done"].as_u64() >= Some(2)
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_acknowledged_is_lost_by_a_kill() {
    let mut process = Process::start();
    process.app.train(&specification(4)).await;
    process.app.open().await;
    let job = process.app.queue(&specification(STEPS)).await;
    process.app.until(&job, some_steps).await;
    let mut acknowledged = Vec::new();
    for (index, log_return) in [0.012, -0.034, 0.0071].into_iter().enumerate() {
        let (status, observed) = process.app.observe(index + 1, log_return).await;
        assert_eq!(status, 200, "{observed}");
        acknowledged.push((log_return, observed));
    }
    let action = process.app.action().await;
    process.kill();
    let left = process.left(&job).await;
    assert_eq!(left.state, JobState::Running);

    process.start_again();
    assert_eq!(process.app.action().await, action);
    for (index, (log_return, observed)) in acknowledged.iter().enumerate() {
        assert_eq!(process.app.observe(index + 1, *log_return).await.1, *observed);
    }
    let (_, history) = process.app.get(&format!("/sessions/{}/history", process.app.session)).await;
    assert_eq!(history["observations"].as_array().unwrap().len(), 3);
    let restarted = Instant::now();
    process.finishes(&job, &left).await;
    assert_within(Duration::from_secs(25), restarted, "a job whose process died, and not its lease,");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_three_processes_died_under_fails_and_the_service_lives() {
    let mut process = Process::start();
    let mut slow = specification(2);
    slow["design"]["count"] = json!(3000);
    let job = process.app.queue(&slow).await;
    for attempt in 1..=3 {
        // The job reads as running from the moment its process died, so the test waits until this process has claimed
        // it.
        until("the next attempt", async || {
            let attempts = crate::support::attempts(process.app.folder()).await;
            assert!(attempts <= attempt, "attempt {attempts} of a process that should make attempt {attempt}");
            (attempts == attempt).then_some(())
        })
        .await;
        process.kill();
        process.start_again();
    }
    let failed = process.app.until(&job, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(failed["state"], "failed", "{failed}");
    assert!(failed["error"].as_str().unwrap().contains("ended 3 times while the job ran"), "{failed}");
    process.app.train(&specification(2)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_terminated_process_exits_0_and_its_job_goes_on() {
    let mut process = Process::start();
    let job = process.app.queue(&specification(STEPS)).await;
    process.app.until(&job, some_steps).await;
    let events = format!("{}/jobs/{job}/events", process.app.url);
    let following = process.app.client.get(&events).send().await.unwrap();
    let status = process.terminate();
    assert_eq!(status.code(), Some(0));
    assert!(following.text().await.unwrap().contains("event: state"));
    let left = process.left(&job).await;
    assert_eq!(left.state, JobState::Queued);
    assert!((2..STEPS).contains(&left.steps_done), "{left:?}");

    process.start_again();
    process.finishes(&job, &left).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_process_asked_to_stop_in_a_long_fit_does_not_wait_for_it() {
    let mut process = Process::start();
    let mut large = specification(1);
    large["design"] = json!({ "count": 1500, "initial_laws": "resampled" });
    let job = process.app.queue(&large).await;
    process.app.until(&job, |job| job["progress"]["phase"] == "fitting").await;
    let terminated = Instant::now();
    assert_eq!(process.terminate().code(), Some(0));
    assert_within(Duration::from_secs(3), terminated, "the end of a process in a long fit");
    assert_eq!(process.left(&job).await.state, JobState::Queued);
}

/// The processor time that a process reports fits into the time that it ran, on as many processors as there are.
#[tokio::test(flavor = "multi_thread")]
async fn a_process_tells_the_seconds_that_it_computed() {
    let started = Instant::now();
    let mut process = Process::start();
    process.app.train(&specification(2)).await;
    let metrics = process.app.get("/metrics").await.1;
    let line = metrics.as_str().unwrap().lines().find_map(|line| line.strip_prefix("process_cpu_seconds_total "));
    let seconds: f64 = line.unwrap().parse().unwrap();
    let processors = std::thread::available_parallelism().unwrap().get();
    let most = started.elapsed().as_secs_f64() * processors as f64;
    assert!(seconds <= most + 1.0, "{seconds} seconds computed, {most} at most");
}

/// A store that rejects a claim is retried after a pause, not at once.
#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_cannot_claim_says_so_once_a_second_until_it_can() {
    let folder = tempfile::tempdir().unwrap();
    let (mut child, url) = crate::support::process::serve(|command| {
        command.arg("--data").arg(folder.path()).env("RUST_LOG", "error").stderr(Stdio::piped());
    });
    let (sender, heard) = std::sync::mpsc::channel();
    let lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    std::thread::spawn(move || {
        lines
            .filter(|line| line.contains("claiming a job"))
            .for_each(|_| sender.send(Instant::now()).unwrap_or_default());
    });
    crate::support::execute(folder.path(), "ALTER TABLE jobs RENAME TO hidden").await;
    let moments: Vec<Instant> = (0..3).map(|_| heard.recv_timeout(patience()).expect("a word of it")).collect();
    assert!(moments[2] - moments[0] > Duration::from_millis(1500), "{moments:?}");
    crate::support::execute(folder.path(), "ALTER TABLE hidden RENAME TO jobs").await;
    let mut process = Process { child, app: App::at(url, folder) };
    process.app.train(&specification(1)).await;
}

/// Between the signal and the end of accepting, everything but readiness is answered as before, and connections close.
#[tokio::test(flavor = "multi_thread")]
async fn a_service_that_leaves_says_so_before_it_stops_accepting() {
    let folder = tempfile::tempdir().unwrap();
    let (child, url) = crate::support::process::serve(|command| {
        command.args(["--drain-delay", "2", "--data"]).arg(folder.path());
    });
    let mut process = Process { child, app: App::at(url, folder) };
    let pid = process.child.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &pid]).status().unwrap().success());
    let left = Instant::now();
    until("readiness to end", async || (process.app.get("/readyz").await.0 == 503).then_some(())).await;
    let answer = process.app.client.get(format!("{}/sessions", process.app.url)).send().await.unwrap();
    assert_eq!((answer.status().as_u16(), answer.headers()["connection"].to_str().unwrap()), (200, "close"));
    assert_eq!(process.app.get("/livez").await.0, 200);
    assert!(process.child.wait().unwrap().success());
    assert!(left.elapsed() >= Duration::from_secs(2), "{:?}", left.elapsed());
}

/// While another process changes the schema, the service that waits for it is alive, is not ready, and can be stopped.
#[tokio::test(flavor = "multi_thread")]
async fn a_service_that_starts_is_alive_and_not_ready() {
    let Some(database) = crate::support::postgres::database().await else { return };
    let mut other = sqlx::PgConnection::connect(&database).await.unwrap();
    sqlx::query("BEGIN").execute(&mut other).await.unwrap();
    sqlx::query("CREATE TABLE _sqlx_migrations (version BIGINT)").execute(&mut other).await.unwrap();
    let address = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let start = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ballast"));
        command.args(["serve", "--store", &database, "--listen", &address.to_string()]);
        command.env("RUST_LOG", "off").stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    };
    let client = Client::new();
    let status = async |path: &str| {
        let answer = client.get(format!("http://{address}{path}")).send().await;
        answer.map_or(0, |answer| answer.status().as_u16())
    };
    let mut stopped = start();
    until("life", async || (status("/livez").await == 200).then_some(())).await;
    assert_eq!((status("/readyz").await, status("/sessions").await), (503, 503));
    assert!(Command::new("kill").args(["-TERM", &stopped.id().to_string()]).status().unwrap().success());
    let terminated = Instant::now();
    assert!(!stopped.wait().unwrap().success());
    assert_within(Duration::from_secs(5), terminated, "a start that is asked to stop");
    let mut started = start();
    until("life", async || (status("/livez").await == 200).then_some(())).await;
    sqlx::query("ROLLBACK").execute(&mut other).await.unwrap();
    until("readiness", async || (status("/readyz").await == 200).then_some(())).await;
    started.kill().unwrap();
    started.wait().unwrap();
}
