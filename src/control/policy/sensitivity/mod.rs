//! How close an advice is to changing: if one return of its record were left out, one more were observed, the mean were
//! higher, or the record longer.
//!
//! Each alternative record is advised for the same period, wealth and holding: the result is the advice now, if that
//! were the record. So a next return is tried in the last period also.

mod bisection;
mod search;
mod sentences;

use serde::Serialize;
use utoipa::ToSchema;

pub use self::bisection::{least_count, parted};
pub(super) use self::search::{AdviceVariants, check_learning};
use super::advice::Advice;
use super::caution::Caution;

/// Distance within which an allocation counts as at an end of the action interval: ten times the tolerance of the
/// search.
const AT_AN_END: f64 = 1e-6;
/// Most periods considered: eight centuries of months.
pub const MOST_PERIODS: usize = 10_000;

/// The allocation as a function of the record.
type AdviceByRecord<'a> = &'a (dyn Fn(&[f64]) -> f64 + Sync);

/// How close an advice is to changing.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Sensitivity {
    /// Range with one return of the record left out; null if the remaining returns would be too few or too equal.
    pub without_one: Option<WithoutOne>,
    /// Effect of one more return.
    pub next_return: NextReturn,
    /// Effect of another mean, and of more returns like those in the record.
    pub premium: Premium,
    /// These figures in sentences. The first says how far an unusual next return would move the advice.
    pub sentences: Vec<String>,
    /// Warning against following the advice, if there is one.
    #[serde(skip)]
    pub caution: Option<Caution>,
}

impl Sensitivity {
    /// Returns the sentence on what the next return would have to be for another advice, and otherwise the one on what an
    /// unusual return would do.
    pub fn change(&self) -> Option<&str> {
        let after = self.sentences.iter().position(|sentence| sentence.starts_with(sentences::AFTER))?;
        // The sentences on crossings follow it.
        let crosses = self.next_return.to_bank.is_some() || self.next_return.to_highest.is_some();
        self.sentences.get(after + usize::from(crosses)).map(String::as_str)
    }
}

/// The range of the advice over the records that lack one return.
///
/// Each distinct return is left out in turn. Fewer are left out in a record of more than 360, or if a step takes long:
/// those that move the advice the most. These are the returns furthest from the mean by their weight, and others spread
/// evenly by rank. Checked by: tests/solver/sensitivity.rs against leaving out every one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct WithoutOne {
    /// The lowest advice, and the return whose absence gives it.
    pub lowest: LeftOut,
    /// The highest advice, and the return whose absence gives it.
    pub highest: LeftOut,
    /// Number of returns left out in turn.
    pub tried: usize,
}

/// The advice without one return.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct LeftOut {
    /// Index of the return in the record, from 0; the first of equal ones.
    pub index: usize,
    /// The return that is left out.
    pub log_return: f64,
    /// The return as `price / previous price - 1`.
    pub simple_return: f64,
    /// The share of wealth that would be advised.
    pub allocation: f64,
}

/// The effect of one more return.
///
/// Returns are tried over the range of the record, extended by half its width on both sides, within `support` if there
/// is one. 49 are evenly spaced. If an end of the action interval is advised at only one of two adjacent returns, the
/// crossing is located by bisection to 1e-6. The advice need not rise with the return, because an extreme return on
/// either side widens the radius. Of several crossings the one nearest to the median is reported; two crossings between
/// adjacent returns are missed. Checked by: tests/solver/sensitivity.rs on a finer grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct NextReturn {
    /// The lowest and the highest log-return tried.
    #[schema(value_type = [f64; 2])]
    pub range: [f64; 2],
    /// The return up to which the advice is the bank alone, and above which it no longer is; null if there is none.
    pub to_bank: Option<ReturnAndLog>,
    /// The return from which the advice is the highest allocation, and below which it is not yet; null if there is
    /// none.
    pub to_highest: Option<ReturnAndLog>,
    /// Advice after a return at the 5 % quantile of the record.
    pub low: NextAdvice,
    /// Advice after a return at the 95 % quantile of the record.
    pub high: NextAdvice,
}

/// A return in both units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct ReturnAndLog {
    /// `ln(price / previous price)`.
    pub log_return: f64,
    /// `price / previous price - 1`.
    pub simple_return: f64,
}

/// The advice after one more return.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct NextAdvice {
    /// Share of the record below it; interpolated between its returns (Hyndman and Fan, type 7).
    pub quantile: f64,
    /// The hypothetical return.
    pub log_return: f64,
    /// The return as `price / previous price - 1`.
    pub simple_return: f64,
    /// The share of wealth that would be advised.
    pub allocation: f64,
}

/// The record's mean return beyond the bank, and the mean at which the advice changes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Premium {
    /// Mean simple return of the record, by its weights, less `rate_per_step`: its excess per period over what the bank
    /// pays now.
    pub present: f64,
    /// The premium after every log-return is shifted by the amount at which the advice leaves the bank, to 1e-6. It is
    /// above `present` if all is in the bank now, or else below it. Null if no shift separates the two. A shift is at
    /// most the distance between the lowest and the highest return, and keeps all of them in `support`. In one period
    /// without trading cost the shift is `ln(1 + rate_per_step)` less the log of the least mean of e^Z in the ball.
    /// Checked by: tests/solver/sensitivity.rs against that.
    pub needed: Option<f64>,
    /// Number of further returns, of the law of the record, after which the advice leaves the bank: the least m at
    /// which the step with the radius times sqrt(n / (n + m)) advises anything. 0 if it has left already; null if it
    /// does not within 10000 periods, or the radius rule is `fixed`.
    pub periods_more: Option<usize>,
}

/// Returns the reasons to be careful with the advice, including those of the sensitivity if given. Checked by:
/// tests/solver/sensitivity.rs.
pub fn cautions(advice: &Advice, sensitivity: Option<&Sensitivity>) -> Vec<Caution> {
    let short = Caution::short_record(advice.sample_size, advice.effective_size);
    short.into_iter().chain(sensitivity.and_then(|found| found.caution.clone())).collect()
}

/// Returns true if an allocation is more than the bank alone.
fn is_invested(allocation: f64) -> bool {
    allocation > AT_AN_END
}
