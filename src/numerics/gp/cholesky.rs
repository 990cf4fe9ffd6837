//! Symmetric positive definite systems. Only this module knows which libraries factor them.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::DMatrix;

use crate::numerics::gp::matern::dot_inline;
use crate::numerics::machine::dispatch::dispatched;

/// From this many rows on, faer's blocked factorisation beats nalgebra's.
const BLOCKED_FROM_ROWS: usize = 64;
/// Amounts tried on the diagonal, relative to its mean. The last is far above rounding and far below any noise.
const RELATIVE_JITTERS: [f64; 5] = [0.0, 1e-12, 1e-10, 1e-8, 1e-6];
/// A squared pivot below this share of its diagonal entry is only rounding: the row depends on others.
const LEAST_PIVOT_SHARE: f64 = 1e-14;
/// Columns that a triangular solve eliminates together: one pass over the unknowns for each four columns.
const COLUMNS: usize = 4;
/// Columns of the inverse of a factor that are solved together: a block that stays in the second-level cache.
const COLUMNS_TOGETHER: usize = 64;

/// The error that a matrix is indefinite, to working precision, even with the largest amount tried on its diagonal.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the matrix is not positive definite, even with {jitter:e} added to its diagonal")]
pub struct Singular {
    /// Largest amount added to the diagonal.
    pub jitter: f64,
}

/// The factor L of A = L L^T, lower triangular with a positive diagonal.
#[derive(Debug, Clone, PartialEq)]
pub struct Cholesky {
    /// The factor; entries above the diagonal are those of the matrix factored.
    lower: DMatrix<f64>,
}

impl Cholesky {
    /// Factors a symmetric matrix in its own memory, and reads only the lower triangle. `None` unless it is positive
    /// definite to working precision.
    ///
    /// Cost n^3 / 3.
    pub fn factor(matrix: DMatrix<f64>) -> Option<Cholesky> {
        let mut lower = matrix;
        let n = lower.nrows();
        assert_eq!(n, lower.ncols(), "a matrix to factor must be square");
        let diagonal = lower.diagonal();
        if n < BLOCKED_FROM_ROWS {
            lower = nalgebra::Cholesky::new(lower)?.unpack_dirty();
        } else {
            factor_blocked(lower.as_mut_slice(), n)?;
        }
        let positive = diagonal.iter().zip(lower.diagonal().iter()).all(|(entry, root)| {
            let pivot = root * root;
            pivot > LEAST_PIVOT_SHARE * entry && pivot.is_finite()
        });
        positive.then_some(Cholesky { lower })
    }

    /// Returns the memory of the factor, for another matrix.
    pub fn into_memory(self) -> DMatrix<f64> {
        self.lower
    }

    /// Returns x with A x = `right`. Cost 2 n^2.
    pub fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut x = self.solve_lower(right);
        let (l, n) = (self.lower.as_slice(), self.lower.nrows());
        dispatched!({
            for j in (0..n).rev() {
                let column = &l[j * n..(j + 1) * n];
                x[j] = (x[j] - dot_inline(&column[j + 1..], &x[j + 1..])) / column[j];
            }
        });
        x
    }

    /// Returns v with L v = `right`. Cost n^2; memory is read once in order.
    pub fn solve_lower(&self, right: &[f64]) -> Vec<f64> {
        let (l, n) = (self.lower.as_slice(), self.lower.nrows());
        assert_eq!(right.len(), n);
        let mut x = right.to_vec();
        dispatched!({
            let blocked = n - n % COLUMNS;
            for j in (0..blocked).step_by(COLUMNS) {
                eliminate_block(l, n, j, &mut x);
            }
            for j in blocked..n {
                x[j] /= l[j * n + j];
                let pivot = x[j];
                for i in j + 1..n {
                    x[i] -= l[j * n + i] * pivot;
                }
            }
        });
        x
    }

    /// Overwrites each column of `right` with v, where L v = column. Cost n^2 for each column; memory is read once for
    /// many.
    pub fn solve_lower_columns(&self, right: &mut DMatrix<f64>) {
        let (n, columns) = right.shape();
        assert_eq!(n, self.lower.nrows());
        solve_lower_triangular_in_place(
            MatRef::from_column_major_slice(self.lower.as_slice(), n, n),
            MatMut::from_column_major_slice_mut(right.as_mut_slice(), n, columns),
            Par::Seq,
        );
    }

    /// Returns the factor of A times the square of `root`. Cost n^2.
    pub fn times(self, root: f64) -> Cholesky {
        Cholesky { lower: self.lower * root }
    }

    /// Returns (A^-1)_ii for each i of `rows`, ascending: the squared length of column i of L^-1, whose entries before i
    /// are 0. Cost (n - i)^2 for each.
    pub fn inverse_diagonal(&self, rows: &[usize]) -> Vec<f64> {
        let n = self.lower.nrows();
        let of = |some: &[usize]| -> Vec<f64> {
            let (first, mut columns) = (some[0], DMatrix::zeros(n - some[0], some.len()));
            some.iter().enumerate().for_each(|(column, row)| columns[(row - first, column)] = 1.0);
            let lower = MatRef::from_column_major_slice(self.lower.as_slice(), n, n);
            let unknown = MatMut::from_column_major_slice_mut(columns.as_mut_slice(), n - first, some.len());
            solve_lower_triangular_in_place(lower.submatrix(first, first, n - first, n - first), unknown, Par::Seq);
            columns.column_iter().map(|column| column.norm_squared()).collect()
        };
        rows.chunks(COLUMNS_TOGETHER).flat_map(of).collect()
    }

    /// Writes A^-1 on and below the diagonal of `inverse`, n by n. Cost 2 n^3 / 3.
    pub fn inverse_lower(&self, inverse: &mut DMatrix<f64>) {
        let n = self.lower.nrows();
        assert_eq!(inverse.shape(), (n, n), "room for the inverse");
        let mut memory = MemBuffer::new(llt::inverse::inverse_scratch::<f64>(n, Par::Seq));
        llt::inverse::inverse(
            MatMut::from_column_major_slice_mut(inverse.as_mut_slice(), n, n),
            MatRef::from_column_major_slice(self.lower.as_slice(), n, n),
            Par::Seq,
            MemStack::new(&mut memory),
        );
    }

    /// Returns ln det A = 2 sum_i ln L_ii. Cost O(n).
    pub fn log_determinant(&self) -> f64 {
        2.0 * self.lower.diagonal().iter().map(|pivot| pivot.ln()).sum::<f64>()
    }
}

/// Adds `sum v v'` over the vectors v, one after the other in `vectors`, to the lower triangle of a matrix of `size`
/// rows, column by column. Cost `size` / 2 for each entry of the vectors.
pub fn add_squares(matrix: &mut [f64], size: usize, vectors: &[f64]) {
    let vectors = MatRef::from_column_major_slice(vectors, size, vectors.len() / size);
    let matrix = MatMut::from_column_major_slice_mut(matrix, size, size);
    let (lower, all) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    matmul(matrix, lower, Accum::Add, vectors, all, vectors.transpose(), all, 1.0, Par::Seq);
}

/// Overwrites the lower triangle of a column-major matrix with its factor; `None` if a pivot is not positive.
fn factor_blocked(values: &mut [f64], n: usize) -> Option<()> {
    let mut memory = MemBuffer::new(llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default()));
    llt::factor::cholesky_in_place(
        MatMut::from_column_major_slice_mut(values, n, n),
        Default::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    )
    .ok()
    .map(|_| ())
}

/// Solves for the unknowns j to j + 3 and eliminates their columns from the rest.
#[inline(always)]
fn eliminate_block(l: &[f64], n: usize, j: usize, x: &mut [f64]) {
    let mut pivots = [0.0; COLUMNS];
    for k in 0..COLUMNS {
        let mut value = x[j + k];
        for (earlier, pivot) in pivots[..k].iter().enumerate() {
            value -= l[(j + earlier) * n + j + k] * pivot;
        }
        pivots[k] = value / l[(j + k) * n + j + k];
        x[j + k] = pivots[k];
    }
    let below = |k: usize| &l[(j + k) * n + j + COLUMNS..(j + k + 1) * n];
    let [a, b, c, d] = [below(0), below(1), below(2), below(3)];
    let rest = &mut x[j + COLUMNS..n];
    for ((((x, a), b), c), d) in rest.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        *x -= (a * pivots[0] + b * pivots[1]) + (c * pivots[2] + d * pivots[3]);
    }
}

/// Factors A + jitter I for the smallest jitter of 0, 1e-12, 1e-10, 1e-8 and 1e-6 mean diagonals that succeeds.
///
/// `matrix` creates A anew for each try, so that only one matrix is in memory at a time. Returns the factor and the
/// amount added to the diagonal, in the units of A. Cost: one factorisation for each try.
pub fn factor_with_jitter(matrix: impl Fn() -> DMatrix<f64>) -> Result<(Cholesky, f64), Singular> {
    let mut jitter = 0.0;
    for relative in RELATIVE_JITTERS {
        let mut shifted = matrix();
        let n = shifted.nrows();
        jitter = relative * (shifted.diagonal().iter().sum::<f64>() / n.max(1) as f64);
        (0..n).for_each(|i| shifted[(i, i)] += jitter);
        if let Some(factor) = Cholesky::factor(shifted) {
            return Ok((factor, jitter));
        }
    }
    Err(Singular { jitter })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a diagonally dominant, and so positive definite, matrix; its entries follow no pattern that a bug could
    /// hide in.
    fn dominant(n: usize) -> DMatrix<f64> {
        DMatrix::from_fn(n, n, |i, j| {
            let (a, b) = (i.max(j), i.min(j));
            ((a * 7 + b * 13) % 10) as f64 / 10.0 + if i == j { n as f64 } else { 0.0 }
        })
    }

    #[test]
    fn squares_are_added_to_the_lower_triangle_alone() {
        for (size, count) in [(1, 1), (3, 5), (7, 0), (31, 128)] {
            let vectors: Vec<f64> =
                (0..size * count).map(|entry| ((entry * 37 + 11) % 101) as f64 / 50.0 - 1.0).collect();
            let before: Vec<f64> = (0..size * size).map(|entry| entry as f64).collect();
            let mut matrix = before.clone();
            add_squares(&mut matrix, size, &vectors);
            for (column, row) in (0..size).flat_map(|column| (0..size).map(move |row| (column, row))) {
                let products = vectors.chunks_exact(size).map(|v| v[row] * v[column]);
                let added = if row < column { 0.0 } else { products.sum::<f64>() };
                let expected = before[column * size + row] + added;
                let found = matrix[column * size + row];
                // Up to 128 products of at most 1, added in another order.
                assert!((found - expected).abs() < 1e-12, "{size} {count} {row} {column}: {found} for {expected}");
            }
        }
    }

    #[test]
    fn solutions_and_inverses_satisfy_their_equations_on_both_sides_of_the_threshold() {
        for n in [1, 2, 3, 5, 63, 64, 65, 130] {
            let a = dominant(n);
            let factor = Cholesky::factor(a.clone()).unwrap();
            let right: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
            let x = nalgebra::DVector::from_vec(factor.solve(&right));
            let residual = &a * x - nalgebra::DVector::from_column_slice(&right);
            assert!(residual.amax() < 1e-12, "n = {n}");
            let mut inverse = DMatrix::from_element(n, n, f64::NAN);
            factor.inverse_lower(&mut inverse);
            inverse.fill_upper_triangle_with_lower_triangle();
            assert!((&inverse * &a - DMatrix::identity(n, n)).amax() < 1e-12, "n = {n}");
            let rows: Vec<usize> = (0..n).step_by(3).collect();
            for (row, entry) in rows.iter().zip(factor.inverse_diagonal(&rows)) {
                assert!((entry - inverse[(*row, *row)]).abs() < 1e-14, "n = {n}, row {row}");
            }
            assert!(
                (factor.clone().times(3.0).log_determinant() - factor.log_determinant() - 2.0 * n as f64 * 3_f64.ln())
                    .abs()
                    < 1e-9
            );
            let expected = a.determinant().ln();
            assert!(!expected.is_finite() || (factor.log_determinant() - expected).abs() < 1e-9);
        }
    }

    #[test]
    fn a_rank_one_matrix_needs_jitter_and_an_indefinite_one_is_refused() {
        for n in [3, 100] {
            let (_, jitter) = factor_with_jitter(|| DMatrix::from_element(n, n, 2.0)).unwrap();
            assert!(jitter > 0.0 && jitter <= 2e-6);
            assert_eq!(factor_with_jitter(|| dominant(n)).unwrap().1, 0.0);
            let refused = factor_with_jitter(|| -dominant(n)).unwrap_err();
            assert!(refused.to_string().contains("not positive definite"));
            assert!(Cholesky::factor(DMatrix::from_element(n, n, f64::NAN)).is_none());
        }
    }
}
