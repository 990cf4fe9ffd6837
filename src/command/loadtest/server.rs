//! The service under load: a process of its own over a data folder of its own, or one that runs already.

use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use thiserror::Error;

use super::connection::{Connection, get};
use crate::command::host::{DataFolder, HostError};

/// A service that is not ready by then never will be.
const PATIENCE: Duration = Duration::from_secs(60);
const POLL: Duration = Duration::from_millis(2);

#[derive(Debug, Error)]
pub enum ServerError {
    #[error(transparent)]
    Folder(#[from] HostError),
    #[error("{doing}")]
    Process { doing: &'static str, source: io::Error },
    #[error("the service said {said:?} and not where it listens; its log ends: {log}")]
    NoAddress { said: String, log: String },
    #[error("{url} names no service")]
    Url { url: String },
    #[error("the service was not ready within {} s", PATIENCE.as_secs())]
    NotReady,
}

pub struct Server {
    pub address: SocketAddr,
    own: Option<Own>,
}

/// What is ours to end.
struct Own {
    child: Child,
    // After the child: the process lets go of the folder before the folder goes.
    folder: DataFolder,
    store: Option<String>,
}

impl Drop for Own {
    fn drop(&mut self) {
        // An error means that it has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Server {
    /// The service at `url`.
    pub fn at(url: &str) -> Result<Self, ServerError> {
        let host = url.trim_start_matches("http://").trim_end_matches('/');
        let found = host.to_socket_addrs().ok().and_then(|mut addresses| addresses.next());
        let address = found.ok_or_else(|| ServerError::Url { url: url.to_owned() })?;
        Ok(Server { address, own: None })
    }

    /// Runs `ballast serve` over a new folder in `parent` and waits until it is ready.
    pub async fn start(parent: &Path, store: Option<&str>) -> Result<Self, ServerError> {
        let folder = DataFolder::make_in(parent, "loadtest")?;
        let (child, address) = spawn(folder.path(), store)?;
        let server = Server { address, own: Some(Own { child, folder, store: store.map(str::to_owned) }) };
        server.until_ready().await?;
        Ok(server)
    }

    /// Kills the process, does `meanwhile` to what it left, and starts another; the time from start to ready.
    /// `None` where the process is not ours.
    pub async fn restart<E: From<ServerError>>(
        &mut self,
        meanwhile: impl AsyncFnOnce(&Path, Option<&str>) -> Result<(), E>,
    ) -> Result<Option<Duration>, E> {
        let Some(own) = &mut self.own else { return Ok(None) };
        let ended = own.child.kill().and_then(|()| own.child.wait());
        ended.map_err(|source| ServerError::Process { doing: "ending the service", source })?;
        meanwhile(own.folder.path(), own.store.as_deref()).await?;
        let started = Instant::now();
        (own.child, self.address) = spawn(own.folder.path(), own.store.as_deref())?;
        self.until_ready().await?;
        Ok(Some(started.elapsed()))
    }

    pub fn folder(&self) -> Option<&Path> {
        self.own.as_ref().map(|own| own.folder.path())
    }

    /// Most resident memory so far, in MB; `None` where the process is not ours or the system does not tell.
    pub fn peak_memory_mb(&self) -> Option<f64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.own.as_ref()?.child.id())).ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        line.trim().strip_suffix(" kB")?.parse::<f64>().ok().map(|kb| kb / 1024.0)
    }

    /// Processor time it has taken, in seconds, to the hundredth that Linux counts in; `None` as above.
    pub fn processor_seconds(&self) -> Option<f64> {
        const TICKS_PER_SECOND: f64 = 100.0;
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.own.as_ref()?.child.id())).ok()?;
        // Past the name, which may hold anything: the state is the first field, user and system time are 12th and 13th.
        let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
        let mut ticks = || fields.next()?.parse::<f64>().ok();
        Some((ticks()? + ticks()?) / TICKS_PER_SECOND)
    }

    async fn until_ready(&self) -> Result<(), ServerError> {
        let started = Instant::now();
        while started.elapsed() < PATIENCE {
            if let Ok(mut connection) = Connection::open(self.address).await
                && connection.exchange(&get("/readyz")).await.is_ok()
            {
                return Ok(());
            }
            tokio::time::sleep(POLL).await;
        }
        Err(ServerError::NotReady)
    }
}

/// Logs as it does in service, to a file of the folder.
fn spawn(folder: &Path, store: Option<&str>) -> Result<(Child, SocketAddr), ServerError> {
    let failed = |doing| move |source| ServerError::Process { doing, source };
    let log: PathBuf = folder.join("log");
    let mut command = Command::new(std::env::current_exe().map_err(failed("finding this program"))?);
    command.args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(folder);
    match store {
        Some(store) => command.env("BALLAST_STORE", store),
        None => command.env_remove("BALLAST_STORE"),
    };
    command.env_remove("BALLAST_ROLE").stdin(Stdio::null()).stdout(Stdio::piped());
    command.stderr(File::create(&log).map_err(failed("making the log"))?);
    let mut child = command.spawn().map_err(failed("starting the service"))?;
    let mut said = String::new();
    if let Some(output) = child.stdout.take() {
        BufReader::new(output).read_line(&mut said).map_err(failed("listening to the service"))?;
    }
    match said.trim().strip_prefix("listening on http://").and_then(|address| address.parse().ok()) {
        Some(address) => Ok((child, address)),
        None => {
            let _ = child.kill();
            let _ = child.wait();
            let log = std::fs::read_to_string(log).unwrap_or_default();
            Err(ServerError::NoAddress { said, log: log.lines().last().unwrap_or_default().to_owned() })
        }
    }
}
