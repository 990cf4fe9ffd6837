//! What is answered to a report and to a correction; kept with them, to be given again.

use jiff::civil::Date;
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use super::assets::{Composed, ObservedAssets};
use super::drift::Drift;
use crate::control::policy::advice::Uncertainty;
use crate::control::problem::actions::Band;

/// The session after an observation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Observed {
    pub session: String,
    pub period: usize,
    /// Null where it is missing.
    pub log_return: Option<f64>,
    /// The holdings that were best kept at the start of the period; where trading costs nothing both ends are the advised
    /// allocation.
    #[schema(value_type = [f64; 2])]
    pub band: Band,
    pub advised_allocation: f64,
    pub executed_allocation: f64,
    /// Wealth at the end of the period, with what was added to it.
    pub wealth: f64,
    /// Share of it in the risky asset, as the return left it.
    pub holding: f64,
    /// Of several assets, by their names: what is told beside is of their fund.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assets: Option<ObservedAssets>,
    /// Change of wealth by the period, what was added or reached otherwise included.
    pub wealth_change: f64,
    /// The last day of the period: as reported, else the next one due, or where that is not known of a period before.
    #[schema(value_type = Option<String>, format = Date)]
    pub date: Option<Date>,
    /// Whether the horizon is reached, and no policy is to follow.
    pub completed: bool,
    /// Whether the returns still come as they came.
    pub drift: Drift,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// The session after a correction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Corrected {
    pub session: String,
    pub correction: usize,
    /// The period put right, put in or taken out.
    pub period: usize,
    /// What it is now; null where it is missing or taken out.
    pub log_return: Option<f64>,
    /// Periods observed now.
    pub observed: usize,
    /// Wealth now.
    pub wealth: f64,
    /// Share of it in the risky asset.
    pub holding: f64,
    /// Of several assets, before the coming period.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assets: Option<Composed>,
    /// Change of wealth by the last period observed, as it stands now.
    pub wealth_change: f64,
    /// The last day of the last period, where it is known.
    #[schema(value_type = Option<String>, format = Date)]
    pub date: Option<Date>,
    /// Whether the returns, as they stand, come as they came.
    pub drift: Drift,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// Where a session stands, as far as every answer that moves it says so.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Stands {
    pub wealth: f64,
    pub holding: f64,
    pub wealth_change: f64,
    pub date: Option<Date>,
    pub drift: Drift,
    /// Standard deviation of the log-returns learned, where the moments tell it.
    #[serde(default, rename = "moments", deserialize_with = "deviation")]
    pub deviation: Option<f64>,
}

fn deviation<'a, D: Deserializer<'a>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    let moments = Vec::<f64>::deserialize(deserializer)?;
    let [mean, square, ..] = moments[..] else { return Ok(None) };
    Ok(Some((square - mean * mean).max(0.0).sqrt()))
}
