//! The Model Context Protocol, by which agents call this service: its messages, its revisions, and its tools.
//!
//! A tool is an operation of the interface under another name. Its input schema comes from the OpenAPI description, and
//! a call of it runs through the router with the caller's own key. So roles, tenants, rate limits and quotas hold
//! without a second implementation. Every tool only reads or advises.

pub(super) mod call;
pub(super) mod message;
pub(super) mod revision;
pub(super) mod tools;
