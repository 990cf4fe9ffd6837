//! Maximum likelihood for the scales of a Gaussian process, with exact gradients.

use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::DMatrix;

use super::cholesky::{Cholesky, Singular};
use super::gp::{Hyperparameters, kernel_lower, squared_distances_below};
use super::matern;
use super::minimise::{Minimum, SearchOutcome, minimise_bounded};
use super::quasi_newton::{curvature_at, minimise_from};

const ITERATION_LIMIT: usize = 100;
/// Subsets searched first: their rows, and the number of rows above which they are. An evaluation on 300 rows costs 1/25
/// of one on 1000, and both the optimum and the curvature of a subset are close to those of all rows.
const SUBSETS: [(usize, usize); 2] = [(300, 400), (1000, 2500)];
/// A search that starts from a known curvature ends where a step promises less than this of ln p, far below the 1/2 by
/// which the scales are uncertain.
const TOLERANCE: f64 = 1e-3;
/// Or after this many steps. At 1,000 points of the paper's problem convergence takes 15 evaluations for the value and 26
/// for the policy, on average; the errors of the surrogates are the same from 6 steps on.
const STEP_LIMIT: usize = 6;
/// Default start: the share of the targets' variance taken for noise.
const START_NOISE_SHARE: f64 = 1e-2;
/// A search starts from length scales no longer than this, in units of the inputs: beyond, the likelihood is flat to the
/// optimiser, which would leave an input that matters where an earlier search on other rows had lost it.
const LONGEST_START: f64 = 30.0;

/// Least and greatest value of each scale; both positive.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    /// Lower and upper bound of every length scale.
    pub lengthscale: [f64; 2],
    /// Lower and upper bound.
    pub signal_variance: [f64; 2],
    /// Lower and upper bound.
    pub noise_variance: [f64; 2],
}

/// The most likely scales found.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The best found.
    pub hyperparameters: Hyperparameters,
    /// ln p(targets) over all rows.
    pub log_likelihood: f64,
    /// Factorisations on all rows and on subsets together.
    pub evaluations: usize,
    /// How the search on all rows ended.
    pub outcome: SearchOutcome,
}

/// Why there are no scales.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum FitError {
    /// No jitter made the covariance matrix factor.
    #[error(transparent)]
    Singular(#[from] Singular),
    /// The stop signal was raised.
    #[error("the search was asked to stop")]
    Stopped,
}

/// The scales in `bounds` under which `targets` (n) at `inputs` (n rows, d columns) are most likely.
///
/// A search over natural logarithms in the box, the signal variance profiled out, from `start` (moved into the bounds)
/// or from the spread of the data: L-BFGS-B on all of up to 400 rows. Of more rows 300, evenly strided, are searched
/// so, and the curvature found there, which grows with the number of rows, leads quasi-Newton steps on all rows, or
/// above 2500 on 1000 rows and then on all: six evaluations or so. A start whose kernel matrix is singular is retried
/// with the greatest noise allowed; `Singular` when that fails too. `Stopped` within one evaluation of `stop` being set.
/// Cost O(n^3) for each evaluation. Source: Rasmussen and Williams 2006, section 5.4.1.
pub fn fit(
    inputs: &DMatrix<f64>,
    targets: &[f64],
    bounds: &Bounds,
    start: Option<&Hyperparameters>,
    stop: &AtomicBool,
) -> Result<Fit, FitError> {
    let n = inputs.nrows();
    let mut point = point_of(&start.cloned().unwrap_or_else(|| start_from_spread(inputs, targets)));
    let mut curvature_of_a_row = None;
    let mut evaluations = 0;
    for (rows, above) in SUBSETS {
        if n > above {
            shorten(&mut point, inputs.ncols());
            let chosen: Vec<usize> = (0..rows).map(|k| k * n / rows).collect();
            let some_inputs = inputs.select_rows(&chosen);
            let some_targets: Vec<f64> = chosen.iter().map(|&row| targets[row]).collect();
            let search = Search { inputs: &some_inputs, targets: &some_targets, bounds, stop };
            let found = search.run(&point, curvature_of_a_row.as_ref())?;
            point = found.minimum.point;
            evaluations += found.minimum.evaluations;
            if curvature_of_a_row.is_none() {
                evaluations += point.len() + 1;
                curvature_of_a_row = search.curvature_of_a_row(&point);
            }
        }
    }
    shorten(&mut point, inputs.ncols());
    let Optimum { minimum, signal_variance } =
        Search { inputs, targets, bounds, stop }.run(&point, curvature_of_a_row.as_ref())?;
    Ok(Fit {
        hyperparameters: hyperparameters(&minimum.point, signal_variance),
        log_likelihood: -minimum.value,
        evaluations: evaluations + minimum.evaluations,
        outcome: minimum.outcome,
    })
}

/// Brings the first `inputs` entries, logarithms of length scales, within [`LONGEST_START`].
fn shorten(point: &mut [f64], inputs: usize) {
    point[..inputs].iter_mut().for_each(|log_scale| *log_scale = log_scale.min(LONGEST_START.ln()));
}

/// Log marginal likelihood and its gradient, in the order log length scales, log signal, log noise variance.
///
/// What a fit climbs, at given scales. `None` when the matrix is singular to working precision.
pub fn log_likelihood_and_gradient(
    inputs: &DMatrix<f64>,
    targets: &[f64],
    hyper: &Hyperparameters,
) -> Option<(f64, Vec<f64>)> {
    let ratio = hyper.noise_variance / hyper.signal_variance;
    let unit = Hyperparameters { signal_variance: 1.0, noise_variance: ratio, ..hyper.clone() };
    let at = likelihood(inputs, targets, &unit, |_| hyper.signal_variance, &mut Matrices::new(targets.len()))?;
    Some((at.log_likelihood, at.gradient))
}

/// The likelihood where the kernel has the signal variance s2 = `signal_variance(y^T A^-1 y)`.
///
///   ln p(y) = -y^T A^-1 y / (2 s2) - ln det A / 2 - n ln(2 pi s2) / 2,     K = s2 A,  A = R(l) + nu I
///   d ln p / d theta = (1/2) sum_ij W_ij dA_ij / d theta,   W = alpha alpha^T - A^-1,   alpha = A^-1 y / s
///   dk / d log l_i = (5/3) (1 + r) exp(-r) ((x_i - y_i) / l_i)^2,   r = sqrt(5) scaled distance
///
/// `unit` holds the length scales l, the signal variance 1 and the noise ratio nu. `None` when A is singular to working
/// precision. One factorisation and one inverse: cost O(n^3), and O(n^2 d) for the contraction.
/// Source: Rasmussen and Williams 2006, eqs. (2.30) and (5.9).
/// Checked by: tests/gp.rs, gradients_equal_those_of_scikit_learn.
fn likelihood(
    inputs: &DMatrix<f64>,
    targets: &[f64],
    unit: &Hyperparameters,
    signal_variance: impl FnOnce(f64) -> f64,
    matrices: &mut Matrices,
) -> Option<Likelihood> {
    let n = targets.len() as f64;
    let scaled = unit.scale(inputs);
    let factor = matrices.factor(&scaled, unit)?;
    let mut weights = factor.solve(targets);
    let squares = matern::dot(targets, &weights);
    let signal_variance = signal_variance(squares);
    let log_likelihood =
        -0.5 * squares / signal_variance - 0.5 * factor.log_determinant() - 0.5 * n * (TAU * signal_variance).ln();
    let root = signal_variance.sqrt();
    weights.iter_mut().for_each(|weight| *weight /= root);
    factor.inverse_lower(&mut matrices.inverse);
    matrices.kernel = factor.into_memory();
    let gradient = contract(&scaled, &mut matrices.inverse, &weights, unit);
    Some(Likelihood { log_likelihood, gradient, signal_variance })
}

/// The memory of an evaluation, kept for the next: fresh pages would cost a fifth of its time.
struct Matrices {
    /// K, then its factor.
    kernel: DMatrix<f64>,
    inverse: DMatrix<f64>,
}

impl Matrices {
    fn new(n: usize) -> Self {
        Matrices { kernel: DMatrix::zeros(n, n), inverse: DMatrix::zeros(n, n) }
    }

    /// The factor of K + noise I over the rows of `scaled`, in the memory of `kernel`.
    fn factor(&mut self, scaled: &DMatrix<f64>, hyper: &Hyperparameters) -> Option<Cholesky> {
        let n = scaled.nrows();
        let mut kernel = std::mem::replace(&mut self.kernel, DMatrix::zeros(0, 0));
        if kernel.nrows() != n {
            kernel = DMatrix::zeros(n, n);
        }
        kernel_lower(scaled, hyper, &mut kernel);
        Cholesky::factor(kernel)
    }
}

/// The sums of W .* dK over one triangle, doubled; `inverse` is overwritten column by column.
fn contract(scaled: &DMatrix<f64>, inverse: &mut DMatrix<f64>, alpha: &[f64], hyper: &Hyperparameters) -> Vec<f64> {
    let (n, d) = scaled.shape();
    let mut squared = vec![0.0; n];
    let mut lengths = vec![0.0; d];
    let (mut below_diagonal, mut trace) = (0.0, 0.0);
    for (j, column) in inverse.as_mut_slice().chunks_exact_mut(n).enumerate() {
        trace += alpha[j] * alpha[j] - column[j];
        let contrast = &mut column[j + 1..];
        let squared = &mut squared[j + 1..];
        squared_distances_below(scaled, j, squared);
        for (entry, other) in contrast.iter_mut().zip(&alpha[j + 1..]) {
            *entry = alpha[j] * other - *entry;
        }
        below_diagonal += matern::contract_column(squared, contrast);
        for (sum, coordinates) in lengths.iter_mut().zip(scaled.as_slice().chunks_exact(n)) {
            *sum += matern::weighted_squares(&coordinates[j + 1..], coordinates[j], contrast);
        }
    }
    let signal = hyper.signal_variance;
    let mut gradient: Vec<f64> = lengths.iter().map(|sum| signal * sum).collect();
    gradient.push(signal * (below_diagonal + 0.5 * trace));
    gradient.push(0.5 * hyper.noise_variance * trace);
    gradient
}

/// The likelihood at some scales, with what a search needs there.
struct Likelihood {
    log_likelihood: f64,
    /// In the order log length scales, log signal variance, log noise variance; of a search, which profiles the signal
    /// variance out, log length scales, log noise ratio.
    gradient: Vec<f64>,
    signal_variance: f64,
}

/// A search for the most likely scales of some rows.
struct Search<'a> {
    inputs: &'a DMatrix<f64>,
    targets: &'a [f64],
    bounds: &'a Bounds,
    stop: &'a AtomicBool,
}

/// Where a search ended.
struct Optimum {
    /// Of -ln p.
    minimum: Minimum,
    /// Profiled out there.
    signal_variance: f64,
}

impl Search<'_> {
    /// The best point found from `start`: by L-BFGS-B, or by quasi-Newton steps where the curvature is known.
    fn run(&self, start: &[f64], curvature_of_a_row: Option<&DMatrix<f64>>) -> Result<Optimum, FitError> {
        let (lower, upper) = self.limits();
        let mut matrices = Matrices::new(self.targets.len());
        let mut best = (f64::INFINITY, f64::NAN);
        let stopped = || self.stop.load(Ordering::Relaxed);
        // Once stopped every point is outside the domain, and the line search gives up.
        let mut objective = |point: &[f64]| {
            let found = if stopped() { None } else { self.profiled(point, &mut matrices) };
            let Some(found) = found else { return (f64::INFINITY, vec![0.0; point.len()]) };
            if -found.log_likelihood < best.0 {
                best = (-found.log_likelihood, found.signal_variance);
            }
            (-found.log_likelihood, found.gradient.into_iter().map(|slope| -slope).collect())
        };
        let mut minimum = match curvature_of_a_row {
            Some(curvature) => {
                let curvature = curvature * self.targets.len() as f64;
                minimise_from(&mut objective, start, curvature, &lower, &upper, TOLERANCE, STEP_LIMIT)
            }
            None => minimise_bounded(&mut objective, start, &lower, &upper, ITERATION_LIMIT),
        };
        if minimum.value == f64::INFINITY {
            let mut noisy = start.to_vec();
            noisy[start.len() - 1] = upper[start.len() - 1];
            let spent = minimum.evaluations;
            minimum = minimise_bounded(&mut objective, &noisy, &lower, &upper, ITERATION_LIMIT);
            minimum.evaluations += spent;
        }
        match minimum.value {
            _ if stopped() => Err(FitError::Stopped),
            f64::INFINITY => Err(Singular { jitter: 0.0 }.into()),
            _ => Ok(Optimum { minimum, signal_variance: best.1 }),
        }
    }

    /// The second derivatives of -ln p at `point`, divided by the number of rows; `None` where they are not finite.
    fn curvature_of_a_row(&self, point: &[f64]) -> Option<DMatrix<f64>> {
        let mut matrices = Matrices::new(self.targets.len());
        let rows = self.targets.len() as f64;
        let slopes = |at: &[f64]| {
            let found = self.profiled(at, &mut matrices)?;
            Some(found.gradient.into_iter().map(|slope| -slope / rows).collect())
        };
        let (lower, upper) = self.limits();
        curvature_at(slopes, point, &lower, &upper)
    }

    /// The box of the search: log length scales, then the log of the noise ratio.
    fn limits(&self) -> (Vec<f64>, Vec<f64>) {
        let Bounds { lengthscale, signal_variance, noise_variance } = self.bounds;
        let side = |side: usize| {
            let mut logs = vec![lengthscale[side].ln(); self.inputs.ncols()];
            logs.push((noise_variance[side] / signal_variance[1 - side]).ln());
            logs
        };
        (side(0), side(1))
    }

    /// The likelihood with the signal variance profiled out, at `point`: log length scales, then the log of the ratio
    /// nu = noise / signal variance.
    ///
    ///   s2(l, nu) = y^T A^-1 y / n, moved into its bounds,   A = R(l) + nu I,   K = s2 A
    ///
    /// Where s2 is inside its bounds its own slope vanishes, so the gradient is the partial one; where a bound of the noise
    /// holds it, s2 moves against nu. The ridge along which s2 and the length scales trade places is gone, and with it most
    /// iterations of a search. `None` where A is singular. Cost as [`likelihood`].
    fn profiled(&self, point: &[f64], matrices: &mut Matrices) -> Option<Likelihood> {
        let Search { inputs, targets, bounds, .. } = *self;
        let unit = hyperparameters(point, 1.0);
        let ratio = unit.noise_variance;
        let (signal, noise) = (bounds.signal_variance, bounds.noise_variance);
        let (least, greatest) = (signal[0].max(noise[0] / ratio), signal[1].min(noise[1] / ratio));
        let profile = |squares: f64| (squares / targets.len() as f64).max(least).min(greatest);
        let mut at = likelihood(inputs, targets, &unit, profile, matrices)?;
        let (noise_slope, signal_slope) = (at.gradient.pop()?, at.gradient.pop()?);
        let held_by_noise = at.signal_variance == noise[0] / ratio || at.signal_variance == noise[1] / ratio;
        at.gradient.push(if held_by_noise { -signal_slope } else { noise_slope });
        Some(at)
    }
}

/// Length scales of sqrt(d) standard deviations, so that typical points lie about one length apart.
fn start_from_spread(inputs: &DMatrix<f64>, targets: &[f64]) -> Hyperparameters {
    let root_d = (inputs.ncols() as f64).sqrt();
    let variance = targets.iter().map(|y| y * y).sum::<f64>() / targets.len().max(1) as f64;
    let variance = variance.max(f64::MIN_POSITIVE.sqrt());
    Hyperparameters {
        lengthscales: inputs
            .column_iter()
            .map(|column| root_d * column.variance().max(f64::MIN_POSITIVE).sqrt())
            .collect(),
        signal_variance: variance,
        noise_variance: START_NOISE_SHARE * variance,
    }
}

/// The point of the search that stands for these scales.
fn point_of(hyper: &Hyperparameters) -> Vec<f64> {
    let ratio = hyper.noise_variance / hyper.signal_variance;
    hyper.lengthscales.iter().chain([&ratio]).map(|scale| scale.ln()).collect()
}

/// The scales at a point of the search and a signal variance.
fn hyperparameters(point: &[f64], signal_variance: f64) -> Hyperparameters {
    let mut lengthscales: Vec<f64> = point.iter().map(|log| log.exp()).collect();
    let ratio = lengthscales.pop().unwrap_or(0.0);
    Hyperparameters { lengthscales, signal_variance, noise_variance: ratio * signal_variance }
}
