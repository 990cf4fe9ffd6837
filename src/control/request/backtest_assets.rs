//! The walk-forward request for several assets: a table of returns, and how the walk-forward goes through it.

use std::collections::BTreeMap;

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::asset_history::AssetHistory;
use super::assets::{ASSETS, DATES, NAMES, check_names};
use super::backtest::{BacktestRequest, PERIODS, Rates, YEAR, days, defaults, frequency};
use super::bounds::{Bounded, FieldBounds, ValueBounds};
use super::declared_backtest::DeclaredBacktest;
use super::frequency::Frequency;
use super::limits::WeightLimits;
use super::means::MeansRule;
use super::own_weights::{OwnAssetsWeights, OwnShares};
use super::radius_rules::ALPHA;
use super::rules::{
    COUNT, HORIZON, LOG_RETURNS, RELATIVE_RISK_AVERSION, SIMPLE_RETURNS, TRADING_COST, return_bounds, same_length,
    whole, within,
};
use super::specification::default_seed;
use super::support::Support;
use crate::control::error::FieldError;

/// Limit on the log-returns that all one-step problems of a walk-forward read: some hours on two cores.
pub const MOST_READ: usize = 1_000_000_000;
/// Limit on the shares that all strategies together hold: a report of some forty megabytes.
pub const MOST_HELD: usize = 2_000_000;
/// Limit on the number of windows: a chart of more would have too many lines.
pub const MOST_WINDOWS: usize = 5;
/// Number of families of strategies: `policy` and `one_step`.
pub const MOST_FAMILIES: usize = 2;

/// Strategies of a walk-forward of several assets that are compared with the rules that people use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum StrategyFamily {
    /// The policy of a fund of the assets, trained anew every `every` periods, as a session that renews itself follows
    /// it.
    Policy,
    /// The one-step problem, solved anew in every period.
    OneStep,
}

/// A walk-forward through a record of several assets. It compares the trained policy of a session, or the one-step
/// problem, with rules that people use.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AssetsBacktestRequest {
    /// Names of the assets, 2 to 30, all different, in the order of the columns.
    #[schema(example = json!(["stocks", "bonds"]))]
    pub assets: Vec<String>,
    /// Log-returns of the assets, oldest first, without gaps; each period has one value for each asset, null before the
    /// asset's first return. Exactly one of this and `simple_returns` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_returns: Option<Vec<Vec<Option<f64>>>>,
    /// Simple returns of the assets, `price / previous price - 1`, in the same layout as `log_returns`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simple_returns: Option<Vec<Vec<Option<f64>>>>,
    /// Return of the bank per period, as a fraction from -0.5 to 0.5: one number for all periods, or one for each.
    pub rate: Rates,
    /// Date of each period, evenly spaced: `2008-01-31`, `2008-01` or `2008`.
    pub dates: Vec<String>,
    /// Number of periods in a year, 1 to 366. Default: derived from `dates`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub periods_per_year: Option<usize>,
    /// The strategies that are compared with the rules that people use: `policy`, `one_step` or both. Default:
    /// `["one_step"]`, because a policy takes several times as long.
    #[serde(default = "one_step")]
    pub strategies: Vec<StrategyFamily>,
    /// Numbers of most recent periods that strategies know; null stands for all periods since the first. Default: 10
    /// years, 20 years and all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub windows: Option<Vec<Option<usize>>>,
    /// Number of periods between trainings of the policy, between estimates of the radius, and between choices of the
    /// static strategy. Default: one year, or `horizon` if that is shorter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every: Option<usize>,
    /// Number of periods that a policy looks ahead, from `every` to 520. Default: `every`. Must be absent unless
    /// `strategies` has `policy`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizon: Option<usize>,
    /// Number of design points per step of a policy, 10 to 10,000. Default 100. Must be absent unless `strategies` has
    /// `policy`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
    /// Miscoverage of the radius, 0.001 to 0.999: the probability that the ball misses the true law. Default 0.1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alpha: Option<f64>,
    /// The log-returns of each asset that the adversary may use. Default: `worst_seen`.
    #[serde(default)]
    pub support: Support,
    /// The means that policies and the one-step problem give the assets. Default: `sample`.
    #[serde(default)]
    pub means: MeansRule,
    /// Relative risk aversion, 1 to 100: log utility at 1, power utility above. Default 3.
    #[serde(default = "defaults::risk_aversion")]
    pub risk_aversion: f64,
    /// Trading cost, as a share of the amount traded, 0 to 0.1. Policies are trained with it; no other strategy takes it
    /// into account. Default 0.
    #[serde(default)]
    pub trading_cost: f64,
    /// Limits on the composition, for every strategy but your own: rules that are not optimised take the nearest
    /// composition that keeps them. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<WeightLimits>,
    /// Strategies of your own by name, at most 10: for every period of the record the shares of wealth in the assets, in
    /// their order, which add up to at most 1, or a formula for the share of each asset over its returns before, such as
    /// `1/deviation60`; formulas that add up to more than 1 are divided by their sum. Shares of the longest window are not
    /// used. Given shares may use only what was known before their period: nothing here can check that.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(value_type = std::collections::HashMap<String, OwnShares<Vec<f64>>>)]
    pub weights: OwnAssetsWeights,
    /// Seed of all random draws. The same request and seed give the same report, bit for bit. Default 1.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

/// Returns the default strategies.
fn one_step() -> Vec<StrategyFamily> {
    vec![StrategyFamily::OneStep]
}

/// A walk-forward of one asset, of several assets if the request has the field `assets`, or of a declared problem if it has
/// the field `problem`.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant)]
pub enum BacktestQuestion {
    /// One asset, which may be held beside the bank.
    Asset(BacktestRequest),
    /// Several assets.
    Assets(AssetsBacktestRequest),
    /// A problem declared in formulas.
    Declared(DeclaredBacktest),
}

impl<'de> Deserialize<'de> for BacktestQuestion {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        let read = match ["assets", "problem"].map(|field| value.get(field).is_some()) {
            [true, _] => serde_json::from_value(value).map(BacktestQuestion::Assets),
            [_, true] => serde_json::from_value(value).map(BacktestQuestion::Declared),
            _ => serde_json::from_value(value).map(BacktestQuestion::Asset),
        };
        read.map_err(D::Error::custom)
    }
}

impl Bounded for AssetsBacktestRequest {
    const BOUNDS: &'static [FieldBounds] = &[
        ("assets", NAMES),
        ("log_returns", ValueBounds::list(&PERIODS, &ValueBounds::list(&ASSETS, &LOG_RETURNS))),
        ("simple_returns", ValueBounds::list(&PERIODS, &ValueBounds::list(&ASSETS, &SIMPLE_RETURNS))),
        ("dates", ValueBounds::list(&PERIODS, &ValueBounds::Any)),
        ("periods_per_year", ValueBounds::count(&YEAR)),
        ("strategies", ValueBounds::List(1, MOST_FAMILIES, &ValueBounds::Any)),
        ("windows", ValueBounds::List(1, MOST_WINDOWS, &ValueBounds::Any)),
        ("every", ValueBounds::Count(1, *DATES.end())),
        ("horizon", ValueBounds::count(&HORIZON)),
        ("count", ValueBounds::count(&COUNT)),
        ("alpha", ValueBounds::number(ALPHA)),
        ("risk_aversion", ValueBounds::number(RELATIVE_RISK_AVERSION)),
        ("trading_cost", ValueBounds::number(TRADING_COST)),
    ];
}

impl AssetsBacktestRequest {
    /// Returns the name of the field that holds the returns, and its values. The values are empty if both fields or
    /// neither are given.
    pub fn returns(&self) -> (&'static str, &[Vec<Option<f64>>]) {
        match (&self.log_returns, &self.simple_returns) {
            (Some(returns), None) => ("log_returns", returns),
            (None, Some(returns)) => ("simple_returns", returns),
            _ => ("log_returns", &[]),
        }
    }

    /// Returns the log-returns, date by date.
    pub fn log_rows(&self) -> AssetHistory {
        let log_return = |value: f64| if self.simple_returns.is_some() { value.ln_1p() } else { value };
        let row = |row: &Vec<Option<f64>>| row.iter().map(|value| value.map(log_return)).collect();
        AssetHistory::new(&self.returns().1.iter().map(row).collect::<Vec<_>>())
    }

    /// Checks the record as it is given. Returns its frequency and the number of periods in a year.
    ///
    /// # Errors
    /// The first field that breaks its rule.
    pub fn check(&self) -> Result<(Frequency, usize), FieldError> {
        if self.log_returns.is_some() == self.simple_returns.is_some() {
            let value = if self.log_returns.is_some() { "given with simple_returns" } else { "null" };
            return Err(FieldError::new("log_returns", value, "give either log_returns or simple_returns, not both"));
        }
        check_names("assets", &self.assets)?;
        let (field, rows) = self.returns();
        if !PERIODS.contains(&rows.len()) {
            let rule = format!("must hold {} to {} periods", PERIODS.start(), PERIODS.end());
            return Err(FieldError::new(field, format!("{} periods", rows.len()), rule));
        }
        let (low, high) = return_bounds(self.simple_returns.is_some());
        for (period, row) in rows.iter().enumerate() {
            if row.len() != self.assets.len() {
                let rule = format!("must have one return for each of the {} assets", self.assets.len());
                return Err(FieldError::new(format!("{field}[{period}]"), format!("{} values", row.len()), rule));
            }
            for (asset, value) in row.iter().enumerate() {
                value.map_or(Ok(()), |value| within(&format!("{field}[{period}][{asset}]"), value, low, high))?;
            }
        }
        self.rate.check(rows.len())?;
        same_length("dates", self.dates.len(), rows.len())?;
        let frequency = frequency(&self.dates)?;
        let year = self.periods_per_year.unwrap_or_else(|| frequency.periods_per_year(&days(&self.dates)));
        whole("periods_per_year", year, &YEAR)?;
        Ok((frequency, year))
    }
}
