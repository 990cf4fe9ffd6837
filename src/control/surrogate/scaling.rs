//! The scaling of features to the inputs of a surrogate.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::features::Features;

/// A feature whose spread over the design is below this share of its size carries no information.
const SMALLEST_SPREAD: f64 = 1e-9;

/// Centre and spread of the features that vary over a step's design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scaling {
    /// Indices, among all features, of those that vary.
    pub active: Vec<usize>,
    /// Means of these features, in their own units.
    pub centre: Vec<f64>,
    /// Standard deviations of these features, in their own units.
    pub spread: Vec<f64>,
}

impl Scaling {
    /// Computes mean and standard deviation over `rows`, the features of one state each.
    pub fn of(rows: &[Features]) -> Self {
        let mut scaling = Scaling { active: Vec::new(), centre: Vec::new(), spread: Vec::new() };
        let count = rows.len() as f64;
        for feature in 0..rows.first().map_or(0, |row| row.0.len()) {
            let mean = rows.iter().map(|row| row.0[feature]).sum::<f64>() / count;
            let variance = rows.iter().map(|row| (row.0[feature] - mean).powi(2)).sum::<f64>() / count;
            if variance.sqrt() > SMALLEST_SPREAD * (1.0 + mean.abs()) {
                scaling.active.push(feature);
                scaling.centre.push(mean);
                scaling.spread.push(variance.sqrt());
            }
        }
        scaling
    }

    /// Returns the surrogate's inputs: the active features in units of their spread.
    pub fn apply(&self, features: &Features) -> Vec<f64> {
        let scaled = self.active.iter().zip(self.centre.iter().zip(&self.spread));
        scaled.map(|(&feature, (centre, spread))| (features.0[feature] - centre) / spread).collect()
    }

    /// Returns one scaled row for each design point.
    pub fn matrix(&self, rows: &[Features]) -> DMatrix<f64> {
        let flat: Vec<f64> = rows.iter().flat_map(|row| self.apply(row)).collect();
        DMatrix::from_row_slice(rows.len(), self.active.len(), &flat)
    }
}
