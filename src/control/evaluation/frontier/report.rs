//! The report of a frontier, as it travels.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::request::frontier::FrontierRequest;
use crate::numerics::summary::Estimate;

/// Name and version of the report's form.
pub const FORMAT: &str = "ballast-frontier-1";

/// What following the advice at multiples of the radius loses on records like the one at hand. The same request gives the same
/// report, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FrontierReport {
    /// `ballast-frontier-1`.
    pub format: String,
    /// As completed.
    pub request: FrontierRequest,
    /// Of the intervals, which tell how exactly the resamples tell a figure, not how like the true law they are.
    pub level: f64,
    /// Whether losses are a year's: where `problem.periods_per_year` is given. Else they are a period's.
    pub per_year: bool,
    /// Of the rule at the record itself, in log-return; scales are multiples of it.
    pub radius: f64,
    /// Standard errors that the record's mean return lies above the bank's, in the fund of inverse volatilities.
    pub evidence: f64,
    /// What is advised at the record itself, scale by scale: the share of wealth in each asset, in the order of the request.
    pub own: Vec<Vec<f64>>,
    /// By the law that records were drawn from.
    pub resampled: Vec<Resampled>,
    /// What the figures say, and what they cannot.
    pub sentences: Vec<String>,
}

/// How records are drawn from the one at hand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Bootstrap {
    /// Independent draws of the returns seen, spread by a kernel.
    Smoothed {
        /// Deviation of the kernel over that of the record, before the variance is brought back.
        bandwidth: f64,
    },
    /// The same, every return moved by as much, to where its asset's mean is the bank's: were there no premium.
    WithoutPremium {
        /// Deviation of the kernel over that of the record, before the variance is brought back.
        bandwidth: f64,
    },
    /// Blocks of the returns seen, in a row; the last is followed by the first.
    Block {
        /// Periods of a block.
        length: usize,
    },
}

/// The frontier on records drawn from one law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Resampled {
    /// How they were drawn.
    pub bootstrap: Bootstrap,
    /// The best allocation for who knows the law: the share of wealth in each asset.
    pub best: Vec<f64>,
    /// Scale by scale.
    pub points: Vec<FrontierPoint>,
}

/// What one multiple of the radius loses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FrontierPoint {
    /// Of the radius.
    pub scale: f64,
    /// Basis points of certainty equivalent behind the best allocation, on average over records.
    pub lost: Estimate,
    /// Of that loss from record to record.
    pub deviation: Estimate,
    /// What more is lost than at the scale that loses least on average, record by record; null at that scale.
    pub beyond_least: Option<Estimate>,
    /// What the advice gains over a constant mix of its own average allocation over all records, in the unit of `lost`: at most 0, up
    /// to rounding, since what an allocation is worth under one law is concave in it.
    pub beyond_own_mix: Estimate,
    /// Share of wealth held in all assets together, on average over records.
    pub total: f64,
}
