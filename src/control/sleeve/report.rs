//! The answer to the question of how much capital a strategy's record supports.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::assets::advice::WorstMean;
use crate::control::policy::caution::Caution;
use crate::control::policy::worst_case::WorstCase;
use crate::control::request::warnings::Warning;

/// The share of the capital that a record supports, beside the Kelly share, which takes the record as the truth.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SleeveReport {
    /// The answer in sentences, the most important first; the last ones say what would refute it.
    pub sentences: Vec<String>,
    /// Share of the capital, in all strategies together: the allocation of `POST /advise` under log utility.
    pub share: f64,
    /// The Kelly share of the record, in all strategies together: the share of the fastest growth if the record is the truth
    /// and money is borrowed at the bank's rate. It may exceed 1. Null if growth has no maximum, or none is found.
    pub kelly: Option<f64>,
    /// The share over the Kelly share; null if the latter is null or 0.
    pub fraction: Option<f64>,
    /// The shares of several strategies, by name; left out for one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub strategies: Option<BTreeMap<String, StrategyShare>>,
    /// Growth of the capital a period or trade.
    pub growth: SleeveGrowth,
    /// Growth of the capital a year, if `problem.periods_per_year` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub growth_a_year: Option<SleeveGrowth>,
    /// Moments of the record; left out for several strategies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record: Option<ReturnMoments>,
    /// Moments under the worst law for the share; left out for several strategies, and if the share is 0, which no law hurts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst: Option<ReturnMoments>,
    /// Findings that would change the answer; left out for long records of several strategies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refutation: Option<Refutation>,
    /// The worst law; left out for several strategies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<WorstCase>,
    /// Radius of the ball, in log-return.
    pub radius: f64,
    /// Number of periods or trades in the record.
    pub sample_size: usize,
    /// Warnings to read before following the answer.
    pub caution: Vec<Caution>,
    /// Parts of the request that may be a mistake.
    pub warnings: Vec<Warning>,
}

/// The share of one of several strategies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct StrategyShare {
    /// Share of the capital.
    pub share: f64,
    /// Its part of the Kelly share; null if that is.
    pub kelly: Option<f64>,
    /// Its mean log-return in the record and under the worst law.
    pub mean: WorstMean,
}

/// Growth of the capital as a fraction of it, compounded.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct SleeveGrowth {
    /// Growth with everything in the bank.
    pub bank: f64,
    /// Growth with the share.
    pub share: GrowthInBothLaws,
    /// Growth with the Kelly share; null if that is.
    pub kelly: Option<GrowthInBothLaws>,
}

/// Growth if the record is the truth, and under the law that is worst for the share.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct GrowthInBothLaws {
    /// Growth under the law of the record.
    pub record: f64,
    /// Growth under the worst law; -1 if it takes everything. Null for the Kelly share of several strategies, or if the share
    /// is 0.
    pub worst: Option<f64>,
}

/// Moments of a simple return, a period or trade.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct ReturnMoments {
    /// Mean.
    pub mean: f64,
    /// Standard deviation, with the divisor n.
    pub standard_deviation: f64,
}

/// Findings that would change the answer. The radius of the ball shrinks with the root of the number of returns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Refutation {
    /// Mean simple return at which the share becomes 0, or rises above it if it is 0, when all log-returns are shifted alike;
    /// null for several strategies, or if no shift does so.
    pub break_even_mean: Option<f64>,
    /// Shift of all returns at which the share becomes 0, or rises above it if it is 0, as a fraction of the price: -0.001 lowers
    /// each by 0.1 %. Null if no shift does so.
    pub break_even_shift: Option<f64>,
    /// Number of further returns, of the law of the record, at which the share rises above 0: 0 if it has. Null if 10,000 are
    /// not enough, or the radius rule is `fixed`.
    pub until_any: Option<usize>,
    /// Number of further returns, of the law of the record, at which the share reaches half of the Kelly share: 0 if it has.
    /// Null if 10,000 are not enough, the Kelly share is null or 0, or the radius rule is `fixed`.
    pub until_half_kelly: Option<usize>,
    /// Number of further returns at which the share reaches three quarters of the Kelly share, as for half.
    pub until_three_quarters_kelly: Option<usize>,
    /// Losses in a row, each as large as the mean loss of the record, after which the share is 0; null if it is 0 now, 60 are not
    /// enough, the record has no loss, or there are several strategies.
    pub losses_in_a_row: Option<usize>,
    /// That mean loss, a simple return below 0; null if `losses_in_a_row` is.
    pub mean_loss: Option<f64>,
}
