//! Worst-case laws shown with an answer, and their limit.

use serde::Deserialize;
use utoipa::ToSchema;

use crate::control::error::FieldError;

/// The most points of a sweep times returns of the law for which worst-case laws are shown: about 10 MB.
const MOST_EXPLAINED: usize = 100_000;
/// Bytes of one atom of a worst-case law in an answer.
pub(super) const ATOM_BYTES: usize = 100;

/// The explanation shown beside an allocation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Explain {
    WorstCase,
}

/// Returns the total number of returns in the worst-case laws that an answer of so many points shows. Checked by:
/// `tests/operation/memory.rs::sweeps_that_explain_are_bounded_and_take_no_more_than_their_part`.
///
/// # Errors
/// A sweep shows more than [`MOST_EXPLAINED`].
pub(super) fn atoms(explain: Option<Explain>, points: usize, returns: usize) -> Result<usize, FieldError> {
    let shown = if explain.is_some() { points * returns } else { 0 };
    if shown <= MOST_EXPLAINED || points == 1 {
        return Ok(shown);
    }
    let rule = format!(
        "must be left out if points times returns exceed {MOST_EXPLAINED}: here they are {points} times {returns}. Explain \
         fewer points, or the points that matter one by one"
    );
    Err(FieldError::new("explain", "worst_case", rule))
}
