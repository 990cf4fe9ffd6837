//! Records that begin at different dates: what the younger assets would have earned before, by regression on the older
//! ones.
//!
//! Let an asset j have returns from date s on, and let O be the assets with longer records. For a date t before s
//!
//!   z_j(t) = a + sum_(i in O) b_i z_i(t) + e(t),
//!
//! with a and b by least squares over the dates from s on. The e(t) are the residuals of those dates, taken in turn and
//! less the mean of those taken. Assets that begin together take the residuals of the same dates, which keeps their
//! correlation. The assets are filled from the longest record to the shortest.
//!
//! The mean of j over all dates is then `mean_j + b (mean_O over all dates - mean_O from s on)`, the maximum-likelihood
//! estimate for normal returns. Source: Stambaugh (1997), Analyzing investments whose histories differ in length, Journal
//! of Financial Economics 45, equation 8. Its covariances are met up to the sampling error of the residuals taken.
//! Checked by: `tests/solver/unequal_records.rs`.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Eigenvalues below this share of the largest count as 0: such regressors are collinear.
const SINGULAR: f64 = 1e-12;
/// Least number of own returns, and the least for each longer record that they are regressed on.
const LEAST: usize = 12;
const LEAST_FOR_EACH: usize = 3;

/// Returns the number of returns that an asset needs, if `older` assets have longer records.
pub fn least_returns(older: usize) -> usize {
    LEAST.max(LEAST_FOR_EACH * older)
}

/// Returns how many records are longer than that of each asset, given the number of dates without a return at the
/// beginning of each.
pub fn longer_records(missing: &[usize]) -> Vec<usize> {
    missing.iter().map(|own| missing.iter().filter(|other| *other < own).count()).collect()
}

/// Fills the first `missing[j]` dates of each column j of `rows`, within `bounds`. Every asset needs [`least_returns`], and
/// one a return on the first date. Cost O(n d^3) for n dates and d assets that all begin at different dates.
pub fn fill(rows: &mut [Vec<f64>], missing: &[usize], bounds: (f64, f64)) {
    let mut starts: Vec<usize> = missing.iter().copied().filter(|start| *start > 0).collect();
    starts.sort_unstable();
    starts.dedup();
    for start in starts {
        let older: Vec<usize> = (0..missing.len()).filter(|asset| missing[*asset] < start).collect();
        let younger = (0..missing.len()).filter(|asset| missing[*asset] == start);
        let regressors = Regressors::new(&rows[start..], &older);
        for asset in younger {
            let own: Vec<f64> = rows[start..].iter().map(|row| row[asset]).collect();
            let (level, slopes) = regressors.fit(&own);
            let explained = |row: &[f64]| level + older.iter().zip(&slopes).map(|(i, b)| b * row[*i]).sum::<f64>();
            let residuals: Vec<f64> = rows[start..].iter().map(|row| row[asset] - explained(row)).collect();
            let drawn: Vec<f64> = (0..start).map(|date| residuals[date % residuals.len()]).collect();
            let mean = drawn.iter().sum::<f64>() / start as f64;
            for (row, residual) in rows[..start].iter_mut().zip(drawn) {
                row[asset] = (explained(row) + residual - mean).clamp(bounds.0, bounds.1);
            }
        }
    }
}

/// The returns of the older assets over the dates of a regression, less their means.
struct Regressors {
    means: Vec<f64>,
    /// One row for each date.
    table: DMatrix<f64>,
    /// The pseudo-inverse of their products, summed over the dates.
    inverse: DMatrix<f64>,
}

impl Regressors {
    fn new(rows: &[Vec<f64>], assets: &[usize]) -> Self {
        let mean = |asset: &usize| rows.iter().map(|row| row[*asset]).sum::<f64>() / rows.len() as f64;
        let means: Vec<f64> = assets.iter().map(mean).collect();
        let table = DMatrix::from_fn(rows.len(), assets.len(), |date, place| rows[date][assets[place]] - means[place]);
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(table.tr_mul(&table));
        let least = SINGULAR * eigenvalues.max();
        let inverses = eigenvalues.map(|value| if value > least { value.recip() } else { 0.0 });
        let inverse = &eigenvectors * DMatrix::from_diagonal(&inverses) * eigenvectors.transpose();
        Regressors { means, table, inverse }
    }

    /// Returns the level and the slopes of least squares.
    fn fit(&self, own: &[f64]) -> (f64, Vec<f64>) {
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        let own = DVector::from_iterator(own.len(), own.iter().map(|value| value - mean));
        let slopes = &self.inverse * self.table.tr_mul(&own);
        let level = mean - slopes.iter().zip(&self.means).map(|(slope, mean)| slope * mean).sum::<f64>();
        (level, slopes.as_slice().to_vec())
    }
}
