//! Gaussian process regression with zero prior mean and the Matern-5/2 kernel.
//!
//!   k(x, y) = s2 (1 + sqrt5 r + 5 r^2 / 3) exp(-sqrt5 r),   r^2 = sum_i ((x_i - y_i) / l_i)^2
//!
//! Source: Rasmussen and Williams 2006, sections 2.2 and 5.4.
//!
//! Its modules hold kernel, likelihood, fit, linear systems and the selection of points.

mod along;
pub mod cholesky;
pub mod farthest;
pub mod fit;
pub mod likelihood;
pub mod matern;

use std::ops::Range;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::numerics::gp::cholesky::{Cholesky, Singular, factor_with_jitter};
use crate::numerics::gp::likelihood::log_likelihood;

/// Hyperparameters of a Gaussian process: l_i in the units of input i, s2 and noise in the units of the target squared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hyperparameters {
    /// Length scales l_i, one for each dimension, in the inputs' units.
    pub lengthscales: Vec<f64>,
    /// s2, in squared units of the targets.
    pub signal_variance: f64,
    /// Noise variance that is added to the diagonal, in squared units of the targets.
    pub noise_variance: f64,
}

impl Hyperparameters {
    /// Divides each column of `inputs` (n rows, d columns) by its length scale. Cost O(n d).
    pub(super) fn scale(&self, inputs: &DMatrix<f64>) -> DMatrix<f64> {
        assert_eq!(inputs.ncols(), self.lengthscales.len(), "one length scale for each column");
        let mut scaled = inputs.clone();
        for (mut column, lengthscale) in scaled.column_iter_mut().zip(&self.lengthscales) {
            column.iter_mut().for_each(|x| *x /= lengthscale);
        }
        scaled
    }
}

/// Writes the squared distances from row `row` of `scaled` to each later row to `out`, of length n - row - 1.
pub(super) fn squared_distances_below(scaled: &DMatrix<f64>, row: usize, out: &mut [f64]) {
    let centre: Vec<f64> = scaled.row(row).iter().copied().collect();
    matern::squared_distances(scaled.as_slice(), scaled.nrows(), row + 1, &centre, out);
}

/// Writes K + noise I over the rows of `scaled` on and below the diagonal of `kernel`, n by n. Cost O(n^2 d / 2).
pub(super) fn kernel_lower(scaled: &DMatrix<f64>, hyper: &Hyperparameters, kernel: &mut DMatrix<f64>) {
    let n = scaled.nrows();
    assert_eq!(kernel.shape(), (n, n), "one row and one column for each input");
    for (j, column) in kernel.as_mut_slice().chunks_exact_mut(n.max(1)).enumerate() {
        column[j] = hyper.signal_variance + hyper.noise_variance;
        let below = &mut column[j + 1..];
        squared_distances_below(scaled, j, below);
        matern::matern_from_squared(below);
        below.iter_mut().for_each(|value| *value *= hyper.signal_variance);
    }
}

/// Returns the matrix of which [`kernel_lower`] writes the lower triangle.
fn kernel(scaled: &DMatrix<f64>, hyper: &Hyperparameters) -> DMatrix<f64> {
    let mut kernel = DMatrix::zeros(scaled.nrows(), scaled.nrows());
    kernel_lower(scaled, hyper, &mut kernel);
    kernel
}

/// The posterior mean of a Gaussian process, or of several that share inputs and length scales. It keeps only what
/// evaluation needs.
///
///   m(x) = s2 sum_j w_j (1 + r_j + r_j^2/3) exp(-r_j),   r_j^2 = 5 sum_i ((x_i - x_ji) / l_i)^2
#[derive(Debug, Clone, PartialEq)]
pub struct GpMean {
    /// Inputs in n rows and d columns, already divided by the length scales.
    inputs: DMatrix<f64>,
    /// K^-1 y times the signal variance, one vector for each function.
    weights: Vec<Vec<f64>>,
    lengthscales: Vec<f64>,
}

impl GpMean {
    /// Creates the mean from `inputs` (n rows, d columns, in their own units) and `weights` K^-1 y of length n for each
    /// function. Cost O(n d).
    pub fn new(inputs: &DMatrix<f64>, weights: &[Vec<f64>], hyper: &Hyperparameters) -> GpMean {
        assert!(weights.iter().all(|weights| inputs.nrows() == weights.len()), "one weight for each row");
        let scaled = |weights: &Vec<f64>| weights.iter().map(|weight| weight * hyper.signal_variance).collect();
        GpMean {
            inputs: hyper.scale(inputs),
            weights: weights.iter().map(scaled).collect(),
            lengthscales: hyper.lengthscales.clone(),
        }
    }

    /// Returns m(query) of the only function, for a `query` of d entries. Cost O(n d) and one allocation of n.
    pub fn mean(&self, query: &[f64]) -> f64 {
        self.mean_with(query, &mut Vec::new())
    }

    /// Does the same as [`GpMean::mean`], but keeps the distances in `scratch`: no allocation once it has grown to n.
    pub fn mean_with(&self, query: &[f64], scratch: &mut Vec<f64>) -> f64 {
        scratch.resize(self.input_count(), 0.0);
        self.squared_distances(query, 0..self.lengthscales.len(), scratch);
        matern::weighted_sum(scratch, &self.weights[0])
    }

    /// Returns m(query) of every function. Cost O(n (d + functions)).
    pub fn means(&self, query: &[f64]) -> Vec<f64> {
        let mut correlations = vec![0.0; self.input_count()];
        self.squared_distances(query, 0..self.lengthscales.len(), &mut correlations);
        matern::matern_from_squared(&mut correlations);
        self.weighted(&correlations).collect()
    }

    /// Returns sum_j w_j `factors_j` with the weights of every function. Cost O(n) each.
    fn weighted(&self, factors: &[f64]) -> impl Iterator<Item = f64> {
        self.weights.iter().map(move |weights| matern::dot(factors, weights))
    }

    /// Overwrites `out[j]` with sum_i ((query_i - x_ji) / l_i)^2 over i in `dimensions`.
    ///
    /// `query` has all d entries; those outside `dimensions` are not read. `out` has n entries. Cost O(n |dimensions|).
    fn squared_distances(&self, query: &[f64], dimensions: Range<usize>, out: &mut [f64]) {
        assert_eq!(query.len(), self.lengthscales.len(), "one query entry for each column");
        assert_eq!(out.len(), self.input_count(), "one distance for each row");
        let n = out.len();
        let centre: Vec<f64> = dimensions.clone().map(|i| query[i] / self.lengthscales[i]).collect();
        matern::squared_distances(
            &self.inputs.as_slice()[dimensions.start * n..dimensions.end * n],
            n,
            0,
            &centre,
            out,
        );
    }

    /// Returns the number of inputs, n.
    pub fn input_count(&self) -> usize {
        self.inputs.nrows()
    }
}

/// Predictions of targets from the others.
#[derive(Debug, Clone, PartialEq)]
pub struct LeaveOneOut {
    /// y_i minus its prediction from the other values of the same target, one vector for each target.
    pub errors: Vec<Vec<f64>>,
    /// Standard deviation of the noise-free value at input i given the others.
    pub latent_sd: Vec<f64>,
}

/// A Gaussian process conditioned on noisy values at n inputs.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussianProcess {
    hyper: Hyperparameters,
    cholesky: Cholesky,
    jitter: f64,
    weights: Vec<f64>,
    mean: GpMean,
}

impl GaussianProcess {
    /// Conditions the process with zero prior mean on `targets` (n) at `inputs` (n rows, d columns).
    ///
    ///   weights = (K + noise I)^-1 y
    ///
    /// If the kernel matrix is singular to working precision, the least jitter that lets it factor is added; see
    /// [`GaussianProcess::jitter`]. Cost O(n^3 / 3). Source: Rasmussen and Williams 2006, algorithm 2.1.
    pub fn condition(
        inputs: &DMatrix<f64>,
        targets: &[f64],
        hyper: &Hyperparameters,
    ) -> Result<GaussianProcess, Singular> {
        assert_eq!(inputs.nrows(), targets.len(), "one target for each row");
        let scaled = hyper.scale(inputs);
        let factored = factor_with_jitter(|| kernel(&scaled, hyper))?;
        Ok(GaussianProcess::of_factor(inputs, targets, hyper.clone(), factored))
    }

    /// Conditions the process on the first of `targets`, with the signal variance that `signal_variance` returns for the
    /// sum of y^T A^-1 y over all of them. Returns it with the log likelihood of all.
    ///
    ///   K = s2 A
    ///
    /// `unit` holds the length scales, the signal variance 1 and the ratio of noise to signal. Jitter and cost are as in
    /// [`GaussianProcess::condition`], and n^2 more for each target.
    pub(super) fn profiled(
        inputs: &DMatrix<f64>,
        targets: &[Vec<f64>],
        unit: &Hyperparameters,
        signal_variance: impl FnOnce(f64) -> f64,
    ) -> Result<(GaussianProcess, f64), Singular> {
        let scaled = unit.scale(inputs);
        let (cholesky, jitter) = factor_with_jitter(|| kernel(&scaled, unit))?;
        let squares = |values: &Vec<f64>| {
            let whitened = cholesky.solve_lower(values);
            matern::dot(&whitened, &whitened)
        };
        let squares: f64 = targets.iter().map(squares).sum();
        let signal_variance = signal_variance(squares);
        let counts = [targets.len(), inputs.nrows()];
        let log_likelihood = log_likelihood(squares, signal_variance, cholesky.log_determinant(), counts);
        let hyper =
            Hyperparameters { signal_variance, noise_variance: unit.noise_variance * signal_variance, ..unit.clone() };
        let cholesky = cholesky.times(signal_variance.sqrt());
        let process = GaussianProcess::of_factor(inputs, &targets[0], hyper, (cholesky, jitter * signal_variance));
        Ok((process, log_likelihood))
    }

    fn of_factor(
        inputs: &DMatrix<f64>,
        targets: &[f64],
        hyper: Hyperparameters,
        (cholesky, jitter): (Cholesky, f64),
    ) -> GaussianProcess {
        let weights = cholesky.solve(targets);
        let mean = GpMean::new(inputs, std::slice::from_ref(&weights), &hyper);
        GaussianProcess { hyper, cholesky, jitter, weights, mean }
    }

    /// Returns the hyperparameters.
    pub fn hyperparameters(&self) -> &Hyperparameters {
        &self.hyper
    }

    /// Returns the bytes of memory of a Gaussian process over `points` rows of `inputs` columns. Most of them hold the
    /// square factor. A quarter as many are counted for memory that remains in use after the factorisation
    /// (`tests/estimates.rs` measures it).
    pub fn bytes_of(points: usize, inputs: usize) -> usize {
        size_of::<f64>().saturating_mul(points).saturating_mul(points + points / 4 + inputs + 2)
    }

    /// Returns the posterior mean k^T (K + noise I)^-1 y at `query`. Cost O(n d).
    pub fn mean(&self, query: &[f64]) -> f64 {
        self.mean.mean(query)
    }

    /// Returns the posterior variance of the noise-free value, s2 - |L^-1 k|^2, at least 0. Cost
    /// O(n^2).
    pub fn latent_variance(&self, query: &[f64]) -> f64 {
        let mut covariances = vec![0.0; self.weights.len()];
        self.covariances(query, &mut covariances);
        let whitened = self.cholesky.solve_lower(&covariances);
        (self.hyper.signal_variance - matern::dot(&whitened, &whitened)).max(0.0)
    }

    /// Returns [`GaussianProcess::latent_variance`] at each query, up to rounding. Cost O(n^2) a query, but a fifth of
    /// the time of single calls.
    pub fn latent_variances(&self, queries: &[Vec<f64>]) -> Vec<f64> {
        let mut covariances = DMatrix::zeros(self.weights.len(), queries.len());
        for (column, query) in covariances.as_mut_slice().chunks_exact_mut(self.weights.len()).zip(queries) {
            self.covariances(query, column);
        }
        self.cholesky.solve_lower_columns(&mut covariances);
        let explained = covariances.column_iter().map(|column| column.norm_squared());
        explained.map(|explained| (self.hyper.signal_variance - explained).max(0.0)).collect()
    }

    /// Overwrites `out` with the covariances between the value at `query` and those at the n inputs.
    fn covariances(&self, query: &[f64], out: &mut [f64]) {
        self.mean.squared_distances(query, 0..query.len(), out);
        matern::matern_from_squared(out);
        out.iter_mut().for_each(|value| *value *= self.hyper.signal_variance);
    }

    /// Returns (K + noise I)^-1 y, one entry for each input.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Returns the amount added to the diagonal beyond the noise so that the matrix factors, in the units of the target
    /// squared.
    pub fn jitter(&self) -> f64 {
        self.jitter
    }

    /// Returns the part that evaluates means, which is all that a stored Gaussian process needs.
    pub fn posterior_mean(&self) -> &GpMean {
        &self.mean
    }

    /// Returns (K + noise I)^-1 y for other values y at the same inputs. Cost O(n^2).
    pub fn weights_of(&self, targets: &[f64]) -> Vec<f64> {
        self.cholesky.solve(targets)
    }

    /// Predicts the values of `targets` at some of the inputs from all others, without refitting, and returns errors and
    /// standard deviations. `rows` are the numbers of these inputs, ascending.
    ///
    ///   error_i = alpha_i / (A^-1)_ii,   latent variance_i = 1 / (A^-1)_ii - noise, at least 0,   A = K + noise I
    ///
    /// Cost O(n^2 / 2) for each input. Source: Rasmussen and Williams 2006, eqs. (5.10) to (5.12).
    /// Checked by: tests/solver/gp.rs, leave_one_out_equals_conditioning_without_the_point.
    pub fn leave_one_out(&self, targets: &[Vec<f64>], rows: &[usize]) -> LeaveOneOut {
        let precision = self.cholesky.inverse_diagonal(rows);
        let of = |values: &Vec<f64>| -> Vec<f64> {
            let weights = self.weights_of(values);
            rows.iter().zip(&precision).map(|(&row, p)| weights[row] / p).collect()
        };
        let errors = targets.iter().map(of).collect();
        let latent_sd = precision.iter().map(|p| (1.0 / p - self.hyper.noise_variance).max(0.0).sqrt()).collect();
        LeaveOneOut { errors, latent_sd }
    }
}
