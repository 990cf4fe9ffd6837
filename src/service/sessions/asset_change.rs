//! The change of a session's assets at a renewal: assets enter with their record, others leave.
//!
//! The record keeps the dates on which every asset of the next policy has a return. Holdings, composition and known
//! prices of the assets that stay are kept. Money in an asset that leaves is sold before the coming period, which pays
//! for it.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::control::error::FieldError;
use crate::control::request::assets::MOST_ASSETS;
use crate::control::request::rules;
use crate::numerics::transport::water_filling::inverse_volatility;
use crate::service::entries::record::SessionRecord;
use crate::service::sessions::assets::Assets;
use crate::service::sessions::plan::Renew;

/// The assets of a session from a renewal on.
#[derive(Debug, Clone, PartialEq)]
pub struct AssetChange {
    /// The names, in the order of the next policy.
    pub names: Arc<[String]>,
    columns: Vec<ReturnSource>,
    /// Periods observed before it.
    observed: usize,
}

/// The source of an asset's returns up to the change.
#[derive(Debug, Clone, PartialEq)]
enum ReturnSource {
    /// The asset with this index before the change.
    Kept(usize),
    /// The record that it enters with: the last value is of the last observed period.
    Entering(Vec<Option<f64>>),
}

impl AssetChange {
    /// Returns the change from the assets `own` to those of a policy; `None` if the renewal changes none.
    ///
    /// # Errors
    /// An asset that enters has no record, one that leaves is not named, or another is.
    pub(in crate::service) fn new(
        (own, next): (&[String], &[String]),
        renew: &Renew,
        observed: usize,
    ) -> Result<Option<Self>, FieldError> {
        if renew.records.is_empty() && renew.leaving.is_empty() {
            return check_none_changes(own, next).map(|()| None);
        }
        if own.is_empty() || next.is_empty() {
            let field = if renew.records.is_empty() { "leaving" } else { "records" };
            return Err(FieldError::new(
                field,
                "given",
                "must be absent unless session and policy have several assets",
            ));
        }
        if renew.leaving.len() > MOST_ASSETS {
            let rule = format!("must name at most {MOST_ASSETS} assets");
            return Err(FieldError::new("leaving", format!("{} names", renew.leaving.len()), rule));
        }
        for (index, name) in renew.leaving.iter().enumerate() {
            if !own.contains(name) || next.contains(name) {
                let rule = "must name an asset of the session that the policy does not have";
                return Err(FieldError::new(format!("leaving[{index}]"), name, rule));
            }
        }
        if let Some(gone) = own.iter().find(|name| !next.contains(name) && !renew.leaving.contains(name)) {
            return Err(FieldError::new(
                "leaving",
                "given",
                format!("must name {gone}, which the policy does not have"),
            ));
        }
        for (name, record) in &renew.records {
            check_record(&format!("records.{name}"), record)?;
            if own.contains(name) || !next.contains(name) {
                let rule = "must be of an asset of the policy that the session does not have yet";
                return Err(FieldError::new(format!("records.{name}"), format!("{} values", record.len()), rule));
            }
        }
        let column = |name: &String| match (own.iter().position(|own| own == name), renew.records.get(name)) {
            (Some(index), _) => Ok(ReturnSource::Kept(index)),
            (None, Some(record)) => Ok(ReturnSource::Entering(record.clone())),
            (None, None) => {
                let rule = "must be given: the policy has the asset, and the session does not yet";
                Err(FieldError::new(format!("records.{name}"), "null", rule))
            }
        };
        let columns = next.iter().map(column).collect::<Result<_, FieldError>>()?;
        Ok(Some(AssetChange { names: next.into(), columns, observed }))
    }

    /// Returns the dates of `record` on which every asset has a return.
    pub(in crate::service) fn record(&self, record: &SessionRecord) -> SessionRecord {
        let mut changed = SessionRecord::of_assets(Vec::new(), vec![0; self.columns.len()]);
        for (date, row) in record.dated() {
            // Dates are numbers of periods, and 0 or less for the history.
            let ago = usize::try_from(self.observed as i64 - date).unwrap_or(usize::MAX);
            let of = |column: &ReturnSource| match column {
                ReturnSource::Kept(index) => Some(row[*index]).filter(|log_return| !log_return.is_nan()),
                ReturnSource::Entering(values) => *values.get(values.len().checked_sub(ago.checked_add(1)?)?)?,
            };
            let joint: Option<Vec<f64>> = self.columns.iter().map(of).collect();
            joint.into_iter().for_each(|row| changed.add(date, &row));
        }
        changed
    }

    /// Returns `assets` after the change, to be renewed with the returns `rows` of the changed record.
    pub(in crate::service) fn assets(&self, assets: &Assets, rows: &[Vec<f64>]) -> Assets {
        let index = |column: &ReturnSource| match column {
            ReturnSource::Kept(index) => Some(*index),
            ReturnSource::Entering(_) => None,
        };
        let mut changed = assets.clone();
        changed.names = self.names.clone();
        changed.prices =
            self.columns.iter().map(|column| index(column).and_then(|index| assets.prices[index])).collect();
        changed.waiting =
            self.columns.iter().map(|column| index(column).is_some_and(|index| assets.waiting[index])).collect();
        changed.fund.holdings = self.kept(&assets.fund.holdings);
        changed.fund.composition = self.shares(&assets.fund.composition).unwrap_or_else(|| inverse_volatility(rows));
        changed.fund.before = changed.fund.composition.clone();
        changed.one_step = None;
        for (name, held) in assets.names.iter().zip(&assets.fund.holdings) {
            if *held > 0.0 && !self.names.contains(name) {
                changed.leaving.insert(name.clone(), *held);
            }
        }
        changed
    }

    /// Returns the shares of the assets that stay, scaled to the sum 1; `None` if they are next to nothing.
    pub(in crate::service) fn shares(&self, shares: &[f64]) -> Option<Vec<f64>> {
        let kept: Vec<f64> = self.kept(shares);
        let whole: f64 = kept.iter().sum();
        (whole >= LEAST_KEPT).then(|| kept.iter().map(|share| share / whole).collect())
    }

    /// Returns the values of the assets from before the change, 0 for those that enter.
    pub(in crate::service) fn kept(&self, values: &[f64]) -> Vec<f64> {
        let of = |column: &ReturnSource| match column {
            ReturnSource::Kept(index) => values[*index],
            ReturnSource::Entering(_) => 0.0,
        };
        self.columns.iter().map(of).collect()
    }
}

/// A smaller part of a composition carries no information about its parts.
const LEAST_KEPT: f64 = 1e-4;

/// Checks that the policy has the assets of the session, in their order.
fn check_none_changes(own: &[String], next: &[String]) -> Result<(), FieldError> {
    if own == next {
        return Ok(());
    }
    let listed = |names: &[String]| if names.is_empty() { "one asset".to_owned() } else { names.join(", ") };
    let rule = match own.is_empty() || next.is_empty() {
        true => format!("must have the assets of the session, in the same order: {}", listed(own)),
        false => format!(
            "must have the assets of the session, in the same order ({}), unless records and leaving name those that enter and leave",
            listed(own)
        ),
    };
    Err(FieldError::new("policy", format!("a policy of {}", listed(next)), rule))
}

fn check_record(field: &str, record: &[Option<f64>]) -> Result<(), FieldError> {
    if !LENGTH.contains(&record.len()) {
        let rule = format!("must hold {} to {} log-returns", LENGTH.start(), LENGTH.end());
        return Err(FieldError::new(field, format!("{} values", record.len()), rule));
    }
    let given = record.iter().enumerate().filter_map(|(index, value)| value.map(|value| (index, value)));
    given.into_iter().try_for_each(|(index, value)| rules::log_return(&format!("{field}[{index}]"), value))
}

/// Allowed length of the record of an asset that enters: up to the longest history with every period since.
pub const LENGTH: std::ops::RangeInclusive<usize> = 2..=7_200;

/// The names of a session's assets, entry by entry; empty for one asset.
#[derive(Debug, Clone, Default)]
pub struct AssetNames {
    first: Arc<[String]>,
    /// The names from an entry on, in the order of entries.
    changed: BTreeMap<usize, Arc<[String]>>,
}

impl AssetNames {
    /// Returns the names of a session that starts with these.
    pub(in crate::service) fn from(first: &[String]) -> Self {
        AssetNames { first: first.into(), changed: BTreeMap::new() }
    }

    /// Adds the names from the renewal with this entry number on.
    pub(in crate::service) fn change(&mut self, entry: usize, names: Arc<[String]>) {
        self.changed.insert(entry, names);
    }

    /// Returns the names behind the entry with this number.
    pub(in crate::service) fn at(&self, entry: usize) -> &Arc<[String]> {
        self.changed.range(..=entry).next_back().map_or(&self.first, |(_, names)| names)
    }

    /// Returns the present names.
    pub(in crate::service) fn last(&self) -> &Arc<[String]> {
        self.at(usize::MAX)
    }
}
