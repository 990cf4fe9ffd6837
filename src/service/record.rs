//! All observed returns of a session, date by date.

use crate::control::request::assets::DATES;
use crate::control::request::rules;

/// The returns of a period; `None` if they are missing.
#[derive(Debug, Clone, PartialEq)]
pub enum Seen {
    /// The log-return of one asset.
    One(Option<f64>),
    /// The log-returns of several assets.
    Several(Option<Vec<f64>>),
}

impl Seen {
    /// Returns the row of several assets if it is not missing.
    pub(super) fn row(&self) -> Option<&[f64]> {
        match self {
            Seen::Several(row) => row.as_deref(),
            Seen::One(_) => None,
        }
    }
}

/// Log-returns in the order observed; several assets date after date.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    assets: usize,
    values: Vec<f64>,
}

impl Record {
    /// Builds the record of so many assets, at least one.
    pub(super) fn new(assets: usize, values: Vec<f64>) -> Self {
        Record { assets, values }
    }

    /// Appends the returns of a period.
    pub(super) fn learn(&mut self, seen: &Seen) {
        match seen {
            Seen::One(log_return) => self.values.extend(log_return),
            Seen::Several(row) => self.values.extend(row.iter().flatten()),
        }
    }

    /// Returns the number of assets.
    pub(super) fn assets(&self) -> usize {
        self.assets
    }

    /// Returns every log-return.
    pub fn all(&self) -> &[f64] {
        &self.values
    }

    /// Returns those of the last `window` dates, at most as many as a history may hold.
    pub(super) fn last(&self, window: Option<usize>) -> &[f64] {
        let longest = if self.assets > 1 { DATES } else { rules::HISTORY_LENGTH };
        let most = window.unwrap_or(usize::MAX).min(*longest.end()) * self.assets;
        &self.values[self.values.len().saturating_sub(most)..]
    }

    /// Splits the values into one row for each date.
    pub(super) fn rows_of(&self, values: &[f64]) -> Vec<Vec<f64>> {
        values.chunks_exact(self.assets).map(<[f64]>::to_vec).collect()
    }
}
