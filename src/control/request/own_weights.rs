//! Strategies of a user's own, compared in a walk-forward: their shares of wealth, period by period.

use std::collections::BTreeMap;

use crate::control::error::FieldError;

/// The most strategies of one's own.
pub const MOST: usize = 10;
/// Length of a name, in characters.
const NAME: std::ops::RangeInclusive<usize> = 1..=80;
/// Shares that exceed all of wealth by no more than this do so by rounding.
const ROUNDING: f64 = 1e-9;

/// Shares of one asset by strategy, one for each period of the record.
pub type OwnWeights = BTreeMap<String, Vec<f64>>;
/// Shares of several assets by strategy, date by date.
pub type OwnAssetsWeights = BTreeMap<String, Vec<Vec<f64>>>;

/// Checks the shares of strategies of one asset over a record of `periods`.
///
/// # Errors
/// A name or a share that breaks a rule.
pub fn check_weights(weights: &OwnWeights, periods: usize) -> Result<(), FieldError> {
    check(weights.iter().map(|(name, shares)| (name, shares.chunks(1).collect())), 1, periods)
}

/// Checks the shares of strategies of so many assets over a record of `periods`.
///
/// # Errors
/// A name or a share that breaks a rule.
pub fn check_assets_weights(weights: &OwnAssetsWeights, assets: usize, periods: usize) -> Result<(), FieldError> {
    check(weights.iter().map(|(name, rows)| (name, rows.iter().map(Vec::as_slice).collect())), assets, periods)
}

fn check<'a>(
    weights: impl ExactSizeIterator<Item = (&'a String, Vec<&'a [f64]>)>,
    assets: usize,
    periods: usize,
) -> Result<(), FieldError> {
    if weights.len() > MOST {
        let rule = format!("must have at most {MOST} strategies");
        return Err(FieldError::new("weights", format!("{} strategies", weights.len()), rule));
    }
    for (name, rows) in weights {
        let field = format!("weights.{name}");
        if !NAME.contains(&name.chars().count()) || name.trim() != name {
            let rule = format!(
                "must have a name of {} to {} characters, without blanks at its ends",
                NAME.start(),
                NAME.end()
            );
            return Err(FieldError::new("weights", format!("{name:?}"), rule));
        }
        if rows.len() != periods {
            let rule = format!("must hold {periods} values, one for each period of the record");
            return Err(FieldError::new(field, format!("{} values", rows.len()), rule));
        }
        for (period, row) in rows.into_iter().enumerate() {
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
