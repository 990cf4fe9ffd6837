//! Notes on a recorded period: a loss that the law does not learn in full, and prices that did not come.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::problem::state::LEAST_LEARNED;
use crate::service::entries::record::PeriodNoise;

/// A note on a recorded period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PeriodNote {
    pub reason: NoteReason,
    /// The asset, if there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asset: Option<String>,
    /// The note, in one sentence.
    pub sentence: String,
}

/// The reason for a note.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoteReason {
    /// The asset lost everything. Its log-return is null.
    TotalLoss,
    /// The log-return is lower than any that a law learns.
    LearnedInPart,
    /// The price of the asset did not come.
    PriceMissing,
    /// The return covers earlier periods also, in which the price did not come.
    PriceLate,
}

/// Returns the notes on a period of assets with these `names`, which are empty for one asset.
pub(in crate::service) fn of(seen: &PeriodNoise, names: &[String]) -> Vec<PeriodNote> {
    if seen.is_missing() {
        return Vec::new();
    }
    let of_asset = |(asset, log_return): (usize, &Option<f64>)| {
        let name = names.get(asset);
        let subject = name.map_or("the asset", String::as_str);
        let (reason, sentence) = match *log_return {
            None => (
                NoteReason::PriceMissing,
                format!(
                    "the price of {subject} did not come: its holding counts as unmoved until it does, and the law learns nothing from this period"
                ),
            ),
            Some(f64::NEG_INFINITY) => (
                NoteReason::TotalLoss,
                format!(
                    "{subject} lost everything: wealth bears all of the loss, and the law learns a log-return of {LEAST_LEARNED}, the lowest that it allows"
                ),
            ),
            Some(log_return) if log_return < LEAST_LEARNED => (
                NoteReason::LearnedInPart,
                format!(
                    "{subject} returned {:.2} %: wealth bears all of the loss, and the law learns a log-return of {LEAST_LEARNED}, the lowest that it allows",
                    100.0 * log_return.exp_m1()
                ),
            ),
            Some(_) if seen.late.contains(&asset) => (
                NoteReason::PriceLate,
                format!(
                    "the return of {subject} covers every period since its last price, and the law learns nothing from this period"
                ),
            ),
            Some(_) => return None,
        };
        Some(PeriodNote { reason, asset: name.cloned(), sentence })
    };
    seen.values.iter().enumerate().filter_map(of_asset).collect()
}

/// Returns whether the notes say that the asset, named if there are several, lost everything.
pub(super) fn is_lost(notes: &[PeriodNote], asset: Option<&str>) -> bool {
    notes.iter().any(|note| note.reason == NoteReason::TotalLoss && note.asset.as_deref() == asset)
}
