//! The report of a frontier, as it is sent.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::request::frontier::FrontierRequest;
use crate::numerics::statistics::summary::Estimate;

/// Name and version of the report format.
pub const FORMAT: &str = "ballast-frontier-1";

/// The loss from following the advice at multiples of the radius, on records like the given one. The same request gives
/// the same report, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FrontierReport {
    /// `ballast-frontier-1`.
    pub format: String,
    /// The completed request.
    pub request: FrontierRequest,
    /// Confidence level of the intervals. They show how exactly the resamples determine a figure, not how close the
    /// resampled laws are to the true law.
    pub level: f64,
    /// True if losses are per year, because `problem.periods_per_year` is given; otherwise they are per period.
    pub per_year: bool,
    /// Radius of the rule at the record itself, in log-return; scales are multiples of it.
    pub radius: f64,
    /// By how many standard errors the record's mean return exceeds the bank's, in the inverse-volatility fund.
    pub evidence: f64,
    /// Advice at the record itself, scale by scale: the share of wealth in each asset, in the order of the request.
    pub own: Vec<Vec<f64>>,
    /// Results for each law that records were drawn from.
    pub resampled: Vec<ResampledFrontier>,
    /// Sentences on what the figures show, and what they cannot show.
    pub sentences: Vec<String>,
}

/// How records are drawn from the given one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Bootstrap {
    /// Independent draws of the past returns, spread by a kernel.
    Smoothed {
        /// Deviation of the kernel over that of the record, before the variance is restored.
        bandwidth: f64,
    },
    /// The smoothed law with each asset's returns shifted so that its mean is the bank's: no premium.
    WithoutPremium {
        /// Deviation of the kernel over that of the record, before the variance is restored.
        bandwidth: f64,
    },
    /// Blocks of consecutive past returns; the last is followed by the first.
    Block {
        /// Periods per block.
        length: usize,
    },
}

/// The frontier on records drawn from one law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ResampledFrontier {
    /// How the records were drawn.
    pub bootstrap: Bootstrap,
    /// The best allocation under the known law: the share of wealth in each asset.
    pub best: Vec<f64>,
    /// Results scale by scale.
    pub points: Vec<FrontierPoint>,
}

/// The loss at one multiple of the radius.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FrontierPoint {
    /// Multiple of the radius.
    pub scale: f64,
    /// Basis points of certainty equivalent below the best allocation, on average over records.
    pub lost: Estimate,
    /// Standard deviation of that loss from record to record.
    pub deviation: Estimate,
    /// Loss beyond that at the scale that loses least on average, record by record; null at that scale.
    pub beyond_least: Option<Estimate>,
    /// Gain of the advice over a constant mix of its own average allocation over all records, in the unit of `lost`. It
    /// is at most 0, up to rounding, because worth under one law is concave in the allocation.
    pub beyond_own_mix: Estimate,
    /// Share of wealth held in all assets together, on average over records.
    pub total: f64,
}
