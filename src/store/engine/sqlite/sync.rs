//! The primitives behind the version numbers. `tests/slots.rs` compiles the same code over a checker's primitives
//! instead.

pub(super) use std::sync::Arc;
pub(super) use std::sync::atomic::{AtomicU64, Ordering};
