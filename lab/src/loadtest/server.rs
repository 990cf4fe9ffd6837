//! The service under load: its own process over its own data folder, replicas over one database, or a service that
//! already runs.

use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;
use thiserror::Error;

use super::connection::{LoadConnection, get};
use super::tunnel::{self, TunnelError};

/// Time after which a service that is not ready counts as failed.
const PATIENCE: Duration = Duration::from_secs(60);
const POLL: Duration = Duration::from_millis(2);

#[derive(Debug, Error)]
pub enum ServerError {
    #[error("making a data folder in {}", parent.display())]
    Folder { parent: PathBuf, source: io::Error },
    #[error("there is no {}: build the service beside this program, with `cargo build --release`, or name another in BALLAST_BINARY", path.display())]
    NoService { path: PathBuf },
    #[error("{doing}")]
    Process { doing: &'static str, source: io::Error },
    #[error("the service printed {first_line:?} instead of its address; its log ends: {log}")]
    NoAddress { first_line: String, log: String },
    #[error("{url} names no service")]
    Url { url: String },
    #[error("{url} is encrypted: use --ca to name the authorities to trust")]
    NoAuthorities { url: String },
    #[error("cannot speak TLS")]
    Tls(#[from] TunnelError),
    #[error("the service was not ready within {} s", PATIENCE.as_secs())]
    NotReady,
}

pub struct Server {
    /// Addresses of the replicas.
    pub addresses: Vec<SocketAddr>,
    own: Option<Own>,
}

/// The processes and the folder that this test must end.
struct Own {
    replicas: Vec<Child>,
    // Declared after the processes: they release the folder before it is removed.
    folder: TempDir,
    store: Option<String>,
}

impl Own {
    fn start(&mut self, replicas: usize) -> Result<Vec<SocketAddr>, ServerError> {
        let start = |_| {
            let (child, address) = spawn(self.folder.path(), self.store.as_deref())?;
            self.replicas.push(child);
            Ok(address)
        };
        (0..replicas).map(start).collect()
    }

    fn end(&mut self) -> io::Result<()> {
        self.replicas.drain(..).try_for_each(|mut child| child.kill().and_then(|()| child.wait()).map(drop))
    }
}

impl Drop for Own {
    fn drop(&mut self) {
        // An error means that they have already ended.
        let _ = self.end();
    }
}

impl Server {
    /// Connects to the service at `url`.
    pub async fn at(url: &str, authorities: Option<&Path>) -> Result<Self, ServerError> {
        let encrypted = url.strip_prefix("https://");
        let host = encrypted.unwrap_or(url.trim_start_matches("http://")).trim_end_matches('/');
        let found = host.to_socket_addrs().ok().and_then(|mut addresses| addresses.next());
        let address = found.ok_or_else(|| ServerError::Url { url: url.to_owned() })?;
        let address = match (encrypted, authorities) {
            (None, _) => address,
            (Some(_), None) => return Err(ServerError::NoAuthorities { url: url.to_owned() }),
            (Some(_), Some(authorities)) => {
                let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
                tunnel::open(address, name, authorities).await?
            }
        };
        Ok(Server { addresses: vec![address], own: None })
    }

    /// Runs `ballast serve` over a new folder in `parent`, or `replicas` of them over one database, and waits until all
    /// are ready.
    pub async fn start(parent: &Path, store: Option<&str>, replicas: usize) -> Result<Self, ServerError> {
        let folder = tempfile::Builder::new().prefix("ballast-loadtest-").tempdir_in(parent);
        let folder = folder.map_err(|source| ServerError::Folder { parent: parent.to_owned(), source })?;
        let mut own = Own { replicas: Vec::new(), folder, store: store.map(str::to_owned) };
        let server = Server { addresses: own.start(replicas)?, own: Some(own) };
        server.until_ready().await?;
        Ok(server)
    }

    /// Kills the processes, runs `meanwhile` on their folder and store, and starts others. Returns the time from start
    /// to ready, or `None` if the processes are not its own.
    pub async fn restart<E: From<ServerError>>(
        &mut self,
        meanwhile: impl AsyncFnOnce(&Path, Option<&str>) -> Result<(), E>,
    ) -> Result<Option<Duration>, E> {
        let Some(own) = &mut self.own else { return Ok(None) };
        own.end().map_err(|source| ServerError::Process { doing: "ending the service", source })?;
        meanwhile(own.folder.path(), own.store.as_deref()).await?;
        let started = Instant::now();
        self.addresses = own.start(self.addresses.len())?;
        self.until_ready().await?;
        Ok(Some(started.elapsed()))
    }

    pub fn folder(&self) -> Option<&Path> {
        self.own.as_ref().map(|own| own.folder.path())
    }

    /// Returns the database that the service was started over, if there is one.
    pub fn store(&self) -> Option<&str> {
        self.own.as_ref()?.store.as_deref()
    }

    /// Returns the bytes of the SQLite database without its log, which is emptied regularly; `None` if there is none of
    /// its own.
    pub fn database_bytes(&self) -> Option<u64> {
        let own = self.own.as_ref().filter(|own| own.store.is_none())?;
        Some(std::fs::metadata(own.folder.path().join("ballast.sqlite")).ok()?.len())
    }

    /// Returns the most resident memory of one process so far, in MB; `None` if no process is its own or the system
    /// does not report it.
    pub fn peak_memory_mb(&self) -> Option<f64> {
        let peak = |child: &Child| {
            let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
            let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
            line.trim().strip_suffix(" kB")?.parse::<f64>().ok().map(|kb| kb / 1024.0)
        };
        self.own.as_ref()?.replicas.iter().map(peak).try_fold(0.0, |most: f64, peak| Some(most.max(peak?)))
    }

    /// Returns the processor time of all processes, in seconds, to Linux's resolution of a hundredth; `None` as above.
    pub fn processor_seconds(&self) -> Option<f64> {
        self.own.as_ref()?.replicas.iter().map(processor_seconds).sum()
    }

    async fn until_ready(&self) -> Result<(), ServerError> {
        let started = Instant::now();
        for &address in &self.addresses {
            while !is_ready(address).await {
                if started.elapsed() > PATIENCE {
                    return Err(ServerError::NotReady);
                }
                tokio::time::sleep(POLL).await;
            }
        }
        Ok(())
    }
}

async fn is_ready(address: SocketAddr) -> bool {
    let Ok(mut connection) = LoadConnection::open(address).await else { return false };
    connection.exchange(&get("/readyz")).await.is_ok()
}

fn processor_seconds(child: &Child) -> Option<f64> {
    const TICKS_PER_SECOND: f64 = 100.0;
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", child.id())).ok()?;
    // Skips the name, which may contain anything: the state is the first field, user and system time are the 12th and
    // 13th.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / TICKS_PER_SECOND)
}

/// Returns the program of the service: the one that `BALLAST_BINARY` names, or else the one beside this program.
fn binary() -> Result<PathBuf, ServerError> {
    let path = match std::env::var_os("BALLAST_BINARY") {
        Some(named) => PathBuf::from(named),
        None => {
            let own = std::env::current_exe();
            let own = own.map_err(|source| ServerError::Process { doing: "finding this program", source })?;
            own.with_file_name("ballast")
        }
    };
    if path.is_file() { Ok(path) } else { Err(ServerError::NoService { path }) }
}

/// Starts a process that logs as in service, to a file in the folder.
fn spawn(folder: &Path, store: Option<&str>) -> Result<(Child, SocketAddr), ServerError> {
    let failed = |doing| move |source| ServerError::Process { doing, source };
    let log: PathBuf = folder.join("log");
    let mut command = Command::new(binary()?);
    command.args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(folder);
    match store {
        Some(store) => command.env("BALLAST_STORE", store),
        None => command.env_remove("BALLAST_STORE"),
    };
    command.env_remove("BALLAST_ROLE").stdin(Stdio::null()).stdout(Stdio::piped());
    command.stderr(File::create(&log).map_err(failed("making the log"))?);
    let mut child = command.spawn().map_err(failed("starting the service"))?;
    let mut first_line = String::new();
    if let Some(output) = child.stdout.take() {
        BufReader::new(output).read_line(&mut first_line).map_err(failed("listening to the service"))?;
    }
    match first_line.trim().strip_prefix("listening on http://").and_then(|address| address.parse().ok()) {
        Some(address) => Ok((child, address)),
        None => {
            let _ = child.kill();
            let _ = child.wait();
            let log = std::fs::read_to_string(log).unwrap_or_default();
            Err(ServerError::NoAddress { first_line, log: log.lines().last().unwrap_or_default().to_owned() })
        }
    }
}
