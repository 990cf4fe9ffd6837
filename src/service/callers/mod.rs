//! Who calls, what they may do, how much of the process they may use, and the audit of it.

pub mod allowance;
pub mod audit;
pub mod bounded;
pub(super) mod fresh_keys;
pub(super) mod identity;
pub mod keys;
pub(super) mod secret;
pub(super) mod turns;
