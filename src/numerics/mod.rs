//! Floor 0: mathematics with no investor in it.

pub mod block_bootstrap;
pub mod bridge;
pub mod bridge_paths;
pub mod chebyshev;
pub mod cholesky;
pub mod confidence_region;
pub(crate) mod dispatch;
pub mod elementary;
pub mod empirical;
pub mod exchangeability;
pub mod exponential_mean;
pub mod farthest;
pub mod gp;
pub mod gp_fit;
pub mod gp_likelihood;
pub mod law;
pub mod law_distance;
pub mod matern;
pub mod minimise;
pub mod moments;
pub mod quasi_newton;
pub mod scale_mixture;
pub mod streams;
pub mod student;
pub mod summary;
pub mod wasserstein;
