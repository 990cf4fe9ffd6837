//! Answers to observations and corrections. They are stored, so that a repeated request gets the same answer.

use std::collections::BTreeMap;

use jiff::civil::Date;
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use crate::control::policy::advice::{SpendingAdvice, Uncertainty};
use crate::control::problem::actions::Band;
use crate::service::entries::drift::{Drift, DriftLevel};
use crate::service::entries::notes::PeriodNote;
use crate::service::sessions::assets::{Composition, ObservedAssets};

/// The session after an observation: an investor's, or one of a declared problem.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum ObservationAnswer {
    Account(Box<Observed>),
    Declared(Box<DeclaredObserved>),
}

/// The session after a correction: an investor's, or one of a declared problem.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum CorrectionAnswer {
    Account(Box<Corrected>),
    Declared(Box<DeclaredCorrected>),
}

/// The part of an answer to an observation that has nothing to do with the problem.
pub(in crate::service) struct ReportedPeriod {
    pub session: String,
    pub period: usize,
    pub completed: bool,
    pub uncertainty: Uncertainty,
}

impl ObservationAnswer {
    /// Returns the radius of the law that learned the period, and the level of its drift.
    pub(super) fn radius_and_drift(&self) -> (f64, DriftLevel) {
        match self {
            ObservationAnswer::Account(answer) => (answer.uncertainty.radius, answer.drift.level),
            ObservationAnswer::Declared(answer) => (answer.uncertainty.radius, answer.drift.level),
        }
    }
}

/// The session of a declared problem after an observation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DeclaredObserved {
    pub session: String,
    pub period: usize,
    /// Null if it is missing.
    pub noise: Option<f64>,
    /// The actions advised for the period, by name. Null if none were: from the states before it an action that the solver
    /// tries may lead out of a range.
    pub advised: Option<BTreeMap<String, f64>>,
    /// The actions executed in it, by name.
    pub executed: BTreeMap<String, f64>,
    /// The reward of the period by the problem's formula; null if the noise is missing or the formula gives no number.
    pub reward: Option<f64>,
    /// Rewards since the start of the session, discounted to it.
    pub earned: f64,
    /// The states after the period, by name.
    pub state: BTreeMap<String, f64>,
    /// The last day of the period: the one reported, or else the next one due by the calendar. If that is unknown too,
    /// it is the last day known of an earlier period.
    #[schema(value_type = Option<String>, format = Date)]
    pub date: Option<Date>,
    /// True if the horizon is reached.
    pub completed: bool,
    /// The test of whether noises still come from the same law.
    pub drift: Drift,
    /// In the unit of the noise.
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// The session of a declared problem after a correction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DeclaredCorrected {
    pub session: String,
    pub correction: usize,
    /// The period corrected, inserted or removed.
    pub period: usize,
    /// Its noise now; null if it is missing or removed.
    pub noise: Option<f64>,
    /// Periods observed now.
    pub observed: usize,
    /// Rewards since the start of the session, discounted to it.
    pub earned: f64,
    /// The states now, by name.
    pub state: BTreeMap<String, f64>,
    /// The last day of the last period, if it is known.
    #[schema(value_type = Option<String>, format = Date)]
    pub date: Option<Date>,
    /// The test of whether the corrected noises still come from the same law.
    pub drift: Drift,
    /// In the unit of the noise.
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// The session of an investor after an observation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Observed {
    pub session: String,
    pub period: usize,
    /// Null if it is missing, or after a total loss, which `notes` says.
    pub log_return: Option<f64>,
    /// Notes on the period: losses that the law does not learn in full, and prices that did not come.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<PeriodNote>,
    /// The holdings that are best kept at the start of the period. If trading costs nothing, both ends are the advised
    /// allocation.
    #[schema(value_type = [f64; 2])]
    pub band: Band,
    pub advised_allocation: f64,
    pub executed_allocation: f64,
    /// Spending that was advised for the start of the period, if the policy has any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub advised_spending: Option<SpendingAdvice>,
    /// Money spent at the start of the period; left out if it is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spent: Option<f64>,
    /// Wealth at the end of the period, including what was added to it.
    pub wealth: f64,
    /// Share of wealth in the risky asset after the return.
    pub holding: f64,
    /// Figures of several assets by name. The figures beside it are then those of their fund.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assets: Option<ObservedAssets>,
    /// Change of wealth over the period, including flows and wealth reported otherwise.
    pub wealth_change: f64,
    /// The last day of the period: the one reported, or else the next one due by the calendar. If that is unknown too,
    /// it is the last day known of an earlier period.
    #[schema(value_type = Option<String>, format = Date)]
    pub date: Option<Date>,
    /// True if the horizon is reached and no policy is to follow.
    pub completed: bool,
    /// The test of whether returns still come from the same law.
    pub drift: Drift,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// The session of an investor after a correction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Corrected {
    pub session: String,
    pub correction: usize,
    /// The period corrected, inserted or removed.
    pub period: usize,
    /// Its log-return now; null if it is missing, removed or a total loss.
    pub log_return: Option<f64>,
    /// Periods observed now.
    pub observed: usize,
    /// Wealth now.
    pub wealth: f64,
    /// Share of wealth in the risky asset.
    pub holding: f64,
    /// Figures of several assets before the coming period.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assets: Option<Composition>,
    /// Change of wealth over the last observed period, after the correction.
    pub wealth_change: f64,
    /// The last day of the last period, if it is known.
    #[schema(value_type = Option<String>, format = Date)]
    pub date: Option<Date>,
    /// The test of whether the corrected returns still come from the same law.
    pub drift: Drift,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// The state of a session, as far as every answer that changes it reports it. A declared problem has no wealth.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct StateSummary {
    /// The period that was reported or corrected.
    period: usize,
    /// Periods observed, after a correction.
    observed: Option<usize>,
    log_return: Option<f64>,
    assets: Option<AssetReturns>,
    pub wealth: Option<f64>,
    pub holding: Option<f64>,
    pub wealth_change: Option<f64>,
    pub date: Option<Date>,
    pub drift: Drift,
    /// Standard deviation of the log-returns in the law, if the moments determine it.
    #[serde(default, rename = "moments", deserialize_with = "deviation")]
    pub deviation: Option<f64>,
}

/// The returns of several assets in an answer to a report.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct AssetReturns {
    log_returns: Option<BTreeMap<String, Option<f64>>>,
}

impl StateSummary {
    /// Returns the log-return of the last period, unless the last answer is to a correction of an earlier one. That of
    /// several assets is the return of their fund.
    pub fn last_return(&self) -> Option<f64> {
        self.log_return.filter(|_| self.observed.is_none_or(|observed| observed == self.period))
    }

    /// Returns the log-returns of several assets in the last period, unless the last answer is to a correction.
    pub fn last_returns(&self) -> Option<&BTreeMap<String, Option<f64>>> {
        self.assets.as_ref()?.log_returns.as_ref()
    }
}

fn deviation<'a, D: Deserializer<'a>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    let moments = Vec::<f64>::deserialize(deserializer)?;
    let [mean, square, ..] = moments[..] else { return Ok(None) };
    Ok(Some((square - mean * mean).max(0.0).sqrt()))
}
