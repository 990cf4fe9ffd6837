//! `ballast-lab loadtest`: the load that the live service bears on this machine, next to the machine's own limits.
//!
//! Runs `ballast serve`, built beside this program, over a new data folder, or uses a service that is already up. Gives it a
//! policy of the paper's problem with a small design, and drives it from one thread over keep-alive connections. The
//! server is ended by killing it, as a crash would: everything it acknowledged must be there when it is started again.

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

use figures::LoadReport;
use server::Server;

#[derive(Debug, Args)]
pub struct LoadTest {
    /// Scenarios to run; all of them unless given
    #[arg(value_enum)]
    scenarios: Vec<Scenario>,
    /// Drive the service at http://host:port or https://host:port instead of starting one
    #[arg(long)]
    url: Option<String>,
    /// Certificate authorities in PEM, one of which must have issued the certificate of an https service
    #[arg(long, requires = "url")]
    ca: Option<PathBuf>,
    /// Start the service over this PostgreSQL database, which keeps what is written to it, instead of SQLite
    #[arg(long, conflicts_with = "url")]
    store: Option<String>,
    /// Replicas over the PostgreSQL database, which share the clients
    #[arg(long, default_value_t = 1, requires = "store", value_parser = clap::value_parser!(u8).range(1..=16))]
    replicas: u8,
    /// Parent of the temporary data folder, which decides the file system that is measured
    #[arg(long, default_value_os_t = std::env::temp_dir())]
    folder: PathBuf,
    /// Number of concurrent connections
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u16).range(1..=1000))]
    clients: u16,
    /// Number of sessions
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    sessions: u32,
    /// Observations of `observe` in one call, each of a different session
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
    /// Design points per step of the policy
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
    /// Takes every session through all its periods, one observation after the other, as fast as they are acknowledged.
    Observe,
    /// Requests the advice at a low rate, without other load.
    ActionIdle,
    /// Requests the advice at a low rate while a training of 1,000 design points saturates its pool.
    ActionWhileTraining,
    /// Requests the advice as fast as possible, alternating with `/livez`.
    ActionVsLivez,
    /// Runs a node with 100,000 sessions: start, memory, and the first two scenarios again.
    #[value(name = "sessions-100k")]
    Sessions100k,
}

impl LoadTest {
    fn runs(&self, scenario: Scenario) -> bool {
        self.scenarios.is_empty() || self.scenarios.contains(&scenario)
    }
}

/// Runs the scenarios and prints the report.
///
/// # Errors
/// The service cannot be started or reached, or refuses a request.
pub fn run(arguments: &LoadTest) -> Result<(), Box<dyn Error>> {
    // One thread, because the generator shares the cores with the service it measures.
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let report = runtime.block_on(async {
        let mut terminate = signal(SignalKind::terminate())?;
        // On a stop signal the started processes end with this one, and the folder is removed.
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

async fn measure(arguments: &LoadTest) -> Result<LoadReport, Box<dyn Error>> {
    let mut server = match &arguments.url {
        Some(url) => Server::at(url, arguments.ca.as_deref()).await?,
        None => Server::start(&arguments.folder, arguments.store.as_deref(), arguments.replicas.into()).await?,
    };
    let mut report = LoadReport::default();
    scenarios::run(arguments, &mut server, &mut report).await?;
    Ok(report)
}

/// Prints on standard error which slow work is under way.
fn tell(line: &str) {
    eprintln!("{line}");
}
