//! Floor 1: the paper, a file a section.

pub mod advisor;
pub mod backward;
pub mod error;
pub mod limits;
pub mod policy;
pub mod specification;
pub mod state;
