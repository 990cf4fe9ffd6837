//! The process itself: its configuration, clock, memory, signals and upkeep. Nothing here knows a session or a job.

pub mod clock;
pub mod config;
pub mod figures;
pub mod memory;
pub mod shutdown;
pub mod spans;
pub(super) mod timekeeper;
pub(super) mod upkeep;
