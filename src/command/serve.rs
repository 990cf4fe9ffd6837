//! `ballast serve`: the service, until SIGTERM or SIGINT.

use std::io::IsTerminal;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use ballast::http;
use ballast::service::config::{Config, Role, StoreLocation};
use ballast::service::shutdown::Shutdown;
use clap::{Args, ValueEnum};
use tokio::signal::unix::{SignalKind, signal};
use tracing_subscriber::EnvFilter;

#[derive(Debug, Args)]
pub struct Serve {
    /// Address to listen on; port 0 picks a free one.
    #[arg(long, env = "BALLAST_LISTEN", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Folder of the SQLite database, unless there is a `--store`.
    #[arg(long, env = "BALLAST_DATA", default_value = "ballast-data")]
    data: PathBuf,
    /// PostgreSQL database that replicas share: postgres://user:password@host:port/database.
    #[arg(long, env = "BALLAST_STORE", hide_env_values = true)]
    store: Option<String>,
    /// What this replica does.
    #[arg(long, env = "BALLAST_ROLE", value_enum, default_value_t = RoleName::All)]
    role: RoleName,
    /// A job whose worker has been silent this long is taken over by another.
    #[arg(long, env = "BALLAST_LEASE_SECONDS", default_value_t = 30, value_parser = clap::value_parser!(u16).range(1..=3600))]
    lease_seconds: u16,
    /// Threads that train. Default: every core but one.
    #[arg(long, env = "BALLAST_TRAINING_THREADS", value_parser = clap::value_parser!(u16).range(1..=1024))]
    training_threads: Option<u16>,
}

/// [`Role`] as the command line names it.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum RoleName {
    /// Answer requests and run jobs.
    All,
    /// Answer requests.
    Api,
    /// Run jobs.
    Worker,
}

impl From<RoleName> for Role {
    fn from(name: RoleName) -> Self {
        match name {
            RoleName::All => Role::All,
            RoleName::Api => Role::Api,
            RoleName::Worker => Role::Worker,
        }
    }
}

pub async fn run(arguments: Serve) -> Result<(), Box<dyn std::error::Error>> {
    start_logging();
    let mut config = Config { listen: arguments.listen, ..Config::new(arguments.data) };
    if let Some(store) = arguments.store.filter(|store| !store.is_empty()) {
        config.store = StoreLocation::Postgres(store.parse()?);
    }
    config.role = arguments.role.into();
    config.lease = Duration::from_secs(arguments.lease_seconds.into());
    config.training_threads = arguments.training_threads.map_or(config.training_threads, usize::from);
    let shutdown = Shutdown::new();
    let (mut terminate, mut interrupt) = (signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?);
    let running = http::serve(config, shutdown.clone()).await?;
    println!("listening on http://{}", running.address);
    tokio::spawn(async move {
        tokio::select! {
            _ = terminate.recv() => {}
            _ = interrupt.recv() => {}
        }
        shutdown.begin();
    });
    running.ended().await;
    Ok(())
}

/// Logs to standard error: for people on a terminal, as JSON elsewhere. `RUST_LOG` chooses what.
fn start_logging() {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info,sqlx=warn"));
    let logging = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    if std::io::stderr().is_terminal() {
        logging.init();
    } else {
        logging.json().flatten_event(true).init();
    }
}
