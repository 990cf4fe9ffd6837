//! Figures that the paper prints in its section 3.

use ballast::control::request::framework::Framework;
use serde::Serialize;

/// Mean of the simulated quantiles at t0 = 20, alpha = 0.1.
pub const MEAN_QUANTILE: f64 = 0.200395;
/// 1 % quantile of the simulated quantiles.
pub const LOW_QUANTILE: f64 = 0.115721;
/// Number of simulated quantiles in the left panel of its first figure.
pub const QUANTILES: usize = 1000;

/// Names of the statistics, as in `tables::estimates`.
pub const STATISTICS: [&str; 6] = ["mean", "variance", "quantile_20", "quantile_90", "max", "min"];

/// A table: the quantile of its history, and the statistics of its three columns.
#[derive(Debug, Serialize)]
pub struct PrintedTable {
    pub quantile: f64,
    pub adaptive: [f64; 6],
    pub known_law: [f64; 6],
    pub static_robust: [f64; 6],
}

const KNOWN_LAW: [f64; 6] = [66.805075, 108.601415, 58.740896, 78.899913, 90.773115, 26.307049];

pub const TABLES: [PrintedTable; 2] = [
    PrintedTable {
        quantile: 0.199165,
        adaptive: [65.425570, 36.679199, 59.682528, 72.937869, 82.953448, 46.192910],
        known_law: KNOWN_LAW,
        static_robust: [63.947066, 6.451175e-9, 63.947003, 63.947173, 63.947302, 63.946811],
    },
    PrintedTable {
        quantile: 0.092942,
        adaptive: [65.440839, 41.907675, 59.575356, 73.363772, 85.322523, 45.40310],
        known_law: KNOWN_LAW,
        static_robust: [63.947067, 6.776359e-9, 63.946997, 63.947175, 63.947367, 63.946763],
    },
];

impl PrintedTable {
    /// Returns the paper's column for a framework.
    pub fn column(&self, framework: Option<Framework>) -> Option<&[f64; 6]> {
        match framework? {
            Framework::Adaptive => Some(&self.adaptive),
            Framework::KnownLaw => Some(&self.known_law),
            Framework::Static => Some(&self.static_robust),
            _ => None,
        }
    }
}
