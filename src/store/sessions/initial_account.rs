//! The account of an investor at the start of a session.

use crate::store::engine::error::Failure;
use crate::store::engine::query::StoreRow;

/// The account of an investor when a session is opened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InitialAccount {
    pub wealth: f64,
    /// The share of wealth in the risky asset.
    pub holding: f64,
}

impl InitialAccount {
    pub(super) fn from_row(row: &StoreRow) -> Result<Option<Self>, Failure> {
        let wealth = row.get::<Option<f64>>("initial_wealth")?;
        let holding = row.get::<Option<f64>>("initial_holding")?;
        Ok(wealth.zip(holding).map(|(wealth, holding)| InitialAccount { wealth, holding }))
    }
}
