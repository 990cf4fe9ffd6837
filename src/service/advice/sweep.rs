//! The ranges that what-if questions sweep.

use serde::Deserialize;
use utoipa::ToSchema;

use crate::control::error::FieldError;

/// Number of points of a sweep; each waits for its own permit among the robust steps that requests cause.
pub const POINTS: std::ops::RangeInclusive<usize> = 2..=101;

/// The swept range, exactly one.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    pub wealth: Option<SweepRange>,
    pub holding: Option<SweepRange>,
    pub radius_scale: Option<SweepRange>,
    pub radius: Option<SweepRange>,
    pub log_return: Option<SweepRange>,
    pub simple_return: Option<SweepRange>,
    /// Noise of a declared problem's coming period.
    pub noise: Option<SweepRange>,
}

/// Evenly spaced values, including both ends.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepRange {
    #[schema(example = 0.0)]
    pub from: f64,
    #[schema(example = 2.0)]
    pub to: f64,
    /// 2 to 101.
    #[schema(example = 21)]
    pub points: usize,
}

impl SweepRange {
    /// Returns the values of the range, of the field with this name.
    ///
    /// # Errors
    /// It has too few or too many points.
    pub(super) fn values(&self, field: &str) -> Result<Vec<f64>, FieldError> {
        if !POINTS.contains(&self.points) {
            let rule = format!("must lie in [{}, {}]", POINTS.start(), POINTS.end());
            return Err(FieldError::new(format!("sweep.{field}.points"), self.points, rule));
        }
        Ok(evenly(self.from, self.to, self.points))
    }
}

/// Returns `points` evenly spaced values, at least two, with exact ends.
pub(super) fn evenly(from: f64, to: f64, points: usize) -> Vec<f64> {
    let last = points - 1;
    let at = |index| if index == last { to } else { from + (to - from) * index as f64 / last as f64 };
    (0..points).map(at).collect()
}
