//! The lock of the slots. `tests/slots.rs` compiles the same slots with a checker's primitives instead.

pub(super) use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub(super) use tokio::sync::{Mutex as AsyncMutex, OwnedMutexGuard};
