//! Estimates with intervals, resampling, and tests.

pub mod block_bootstrap;
pub mod exchangeability;
pub mod long_run_mean;
pub mod moving_mean;
pub mod shrinkage;
pub mod summary;
pub mod tail_index;
pub mod unequal_records;
