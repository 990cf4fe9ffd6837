//! The state y = (x, F^): wealth and the empirical law of log-returns.

use crate::numerics::empirical::EmpiricalDistribution;

/// Wealth and what has been learned.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    pub wealth: f64,
    pub law: EmpiricalDistribution,
}
