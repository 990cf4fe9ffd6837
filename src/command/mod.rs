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
mod means;
mod moments;
mod progress;
mod record;
mod returns;
pub mod serve;
pub mod solve;
mod store_location;
mod tls_client;
mod traces;
