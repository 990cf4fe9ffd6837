//! Floor 5: translates between the wire and the use cases, and does nothing else.

mod agents;
pub mod api_client;
mod connection;
mod description;
pub mod gate;
pub mod problem;
mod router;
mod routes;
mod server;
pub mod site;
pub mod webhooks;

pub use router::{description_json, reference_page};
pub use server::{RunningServer, ServeError, serve};
