//! A question about several assets: what is known of their returns, and how far the adversary may move them.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::learning::Learning;
use super::radius_rule::RadiusRule;
use super::rules;
use super::specification::{ProblemSpecification, Specification, UtilitySpecification, defaults};
use crate::control::error::FieldError;
use crate::numerics::fund_bridges::fund_returns;
use crate::numerics::levelling::{Ground, inverse_volatility};

/// Assets at most.
pub const MOST_ASSETS: usize = 30;
/// Assets of a question.
pub const ASSETS: std::ops::RangeInclusive<usize> = 2..=MOST_ASSETS;
/// Dates of a history: so many of the most assets are some seconds of search.
pub const DATES: std::ops::RangeInclusive<usize> = 2..=2000;
/// Characters of the name of an asset.
pub const NAME_LENGTH: std::ops::RangeInclusive<usize> = 1..=100;

/// What is known of several assets, and the investor who may hold them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AssetsProblem {
    /// Names of the assets, each another, in the order of the columns of `history`.
    #[schema(example = json!(["stocks", "bonds"]))]
    pub assets: Vec<String>,
    /// What moving a law costs the adversary.
    #[serde(default)]
    pub ground_norm: GroundNorm,
    /// Bank return per step, as a fraction.
    pub rate_per_step: f64,
    /// Periods of the history in a year: what is said a year is said with it. It changes no advice.
    #[serde(default)]
    pub periods_per_year: Option<f64>,
    /// Wealth, in any currency.
    #[serde(default = "defaults::initial_wealth")]
    pub initial_wealth: f64,
    /// Share of wealth that may be held in all assets together: `[0, highest]`.
    #[serde(default = "defaults::action_interval")]
    pub action_interval: [f64; 2],
    /// Of wealth at the end of the period.
    #[serde(default)]
    pub utility: UtilitySpecification,
    /// Default: `bridge`. That of the fund of inverse volatilities, made wide enough for all funds at once.
    #[serde(default)]
    pub radius: Option<RadiusRule>,
    /// Below which the adversary moves no log-return. Without it an asset may lose all.
    #[serde(default)]
    pub support: Option<LowestReturn>,
    /// Log-returns, date by date, oldest first; each date has one for each asset.
    pub history: Vec<Vec<f64>>,
}

/// The distance between two dates' log-returns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum GroundNorm {
    /// The sum of the moves, each times its asset's inverse volatility, which sum to 1: moving all assets by s costs s.
    #[default]
    ScaledOne,
    /// The largest move.
    Sup,
}

impl GroundNorm {
    /// The ground cost at a history.
    pub fn at(self, rows: &[Vec<f64>]) -> Ground {
        match self {
            GroundNorm::ScaledOne => Ground::Weighted(inverse_volatility(rows)),
            GroundNorm::Sup => Ground::Sup,
        }
    }
}

/// The lowest log-return of any asset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LowestReturn {
    /// In log-return; at most the lowest of the history.
    pub min: f64,
}

impl AssetsProblem {
    /// The problem of the fund of inverse volatilities, for one period: rate, utility and radius are checked and completed there,
    /// and its radius is what that of all funds is a multiple of.
    ///
    /// # Errors
    /// A field breaks a rule.
    pub fn fund(&self, seed: u64) -> Result<Specification, FieldError> {
        self.check_names()?;
        self.check_history()?;
        let problem = ProblemSpecification {
            horizon: 1,
            periods_per_year: self.periods_per_year,
            initial_wealth: self.initial_wealth,
            action_interval: self.action_interval,
            utility: self.utility,
            radius: self.radius,
            ..ProblemSpecification::of(
                fund_returns(&self.history, &inverse_volatility(&self.history)),
                self.rate_per_step,
            )
        };
        Specification::of(problem, seed).completed()
    }

    fn check_names(&self) -> Result<(), FieldError> {
        let assets = &self.assets;
        if !ASSETS.contains(&assets.len()) {
            let rule =
                format!("must name {} to {} assets, each with a column of history", ASSETS.start(), ASSETS.end());
            return Err(FieldError::new("problem.assets", format!("{} names", assets.len()), rule));
        }
        let mut seen = BTreeSet::new();
        for (index, name) in assets.iter().enumerate() {
            let field = || format!("problem.assets[{index}]");
            if !NAME_LENGTH.contains(&name.chars().count()) {
                let rule = format!("must have {} to {} characters", NAME_LENGTH.start(), NAME_LENGTH.end());
                return Err(FieldError::new(field(), format!("{} characters", name.chars().count()), rule));
            }
            if !seen.insert(name) {
                return Err(FieldError::new(field(), name, "must be a name of its own"));
            }
        }
        Ok(())
    }

    fn check_history(&self) -> Result<(), FieldError> {
        let (rows, width) = (&self.history, self.assets.len());
        if !DATES.contains(&rows.len()) {
            let rule = format!("must hold {} to {} dates", DATES.start(), DATES.end());
            return Err(FieldError::new("problem.history", format!("{} dates", rows.len()), rule));
        }
        for (date, row) in rows.iter().enumerate() {
            if row.len() != width {
                let rule = format!("must have one log-return for each of the {width} assets");
                return Err(FieldError::new(format!("problem.history[{date}]"), format!("{} values", row.len()), rule));
            }
            for (asset, &value) in row.iter().enumerate() {
                rules::log_return(&format!("problem.history[{date}][{asset}]"), value)?;
            }
        }
        for (asset, name) in self.assets.iter().enumerate() {
            let column: Vec<f64> = rows.iter().map(|row| row[asset]).collect();
            Learning::Equal {}.check_deviation(&format!("problem.history, {name}"), &column)?;
        }
        let Some(LowestReturn { min }) = self.support else { return Ok(()) };
        rules::log_return("problem.support.min", min)?;
        let lowest = rows.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        if min > lowest {
            let rule = format!("must be at most {lowest}, the lowest log-return of the history");
            return Err(FieldError::new("problem.support.min", min, rule));
        }
        Ok(())
    }
}
