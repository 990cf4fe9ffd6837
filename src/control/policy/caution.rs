//! What to know before an advice is followed.

use serde::Serialize;
use utoipa::ToSchema;

/// A record with fewer returns, by its effective size, is short: two years of months.
const SHORT_RECORD: usize = 24;

/// A reason to be careful with an advice.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Caution {
    /// For programs.
    pub code: CautionCode,
    /// For people.
    pub sentence: String,
}

/// The reasons.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CautionCode {
    /// The record has fewer than 24 returns, by its effective size.
    ShortRecord,
    /// Without one of its returns the advice would move by more than half of the action interval, or between the bank alone and
    /// holding something. Told where the sensitivity is asked for.
    OneReturn,
}

impl Caution {
    /// Of an advice that rests on few returns, or on few by their weight.
    pub fn short_record(sample_size: usize, effective_size: f64) -> Option<Self> {
        if effective_size >= SHORT_RECORD as f64 {
            return None;
        }
        let worth = match effective_size < sample_size as f64 {
            true => format!(", which weigh like {effective_size:.1} equal ones"),
            false => String::new(),
        };
        let sentence = format!(
            "The advice rests on {sample_size} returns{worth}: with fewer than {SHORT_RECORD}, each of them weighs much, and most of what the asset can do is yet unseen."
        );
        Some(Caution { code: CautionCode::ShortRecord, sentence })
    }

    /// Of a return without which the advice would be another.
    pub(super) fn one_return(simple_return: f64, without: f64, with: f64) -> Self {
        let [lacking, without, with] = [simple_return, without, with].map(|share| 100.0 * share);
        let sentence = format!(
            "Without its return of {lacking:.1} % the advice would be {without:.1} %, and with it is {with:.1} %."
        );
        Caution { code: CautionCode::OneReturn, sentence }
    }
}
