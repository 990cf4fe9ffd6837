//! Returns of several assets, whose records may begin at different dates.

use std::ops::{Deref, Range};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::control::error::FieldError;
use crate::numerics::statistics::unequal_records::{fill, least_returns, longer_records};

/// Largest absolute log-return of one period. Wealth then changes by a factor of at most 148.
pub const LARGEST_LOG_RETURN: f64 = 5.0;

/// Log-returns by date, oldest first, with one value for each asset. Before an asset's first return its values follow from
/// the assets with longer records (`numerics/statistics/unequal_records.rs`). In requests and documents they are null.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AssetHistory {
    rows: Vec<Vec<f64>>,
    /// The number of dates before each asset's first return.
    missing: Vec<usize>,
}

impl AssetHistory {
    /// Takes returns as given, null before an asset's first one. If they do not suffice to fill these, they stay NaN, which
    /// [`Self::check`] refuses.
    pub fn new(given: &[Vec<Option<f64>>]) -> Self {
        AssetHistory::marked(given.iter().map(|row| row.iter().map(|z| z.unwrap_or(f64::NAN)).collect()).collect())
    }

    /// Takes returns as given, NaN before an asset's first one.
    pub fn marked(rows: Vec<Vec<f64>>) -> Self {
        let width = rows.iter().map(Vec::len).min().unwrap_or(0);
        let first = |asset: usize| rows.iter().position(|row| !row[asset].is_nan()).unwrap_or(rows.len());
        let missing = (0..width).map(first).collect();
        let mut returns = AssetHistory { rows, missing };
        if returns.check("history", &[]).is_ok() {
            fill(&mut returns.rows, &returns.missing, (-LARGEST_LOG_RETURN, LARGEST_LOG_RETURN));
        }
        returns
    }

    /// Takes values that were filled before.
    pub fn filled(rows: Vec<Vec<f64>>, missing: Vec<usize>) -> Self {
        AssetHistory { rows, missing }
    }

    /// Returns the number of dates before each asset's first return.
    pub fn missing(&self) -> &[usize] {
        &self.missing
    }

    /// Returns true if every asset has a return on every date.
    pub fn are_equal(&self) -> bool {
        self.missing.iter().all(|missing| *missing == 0)
    }

    /// Returns `sqrt(n_i / n)` for each asset, with n_i of the n returns its own: how well its law is known beside that of
    /// a whole record.
    pub fn evidence(&self) -> Vec<f64> {
        let dates = self.rows.len();
        self.missing.iter().map(|missing| ((dates - missing) as f64 / dates as f64).sqrt()).collect()
    }

    /// Returns the returns as given, NaN before an asset's first one.
    pub fn as_given(&self) -> Vec<Vec<f64>> {
        let of = |(date, row): (usize, &Vec<f64>)| {
            let own = row.iter().zip(&self.missing);
            own.map(|(value, missing)| if date < *missing { f64::NAN } else { *value }).collect()
        };
        self.rows.iter().enumerate().map(of).collect()
    }

    /// Returns the returns of some dates, as if those were the whole record.
    pub fn of(&self, dates: Range<usize>) -> Self {
        if self.are_equal() {
            return AssetHistory { rows: self.rows[dates].to_vec(), missing: self.missing.clone() };
        }
        AssetHistory::marked(self.as_given()[dates].to_vec())
    }

    /// Appends the returns of a date.
    pub fn push(&mut self, row: Vec<f64>) {
        self.missing.resize(row.len(), 0);
        self.rows.push(row);
    }

    /// Checks that nulls only stand before an asset's first return, that one asset has a return on the first date, and that
    /// each has enough. `named` is the field; the assets may have `names`.
    ///
    /// # Errors
    /// The first that breaks a rule.
    pub fn check(&self, named: &str, names: &[String]) -> Result<(), FieldError> {
        if self.are_equal() && self.rows.iter().flatten().all(|value| !value.is_nan()) {
            return Ok(());
        }
        let dates = self.rows.len();
        for (date, row) in self.rows.iter().enumerate() {
            for (asset, missing) in self.missing.iter().enumerate() {
                if row[asset].is_nan() && date >= *missing {
                    let rule = "must be a number: null may stand only before an asset's first return";
                    return Err(FieldError::new(format!("{named}[{date}][{asset}]"), "null", rule));
                }
            }
        }
        if !self.missing.contains(&0) {
            let rule = "must have a return of at least one asset on the first date";
            return Err(FieldError::new(format!("{named}[0]"), "null for every asset", rule));
        }
        for ((asset, missing), older) in self.missing.iter().enumerate().zip(longer_records(&self.missing)) {
            let (own, least) = (dates.saturating_sub(*missing), least_returns(older));
            if *missing > 0 && own < least {
                let name = names.get(asset).map_or_else(|| format!("asset {}", asset + 1), Clone::clone);
                let rule = format!(
                    "must have at least {least} returns of {name}, because {older} assets have longer records: at least \
                     12, and 3 for each of those"
                );
                return Err(FieldError::new(named, format!("{own} returns of {name}"), rule));
            }
        }
        Ok(())
    }
}

impl Deref for AssetHistory {
    type Target = [Vec<f64>];

    fn deref(&self) -> &Self::Target {
        &self.rows
    }
}

impl From<Vec<Vec<f64>>> for AssetHistory {
    fn from(rows: Vec<Vec<f64>>) -> Self {
        let missing = vec![0; rows.first().map_or(0, Vec::len)];
        AssetHistory { rows, missing }
    }
}

impl Serialize for AssetHistory {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.are_equal() {
            return self.rows.serialize(serializer);
        }
        let given = self.as_given();
        serializer.collect_seq(
            given.iter().map(|row| row.iter().map(|z| Some(*z).filter(|z| !z.is_nan())).collect::<Vec<_>>()),
        )
    }
}

impl<'de> Deserialize<'de> for AssetHistory {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let given: Vec<Vec<Option<f64>>> = Deserialize::deserialize(deserializer)?;
        Ok(AssetHistory::new(&given))
    }
}
