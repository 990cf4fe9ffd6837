//! Parses the command line and runs the command.

#![forbid(unsafe_code)]

mod command;

use std::process::ExitCode;

use ballast::report::{end_where_nobody_reads, with_causes};
use ballast::service::process::config::Config;
use clap::{Parser, Subcommand};
use command::{
    advise, audit, backtest, backup, check, demo, frontier, healthcheck, keys, letters, plan, serve, sleeve, solve,
};
use tokio::runtime::Builder;

/// Nonparametric adaptive robust control of an investor, as a service.
#[derive(Debug, Parser)]
#[command(version)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

/// The allocator, also of SQLite. The threads of both use little address space, so the service survives a limit on it
/// (`tests/operation/memory.rs`).
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

#[derive(Debug, Subcommand)]
enum Command {
    /// Train on real returns and advise a live session through 2008.
    Demo(demo::DemoArgs),
    /// Say what to hold through the coming period, from a file of returns or prices.
    Advise(advise::AdviseArgs),
    /// Plan what to spend and what to hold for years, from a file of returns or prices.
    Plan(plan::PlanArgs),
    /// Say how much of the capital a strategy deserves, from a file of its returns or trades.
    Sleeve(sleeve::SleeveArgs),
    /// Run the service.
    Serve(serve::Serve),
    /// Report a walk-forward on real returns: train on the past, follow the policy for the next year, repeat.
    Backtest(backtest::BacktestArgs),
    /// Report what more or less caution would cost on records like the one in a file.
    Frontier(frontier::FrontierArgs),
    /// Solve a problem declared in formulas: say what to do first, what it is worth, and under which worst law.
    Solve(solve::SolveArgs),
    /// Write the letters to all clients of a running service, a file each.
    Letters(letters::LettersArgs),
    /// Manage the keys that allow callers to use a service.
    #[command(subcommand)]
    Keys(keys::KeysCommand),
    /// Show who did what, newest first.
    Audit(audit::AuditCommand),
    /// Verify every row of a store by its seal or hash. Only reads, and works while a service runs or without one.
    Check(check::Check),
    /// Copy the database of a data folder into one file, while the service runs, and verify the copy.
    Backup(backup::Backup),
    /// Make a data folder from a backup and verify it.
    Restore(backup::Restore),
    /// Move a data folder into PostgreSQL and compare every row, while no service runs.
    Move(backup::MoveCommand),
    /// Restore one damaged item of a data folder from a backup, while no service runs.
    Repair(backup::RepairCommand),
    /// Exit 0 if a running service is ready, else 1.
    Healthcheck(healthcheck::Healthcheck),
    /// Print the OpenAPI description.
    Openapi {
        /// Print it as a page of Markdown, for people.
        #[arg(long)]
        page: bool,
    },
}

fn main() -> ExitCode {
    end_where_nobody_reads();
    let blocking_threads = Config::new("").blocking_threads();
    let runtime = Builder::new_multi_thread().enable_all().max_blocking_threads(blocking_threads).build();
    let runtime = match runtime {
        Ok(runtime) => runtime,
        Err(error) => {
            eprintln!("ballast: starting the runtime: {error}");
            return ExitCode::FAILURE;
        }
    };
    let outcome = runtime.block_on(outcome());
    // End the process now, even if a thread still computes something that nobody waits for.
    runtime.shutdown_background();
    outcome
}

async fn outcome() -> ExitCode {
    let outcome = match CommandLine::parse().command {
        Command::Demo(arguments) => demo::run(arguments).await.map_err(Into::into),
        Command::Serve(arguments) => serve::run(arguments).await,
        Command::Advise(arguments) => tokio::task::block_in_place(|| advise::run(&arguments)),
        Command::Plan(arguments) => tokio::task::block_in_place(|| plan::run(&arguments)),
        Command::Sleeve(arguments) => tokio::task::block_in_place(|| sleeve::run(&arguments)),
        Command::Backtest(arguments) => tokio::task::block_in_place(|| backtest::run(&arguments)).map_err(Into::into),
        Command::Frontier(arguments) => tokio::task::block_in_place(|| frontier::run(&arguments)),
        Command::Solve(arguments) => tokio::task::block_in_place(|| solve::run(&arguments)),
        Command::Letters(arguments) => letters::run(arguments).await,
        Command::Keys(arguments) => keys::run(arguments).await,
        Command::Audit(arguments) => audit::run(arguments).await,
        Command::Check(arguments) => check::run(arguments).await,
        Command::Backup(arguments) => backup::run(arguments).await,
        Command::Restore(arguments) => backup::restore(arguments).await,
        Command::Move(arguments) => backup::relocate(arguments).await,
        Command::Repair(arguments) => backup::repair(arguments).await,
        Command::Healthcheck(arguments) => healthcheck::run(&arguments),
        Command::Openapi { page } => {
            let description =
                if page { ballast::http::reference_page() } else { ballast::http::description_json().into() };
            print!("{description}");
            Ok(())
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("ballast: {}", with_causes(error.as_ref()));
            ExitCode::FAILURE
        }
    }
}
