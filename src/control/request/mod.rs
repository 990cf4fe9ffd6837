//! The requests: their fields, their defaults, and every rule they must satisfy. No mathematics.

pub mod annualised;
pub mod assets;
pub mod backtest;
pub mod backtest_assets;
pub mod caution;
pub mod caution_rules;
pub mod centre;
pub mod centre_rules;
pub mod completion;
pub mod contributions;
pub mod dates;
pub mod evaluation;
pub mod framework;
pub mod frequency;
pub mod frontier;
pub mod fund;
pub mod learning;
pub mod radius_rule;
pub mod rules;
pub mod sampling_law;
pub mod specification;
pub mod support;
pub mod terms;
pub mod text;
pub mod warnings;
pub mod withdrawals;
