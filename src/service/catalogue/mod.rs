//! The things that a tenant owns: policies, labels, and the overview of sessions.

pub mod labels;
pub mod overview;
pub mod policies;
