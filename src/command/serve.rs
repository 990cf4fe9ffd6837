//! `ballast serve`: the service, until SIGTERM or SIGINT.

use std::io::IsTerminal;
use std::net::SocketAddr;
use std::path::PathBuf;

use ballast::http;
use ballast::service::config::Config;
use ballast::service::shutdown::Shutdown;
use clap::Args;
use tokio::signal::unix::{SignalKind, signal};
use tracing_subscriber::EnvFilter;

#[derive(Debug, Args)]
pub struct Serve {
    /// Address to listen on; port 0 picks a free one.
    #[arg(long, env = "BALLAST_LISTEN", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Folder of the database.
    #[arg(long, env = "BALLAST_DATA", default_value = "ballast-data")]
    data: PathBuf,
    /// Threads that train. Default: every core but one.
    #[arg(long, env = "BALLAST_TRAINING_THREADS", value_parser = clap::value_parser!(u16).range(1..=1024))]
    training_threads: Option<u16>,
}

pub async fn run(arguments: Serve) -> Result<(), Box<dyn std::error::Error>> {
    start_logging();
    let mut config = Config { listen: arguments.listen, ..Config::new(arguments.data) };
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
