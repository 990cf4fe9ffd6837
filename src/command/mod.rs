//! The commands of the binary.

pub mod advise;
mod api_client;
pub mod audit;
pub mod backtest;
pub mod backup;
pub mod bench;
mod caution;
pub mod check;
mod compare;
pub mod coverage;
pub mod demo;
pub mod evaluate;
pub mod frontier;
pub mod healthcheck;
mod host;
pub mod keys;
pub mod loadtest;
mod moments;
mod record;
pub mod reproduce;
mod returns;
pub mod serve;
mod store_location;
mod tables;
mod tls_client;
mod traces;

/// Formats an error and its causes on one line.
pub fn with_causes(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |cause| cause.source());
    causes.fold(error.to_string(), |line, cause| format!("{line}: {cause}"))
}
