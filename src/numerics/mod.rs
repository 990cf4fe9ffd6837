//! Floor 0: mathematics with no investor in it.

pub mod bridge;
pub mod chebyshev;
pub mod cholesky;
pub mod elementary;
pub mod empirical;
pub mod exponential_mean;
pub mod farthest;
pub mod gp;
pub mod gp_fit;
pub mod law;
pub mod law_distance;
pub mod matern;
pub mod minimise;
pub mod moments;
pub mod streams;
pub mod student;
pub mod summary;
pub mod wasserstein;
