//! From bytes to requests: listeners, connections and encryption. Nothing here knows a route.

pub(super) mod certificate_expiry;
pub(super) mod connections;
pub(super) mod conversation;
pub(super) mod listener;
pub(super) mod patient;
pub(super) mod tls;
