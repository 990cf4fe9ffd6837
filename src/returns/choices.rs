//! What a person says of a text beforehand, or answers when asked.

use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What the numbers are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Gains over what was held: 0.012 of 100 that became 101.2.
    Simple,
    /// Logarithms of what 1 became.
    Log,
    /// Prices or levels, of which each pair gives a return.
    Price,
    /// What 1 becomes in a period: 1.012 is a gain of 1.2 %.
    Gross,
    /// Gains since the start of the record, of which each pair gives a return.
    Cumulated,
}

/// What returns are counted in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// 0.012 is 1.2 %.
    Fraction,
    /// 1.2 is 1.2 %.
    Percent,
}

/// What the rates of the bank are counted in, where a column tells them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum RateUnit {
    /// 0.002 is 0.2 % a period.
    Fraction,
    /// 0.2 is 0.2 % a period.
    Percent,
    /// They are rates of no period, and left out.
    Unused,
}

/// What is said of a text; what is left out follows from it, or is asked.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema, Args)]
#[serde(deny_unknown_fields, default)]
pub struct Choices {
    /// A column of returns or prices, by its name or its number from 1; several of them are several assets
    #[arg(long = "column", id = "column")]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub columns: Vec<String>,
    /// What the numbers are
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<Kind>,
    /// What returns are counted in
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// What the rates of the bank are counted in, where a column tells them
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_unit: Option<RateUnit>,
    /// Whether 01/02/2020 is the first of February, and not the second of January
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub day_first: Option<bool>,
    /// Whether the first row is the newest, where no dates tell
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub newest_first: Option<bool>,
    /// Whether a comma is the decimal mark
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decimal_comma: Option<bool>,
    /// Whether a comma parts numbers, and is not within them
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comma_parts: Option<bool>,
    /// Whether numbers in several columns are one record, line by line
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub one_record: Option<bool>,
    /// Whether a record from which periods are missing is taken as it is, without the rows that have no number
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaps: Option<bool>,
    /// Whether what is unusual of an asset is right: a deviation above 30 % a period or 150 % a year, a mean above 100 % a year
    /// beyond chance, or a return far from all others
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unusual: Option<bool>,
    /// Whether the returns are those beyond the bank, to which what its column says is added
    #[arg(long)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excess: Option<bool>,
    /// How many of the last returns count; all of them unless given
    #[arg(skip)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latest: Option<usize>,
}

impl Choices {
    /// These, and `more`, which counts where both say something.
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
