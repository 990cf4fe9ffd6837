//! `ballast bench`: the figures of `docs/measurements.md`, measured on this machine.

use std::error::Error;

use clap::Subcommand;

mod accuracy;
mod action;
mod assets;
mod horizons;
mod kernels;
pub mod paper;
mod summary;
mod training;

#[derive(Debug, Subcommand)]
pub enum Bench {
    /// Time a whole training of the paper's configuration, phase by phase.
    Training(training::TrainingBench),
    /// Time the fit, the kernel sums, the exponential and the inner solve, on one thread.
    Kernels(kernels::KernelsBench),
    /// Compare the surrogates with direct solves at fresh states, in basis points of log certainty equivalent.
    Accuracy(accuracy::AccuracyBench),
    /// Compare policies for one history with brute force, in basis points and in allocation.
    Horizons(horizons::HorizonsBench),
    /// Time the robust step of several assets, from a cold start and from a warm start at the solution of the month
    /// before.
    Assets(assets::AssetsBench),
    /// Time GET /action on loopback, next to GET /livez.
    Action(action::ActionBench),
}

pub async fn run(bench: Bench) -> Result<(), Box<dyn Error>> {
    match bench {
        Bench::Training(arguments) => tokio::task::block_in_place(|| training::run(&arguments)),
        Bench::Accuracy(arguments) => tokio::task::block_in_place(|| accuracy::run(&arguments)),
        Bench::Horizons(arguments) => tokio::task::block_in_place(|| horizons::run(&arguments)),
        Bench::Assets(arguments) => tokio::task::block_in_place(|| assets::run(&arguments)),
        Bench::Kernels(arguments) => tokio::task::block_in_place(|| kernels::run(&arguments)),
        Bench::Action(arguments) => action::run(&arguments).await,
    }
}
