//! The duration of a whole training, by phase.

use std::error::Error;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use ballast::control::pool::TrainingPool;
use ballast::control::progress::{Phase, StepProgress, Watch};
use ballast::control::request::specification::InitialLaws;
use ballast::control::training::Training;
use clap::Args;

use super::summary::{median, peak_memory_mb};
use crate::paper;

#[derive(Debug, Args)]
pub struct TrainingBench {
    /// Design points per step
    #[arg(long, default_value_t = 1000)]
    count: usize,
    /// Accuracy to reach in basis points, with at most `--count` design points
    #[arg(long)]
    accuracy: Option<f64>,
    #[arg(long, default_value_t = 10)]
    horizon: usize,
    /// Returns of the history
    #[arg(long, default_value_t = 20)]
    sample_size: usize,
    /// Moments of the law among the features
    #[arg(long, default_value_t = 4)]
    moments: usize,
    /// Give every design point its own history
    #[arg(long)]
    resampled: bool,
    /// Threads to train with, one figure each
    #[arg(long, value_delimiter = ',', default_values_t = [std::thread::available_parallelism().map_or(1, usize::from)])]
    threads: Vec<usize>,
    #[arg(long, default_value_t = 1)]
    runs: usize,
}

/// Seconds spent in each phase.
#[derive(Debug, Clone, Copy, Default)]
struct Spent {
    solving: f64,
    fitting: f64,
}

pub fn run(bench: &TrainingBench) -> Result<(), Box<dyn Error>> {
    let initial_laws = if bench.resampled { InitialLaws::Resampled } else { InitialLaws::Given };
    let mut specification = paper::specification(bench.sample_size, bench.horizon, bench.count, initial_laws);
    specification.surrogate.moment_count = bench.moments;
    specification.design.accuracy = bench.accuracy;
    println!("threads  run  total s  solving s  fitting s  peak MB");
    for &threads in &bench.threads {
        let pool = TrainingPool::new(threads)?;
        let mut totals = Vec::new();
        for run in 1..=bench.runs {
            let started = Instant::now();
            let phases = Mutex::new((Spent::default(), Phase::Solving, started));
            let progress = |progress: StepProgress| note_phase(&phases, progress.phase);
            let watch = Watch { stop: &AtomicBool::new(false), progress: &progress };
            let training = Training::new(&specification)?;
            pool.install(|| training.run(&watch))?;
            note_phase(&phases, Phase::Solving);
            let total = started.elapsed().as_secs_f64();
            let spent = phases.lock().map_or(Spent::default(), |phases| phases.0);
            let memory = peak_memory_mb().map_or(String::from("unknown"), |mb| format!("{mb:.0}"));
            println!("{threads:>7} {run:>4} {total:>8.2} {:>10.2} {:>10.2} {memory:>8}", spent.solving, spent.fitting);
            totals.push(total);
        }
        println!("{threads:>7}  median {:.2} s", median(&totals));
    }
    Ok(())
}

/// Adds the time since the last report to the phase that was running.
fn note_phase(phases: &Mutex<(Spent, Phase, Instant)>, phase: Phase) {
    let Ok(mut noted) = phases.lock() else { return };
    let now = Instant::now();
    let elapsed = (now - noted.2).as_secs_f64();
    match noted.1 {
        Phase::Solving => noted.0.solving += elapsed,
        Phase::Fitting => noted.0.fitting += elapsed,
        Phase::Simulating => {}
    }
    (noted.1, noted.2) = (phase, now);
}
