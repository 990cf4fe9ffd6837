//! The report of a frontier, as it travels, and what it says in sentences.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::laws::Bootstrap;
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
    /// As sent, with what was left out.
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
    /// Share of wealth held in all assets together, on average over records.
    pub total: f64,
}

/// Standard errors beyond which a premium is told from none.
const TOLD: f64 = 2.0;

/// What the figures say, the most important first.
pub(super) fn sentences(resampled: &[Resampled], evidence: f64, per_year: bool) -> Vec<String> {
    let mut sentences: Vec<String> = resampled.iter().filter_map(|resampled| of_one(resampled, per_year)).collect();
    let behind = if evidence < 0.0 { "below" } else { "above" };
    let errors = evidence.abs();
    let told = if errors < TOLD { "the record cannot tell it from none" } else { "the record tells it from none" };
    sentences.push(format!(
        "The mean return of the record lies {errors:.1} standard errors {behind} the bank's: {told}. Every record drawn here has that premium in it, so the figures say how much caution a premium like it repays, not that there is one; were there none, the largest radius would lose least."
    ));
    sentences.push(
        "A scale that did best in the past says next to nothing about the future: choose by how much loss from record to record you can bear."
            .to_owned(),
    );
    sentences
}

/// Which scale loses least, and which cannot be told apart from it.
fn of_one(resampled: &Resampled, per_year: bool) -> Option<String> {
    let least = resampled.points.iter().find(|point| point.beyond_least.is_none())?;
    let steadiest =
        resampled.points.iter().min_by(|one, other| one.deviation.value.total_cmp(&other.deviation.value))?;
    let per = if per_year { "a year" } else { "a period" };
    let records = match resampled.bootstrap {
        Bootstrap::Smoothed { .. } => "On records drawn from the smoothed returns".to_owned(),
        Bootstrap::Block { length } => format!("On records of blocks of {length} periods"),
    };
    let alike: Vec<String> = resampled
        .points
        .iter()
        .filter(|point| point.beyond_least.is_some_and(|beyond| beyond.low <= 0.0))
        .map(|point| point.scale.to_string())
        .collect();
    let alike = match alike.as_slice() {
        [] => String::new(),
        alike => format!("; {} cannot be told apart from it by so many records", alike.join(", ")),
    };
    Some(format!(
        "{records} {} times the radius loses least on average, {:.1} basis points {per}{alike}. From record to record {} varies least, by {:.1}.",
        least.scale, least.lost.value, steadiest.scale, steadiest.deviation.value
    ))
}
