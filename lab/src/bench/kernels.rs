//! The parts that take most of a training, each timed alone, on one thread.

use std::error::Error;
use std::hint::black_box;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use ballast::numerics::gp::cholesky::Cholesky;
use ballast::numerics::gp::fit::{Bounds, fit};
use ballast::numerics::machine::elementary::exp;
use ballast::numerics::machine::streams::stream;
use ballast::numerics::transport::wasserstein::WassersteinBall;
use clap::Args;
use nalgebra::DMatrix;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::summary::timed;

#[derive(Debug, Args)]
pub struct KernelsBench {
    /// Rows of the Gaussian process
    #[arg(long, default_value_t = 1000)]
    rows: usize,
    /// Inputs of the Gaussian process
    #[arg(long, default_value_t = 6)]
    inputs: usize,
    #[arg(long, default_value_t = 3)]
    runs: usize,
    /// Write the rows to this file (inputs, target last, header line), for another program to fit
    #[arg(long)]
    csv: Option<PathBuf>,
}

const QUERIES: usize = 1000;
/// Atoms, support points and solves of the inner problem.
const ATOMS: usize = 30;
const SUPPORT: usize = 120;
const SOLVES: usize = 2000;
/// Count of numbers read from memory: far more than any cache holds.
const NUMBERS: usize = 32 << 20;
/// Size of the array of exponentials, which stays in the first-level cache, and how often it is computed.
const EXPONENTIALS: (usize, usize) = (1000, 2000);

pub fn run(bench: &KernelsBench) -> Result<(), Box<dyn Error>> {
    let (inputs, targets) = smooth_function(bench.rows, bench.inputs);
    if let Some(path) = &bench.csv {
        write_csv(path, &inputs, &targets)?;
    }
    let (inputs, targets) = standardized(&inputs, &targets);
    // The bounds of the scikit-learn program that it is compared with.
    let bounds = Bounds { lengthscale: [0.1, 1e3], signal_variance: [1e-3, 1e3], noise_variance: [1e-8, 1.0] };
    let fitted = || fit(&inputs, std::slice::from_ref(&targets), &bounds, None, &AtomicBool::new(false));
    let found = fitted()?;
    let fit_seconds = timed(bench.runs, || drop(black_box(fitted())));
    println!(
        "fit: {fit_seconds:.4} s, log-likelihood per point {:.6}, {} evaluations ({:?})",
        found.log_likelihood / targets.len() as f64,
        found.evaluations,
        found.outcome
    );
    let process = &found.process;
    let mut generator = stream(2, "bench-queries", 0, 0);
    let queries: Vec<Vec<f64>> = (0..QUERIES).map(|_| normals(&mut generator, bench.inputs)).collect();
    let mut scratch = Vec::new();
    let predict_seconds = timed(bench.runs, || {
        let means = queries.iter().map(|query| process.posterior_mean().mean_with(query, &mut scratch));
        black_box(means.sum::<f64>());
    });
    let evaluations = (QUERIES * bench.rows) as f64 / predict_seconds;
    println!("mean at {QUERIES} queries: {predict_seconds:.5} s, {:.0} million kernels a second", evaluations / 1e6);
    println!("exponential alone: {:.0} million a second", exponentials_per_second(bench.runs) / 1e6);
    let products = (bench.rows as f64).powi(3) / 6.0;
    let factor_seconds = cholesky_seconds(bench.rows, bench.runs);
    println!("Cholesky of {} rows: {:.1} billion products a second", bench.rows, products / factor_seconds / 1e9);
    println!("memory read: {:.1} GB a second", bytes_read_per_second(bench.runs) / 1e9);
    println!("inner solve, {ATOMS} atoms, {SUPPORT} support points: {:.2} us", 1e6 * inner_solve_seconds(bench.runs));
    let inner = InnerProblem::new();
    for radius in [0.01, 0.05, 0.1] {
        println!("inner value at radius {radius}: {:.15}", inner.worst_expectation(radius));
    }
    Ok(())
}

fn normals(generator: &mut impl Rng, count: usize) -> Vec<f64> {
    (0..count).map(|_| generator.sample(StandardNormal)).collect()
}

/// Returns a smooth function of normal inputs with a kink, and noise of a hundredth of its size.
fn smooth_function(rows: usize, inputs: usize) -> (DMatrix<f64>, Vec<f64>) {
    let mut generator = stream(1, "bench-rows", 0, 0);
    let points: Vec<Vec<f64>> = (0..rows).map(|_| normals(&mut generator, inputs)).collect();
    let value = |x: &Vec<f64>| {
        let smooth: f64 = x.iter().zip(1..).map(|(x, order)| (x / f64::from(order)).sin()).sum();
        let kink = (x.iter().sum::<f64>() / x.len() as f64).max(0.0);
        smooth + kink * kink
    };
    let targets = points.iter().map(|x| value(x) + 0.01 * generator.sample::<f64, _>(StandardNormal)).collect();
    (DMatrix::from_row_iterator(rows, inputs, points.into_iter().flatten()), targets)
}

/// Scales columns and targets to mean 0 and variance 1.
fn standardized(inputs: &DMatrix<f64>, targets: &[f64]) -> (DMatrix<f64>, Vec<f64>) {
    let standard = |values: &[f64]| -> Vec<f64> {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
        values.iter().map(|value| (value - mean) / variance.sqrt()).collect()
    };
    let columns = inputs.column_iter().flat_map(|column| standard(&column.iter().copied().collect::<Vec<f64>>()));
    (DMatrix::from_iterator(inputs.nrows(), inputs.ncols(), columns), standard(targets))
}

fn write_csv(path: &PathBuf, inputs: &DMatrix<f64>, targets: &[f64]) -> csv::Result<()> {
    let mut file = csv::Writer::from_path(path)?;
    file.write_record((1..=inputs.ncols()).map(|index| format!("x{index}")).chain(["y".to_owned()]))?;
    for (row, target) in inputs.row_iter().zip(targets) {
        file.write_record(row.iter().chain([target]).map(|number| format!("{number:e}")))?;
    }
    Ok(file.flush()?)
}

fn exponentials_per_second(runs: usize) -> f64 {
    let (size, passes) = EXPONENTIALS;
    let arguments: Vec<f64> = (0..size).map(|index| -10.0 * index as f64 / size as f64).collect();
    let mut values = arguments.clone();
    let seconds = timed(runs, || {
        for _ in 0..passes {
            pulp::Arch::new().dispatch(
                #[inline(always)]
                || values.iter_mut().zip(&arguments).for_each(|(value, x)| *value = exp(*x)),
            );
            black_box(&mut values);
        }
    });
    (size * passes) as f64 / seconds
}

/// Returns the seconds of one factorisation, n^3/6 products and as many sums.
fn cholesky_seconds(rows: usize, runs: usize) -> f64 {
    let entry = |row: usize, column: usize| (-(row as f64 - column as f64).abs() / rows as f64).exp();
    let mut matrices = vec![DMatrix::from_fn(rows, rows, entry); runs.max(1)];
    timed(runs, || drop(black_box(matrices.pop().map(Cholesky::factor))))
}

fn bytes_read_per_second(runs: usize) -> f64 {
    let numbers: Vec<u64> = (0..NUMBERS as u64).collect();
    let seconds = timed(runs, || _ = black_box(numbers.iter().fold(0, |all, number| all ^ number)));
    (NUMBERS * size_of::<u64>()) as f64 / seconds
}

/// The inner problem that is timed: equally likely atoms in the middle of an even support, exponential payoff.
struct InnerProblem {
    support: Vec<f64>,
    masses: Vec<f64>,
    payoff: Vec<f64>,
}

impl InnerProblem {
    fn new() -> Self {
        let support: Vec<f64> = (0..SUPPORT).map(|k| -1.0 + 1.6 * k as f64 / (SUPPORT - 1) as f64).collect();
        let first = (SUPPORT - ATOMS) / 2;
        let mass = |k: usize| if (first..first + ATOMS).contains(&k) { 1.0 / ATOMS as f64 } else { 0.0 };
        let payoff = support.iter().map(|z| -(-2.0 * z).exp()).collect();
        InnerProblem { masses: (0..SUPPORT).map(mass).collect(), support, payoff }
    }

    fn worst_expectation(&self, radius: f64) -> f64 {
        WassersteinBall { support: &self.support, masses: &self.masses, radius }.worst_expectation(&self.payoff).0
    }
}

/// Returns the seconds of one exact inner solve, over radii from 0 to half the spread of the atoms.
fn inner_solve_seconds(runs: usize) -> f64 {
    let inner = InnerProblem::new();
    let seconds = timed(runs, || {
        for solve in 0..SOLVES {
            black_box(inner.worst_expectation(0.2 * solve as f64 / SOLVES as f64));
        }
    });
    seconds / SOLVES as f64
}
