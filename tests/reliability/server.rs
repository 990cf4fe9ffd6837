//! The real binary over a place of its own: started, killed, terminated, and asked whether its database is whole.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Connection};
use tempfile::TempDir;

use crate::support::patience::within;
use crate::support::process::try_serve;

/// Time given to a process to get ready or to end: `Config::drain` and some.
const PATIENCE: Duration = Duration::from_secs(30);
const POLL: Duration = Duration::from_millis(2);

/// The place of a server's facts, and what every server started here wrote to standard error.
pub struct Site {
    folder: TempDir,
    arguments: Vec<String>,
}

impl Site {
    pub fn new() -> Site {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("data");
        Site { arguments: vec!["--data".into(), data.to_str().unwrap().into()], folder }
    }

    /// As [`Site::new`], started with `more` arguments.
    pub fn limited(more: &[&str]) -> Site {
        let mut site = Site::new();
        site.arguments.extend(more.iter().map(|&part| part.into()));
        site
    }

    /// A server that keeps its facts in `data`, which somebody else made.
    pub fn at(data: &Path) -> Site {
        Site::with(&["--data", data.to_str().unwrap()])
    }

    pub fn with(arguments: &[&str]) -> Site {
        Site { folder: tempfile::tempdir().unwrap(), arguments: arguments.iter().map(|&part| part.into()).collect() }
    }

    /// The folder of the database.
    pub fn data(&self) -> PathBuf {
        PathBuf::from(&self.arguments[1])
    }

    /// Starts a server and waits until it is ready.
    ///
    /// # Errors
    /// How it ended instead.
    pub async fn start(&self) -> Result<Server, String> {
        let started = Instant::now();
        let log = File::options().create(true).append(true).open(self.log()).unwrap();
        let served = try_serve(|command| {
            command.args(&self.arguments).args(["--training-threads", "1"]).env("RUST_LOG", "error").stderr(log);
        });
        let (child, url) = served.map_err(|(mut child, printed)| {
            let status = child.wait().unwrap();
            format!("printed {printed:?} and ended with {status}: {}", self.last_words())
        })?;
        let mut server = Server { child, url, ready: Duration::ZERO };
        while !is_ready(&server.url).await {
            if let Some(status) = server.child.try_wait().unwrap() {
                return Err(format!("ended with {status} before it was ready: {}", self.last_words()));
            }
            if started.elapsed() > within(PATIENCE) {
                return Err("never got ready".into());
            }
            tokio::time::sleep(POLL).await;
        }
        server.ready = started.elapsed();
        Ok(server)
    }

    fn log(&self) -> PathBuf {
        self.folder.path().join("log")
    }

    fn log_text(&self) -> String {
        std::fs::read_to_string(self.log()).unwrap_or_default()
    }

    fn last_words(&self) -> String {
        self.log_text().lines().last().unwrap_or("said nothing").to_owned()
    }

    /// Returns what the servers started here wrote about panics.
    pub fn panics(&self) -> Vec<String> {
        let text = self.log_text();
        let lines: Vec<&str> = text.lines().collect();
        let panics = (0..lines.len()).filter(|&at| lines[at].contains("panicked at"));
        panics.map(|at| lines[at..lines.len().min(at + 2)].join(" ")).collect()
    }

    /// Returns what SQLite says of the file: `ok`, or its complaints.
    pub async fn integrity(&self) -> String {
        let options = SqliteConnectOptions::new().filename(self.data().join("ballast.sqlite")).read_only(true);
        let checking = async {
            let mut connection = options.disable_statement_logging().connect().await?;
            let lines: Vec<String> = sqlx::query_scalar("PRAGMA integrity_check").fetch_all(&mut connection).await?;
            connection.close().await?;
            Ok::<_, sqlx::Error>(lines.join("; "))
        };
        checking.await.unwrap_or_else(|error| error.to_string())
    }
}

async fn is_ready(url: &str) -> bool {
    reqwest::get(format!("{url}/readyz")).await.is_ok_and(|answer| answer.status() == 200)
}

/// A server at work; killed when dropped.
pub struct Server {
    child: Child,
    pub url: String,
    /// From its start to its readiness.
    pub ready: Duration,
}

impl Server {
    pub fn pid(&self) -> String {
        self.child.id().to_string()
    }

    pub fn signal(&self, name: &str) {
        assert!(Command::new("kill").args([name, &self.pid()]).status().unwrap().success());
    }

    /// Stops it; returns once none of its threads is in a system call any more.
    pub async fn freeze(&self) {
        self.signal("-STOP");
        while !self.is_frozen() {
            tokio::time::sleep(POLL).await;
        }
    }

    fn is_frozen(&self) -> bool {
        let threads = std::fs::read_dir(format!("/proc/{}/task", self.pid())).unwrap();
        // The state follows the name, which is in brackets. A traced thread stops as `t`.
        threads.flatten().all(|thread| {
            let stat = std::fs::read_to_string(thread.path().join("stat")).unwrap_or_default();
            stat.rsplit(") ").next().is_some_and(|rest| rest.starts_with(['T', 't']))
        })
    }

    /// Returns true if the process that was started still runs.
    pub fn lives(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// Most resident memory so far, in MB.
    pub fn peak_mb(&self) -> usize {
        self.figure("VmHWM:").map_or(usize::MAX, |kilobytes| kilobytes >> 10)
    }

    /// Threads it has now.
    pub fn threads(&self) -> usize {
        self.figure("Threads:").unwrap_or(usize::MAX)
    }

    /// A figure of the process as `/proc` tells it.
    fn figure(&self, name: &str) -> Option<usize> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.pid())).ok()?;
        status.lines().find_map(|line| line.strip_prefix(name)?.split_whitespace().next()?.parse().ok())
    }

    /// Waits for its end; `None` where it does not come.
    pub async fn ended(&mut self) -> Option<ExitStatus> {
        let started = Instant::now();
        while started.elapsed() < within(PATIENCE) {
            if let Some(status) = self.child.try_wait().unwrap() {
                return Some(status);
            }
            tokio::time::sleep(POLL).await;
        }
        None
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // SIGKILL ends a stopped process too.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
