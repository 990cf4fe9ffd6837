//! Maximum likelihood for the hyperparameters of a Gaussian process, with exact gradients.

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::DMatrix;

use crate::numerics::gp::cholesky::Singular;
use crate::numerics::gp::likelihood::{Likelihood, Matrices, likelihood};
use crate::numerics::gp::{GaussianProcess, Hyperparameters};
use crate::numerics::search::minimise::{Minimum, SearchOutcome, minimise_bounded};
use crate::numerics::search::quasi_newton::{curvature_at, minimise_from};

const ITERATION_LIMIT: usize = 100;
/// The most rows of a search. The length scales of more rows than these gain nothing that the errors of the surrogates
/// show (`docs/measurements.md`), and an evaluation on 4,000 rows costs a thousand times as much.
const SEARCHED: usize = 400;
/// The rows of the first search if there are more than those. Both the optimum and the curvature of a subset are close
/// to those of all rows. With 150 rows some surrogates of the paper's problem had twice the error.
const FIRST_SEARCH: usize = 200;
/// A search from a known curvature ends if a step predicts an improvement of ln p below this, far below the 1/2 by
/// which the hyperparameters are uncertain.
const TOLERANCE: f64 = 1e-3;
/// The most steps of such a search. At 1,000 points of the paper's problem convergence takes 15 evaluations for the
/// value and 26 for the policy, on average. The errors of the surrogates are the same from 6 steps on. Where the start
/// was shortened, there are as many more as it takes to come back, at most a factor of e each.
const STEP_LIMIT: usize = 6;
/// Default start: the share of the targets' variance that is noise.
const START_NOISE_SHARE: f64 = 1e-2;
/// The longest length scale at which a search starts, in units of the inputs. Beyond it the likelihood is flat to the
/// optimiser. If an earlier search on other rows had lost an input that matters, a later search could not recover it.
const LONGEST_START: f64 = 30.0;

/// Lower and upper bounds of the hyperparameters, all positive.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    /// Lower and upper bound of every length scale.
    pub lengthscale: [f64; 2],
    /// Lower and upper bound of the signal variance.
    pub signal_variance: [f64; 2],
    /// Lower and upper bound of the noise variance.
    pub noise_variance: [f64; 2],
}

impl Bounds {
    /// Returns the signal variance closest to `wanted` with which noise of `ratio` times it is within its bounds too.
    fn signal_variance(&self, ratio: f64, wanted: f64) -> f64 {
        let (signal, noise) = (self.signal_variance, self.noise_variance);
        wanted.max(signal[0].max(noise[0] / ratio)).min(signal[1].min(noise[1] / ratio))
    }
}

/// The most likely hyperparameters found.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The process with the best hyperparameters found, conditioned on the first function.
    pub process: GaussianProcess,
    /// ln p(targets) over all rows.
    pub log_likelihood: f64,
    /// Factorisations on all rows and on subsets together.
    pub evaluations: usize,
    /// The reason why the last search ended.
    pub outcome: SearchOutcome,
}

/// The reason why no hyperparameters were found.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum FitError {
    /// No jitter made the covariance matrix factor.
    #[error(transparent)]
    Singular(#[from] Singular),
    /// The stop signal was raised.
    #[error("the search was stopped")]
    Stopped,
}

/// Finds the hyperparameters in `bounds` under which `targets` at `inputs` (n rows, d columns) are most likely. The
/// targets are one or more functions of the inputs, n values each, and independent draws of one process.
///
/// The search is over natural logarithms in the box, with the signal variance profiled out. It starts from `start`
/// (clamped to the bounds) or from the spread of the data, and runs L-BFGS-B on all of up to 400 rows. With more rows
/// it runs on 200 evenly spaced rows. The curvature found there, which grows with the number of rows, then guides about
/// six quasi-Newton steps on 400 rows, from scales of at most 30. If some were longer it takes more steps, and if it
/// does not come back it starts from what was found. The length scales and the noise ratio found are those of all rows,
/// whose signal variance is then computed from one factorisation. If the kernel matrix at the start is singular, the
/// search is retried with the greatest noise allowed, and returns `Singular` if that also fails. It returns `Stopped`
/// within one evaluation of `stop` being set. Cost O(n^3 / 3), beside the searches. Source: Rasmussen and Williams 2006,
/// section 5.4.1.
/// Checked by: tests/solver/gp.rs, a_fit_through_subsets_ends_as_high_as_an_independent_search_over_all_rows and
/// nearly_linear_functions_of_many_rows_get_long_scales.
pub fn fit(
    inputs: &DMatrix<f64>,
    targets: &[Vec<f64>],
    bounds: &Bounds,
    start: Option<&Hyperparameters>,
    stop: &AtomicBool,
) -> Result<Fit, FitError> {
    let n = inputs.nrows();
    let mut point = point_of(&start.cloned().unwrap_or_else(|| start_from_spread(inputs, targets)));
    let mut evaluations = 1;
    let mut curvature_of_a_row = None;
    shorten(&mut point, inputs.ncols());
    let mut start = point.clone();
    if n > SEARCHED {
        let (some_inputs, some_targets) = evenly(FIRST_SEARCH, inputs, targets);
        let search = LikelihoodSearch { inputs: &some_inputs, targets: &some_targets, bounds, stop };
        let found = search.run(&point, None)?;
        point = found.point;
        evaluations += found.evaluations + point.len() + 1;
        curvature_of_a_row = search.curvature_of_a_row(&point);
        start.clone_from(&point);
    }
    let to_come_back = shorten(&mut start, inputs.ncols()).ceil() as usize;
    let (some_inputs, some_targets) = evenly(SEARCHED, inputs, targets);
    let search = LikelihoodSearch { inputs: &some_inputs, targets: &some_targets, bounds, stop };
    let run = |start: &[f64], steps: usize| search.run(start, curvature_of_a_row.as_ref().map(|known| (known, steps)));
    let mut minimum = run(&start, STEP_LIMIT + to_come_back)?;
    if to_come_back > 0 && curvature_of_a_row.is_some() {
        // Steps may not have sufficed.
        let known = run(&point, 0)?;
        evaluations += known.evaluations;
        if known.value < minimum.value {
            evaluations += minimum.evaluations;
            minimum = run(&point, STEP_LIMIT)?;
        }
    }
    let unit = hyperparameters(&minimum.point, 1.0);
    let values = n * targets.len();
    let signal_variance = |squares: f64| bounds.signal_variance(unit.noise_variance, squares / values as f64);
    let (process, log_likelihood) = GaussianProcess::profiled(inputs, targets, &unit, signal_variance)?;
    Ok(Fit { process, log_likelihood, evaluations: evaluations + minimum.evaluations, outcome: minimum.outcome })
}

/// Returns the numbers of `count` evenly spaced ones of `all` rows, ascending; all of them if there are no more.
pub fn evenly_spaced(count: usize, all: usize) -> Vec<usize> {
    let count = count.min(all);
    (0..count).map(|k| k * all / count).collect()
}

/// Returns up to so many evenly spaced rows, with the targets there.
fn evenly(rows: usize, inputs: &DMatrix<f64>, targets: &[Vec<f64>]) -> (DMatrix<f64>, Vec<Vec<f64>>) {
    let chosen = evenly_spaced(rows, inputs.nrows());
    let some = |values: &Vec<f64>| chosen.iter().map(|&row| values[row]).collect();
    (inputs.select_rows(&chosen), targets.iter().map(some).collect())
}

/// Limits the first `inputs` entries, logarithms of length scales, to [`LONGEST_START`]. Returns the farthest move.
fn shorten(point: &mut [f64], inputs: usize) -> f64 {
    let mut farthest: f64 = 0.0;
    for log_scale in &mut point[..inputs] {
        farthest = farthest.max(*log_scale - LONGEST_START.ln());
        *log_scale = log_scale.min(LONGEST_START.ln());
    }
    farthest
}

/// A search for the most likely hyperparameters of some rows.
struct LikelihoodSearch<'a> {
    inputs: &'a DMatrix<f64>,
    targets: &'a [Vec<f64>],
    bounds: &'a Bounds,
    stop: &'a AtomicBool,
}

impl LikelihoodSearch<'_> {
    /// Returns the minimum of -ln p found from `start`, by L-BFGS-B, or by so many quasi-Newton steps if the curvature is
    /// known.
    fn run(&self, start: &[f64], curvature_of_a_row: Option<(&DMatrix<f64>, usize)>) -> Result<Minimum, FitError> {
        let (lower, upper) = self.limits();
        let mut matrices = Matrices::new(self.inputs.nrows());
        let stopped = || self.stop.load(Ordering::Relaxed);
        // Once stopped, every point is outside the domain, so the line search gives up.
        let mut objective = |point: &[f64]| {
            let found = if stopped() { None } else { self.profiled(point, &mut matrices) };
            let Some(found) = found else { return (f64::INFINITY, vec![0.0; point.len()]) };
            (-found.log_likelihood, found.gradient.into_iter().map(|slope| -slope).collect())
        };
        let mut minimum = match curvature_of_a_row {
            Some((curvature, steps)) => {
                let curvature = curvature * self.inputs.nrows() as f64;
                minimise_from(&mut objective, start, curvature, &lower, &upper, TOLERANCE, steps)
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
            _ => Ok(minimum),
        }
    }

    /// Returns the second derivatives of -ln p at `point`, divided by the number of rows; `None` if they are not
    /// finite.
    fn curvature_of_a_row(&self, point: &[f64]) -> Option<DMatrix<f64>> {
        let mut matrices = Matrices::new(self.inputs.nrows());
        let rows = self.inputs.nrows() as f64;
        let slopes = |at: &[f64]| {
            let found = self.profiled(at, &mut matrices)?;
            Some(found.gradient.into_iter().map(|slope| -slope / rows).collect())
        };
        let (lower, upper) = self.limits();
        curvature_at(slopes, point, &lower, &upper)
    }

    /// Returns the box of the search: log length scales, then the log of the noise ratio.
    fn limits(&self) -> (Vec<f64>, Vec<f64>) {
        let Bounds { lengthscale, signal_variance, noise_variance } = self.bounds;
        let side = |side: usize| {
            let mut logs = vec![lengthscale[side].ln(); self.inputs.ncols()];
            logs.push((noise_variance[side] / signal_variance[1 - side]).ln());
            logs
        };
        (side(0), side(1))
    }

    /// Returns the likelihood with the signal variance profiled out at `point`, which holds log length scales, then the
    /// log of the ratio nu = noise / signal variance.
    ///
    ///   s2(l, nu) = sum y^T A^-1 y / (p n), clamped to its bounds,   A = R(l) + nu I,   K = s2 A
    ///
    /// If s2 is inside its bounds its own slope vanishes, so the gradient is the partial one. If a bound of the noise
    /// holds s2, it moves against nu. Profiling removes the ridge along which s2 and the length scales compensate each
    /// other, and with it most iterations of a search. `None` if A is singular. Cost as [`likelihood`].
    fn profiled(&self, point: &[f64], matrices: &mut Matrices) -> Option<Likelihood> {
        let LikelihoodSearch { inputs, targets, bounds, .. } = *self;
        let unit = hyperparameters(point, 1.0);
        let ratio = unit.noise_variance;
        let noise = bounds.noise_variance;
        let values = (inputs.nrows() * targets.len()) as f64;
        let profile = |squares: f64| bounds.signal_variance(ratio, squares / values);
        let mut at = likelihood(inputs, targets, &unit, profile, matrices)?;
        let (noise_slope, signal_slope) = (at.gradient.pop()?, at.gradient.pop()?);
        let held_by_noise = at.signal_variance == noise[0] / ratio || at.signal_variance == noise[1] / ratio;
        at.gradient.push(if held_by_noise { -signal_slope } else { noise_slope });
        Some(at)
    }
}

/// Returns length scales of sqrt(d) standard deviations, so that typical points are about one length apart.
fn start_from_spread(inputs: &DMatrix<f64>, targets: &[Vec<f64>]) -> Hyperparameters {
    let root_d = (inputs.ncols() as f64).sqrt();
    let values = inputs.nrows() * targets.len();
    let variance = targets.iter().flatten().map(|y| y * y).sum::<f64>() / values.max(1) as f64;
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

/// Returns the search point for these hyperparameters.
fn point_of(hyper: &Hyperparameters) -> Vec<f64> {
    let ratio = hyper.noise_variance / hyper.signal_variance;
    hyper.lengthscales.iter().chain([&ratio]).map(|scale| scale.ln()).collect()
}

/// Returns the hyperparameters for a search point and a signal variance.
fn hyperparameters(point: &[f64], signal_variance: f64) -> Hyperparameters {
    let mut lengthscales: Vec<f64> = point.iter().map(|log| log.exp()).collect();
    let ratio = lengthscales.pop().unwrap_or(0.0);
    Hyperparameters { lengthscales, signal_variance, noise_variance: ratio * signal_variance }
}
