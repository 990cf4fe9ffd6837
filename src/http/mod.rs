//! Floor 4: translation between the wire and the use cases, and nothing else.

mod access;
mod advise;
mod asset;
mod audit;
mod backtests;
mod bodies;
mod bounds;
mod connections;
mod conversation;
mod dashboard;
pub mod decode;
mod defaults;
mod described;
mod documentation;
mod evaluations;
mod events;
mod extract;
mod fault;
mod hosts;
mod jobs;
mod listener;
mod operations;
mod page;
mod patient;
mod policies;
pub mod problem;
mod router;
mod schema;
mod server;
mod sessions;
mod telemetry;
mod tls;
mod what_if;
mod wire;

pub use router::description_json;
pub use server::{Running, ServeError, serve};
