//! Ballast: nonparametric adaptive robust control of an investor, as a library and a service.
//!
//! Six layers, the lowest first; a layer may name only the layers before it (a test reads `src` and checks).
//!
//! - [`numerics`]: mathematics without an investor: Gaussian processes, empirical laws, bridges, transport.
//! - [`control`]: the paper: the problem, its uncertainty sets, the robust Bellman step, the policy.
//! - [`returns`]: parsing of returns from text, as people paste it and programs write it.
//! - [`store`]: durable facts: jobs, policies, sessions, observations.
//! - [`service`]: use cases: train, open a session, observe, act. No HTTP types.
//! - [`http`]: translation between the wire and the use cases, and nothing else.
//!
//! A leaf beside the layers, [`report`], names none of them: charts, pages and tables from data, for people to read.

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
