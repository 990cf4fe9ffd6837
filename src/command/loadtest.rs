//! `ballast loadtest`: what the live service bears on this machine, beside what the machine itself does.
//!
//! Runs `ballast serve` as a process of its own over a new data folder, gives it a policy of the paper's
//! problem with a small design, and drives it from one thread over keep-alive connections; or does so at a service that is up already.
//! The server is ended by killing it, as a crash would: what it acknowledged must be there when it is started again.

use std::error::Error;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use tokio::signal::unix::{SignalKind, signal};

mod connection;
mod figures;
mod limits;
mod load;
mod populate;
mod scenarios;
mod server;
mod stored;
mod tunnel;

use figures::Report;
use server::Server;

#[derive(Debug, Args)]
pub struct LoadTest {
    /// What to run; everything unless given
    #[arg(value_enum)]
    scenarios: Vec<Scenario>,
    /// Drive the service at http://host:port or https://host:port instead of starting one
    #[arg(long)]
    url: Option<String>,
    /// Authorities in PEM, one of which the certificate of an https service must be by
    #[arg(long, requires = "url")]
    ca: Option<PathBuf>,
    /// Start the service over this PostgreSQL database, which keeps what is written to it, instead of SQLite
    #[arg(long, conflicts_with = "url")]
    store: Option<String>,
    /// Replicas over the PostgreSQL database, which share the clients
    #[arg(long, default_value_t = 1, requires = "store", value_parser = clap::value_parser!(u8).range(1..=16))]
    replicas: u8,
    /// Where the temporary data folder is made: the file system measured
    #[arg(long, default_value_os_t = std::env::temp_dir())]
    folder: PathBuf,
    /// Connections that ask at the same time
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u16).range(1..=1000))]
    clients: u16,
    /// Sessions that are asked
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    sessions: u32,
    /// Observations of `observe` in one call, each of another session
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1000))]
    batch: u16,
    /// How often `observe` is run, each time with new sessions
    #[arg(long, default_value_t = 3)]
    rounds: u32,
    /// Sessions of `sessions-100k`
    #[arg(long, default_value_t = 100_000, value_parser = clap::value_parser!(u32).range(1..))]
    live_sessions: u32,
    /// Periods of a session
    #[arg(long, default_value_t = 20)]
    horizon: usize,
    /// Design points a step of the policy asked
    #[arg(long, default_value_t = 60)]
    count: usize,
    /// Seconds that each measurement of `/action`, of `/livez` and of the disk takes
    #[arg(long, default_value_t = 6.0)]
    seconds: f64,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Scenario {
    /// Every session through all its periods, one observation after the other, as fast as they are acknowledged.
    Observe,
    /// The advice at a low rate, nothing else going on.
    ActionIdle,
    /// The same while a training of 1,000 design points saturates its pool.
    ActionWhileTraining,
    /// The advice as fast as it comes, in turns with `/livez`.
    ActionVsLivez,
    /// A node with 100,000 sessions: start, memory, and the first two again.
    #[value(name = "sessions-100k")]
    Sessions100k,
}

impl LoadTest {
    fn runs(&self, scenario: Scenario) -> bool {
        self.scenarios.is_empty() || self.scenarios.contains(&scenario)
    }
}

/// # Errors
/// The service cannot be started or reached, or refuses a request.
pub fn run(arguments: &LoadTest) -> Result<(), Box<dyn Error>> {
    // One thread: the generator shares the cores with what it measures.
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let report = runtime.block_on(async {
        let mut terminate = signal(SignalKind::terminate())?;
        // What was started ends with this process, and its folder goes.
        tokio::select! {
            report = measure(arguments) => report,
            _ = terminate.recv() => Err("stopped".into()),
            _ = tokio::signal::ctrl_c() => Err("stopped".into()),
        }
    })?;
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print!("{report}");
    }
    Ok(())
}

async fn measure(arguments: &LoadTest) -> Result<Report, Box<dyn Error>> {
    let mut server = match &arguments.url {
        Some(url) => Server::at(url, arguments.ca.as_deref()).await?,
        None => Server::start(&arguments.folder, arguments.store.as_deref(), arguments.replicas.into()).await?,
    };
    let mut report = Report::default();
    scenarios::run(arguments, &mut server, &mut report).await?;
    Ok(report)
}

/// Says on standard error what takes long.
fn tell(line: &str) {
    eprintln!("{line}");
}
