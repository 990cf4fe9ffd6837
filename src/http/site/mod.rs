//! The files that are served to browsers: the dashboard and the guide, embedded in the binary.

pub(super) mod asset;
pub mod dashboard;
pub(super) mod guide;
