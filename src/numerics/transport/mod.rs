//! Optimal transport on the line: worst expectations over Wasserstein balls, and the searches that they need.

pub mod least_variance;
pub(super) mod runs;
pub mod wasserstein;
pub mod water_filling;
