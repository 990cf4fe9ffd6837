//! Measures Ballast: its speed and accuracy, the load it bears, how often its balls hold the law, and the paper's
//! figures. The documents print which command makes each of their figures.

#![forbid(unsafe_code)]

mod bench;
mod caution_worlds;
mod compare;
mod coverage;
mod evaluate;
mod fund_coverage;
mod loadtest;
mod market;
mod paper;
mod reproduce;
mod tables;

use std::error::Error;
use std::process::ExitCode;

use ballast::report::{end_where_nobody_reads, with_causes};
use clap::{Parser, Subcommand};

/// Measurements and experiments with Ballast.
#[derive(Debug, Parser)]
#[command(version)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

/// The allocator of the service.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

#[derive(Debug, Subcommand)]
enum Command {
    /// Measure this machine's speed and accuracy.
    #[command(subcommand)]
    Bench(bench::Bench),
    /// Measure the load that the live service can bear on this machine.
    Loadtest(loadtest::LoadTest),
    /// Recompute the tables and figures of the paper's section 3.
    Reproduce(reproduce::Reproduce),
    /// Compare frameworks out of sample.
    Evaluate(evaluate::Evaluate),
    /// Report how often balls contain the law that records come from, and what they cost.
    Coverage(coverage::CoverageArgs),
    /// Report how often the balls of all funds of several assets contain their laws at once.
    FundCoverage(fund_coverage::FundCoverage),
    /// Report what each level of caution costs when the true law is known.
    CautionWorlds(caution_worlds::CautionWorlds),
}

fn main() -> ExitCode {
    end_where_nobody_reads();
    match outcome(CommandLine::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("ballast-lab: {}", with_causes(error.as_ref()));
            ExitCode::FAILURE
        }
    }
}

fn outcome(command: Command) -> Result<(), Box<dyn Error>> {
    match command {
        Command::Bench(bench) => bench::run(bench),
        Command::Loadtest(arguments) => loadtest::run(&arguments),
        Command::Reproduce(arguments) => reproduce::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        Command::Coverage(arguments) => coverage::run(&arguments),
        Command::FundCoverage(arguments) => {
            fund_coverage::run(&arguments);
            Ok(())
        }
        Command::CautionWorlds(arguments) => caution_worlds::run(&arguments),
    }
}
