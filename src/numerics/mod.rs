//! Floor 0: mathematics with no investor in it.

pub mod bridge;
pub mod chebyshev;
pub mod empirical;
pub mod law;
pub mod moments;
pub mod streams;
pub mod wasserstein;
