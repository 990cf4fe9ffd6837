//! What may be asked: the requests, their defaults, and every rule they must keep. No mathematics.

pub mod annualised;
pub mod completion;
pub mod contributions;
pub mod evaluation;
pub mod framework;
pub mod learning;
pub mod radius_rule;
pub mod rules;
pub mod specification;
pub mod warnings;
pub mod withdrawals;
