//! All observed returns of a session, date by date.

use crate::control::request::assets::DATES;
use crate::control::request::rules;

/// The returns of a period; `None` if they are missing.
#[derive(Debug, Clone, PartialEq)]
pub enum PeriodReturns {
    /// The log-return of one asset.
    One(Option<f64>),
    /// The log-returns of several assets.
    Several(Option<Vec<f64>>),
}

impl PeriodReturns {
    /// Returns the row of several assets if it is not missing.
    pub(in crate::service) fn row(&self) -> Option<&[f64]> {
        match self {
            PeriodReturns::Several(row) => row.as_deref(),
            PeriodReturns::One(_) => None,
        }
    }

    /// Returns the log-return of one asset if it is not missing.
    pub(in crate::service) fn one(&self) -> Option<f64> {
        match self {
            PeriodReturns::One(log_return) => *log_return,
            PeriodReturns::Several(_) => None,
        }
    }
}

/// Log-returns in the order observed; several assets date after date.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionRecord {
    assets: usize,
    values: Vec<f64>,
}

impl SessionRecord {
    /// Builds the record of so many assets, at least one.
    pub(in crate::service) fn new(assets: usize, values: Vec<f64>) -> Self {
        SessionRecord { assets, values }
    }

    /// Appends the returns of a period.
    pub(in crate::service) fn learn(&mut self, seen: &PeriodReturns) {
        match seen {
            PeriodReturns::One(log_return) => self.values.extend(log_return),
            PeriodReturns::Several(row) => self.values.extend(row.iter().flatten()),
        }
    }

    /// Returns the number of assets.
    pub(in crate::service) fn assets(&self) -> usize {
        self.assets
    }

    /// Returns every log-return.
    pub fn all(&self) -> &[f64] {
        &self.values
    }

    /// Returns those of the last `window` dates, at most as many as a history may hold.
    pub(in crate::service) fn last(&self, window: Option<usize>) -> &[f64] {
        let longest = if self.assets > 1 { DATES } else { rules::HISTORY_LENGTH };
        let most = window.unwrap_or(usize::MAX).min(*longest.end()) * self.assets;
        &self.values[self.values.len().saturating_sub(most)..]
    }

    /// Splits the values into one row for each date.
    pub(in crate::service) fn rows_of(&self, values: &[f64]) -> Vec<Vec<f64>> {
        values.chunks_exact(self.assets).map(<[f64]>::to_vec).collect()
    }
}
