//! Warnings to read before an advice is followed.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Effective sample size below which a record is short: two years of months.
const SHORT_RECORD: usize = 24;

/// Basis points between value and bound: up to `CERTIFIED` an allocation counts as the best, and from `BEYOND_USE` on
/// the bound is no use.
const CERTIFIED: f64 = 0.01;
const BEYOND_USE: f64 = 100.0;

/// A reason to be careful with an advice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Caution {
    /// Code for programs.
    pub code: CautionCode,
    /// Sentence for people.
    pub sentence: String,
}

/// The kinds of reasons.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CautionCode {
    /// The record has an effective sample size below 24 returns.
    ShortRecord,
    /// Without one of its returns the advice would move by more than half of the action interval, or between the bank
    /// alone and holding something. Reported if the sensitivity is requested.
    OneReturn,
    /// The search for the best allocation of several assets ended before its two bounds met within a hundredth of a
    /// basis point.
    NotCertified,
    /// The next policy is not ready yet, and the one before it advises.
    Waiting,
}

impl Caution {
    /// Warns of an advice that rests on few returns, or on few by their weight.
    pub fn short_record(sample_size: usize, effective_size: f64) -> Option<Self> {
        if effective_size >= SHORT_RECORD as f64 {
            return None;
        }
        let worth = match effective_size < sample_size as f64 {
            true => format!(", which count as much as {effective_size:.1} equally weighted ones"),
            false => String::new(),
        };
        let sentence = format!(
            "The advice rests on {sample_size} returns{worth}. With fewer than {SHORT_RECORD}, each return weighs heavily, and most of what the asset can do has not been seen yet."
        );
        Some(Caution { code: CautionCode::ShortRecord, sentence })
    }

    /// Warns that another allocation may be worth more than the advised one. `gap` is the difference, in log certainty
    /// equivalent, between the value of the advice and the upper bound.
    pub fn not_certified(gap: f64) -> Option<Self> {
        let basis_points = 1e4 * gap;
        let sentence = match basis_points {
            within if within <= CERTIFIED => return None,
            some if some < BEYOND_USE => format!(
                "The search for the best allocation ended early: another allocation could be worth up to {some:.2} basis points more."
            ),
            _ => "The search for the best allocation failed, so another allocation may be much better. Do not follow this advice."
                .to_owned(),
        };
        Some(Caution { code: CautionCode::NotCertified, sentence })
    }

    /// Warns that the advice for `period` comes from a policy trained up to `horizon`, because the next one is not
    /// ready.
    pub fn waiting(period: usize, horizon: usize) -> Self {
        let sentence = match period > horizon {
            true => format!(
                "The next policy is not trained yet, and the last one ended with period {horizon}. Its last step, which looks one period ahead, gives this advice from all that was reported so far."
            ),
            false => format!(
                "The next policy is not trained yet. The one before it, which lasts to period {horizon}, gives this advice from all that was reported so far."
            ),
        };
        Caution { code: CautionCode::Waiting, sentence }
    }

    /// Warns that the advice would be different without one return.
    pub(super) fn one_return(simple_return: f64, without: f64, with: f64) -> Self {
        let [lacking, without, with] = [simple_return, without, with].map(|share| 100.0 * share);
        let sentence = format!(
            "Without the return of {lacking:.1} % the advice would be {without:.1} %; with it the advice is {with:.1} %."
        );
        Caution { code: CautionCode::OneReturn, sentence }
    }
}
