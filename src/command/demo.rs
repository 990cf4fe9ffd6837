//! `ballast demo`: the whole procedure once, on real returns, over HTTP.
//!
//! Starts the service in this process on a free loopback port with its own data folder, and trains on the 240 months
//! before 2008. It then goes through 2008 as an investor's program would: ask, hold, report. A second act does the same
//! with four industries.

use std::net::SocketAddr;
use std::time::Instant;

use ballast::http::api_client::{ApiClient, ApiError};
use clap::Args;
use thiserror::Error;

use super::host::{Host, HostError};
use super::returns::ReturnsError;

mod assets;
mod calls;
mod past;
mod progress;
mod story;

#[derive(Debug, Clone, Args)]
pub struct DemoArgs {
    /// Leave the service up afterwards, until Ctrl-C
    #[arg(long)]
    stay: bool,
    /// Leave the service up, and open its page in the browser of this desktop
    #[arg(long)]
    open: bool,
    /// Design points per step: more is more accurate and slower
    #[arg(long, default_value_t = 500)]
    count: usize,
}

#[derive(Debug, Error)]
pub enum DemoError {
    #[error(transparent)]
    Host(#[from] HostError),
    #[error("reading the bundled returns")]
    Market(#[from] ReturnsError),
    #[error("calling the service")]
    Api(#[from] ApiError),
    #[error("{call} answered JSON of an unexpected shape")]
    Shape { call: &'static str, source: serde_json::Error },
    #[error("the training ended as {state}: {reason}")]
    Training { state: String, reason: String },
}

/// Runs the demo to its end, or to Ctrl-C.
pub async fn run(args: DemoArgs) -> Result<(), DemoError> {
    let started = Instant::now();
    let service = Host::start("demo").await?;
    println!("Ballast is up on http://{} with its data in {}.", service.address, service.folder().display());
    let outcome = tokio::select! {
        outcome = whole(service.address, &args, started) => outcome,
        _ = tokio::signal::ctrl_c() => {
            println!("\nStopped.");
            Ok(())
        }
    };
    service.stop().await;
    outcome
}

async fn whole(address: SocketAddr, args: &DemoArgs, started: Instant) -> Result<(), DemoError> {
    let api = ApiClient::new(address);
    story::narrate(&api, args.count).await?;
    assets::narrate(&api, args.count).await?;
    println!("\nDone in {:.0} s.", started.elapsed().as_secs_f64());
    if args.open {
        let page = format!("http://{address}/");
        let opened = tokio::task::spawn_blocking(|| open::that(page)).await;
        if !matches!(opened, Ok(Ok(()))) {
            println!("No browser could be opened on this machine.");
        }
    }
    if args.stay || args.open {
        println!("The service stays up on http://{address} until Ctrl-C.");
        std::future::pending::<()>().await;
    }
    Ok(())
}
