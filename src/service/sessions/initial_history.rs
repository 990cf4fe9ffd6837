//! The returns that a session starts from.

use std::fmt;

use serde::de::{Error, SeqAccess, Visitor, value::SeqAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

/// Log-returns known at the start of a session, oldest first.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
pub enum InitialHistory {
    /// Returns of one asset.
    One(Vec<f64>),
    /// Rows of several assets, one row a date; each row has one number for each asset.
    Several(Vec<Vec<f64>>),
}

impl InitialHistory {
    /// Builds the history of one asset, or of so many from values date after date.
    pub(in crate::service) fn of(values: Vec<f64>, assets: Option<usize>) -> Self {
        match assets {
            None => InitialHistory::One(values),
            Some(assets) => InitialHistory::Several(values.chunks_exact(assets).map(<[f64]>::to_vec).collect()),
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
        let of = |date: Date| match date {
            Date::Number(value) => vec![value],
            Date::Row(values) => values,
        };
        let read: Vec<Vec<f64>> = dates.into_iter().map(of).collect();
        Ok(if rows > 0 { InitialHistory::Several(read) } else { InitialHistory::One(read.concat()) })
    }
}

/// The log-returns of a date.
enum Date {
    Number(f64),
    Row(Vec<f64>),
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
                Vec::<f64>::deserialize(SeqAccessDeserializer::new(row)).map(Date::Row)
            }
        }

        deserializer.deserialize_any(HistoryVisitor)
    }
}
