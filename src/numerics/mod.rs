//! Floor 0: mathematics with no investor in it.

pub mod cholesky;
pub mod empirical;
pub mod gp;
pub mod gp_fit;
pub mod matern;
pub mod minimise;
