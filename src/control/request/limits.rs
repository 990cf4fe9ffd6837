//! Limits on the composition of a fund of several assets: on the share of each asset, on the sum of the shares of a group,
//! and on the turnover of a period.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::bounds::{Bounded, FieldBounds, ValueBounds, within};
use super::by_name::distinct;
use super::text::check_text;
use crate::control::error::FieldError;
use crate::control::problem::compositions::{CompositionSet, GroupRange};

/// Allowed number of characters in the name of an asset or a group.
const NAME_LENGTH: std::ops::RangeInclusive<usize> = 1..=100;
/// Largest number of assets of a group.
const MOST_MEMBERS: usize = 30;
/// Largest number of groups.
pub const MOST_GROUPS: usize = 30;
/// The largest turnover: everything is sold and bought anew.
pub const MOST_TURNOVER: f64 = 2.0;
/// Sums of shares that differ by no more are equal.
const ROUNDING: f64 = 1e-9;

/// Limits on the composition: shares of the risky holdings, which sum to 1. A greatest share then holds for shares of
/// wealth too. The share in all assets together is limited by `action_interval`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WeightLimits {
    /// The least and the greatest share of every asset that `assets` does not name. Default: 0 and 1.
    #[serde(default, skip_serializing_if = "ShareRange::is_any")]
    pub each: ShareRange,
    /// The least and the greatest share of an asset, by its name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "distinct")]
    #[schema(value_type = std::collections::HashMap<String, ShareRange>)]
    pub assets: BTreeMap<String, ShareRange>,
    /// Groups of assets with limits on the sums of their shares, at most 30. Groups may overlap.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<GroupLimit>,
    /// Limit on the turnover of a period, 0 to 2: the sum over the assets of the changes of shares of the risky holdings,
    /// from those held before trading. If the other limits need a larger turnover, the smallest one that they allow is
    /// made. Nothing is limited if nothing is held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_turnover: Option<f64>,
}

/// The least and the greatest share of an asset in the risky holdings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ShareRange {
    /// The least share, 0 to 1. Default 0.
    #[serde(default)]
    pub min: f64,
    /// The greatest share, 0 to 1. Default 1.
    #[serde(default = "whole")]
    pub max: f64,
}

/// A group of assets, and the least and the greatest sum of their shares in the risky holdings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GroupLimit {
    /// Name of the group; all differ.
    pub name: String,
    /// Names of its assets, all different.
    pub assets: Vec<String>,
    /// The least sum, 0 to 1. Default 0.
    #[serde(default)]
    pub min: f64,
    /// The greatest sum, 0 to 1. Default 1.
    #[serde(default = "whole")]
    pub max: f64,
}

fn whole() -> f64 {
    1.0
}

impl Default for ShareRange {
    fn default() -> Self {
        ShareRange { min: 0.0, max: 1.0 }
    }
}

impl ShareRange {
    fn is_any(&self) -> bool {
        *self == Self::default()
    }
}

const SHARES: ValueBounds = ValueBounds::Number(0.0, 1.0);
const GROUPS: ValueBounds = ValueBounds::List(0, MOST_GROUPS, &ValueBounds::Any);
const MEMBERS: ValueBounds = ValueBounds::Set(1, MOST_MEMBERS, &ValueBounds::text(&NAME_LENGTH));

impl Bounded for WeightLimits {
    const BOUNDS: &'static [FieldBounds] =
        &[("groups", GROUPS), ("max_turnover", ValueBounds::Number(0.0, MOST_TURNOVER))];
}

impl Bounded for ShareRange {
    const BOUNDS: &'static [FieldBounds] = &[("min", SHARES), ("max", SHARES)];
}

impl Bounded for GroupLimit {
    const BOUNDS: &'static [FieldBounds] =
        &[("name", ValueBounds::text(&NAME_LENGTH)), ("assets", MEMBERS), ("min", SHARES), ("max", SHARES)];
}

impl WeightLimits {
    /// Returns the compositions of `assets` that these limits allow before a period, from `holdings`, which are shares
    /// of wealth. Checked limits name no other assets.
    pub fn compositions(&self, assets: &[String], holdings: &[f64]) -> CompositionSet {
        let set = self.without_turnover(assets, self.groups.len());
        match self.max_turnover {
            Some(most) => set.within_turnover(holdings, most),
            None => set,
        }
    }

    /// Returns the composition of `assets` within the limits on shares that is nearest to this one.
    pub fn nearest(&self, assets: &[String], composition: Vec<f64>) -> Vec<f64> {
        self.without_turnover(assets, self.groups.len()).nearest(composition)
    }

    fn range(&self, asset: &String) -> ShareRange {
        self.assets.get(asset).copied().unwrap_or(self.each)
    }

    /// Returns the compositions that the limits of assets and of the first groups allow.
    fn without_turnover(&self, assets: &[String], groups: usize) -> CompositionSet {
        let range = |asset: &String| {
            let ShareRange { min, max } = self.range(asset);
            [min, max]
        };
        let group = |group: &GroupLimit| GroupRange {
            members: (0..assets.len()).filter(|place| group.assets.contains(&assets[*place])).collect(),
            least: group.min,
            most: group.max,
        };
        CompositionSet::new(assets.iter().map(range).collect(), self.groups[..groups].iter().map(group).collect())
    }

    /// Checks the limits in the field `named` of a problem with these `assets`.
    ///
    /// # Errors
    /// The first field that breaks a rule, or that no composition keeps together with those before it.
    pub fn check(&self, named: &str, assets: &[String]) -> Result<(), FieldError> {
        check_range(&format!("{named}.each"), self.each)?;
        for (name, range) in &self.assets {
            let field = format!("{named}.assets.{name}");
            check_known(&field, name, assets)?;
            check_range(&field, *range)?;
        }
        self.check_sums(named, assets)?;
        if self.groups.len() > MOST_GROUPS {
            let rule = format!("must be at most {MOST_GROUPS} groups");
            return Err(FieldError::new(format!("{named}.groups"), format!("{} groups", self.groups.len()), rule));
        }
        let mut seen = BTreeSet::new();
        for (index, group) in self.groups.iter().enumerate() {
            let field = format!("{named}.groups[{index}]");
            group.check(&field, assets)?;
            if !seen.insert(&group.name) {
                return Err(FieldError::new(format!("{field}.name"), &group.name, "must differ from the other names"));
            }
            self.check_group(&field, index, assets)?;
        }
        self.max_turnover.map_or(Ok(()), |most| within(&format!("{named}.max_turnover"), most, 0.0, MOST_TURNOVER))
    }

    /// Checks that shares within the limits of single assets can sum to 1.
    fn check_sums(&self, named: &str, assets: &[String]) -> Result<(), FieldError> {
        let sum = |of: fn(ShareRange) -> f64| assets.iter().map(|asset| of(self.range(asset))).sum::<f64>();
        let (least, most) = (sum(|range| range.min), sum(|range| range.max));
        if least > 1.0 + ROUNDING {
            let rule = "must be at most 1: the shares of the composition sum to 1";
            return Err(FieldError::new(format!("{named}.assets"), format!("least shares that sum to {least}"), rule));
        }
        if most < 1.0 - ROUNDING {
            let rule = "must be at least 1: the shares of the composition sum to 1";
            return Err(FieldError::new(
                format!("{named}.assets"),
                format!("greatest shares that sum to {most}"),
                rule,
            ));
        }
        Ok(())
    }

    /// Checks that a group's limits can be kept together with those of the assets and of the groups before it.
    fn check_group(&self, field: &str, index: usize, assets: &[String]) -> Result<(), FieldError> {
        let GroupLimit { name, assets: members, min, max } = &self.groups[index];
        let places: Vec<usize> = (0..assets.len()).filter(|place| members.contains(&assets[*place])).collect();
        let [least, most] = self.without_turnover(assets, index).range_of(&places);
        let others = if index > 0 { "of the assets and of the groups before it" } else { "of the assets" };
        // In the digits that somebody types.
        let shown = |sum: f64| (sum * 1e6).round() / 1e6;
        if *min > most + ROUNDING {
            let rule =
                format!("must be at most {} for the group {name}: the limits {others} allow no more", shown(most));
            return Err(FieldError::new(format!("{field}.min"), *min, rule));
        }
        if *max < least - ROUNDING {
            let rule = format!("must be at least {} for the group {name}: the limits {others} need it", shown(least));
            return Err(FieldError::new(format!("{field}.max"), *max, rule));
        }
        Ok(())
    }
}

impl GroupLimit {
    fn check(&self, field: &str, assets: &[String]) -> Result<(), FieldError> {
        check_text(&format!("{field}.name"), &self.name, NAME_LENGTH, &[])?;
        if self.assets.is_empty() {
            let rule = format!("must name an asset of the group {}", self.name);
            return Err(FieldError::new(format!("{field}.assets"), "0 names", rule));
        }
        for (index, name) in self.assets.iter().enumerate() {
            let field = format!("{field}.assets[{index}]");
            check_known(&field, name, assets)?;
            if self.assets[..index].contains(name) {
                return Err(FieldError::new(field, name, "must differ from the other names"));
            }
        }
        check_range(field, ShareRange { min: self.min, max: self.max })
    }
}

fn check_known(field: &str, name: &str, assets: &[String]) -> Result<(), FieldError> {
    if assets.iter().any(|asset| asset == name) {
        return Ok(());
    }
    Err(FieldError::new(field, name, format!("must name one of the assets: {}", assets.join(", "))))
}

fn check_range(field: &str, ShareRange { min, max }: ShareRange) -> Result<(), FieldError> {
    within(&format!("{field}.min"), min, 0.0, 1.0)?;
    within(&format!("{field}.max"), max, 0.0, 1.0)?;
    if min <= max {
        return Ok(());
    }
    Err(FieldError::new(format!("{field}.min"), min, format!("must be at most {field}.max, {max}")))
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn error(limits: Value) -> String {
        let assets = ["stocks", "bonds", "gold"].map(str::to_owned);
        let limits: WeightLimits = serde_json::from_value(limits).unwrap();
        limits.check("limits", &assets).map_or_else(|error| error.to_string(), |()| "none".to_owned())
    }

    #[test]
    fn a_limit_that_cannot_be_kept_is_named_with_its_rule() {
        let group =
            |assets: Value, min: f64, max: f64| json!({ "name": "hard", "assets": assets, "min": min, "max": max });
        for (limits, expected) in [
            (json!({}), "none"),
            (json!({ "each": { "max": 0.4 }, "max_turnover": 0.0 }), "none"),
            (
                json!({ "assets": { "silver": { "max": 0.1 } } }),
                "limits.assets.silver is silver: must name one of the assets: stocks, bonds, gold",
            ),
            (
                json!({ "assets": { "gold": { "min": 0.3, "max": 0.1 } } }),
                "limits.assets.gold.min is 0.3: must be at most limits.assets.gold.max, 0.1",
            ),
            (json!({ "each": { "max": 1.5 } }), "limits.each.max is 1.5: must be a number in [0, 1]"),
            (
                json!({ "each": { "min": 0.375 } }),
                "limits.assets is least shares that sum to 1.125: must be at most 1: the shares of the composition sum to 1",
            ),
            (
                json!({ "each": { "max": 0.25 } }),
                "limits.assets is greatest shares that sum to 0.75: must be at least 1: the shares of the composition sum to 1",
            ),
            (
                json!({ "assets": { "stocks": { "max": 0.5 } }, "groups": [group(json!(["bonds", "gold"]), 0.0, 0.4)] }),
                "limits.groups[0].max is 0.4: must be at least 0.5 for the group hard: the limits of the assets need it",
            ),
            (
                json!({ "groups": [
                    { "name": "paper", "assets": ["stocks", "bonds"], "min": 0.8 },
                    group(json!(["gold"]), 0.3, 1.0),
                ] }),
                "limits.groups[1].min is 0.3: must be at most 0.2 for the group hard: the limits of the assets and of the groups before it allow no more",
            ),
            (
                json!({ "groups": [group(json!(["gold", "gold"]), 0.0, 1.0)] }),
                "limits.groups[0].assets[1] is gold: must differ from the other names",
            ),
            (
                json!({ "groups": [group(json!([]), 0.0, 1.0)] }),
                "limits.groups[0].assets is 0 names: must name an asset of the group hard",
            ),
            (json!({ "max_turnover": 2.5 }), "limits.max_turnover is 2.5: must be a number in [0, 2]"),
        ] {
            assert_eq!(error(limits), expected);
        }
    }
}
