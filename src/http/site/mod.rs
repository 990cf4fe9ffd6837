//! Pages and files for browsers: the dashboard and the guide, embedded in the binary, and letters to clients.

pub(super) mod asset;
pub mod dashboard;
pub(super) mod guide;
pub(super) mod letter;
mod letter_chart;
