//! The advice for a period, as a replay needs it.

use crate::control::policy::advice::{Advice, SpendingAdvice};

/// Shares of wealth that were advised for a period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdvisedShares {
    /// The share in all assets, of the wealth that is left after spending.
    pub held: f64,
    /// The share to spend at the start.
    pub spent: f64,
}

impl AdvisedShares {
    /// Returns the shares of an advice.
    pub fn of(advice: &Advice) -> Self {
        AdvisedShares { held: advice.allocation, spent: SpendingAdvice::share_of(advice.spending) }
    }
}

/// The advice for a period, as a replay needs it.
#[derive(Debug, Clone, PartialEq)]
pub enum AdvisedActions {
    /// Shares of an investor's wealth.
    Shares(AdvisedShares),
    /// The actions of a declared problem, in the order of their names.
    Actions(Vec<f64>),
}

impl AdvisedActions {
    /// Returns the shares of wealth; none of a declared problem.
    pub(super) fn shares(&self) -> AdvisedShares {
        match self {
            AdvisedActions::Shares(shares) => *shares,
            AdvisedActions::Actions(_) => AdvisedShares { held: 0.0, spent: 0.0 },
        }
    }

    /// Returns the actions of a declared problem; none of an investor.
    pub(super) fn actions(&self) -> &[f64] {
        match self {
            AdvisedActions::Shares(_) => &[],
            AdvisedActions::Actions(actions) => actions,
        }
    }
}
