//! How near an advice is to changing: were one return of its record another, one more seen, the mean higher, the record
//! longer.
//!
//! The advice of another record is found as the one it stands beside, for the same period, wealth and holding: what is asked
//! is what would be advised now, were that the record. So a next return is tried in the last period too.

mod search;

use serde::Serialize;
use utoipa::ToSchema;

pub(super) use self::search::check_learning;
use super::advice::Advice;
use super::caution::Caution;

/// How near an advice is to changing.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Sensitivity {
    /// With one return of the record left out; null where so few or so equal returns would be left that none may be.
    pub without_one: Option<WithoutOne>,
    /// With one more return.
    pub next_return: NextReturn,
    /// With another mean, and with more returns like those seen.
    pub premium: Premium,
    /// What it says against following the advice.
    #[serde(skip)]
    pub caution: Option<Caution>,
}

/// The range of the advice over the records that lack one return.
///
/// Each distinct return is left out in turn. Of a record of more than 360, or of fewer where a step takes long, the returns that move
/// the advice the most are: those furthest from the mean by their weight, and others evenly between by their rank. Checked by:
/// tests/solver/sensitivity.rs against leaving out every one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct WithoutOne {
    /// The lowest advice, and the return whose absence gives it.
    pub lowest: LeftOut,
    /// The highest advice, and the return whose absence gives it.
    pub highest: LeftOut,
    /// Returns left out in turn.
    pub tried: usize,
}

/// The advice without one return.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct LeftOut {
    /// Of the return in the record, from 0; the first of equal ones.
    pub index: usize,
    /// The return.
    pub log_return: f64,
    /// The same as `price / previous price - 1`.
    pub simple_return: f64,
    /// The share of wealth that would be advised.
    pub allocation: f64,
}

/// What one more return would change.
///
/// Returns are tried from the lowest of the record less half the distance between its extremes to the highest and half of it
/// more, within `support` where there is one: at 49 of them, evenly, and between neighbours of which one is advised an end of
/// the action interval and the other is not, by halving, to 1e-6. The advice need not rise with the return, for one far out
/// widens the radius whichever side it lies on: of several crossings the one nearest to the median is told, and a pair of them
/// between two neighbours is missed. Checked by: tests/solver/sensitivity.rs on a finer grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct NextReturn {
    /// The lowest and the highest log-return tried.
    #[schema(value_type = [f64; 2])]
    pub range: [f64; 2],
    /// The return after which the advice is the bank alone, and after any higher one no longer; null where there is none.
    pub to_bank: Option<Return>,
    /// The return after which the advice is the highest allocation, and after any lower one not yet; null where there is none.
    pub to_highest: Option<Return>,
    /// After a return at the 5 % quantile of the record.
    pub low: NextAdvice,
    /// After a return at the 95 % quantile of the record.
    pub high: NextAdvice,
}

/// A return in both units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Return {
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
    /// The return supposed.
    pub log_return: f64,
    /// The same as `price / previous price - 1`.
    pub simple_return: f64,
    /// The share of wealth that would be advised.
    pub allocation: f64,
}

/// What the record pays beyond the bank, and what it would have to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Premium {
    /// Mean simple return of the record, by its weights, less `rate_per_step`: what it paid a period beyond what the bank pays now.
    pub present: f64,
    /// The same of the record with every log-return shifted by the amount at which the advice leaves the bank, to 1e-6: above
    /// `present` where all is in the bank now, else below it. Null where no shift within the distance between the lowest and the
    /// highest return, that leaves all of them in `support`, parts the two. In one period without trading cost the shift is
    /// `ln(1 + rate_per_step)` less the log of the least mean of e^Z in the ball. Checked by: tests/solver/sensitivity.rs against that.
    pub needed: Option<f64>,
    /// More returns, of the law of those seen, after which the advice leaves the bank: the least number m at which the step with
    /// the radius times sqrt(n / (n + m)) advises anything. 0 where it has left already; null where it does not within 10000
    /// periods, or the radius rule is `fixed`.
    pub periods_more: Option<usize>,
}

/// The reasons to be careful with an advice, as far as they were asked for. Checked by: tests/solver/sensitivity.rs.
pub fn cautions(advice: &Advice, sensitivity: Option<&Sensitivity>) -> Vec<Caution> {
    let short = Caution::short_record(advice.sample_size, advice.effective_size);
    short.into_iter().chain(sensitivity.and_then(|found| found.caution.clone())).collect()
}
