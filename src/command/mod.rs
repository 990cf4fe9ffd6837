//! Commands of the binary that are clients of the service, and what they need.

mod api_client;
pub mod demo;
mod demo_progress;
mod us_market;
