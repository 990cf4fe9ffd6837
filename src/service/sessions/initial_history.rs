//! The returns that a session starts from.

use std::fmt;

use serde::de::{Error, SeqAccess, Visitor, value::SeqAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use crate::control::request::asset_history::AssetHistory;

/// Log-returns known at the start of a session, oldest first.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
pub enum InitialHistory {
    /// Returns of one asset.
    One(Vec<f64>),
    /// Rows of several assets, one row a date; each row has one number for each asset, null before its first return.
    #[schema(value_type = Vec<Vec<Option<f64>>>)]
    Several(AssetHistory),
}

impl InitialHistory {
    /// Builds the history of one asset, or of several from values date after date and the number of dates before the first
    /// return of each.
    pub(in crate::service) fn of(values: Vec<f64>, missing: Option<Vec<usize>>) -> Self {
        match missing {
            None => InitialHistory::One(values),
            Some(missing) => {
                let rows = values.chunks_exact(missing.len()).map(<[f64]>::to_vec).collect();
                InitialHistory::Several(AssetHistory::filled(rows, missing))
            }
        }
    }

    /// Returns the values of one asset, or of several date after date.
    pub(in crate::service) fn values(self) -> Vec<f64> {
        match self {
            InitialHistory::One(values) => values,
            InitialHistory::Several(rows) => rows.concat(),
        }
    }
}

/// Reads number by number or row by row, so that an error names its position.
impl<'de> Deserialize<'de> for InitialHistory {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let dates = Vec::<Date>::deserialize(deserializer)?;
        let rows = dates.iter().filter(|date| matches!(date, Date::Row(_))).count();
        if rows > 0 && rows < dates.len() {
            return Err(D::Error::custom("must be numbers or rows of numbers, not both"));
        }
        let row = |date: &Date| match date {
            Date::Number(_) => None,
            Date::Row(values) => Some(values.clone()),
        };
        let number = |date: &Date| match date {
            Date::Number(value) => Some(*value),
            Date::Row(_) => None,
        };
        Ok(match rows {
            0 => InitialHistory::One(dates.iter().filter_map(number).collect()),
            _ => InitialHistory::Several(AssetHistory::new(&dates.iter().filter_map(row).collect::<Vec<_>>())),
        })
    }
}

/// The log-returns of a date.
enum Date {
    Number(f64),
    Row(Vec<Option<f64>>),
}

impl<'de> Deserialize<'de> for Date {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct HistoryVisitor;

        impl<'de> Visitor<'de> for HistoryVisitor {
            type Value = Date;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("f64, or a row of them")
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Date, E> {
                Ok(Date::Number(value))
            }

            fn visit_u64<E: Error>(self, value: u64) -> Result<Date, E> {
                Ok(Date::Number(value as f64))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Date, E> {
                Ok(Date::Number(value as f64))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, row: A) -> Result<Date, A::Error> {
                Vec::<Option<f64>>::deserialize(SeqAccessDeserializer::new(row)).map(Date::Row)
            }
        }

        deserializer.deserialize_any(HistoryVisitor)
    }
}
