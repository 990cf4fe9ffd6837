//! Ballast: nonparametric adaptive robust control of an investor, as a library and a service.
//!
//! Six floors; a floor may name only the floors below it (a test reads `src` and checks).
//!
//! - [`numerics`]: mathematics with no investor in it: Gaussian processes, empirical laws, bridges, transport.
//! - [`control`]: the paper: the problem, its uncertainty sets, the robust Bellman step, the policy.
//! - [`returns`]: text of returns, as people paste it and programs write it, read into returns.
//! - [`store`]: durable facts: jobs, policies, sessions, observations.
//! - [`service`]: use cases: train, open a session, observe, act. No HTTP types.
//! - [`http`]: translation between the wire and the use cases, and nothing else.
//!
//! Beside them stands [`report`], a leaf that names no floor: charts, pages and tables from data, for people to read.

#![forbid(unsafe_code)]

#[deny(missing_docs)]
pub mod control;
pub mod http;
#[deny(missing_docs)]
pub mod numerics;
pub mod report;
#[deny(missing_docs)]
pub mod returns;
pub mod service;
pub mod store;
