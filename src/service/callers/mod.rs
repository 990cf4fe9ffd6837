//! Who calls, what they may do, how much of the process they may use, and the audit of it.

pub mod allowance;
pub mod audit;
pub mod fair_queue;
pub(super) mod identity;
pub(super) mod key_refresh;
pub mod keys;
pub(super) mod rejected;
pub(super) mod secret;
pub(super) mod turns;
