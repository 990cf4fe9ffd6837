//! Floor 0: mathematics with no investor in it.

pub mod bridge;
pub mod gp;
pub mod law;
pub mod machine;
pub mod search;
pub mod statistics;
pub mod transport;
