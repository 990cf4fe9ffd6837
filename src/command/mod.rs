//! The commands of the binary.

pub mod advise;
pub mod audit;
pub mod backtest;
pub mod backup;
mod caution;
pub mod check;
pub mod demo;
pub mod frontier;
pub mod healthcheck;
mod host;
pub mod keys;
mod moments;
mod record;
mod returns;
pub mod serve;
mod store_location;
mod tls_client;
mod traces;

/// Formats an error and its causes on one line.
pub fn with_causes(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |cause| cause.source());
    causes.fold(error.to_string(), |line, cause| format!("{line}: {cause}"))
}
