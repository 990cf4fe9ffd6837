//! Strategies compared on simulated paths and on real returns (paper, section 3.2).

pub mod account;
pub mod analysis;
pub mod assets;
pub mod backtest;
pub mod backtest_report;
mod coverage;
pub mod deciding_paths;
pub mod declared_comparison;
pub mod declared_walk;
pub mod frontier;
pub mod names;
pub mod own;
pub mod paths;
pub mod plan;
pub mod report;
pub mod resampling;
pub mod statistics;
pub mod verdict;
pub mod walk_forward;
pub mod yearly_worth;
