//! Commands of the binary that are clients of the service, and what they need.

mod api_client;
pub mod demo;
mod us_market;

/// An error and its causes on one line.
pub fn with_causes(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |cause| cause.source());
    causes.fold(error.to_string(), |line, cause| format!("{line}: {cause}"))
}
