//! The ways to correct the periods of a session.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A change to observed periods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// Reports the period again.
    #[default]
    Replace,
    /// Inserts a period that was skipped before the named period. That one and those after it move up by one number.
    Insert,
    /// Removes the period, without a report. Those after it move down by one number.
    Remove,
}

impl Change {
    pub(super) fn is_replace(&self) -> bool {
        *self == Change::Replace
    }
}
