//! Ways to put the periods of a session right.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Changes of the periods that passed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// The period is reported anew.
    #[default]
    Replace,
    /// A period that was skipped is put in before the period named; that one and those after it get the next number.
    Insert,
    /// The period is taken out, with no report of it; those after it get the number before.
    Remove,
}

impl Change {
    pub(super) fn is_replace(&self) -> bool {
        *self == Change::Replace
    }
}
