//! The steps that every request passes before a handler sees it, and every answer before it is sent: callers and their
//! classes, host names, bodies, decoding, errors, telemetry. Nothing here knows a resource.

pub(super) mod access;
pub(super) mod bodies;
pub mod decode;
pub(super) mod extract;
pub(super) mod fault;
pub(super) mod hosts;
pub(super) mod telemetry;
