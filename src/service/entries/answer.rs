//! Answers to observations and corrections. They are stored, so that a repeated request gets the same answer.

use jiff::civil::Date;
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use crate::control::policy::advice::Uncertainty;
use crate::control::problem::actions::Band;
use crate::service::entries::drift::Drift;
use crate::service::entries::notes::PeriodNote;
use crate::service::sessions::assets::{Composition, ObservedAssets};

/// The session after an observation.
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
    /// Wealth at the end of the period, including what was added to it.
    pub wealth: f64,
    /// Share of wealth in the risky asset after the return.
    pub holding: f64,
    /// Figures of several assets by name. The figures beside it are then those of their fund.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assets: Option<ObservedAssets>,
    /// Change of wealth over the period, including flows and wealth reported otherwise.
    pub wealth_change: f64,
    /// The last day of the period: as reported, else the next one due. If that is unknown, the day of an earlier
    /// period.
    #[schema(value_type = Option<String>, format = Date)]
    pub date: Option<Date>,
    /// True if the horizon is reached and no policy is to follow.
    pub completed: bool,
    /// The test of whether returns still come from the same law.
    pub drift: Drift,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// The session after a correction.
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

/// The state of a session, as far as every answer that changes it reports it.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct StateSummary {
    pub wealth: f64,
    pub holding: f64,
    pub wealth_change: f64,
    pub date: Option<Date>,
    pub drift: Drift,
    /// Standard deviation of the log-returns in the law, if the moments determine it.
    #[serde(default, rename = "moments", deserialize_with = "deviation")]
    pub deviation: Option<f64>,
}

fn deviation<'a, D: Deserializer<'a>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    let moments = Vec::<f64>::deserialize(deserializer)?;
    let [mean, square, ..] = moments[..] else { return Ok(None) };
    Ok(Some((square - mean * mean).max(0.0).sqrt()))
}
