//! Commands of the binary that are clients of the service, and what they need.

mod api_client;
pub mod demo;
mod us_market;
