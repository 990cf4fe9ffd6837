//! `ballast-lab bench`: the figures of `docs/measurements.md`, measured on this machine.

use std::error::Error;

use clap::Subcommand;

mod accuracy;
mod action;
mod assets;
mod declared;
mod horizons;
mod kernels;
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
    /// Time the problems of `examples/problems`, and the investor declared in formulas beside its own solver.
    Declared(declared::DeclaredBench),
    /// Time GET /action on loopback, next to GET /livez.
    Action(action::ActionBench),
}

pub fn run(bench: Bench) -> Result<(), Box<dyn Error>> {
    match bench {
        Bench::Training(arguments) => training::run(&arguments),
        Bench::Accuracy(arguments) => accuracy::run(&arguments),
        Bench::Horizons(arguments) => horizons::run(&arguments),
        Bench::Assets(arguments) => assets::run(&arguments),
        Bench::Declared(arguments) => declared::run(&arguments),
        Bench::Kernels(arguments) => kernels::run(&arguments),
        Bench::Action(arguments) => tokio::runtime::Runtime::new()?.block_on(action::run(&arguments)),
    }
}
