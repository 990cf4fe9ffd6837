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
pub mod letters;
pub mod limits;
mod means;
mod moments;
pub mod plan;
mod progress;
mod record;
mod returns;
pub mod serve;
pub mod sleeve;
pub mod solve;
mod store_location;
mod tls_client;
mod traces;
