//! All that was observed of the noise of a session, date by date.

use std::borrow::Cow;

use crate::control::problem::state::LEAST_LEARNED;
use crate::control::request::asset_history::AssetHistory;
use crate::control::request::assets::DATES;
use crate::control::request::rules;
use crate::service::sessions::initial_history::InitialHistory;

/// The noise of a period: the log-returns of the assets, or the one noise of a declared problem in the unit of the
/// solver.
#[derive(Debug, Clone, PartialEq)]
pub struct PeriodNoise {
    /// In the order of the assets: minus infinity after a total loss, and `None` if it is missing.
    pub values: Vec<Option<f64>>,
    /// Indices of the assets whose return also covers earlier periods, in which their price did not come.
    pub late: Vec<usize>,
}

impl PeriodNoise {
    /// Returns the noise of one series.
    pub(in crate::service) fn of(value: Option<f64>) -> Self {
        PeriodNoise { values: vec![value], late: Vec::new() }
    }

    /// Returns whether every value is missing.
    pub(in crate::service) fn is_missing(&self) -> bool {
        self.values.iter().all(Option::is_none)
    }

    /// Returns the log-returns that move wealth: an asset without a return counts as unmoved.
    pub(in crate::service) fn moves(&self) -> Vec<f64> {
        self.values.iter().map(|log_return| log_return.unwrap_or(0.0)).collect()
    }

    /// Returns the row that a law learns. `None` if there is no return of every asset over this period alone.
    pub(in crate::service) fn learned(&self) -> Option<Vec<f64>> {
        let row: Option<Vec<f64>> = self.values.iter().copied().collect();
        row.filter(|_| self.late.is_empty()).map(|row| row.into_iter().map(|z| z.max(LEAST_LEARNED)).collect())
    }
}

/// The noises that a law learned, in the order observed; several assets date after date.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionRecord {
    assets: usize,
    values: Vec<f64>,
    /// The number of dates before each asset's first return, whose values were filled in.
    missing: Vec<usize>,
    /// The period of each date; 0 for the last date of the initial history, -1 for the one before, and so on.
    dates: Vec<i64>,
}

impl SessionRecord {
    /// Builds the record of one asset or another noise from an initial history.
    pub(in crate::service) fn new(values: Vec<f64>) -> Self {
        SessionRecord::of_assets(values, vec![0])
    }

    /// Builds the record of several assets from an initial history, date after date, with the number of dates before the
    /// first return of each.
    pub(in crate::service) fn of_assets(values: Vec<f64>, missing: Vec<usize>) -> Self {
        let dates = values.len() / missing.len();
        SessionRecord { assets: missing.len(), values, missing, dates: (1 - dates as i64..=0).collect() }
    }

    /// Appends the returns of a period, if there is one of every asset.
    pub(in crate::service) fn learn(&mut self, period: usize, seen: &PeriodNoise) {
        if let Some(row) = seen.learned() {
            self.add(period as i64, &row);
        }
    }

    /// Appends the row of a date.
    pub(in crate::service) fn add(&mut self, date: i64, row: &[f64]) {
        self.values.extend(row);
        self.dates.push(date);
    }

    /// Returns each date with its returns, NaN before an asset's first one.
    pub(in crate::service) fn dated(&self) -> impl Iterator<Item = (i64, Vec<f64>)> {
        self.dates.iter().copied().zip(self.returns().as_given())
    }

    /// Returns the number of assets.
    pub(in crate::service) fn assets(&self) -> usize {
        self.assets
    }

    /// Returns every log-return.
    pub fn all(&self) -> &[f64] {
        &self.values
    }

    /// Returns those of the last `window` dates, at most as many as a history may hold, NaN before an asset's first one.
    pub(in crate::service) fn last(&self, window: Option<usize>) -> Cow<'_, [f64]> {
        let longest = if self.assets > 1 { DATES } else { rules::HISTORY_LENGTH };
        let first = self.dates.len().saturating_sub(window.unwrap_or(usize::MAX).min(*longest.end()));
        if self.missing.iter().all(|missing| *missing <= first) {
            return self.values[first * self.assets..].into();
        }
        self.returns().as_given()[first..].concat().into()
    }

    /// Returns all returns of several assets.
    pub(in crate::service) fn returns(&self) -> AssetHistory {
        AssetHistory::filled(self.rows_of(&self.values), self.missing.clone())
    }

    /// Returns those of the last `window` dates of several assets, as if they were the whole record.
    pub(in crate::service) fn last_returns(&self, window: Option<usize>) -> AssetHistory {
        AssetHistory::marked(self.rows_of(&self.last(window)))
    }

    /// Returns all returns as answers show them.
    pub(in crate::service) fn shown(&self) -> InitialHistory {
        match self.assets {
            1 => InitialHistory::One(self.values.clone()),
            _ => InitialHistory::Several(self.returns()),
        }
    }

    fn rows_of(&self, values: &[f64]) -> Vec<Vec<f64>> {
        values.chunks_exact(self.assets).map(<[f64]>::to_vec).collect()
    }
}
