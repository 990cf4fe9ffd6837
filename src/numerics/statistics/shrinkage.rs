//! Shrinkage of the means of several assets: a mean estimated from a record is mostly noise, and those of different
//! assets are closer to each other than their estimates.
//!
//! With m_i the mean of the simple gross returns `e^z` of asset i, the shrunk means are
//!
//!   m_i + w (m - m_i),   w the intensity.
//!
//! With a chosen intensity, m is the average of the m_i. With the intensity of Bayes-Stein, m is the mean of the
//! minimum-variance portfolio of these returns (shorts allowed) and, for d assets and n dates,
//!
//!   w = (d + 2) / (d + 2 + n (mu - m)' S^-1 (mu - m)),   S = (n - 1) / (n - d - 2) times the sample covariance.
//!
//! Up to n = d + 2 dates S has no such value and w is 1, its limit. If returns are collinear, S^-1 is the pseudo-inverse.
//! Source: Jorion (1986), Bayes-Stein estimation for portfolio analysis, Journal of Financial and Quantitative Analysis
//! 21, equations 14 and 17.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Eigenvalues below this share of the largest count as 0.
const SINGULAR: f64 = 1e-12;

/// Shrunk means of several assets.
#[derive(Debug, Clone, PartialEq)]
pub struct ShrunkMeans {
    /// w, from 0 (the means seen) to 1 (one mean for all assets).
    pub intensity: f64,
    /// The mean of each asset's simple gross returns, as seen.
    pub seen: Vec<f64>,
    /// That mean after shrinkage.
    pub shrunk: Vec<f64>,
}

impl ShrunkMeans {
    /// Shrinks the means of the log-returns `rows`, date by date, by a chosen intensity towards their average. Cost
    /// O(n d).
    ///
    /// Checked by: `tests/solver/means.rs::half_of_the_way_is_the_middle`.
    pub fn by(rows: &[Vec<f64>], intensity: f64) -> Self {
        let seen = gross_means(rows);
        let target = seen.iter().sum::<f64>() / seen.len() as f64;
        ShrunkMeans::towards(seen, target, intensity)
    }

    /// Shrinks the means of the log-returns `rows` as Bayes-Stein does. Cost O(n d^2 + d^3).
    ///
    /// Checked by: `tests/solver/means.rs::bayes_stein_is_that_of_skfolio`.
    pub fn bayes_stein(rows: &[Vec<f64>]) -> Self {
        let seen = gross_means(rows);
        let (dates, assets) = (rows.len(), seen.len());
        let inverse = pseudo_inverse(covariance(rows, &seen));
        let (means, ones) = (DVector::from_row_slice(&seen), DVector::from_element(assets, 1.0));
        let weights = &inverse * &ones;
        let whole = weights.sum();
        let target = if whole > 0.0 { weights.dot(&means) / whole } else { means.mean() };
        if dates <= assets + 2 {
            return ShrunkMeans::towards(seen, target, 1.0);
        }
        let away = means.add_scalar(-target);
        let predictive = (dates - assets - 2) as f64 / (dates - 1) as f64;
        let distance = dates as f64 * predictive * away.dot(&(&inverse * &away));
        let prior = (assets + 2) as f64;
        ShrunkMeans::towards(seen, target, prior / (prior + distance))
    }

    fn towards(seen: Vec<f64>, target: f64, intensity: f64) -> Self {
        let shrunk = seen.iter().map(|mean| mean + intensity * (target - mean)).collect();
        ShrunkMeans { intensity, seen, shrunk }
    }

    /// Returns the log-returns `rows`, each column moved by a constant so that its simple returns have the shrunk mean.
    /// No value leaves `[-bound, bound]`. Cost O(n d).
    pub fn applied(&self, rows: &[Vec<f64>], bound: f64) -> Vec<Vec<f64>> {
        let moves: Vec<f64> = self.shrunk.iter().zip(&self.seen).map(|(shrunk, seen)| (shrunk / seen).ln()).collect();
        let moved = |row: &Vec<f64>| row.iter().zip(&moves).map(|(z, step)| (z + step).clamp(-bound, bound)).collect();
        rows.iter().map(moved).collect()
    }
}

fn gross_means(rows: &[Vec<f64>]) -> Vec<f64> {
    let (count, assets) = (rows.len() as f64, rows.first().map_or(0, Vec::len));
    (0..assets).map(|asset| rows.iter().map(|row| row[asset].exp()).sum::<f64>() / count).collect()
}

/// Returns the unbiased covariance of the simple returns.
fn covariance(rows: &[Vec<f64>], means: &[f64]) -> DMatrix<f64> {
    let away = DMatrix::from_fn(rows.len(), means.len(), |date, asset| rows[date][asset].exp() - means[asset]);
    away.transpose() * &away / (rows.len() as f64 - 1.0).max(1.0)
}

fn pseudo_inverse(symmetric: DMatrix<f64>) -> DMatrix<f64> {
    let mut eigen = SymmetricEigen::new(symmetric);
    let least = SINGULAR * eigen.eigenvalues.amax();
    eigen.eigenvalues.apply(|value| *value = if *value > least { value.recip() } else { 0.0 });
    eigen.recompose()
}
