//! From bytes to requests: listeners, connections and encryption. Nothing here knows a route.

pub(super) mod certificate_expiry;
pub(super) mod connection_table;
pub(super) mod exchanges;
pub(super) mod listener;
pub(super) mod timed_stream;
pub(super) mod tls;
