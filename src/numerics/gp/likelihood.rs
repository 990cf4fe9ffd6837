//! The likelihood of the hyperparameters of a Gaussian process, with exact gradients.

use std::f64::consts::TAU;

use nalgebra::DMatrix;

use crate::numerics::gp::cholesky::Cholesky;
use crate::numerics::gp::{Hyperparameters, kernel_lower, matern, squared_distances_below};

/// Returns the log marginal likelihood and its gradient, in the order log length scales, log signal, log noise
/// variance.
///
/// This is the function that a fit maximises, at given hyperparameters. `None` if the matrix is singular to working
/// precision.
pub fn log_likelihood_and_gradient(
    inputs: &DMatrix<f64>,
    targets: &[Vec<f64>],
    hyper: &Hyperparameters,
) -> Option<(f64, Vec<f64>)> {
    let ratio = hyper.noise_variance / hyper.signal_variance;
    let unit = Hyperparameters { signal_variance: 1.0, noise_variance: ratio, ..hyper.clone() };
    let at = likelihood(inputs, targets, &unit, |_| hyper.signal_variance, &mut Matrices::new(inputs.nrows()))?;
    Some((at.log_likelihood, at.gradient))
}

/// Returns the log likelihood of p targets y of n values each, given the sum of y^T A^-1 y over them and ln det A:
///
///   ln p = -sum y^T A^-1 y / (2 s2) - p ln det A / 2 - p n ln(2 pi s2) / 2,   K = s2 A
///
/// Source: Rasmussen and Williams 2006, eq. (2.30).
/// Checked by: tests/solver/gp.rs, gradients_equal_those_of_scikit_learn.
pub(super) fn log_likelihood(squares: f64, signal_variance: f64, log_determinant: f64, [p, n]: [usize; 2]) -> f64 {
    let (p, n) = (p as f64, n as f64);
    -0.5 * squares / signal_variance - 0.5 * p * log_determinant - 0.5 * p * n * (TAU * signal_variance).ln()
}

/// Returns the likelihood for the signal variance s2 = `signal_variance(sum y^T A^-1 y)`, with sums over the p targets
/// y.
///
///   K = s2 A,   A = R(l) + nu I
///   d ln p / d theta = (1/2) sum_ij W_ij dA_ij / d theta,   W = sum alpha alpha^T - p A^-1,   alpha = A^-1 y / s
///   dk / d log l_i = (5/3) (1 + r) exp(-r) ((x_i - y_i) / l_i)^2,   r = sqrt(5) scaled distance
///
/// `unit` holds the length scales l, the signal variance 1 and the noise ratio nu. `None` if A is singular to working
/// precision. Needs one factorisation and one inverse: cost O(n^3), and O(n^2 d) for the contraction.
/// Source: Rasmussen and Williams 2006, eq. (5.9).
/// Checked by: tests/solver/gp.rs, gradients_equal_those_of_scikit_learn.
pub(in crate::numerics) fn likelihood(
    inputs: &DMatrix<f64>,
    targets: &[Vec<f64>],
    unit: &Hyperparameters,
    signal_variance: impl FnOnce(f64) -> f64,
    matrices: &mut Matrices,
) -> Option<Likelihood> {
    let (n, p) = (inputs.nrows(), targets.len());
    let scaled = unit.scale(inputs);
    let factor = matrices.factor(&scaled, unit)?;
    let mut weights: Vec<Vec<f64>> = targets.iter().map(|values| factor.solve(values)).collect();
    let squares = targets.iter().zip(&weights).map(|(values, weights)| matern::dot(values, weights)).sum();
    let signal_variance = signal_variance(squares);
    let log_likelihood = log_likelihood(squares, signal_variance, factor.log_determinant(), [p, n]);
    let root = signal_variance.sqrt();
    weights.iter_mut().flatten().for_each(|weight| *weight /= root);
    factor.inverse_lower(&mut matrices.inverse);
    matrices.kernel = factor.into_memory();
    let gradient = contract(&scaled, &mut matrices.inverse, &weights, unit);
    Some(Likelihood { log_likelihood, gradient, signal_variance })
}

/// Memory of an evaluation, kept for the next one: fresh pages would take a fifth of its time.
pub(in crate::numerics) struct Matrices {
    /// K, then its factor.
    kernel: DMatrix<f64>,
    inverse: DMatrix<f64>,
}

impl Matrices {
    pub fn new(n: usize) -> Self {
        Matrices { kernel: DMatrix::zeros(n, n), inverse: DMatrix::zeros(n, n) }
    }

    /// Returns the factor of K + noise I over the rows of `scaled`, in the memory of `kernel`.
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

/// Returns the sums of W .* dK over one triangle, doubled; `inverse` is overwritten column by column.
fn contract(
    scaled: &DMatrix<f64>,
    inverse: &mut DMatrix<f64>,
    alphas: &[Vec<f64>],
    hyper: &Hyperparameters,
) -> Vec<f64> {
    let ((n, d), p) = (scaled.shape(), alphas.len() as f64);
    let mut squared = vec![0.0; n];
    let mut lengths = vec![0.0; d];
    let (mut below_diagonal, mut trace) = (0.0, 0.0);
    for (j, column) in inverse.as_mut_slice().chunks_exact_mut(n).enumerate() {
        trace += alphas.iter().map(|alpha| alpha[j] * alpha[j]).sum::<f64>() - p * column[j];
        let contrast = &mut column[j + 1..];
        let squared = &mut squared[j + 1..];
        squared_distances_below(scaled, j, squared);
        contrast.iter_mut().for_each(|entry| *entry *= -p);
        for alpha in alphas {
            contrast.iter_mut().zip(&alpha[j + 1..]).for_each(|(entry, other)| *entry += alpha[j] * other);
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

/// The likelihood at some hyperparameters, with the values that a search needs.
pub(in crate::numerics) struct Likelihood {
    pub log_likelihood: f64,
    /// Gradient in the order log length scales, log signal variance, log noise variance. A search profiles the signal
    /// variance out, and has log length scales, log noise ratio.
    pub gradient: Vec<f64>,
    pub signal_variance: f64,
}
