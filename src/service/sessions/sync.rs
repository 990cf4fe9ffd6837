//! The lock of the slots. `tests/slots.rs` compiles the same slots with a checker's primitives instead.

pub(in crate::service) use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub(in crate::service) use tokio::sync::{Mutex as AsyncMutex, OwnedMutexGuard};
