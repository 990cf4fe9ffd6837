//! The choices that a person makes about a text beforehand, or in answer to a question.

use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The kind of the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Gains over the wealth held: 0.012 if 100 became 101.2.
    Simple,
    /// Logarithms of the value that 1 grew to.
    Log,
    /// Prices or levels; each pair of them gives a return.
    Price,
    /// Value that 1 grows to in a period: 1.012 is a gain of 1.2 %.
    Gross,
    /// Gains since the start of the record; each pair of them gives a return.
    Cumulated,
}

/// The unit of returns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// 0.012 is 1.2 %.
    Fraction,
    /// 1.2 is 1.2 %.
    Percent,
}

/// The unit of the bank's rates, if a column holds them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum RateUnit {
    /// 0.002 is 0.2 % a period.
    Fraction,
    /// 0.2 is 0.2 % a period.
    Percent,
    /// The rates are not per period, and are left out.
    Unused,
}

/// Choices about a text. A choice that is left out is inferred from the text, or asked for.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema, Args)]
#[serde(deny_unknown_fields, default)]
pub struct Choices {
    /// A column of returns or prices, by its name or its number from 1; several columns are several assets
    #[arg(long = "column", id = "column")]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub columns: Vec<String>,
    /// The kind of the numbers
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<Kind>,
    /// The unit of returns
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// The unit of the bank's rates, if a column holds them
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_unit: Option<RateUnit>,
    /// If true, 01/02/2020 is the first of February; if false, the second of January
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub day_first: Option<bool>,
    /// If true, the first row is the newest; used only if no dates are understood
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub newest_first: Option<bool>,
    /// If true, a comma is the decimal mark
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decimal_comma: Option<bool>,
    /// If true, a comma separates numbers; if false, it is part of a number
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comma_parts: Option<bool>,
    /// If true, numbers in several columns are one record, read line by line
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub one_record: Option<bool>,
    /// If true, a record with missing periods is accepted as it is, without the rows that have no number
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaps: Option<bool>,
    /// If true, columns that begin later than others keep their own beginning; if false, the older rows of all are left out
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unequal: Option<bool>,
    /// If true, numbers that are unusual for an asset are right: a deviation above 30 % a period or 150 % a year, a
    /// mean above 100 % a year beyond chance, or a return far from all others
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unusual: Option<bool>,
    /// If true, the returns are in excess of the bank's, and the rates in its column are added
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excess: Option<bool>,
    /// Number of the latest returns to use; all of them by default
    #[arg(skip)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latest: Option<usize>,
}

impl Choices {
    /// Returns these choices combined with `more`, which wins if both make a choice.
    #[must_use]
    pub fn with(&self, more: &Choices) -> Choices {
        Choices {
            columns: if more.columns.is_empty() { self.columns.clone() } else { more.columns.clone() },
            kind: more.kind.or(self.kind),
            unit: more.unit.or(self.unit),
            rate_unit: more.rate_unit.or(self.rate_unit),
            day_first: more.day_first.or(self.day_first),
            newest_first: more.newest_first.or(self.newest_first),
            decimal_comma: more.decimal_comma.or(self.decimal_comma),
            comma_parts: more.comma_parts.or(self.comma_parts),
            one_record: more.one_record.or(self.one_record),
            gaps: more.gaps.or(self.gaps),
            unequal: more.unequal.or(self.unequal),
            unusual: more.unusual.or(self.unusual),
            excess: more.excess.or(self.excess),
            latest: more.latest.or(self.latest),
        }
    }
}

impl From<Kind> for Choices {
    fn from(kind: Kind) -> Self {
        Choices { kind: Some(kind), ..Choices::default() }
    }
}

impl From<Unit> for Choices {
    fn from(unit: Unit) -> Self {
        Choices { unit: Some(unit), ..Choices::default() }
    }
}
