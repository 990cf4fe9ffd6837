//! Strategies of a user's own, compared with policies: their shares of wealth, period by period or by a formula.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::{self, SeqAccess, Visitor, value::SeqAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::problem::own_formula::OwnFormula;

/// The most strategies of one's own.
pub const MOST: usize = 10;
/// Length of a name, in characters.
const NAME: std::ops::RangeInclusive<usize> = 1..=80;
/// Shares that exceed all of wealth by no more than this do so by rounding.
const ROUNDING: f64 = 1e-9;

/// Shares of a strategy: given for every period, or found by a formula.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
pub enum OwnShares<S> {
    /// For every period of the record.
    Given(Vec<S>),
    /// A formula over `last`, the return of the period before; `mean` and `deviation` of all periods before, or of the last N
    /// as in `mean12` and `deviation60`; `bank`, the rate that the bank paid last; and `n`, the number of returns before.
    /// Returns are simple. Operators and functions are those of declared problems.
    Formula(String),
}

/// Strategies of one asset by name.
pub type OwnWeights = BTreeMap<String, OwnShares<f64>>;
/// Strategies of several assets by name. The formula gives the share of each asset from its own returns; shares that add up
/// to more than 1 are divided by their sum.
pub type OwnAssetsWeights = BTreeMap<String, OwnShares<Vec<f64>>>;
/// Formulas by name, for simulated returns.
pub type OwnFormulas = BTreeMap<String, String>;

// By hand, because the errors of an untagged enum name no element of the list.
impl<'de, S: Deserialize<'de>> Deserialize<'de> for OwnShares<S> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(SharesVisitor(PhantomData))
    }
}

struct SharesVisitor<S>(PhantomData<S>);

impl<'de, S: Deserialize<'de>> Visitor<'de> for SharesVisitor<S> {
    type Value = OwnShares<S>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a list of shares or a formula")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Self::Value, E> {
        Ok(OwnShares::Formula(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(list)).map(OwnShares::Given)
    }
}

/// Checks the strategies of one asset over a record of `periods`.
///
/// # Errors
/// A name, a share or a formula that breaks a rule.
pub fn check_weights(weights: &OwnWeights, periods: usize) -> Result<(), FieldError> {
    check(weights, periods, |share| std::slice::from_ref(share), 1)
}

/// Checks the strategies of so many assets over a record of `periods`.
///
/// # Errors
/// A name, a share or a formula that breaks a rule.
pub fn check_assets_weights(weights: &OwnAssetsWeights, assets: usize, periods: usize) -> Result<(), FieldError> {
    check(weights, periods, Vec::as_slice, assets)
}

/// Reads the formulas of strategies by their names.
///
/// # Errors
/// A name or a formula that breaks a rule.
pub fn parsed(formulas: &OwnFormulas) -> Result<Vec<(String, OwnFormula)>, FieldError> {
    check_names(formulas.len(), formulas.keys())?;
    formulas.iter().map(|(name, text)| Ok((name.clone(), OwnFormula::parse(&field(name), text)?))).collect()
}

/// Returns the field of a strategy.
pub fn field(name: &str) -> String {
    format!("weights.{name}")
}

fn check_names<'a>(count: usize, names: impl Iterator<Item = &'a String>) -> Result<(), FieldError> {
    if count > MOST {
        let rule = format!("must have at most {MOST} strategies");
        return Err(FieldError::new("weights", format!("{count} strategies"), rule));
    }
    for name in names {
        if !NAME.contains(&name.chars().count()) || name.trim() != name {
            let rule = format!(
                "must have a name of {} to {} characters, without blanks at its ends",
                NAME.start(),
                NAME.end()
            );
            return Err(FieldError::new("weights", format!("{name:?}"), rule));
        }
    }
    Ok(())
}

fn check<S>(
    weights: &BTreeMap<String, OwnShares<S>>,
    periods: usize,
    row: impl Fn(&S) -> &[f64],
    assets: usize,
) -> Result<(), FieldError> {
    check_names(weights.len(), weights.keys())?;
    for (name, own) in weights {
        let field = field(name);
        let rows = match own {
            OwnShares::Given(rows) => rows,
            OwnShares::Formula(text) => {
                OwnFormula::parse(&field, text)?;
                continue;
            }
        };
        if rows.len() != periods {
            let rule = format!("must hold {periods} values, one for each period of the record, or be a formula");
            return Err(FieldError::new(field, format!("{} values", rows.len()), rule));
        }
        for (period, row) in rows.iter().map(&row).enumerate() {
            let at = || format!("{field}[{period}]");
            if row.len() != assets {
                let rule = format!("must have one share for each of the {assets} assets");
                return Err(FieldError::new(at(), format!("{} values", row.len()), rule));
            }
            let total: f64 = row.iter().sum();
            if row.iter().any(|share| *share < 0.0 || share.is_nan()) || total > 1.0 + ROUNDING {
                let rule = "must be shares of wealth from 0 to 1 that add up to at most 1; the rest is in the bank";
                return Err(FieldError::new(at(), format!("{row:?}"), rule));
            }
        }
    }
    Ok(())
}
