//! The walk-forward request: the periods of a record, and how the walk-forward goes through them.

use std::collections::BTreeMap;

use jiff::civil::Date;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::bounds::{Bounded, FieldBounds, ValueBounds};
use crate::control::request::caution::CautionLevel;
use crate::control::request::centre::CentreSpecification;
use crate::control::request::centre_rules::check_walked;
use crate::control::request::dates::{self, date};
use crate::control::request::frequency::Frequency;
use crate::control::request::own_weights::{OwnShares, OwnWeights, check_weights};
use crate::control::request::radius_rules::{ALPHA, RADIUS_SCALE};
use crate::control::request::rules::{
    COUNT, HISTORY_LENGTH, HORIZON, LOG_RETURNS, RATE, RELATIVE_RISK_AVERSION, SIMPLE_RETURNS, TRADING_COST,
    return_bounds, same_length, whole, within,
};
use crate::control::request::specification::default_seed;
use crate::control::request::support::Support;

/// Allowed number of periods of a record.
pub const PERIODS: std::ops::RangeInclusive<usize> = 3..=20_000;
/// Allowed number of periods in a year; the shortest period is a day.
pub const YEAR: std::ops::RangeInclusive<usize> = 1..=366;
/// Allowed number of miscoverage levels; one chart could not show more of them distinctly.
pub const LEVELS: std::ops::RangeInclusive<usize> = 1..=3;
/// Largest number of policies trained.
pub const MOST_TRAININGS: usize = 5_000;
/// Largest number of steps of all policies together.
pub const MOST_STEPS: usize = 200_000;
/// Default number of years of history that a policy is trained on.
const WINDOW_YEARS: usize = 20;

/// A walk-forward through a record of returns. At regular intervals, policies are trained on the preceding window and
/// followed until the next training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BacktestRequest {
    /// Log-returns of the risky asset, oldest first, without gaps: 3 to 20,000 values from -5 to 5. Exactly one of this
    /// and `simple_returns` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_returns: Option<Vec<f64>>,
    /// Simple returns of the risky asset, `price / previous price - 1`, oldest first, without gaps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simple_returns: Option<Vec<f64>>,
    /// Return of the bank per period, as a fraction from -0.5 to 0.5: one number for all periods, or one for each.
    pub rate: Rates,
    /// Date of each period, evenly spaced: `2008-01-31`, `2008-01` or `2008`. The dates determine the number of periods
    /// in a year.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dates: Option<Vec<String>>,
    /// Number of periods in a year, 1 to 366. Default: derived from `dates`; required without them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub periods_per_year: Option<usize>,
    /// Number of periods of history that each policy is trained on, 2 to 20,000. Default: 20 years, or half of the
    /// record if 20 years would leave less than a year after them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<usize>,
    /// Number of periods from one training to the next, at most `horizon`. Default: one year, or `horizon` if that is
    /// shorter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every: Option<usize>,
    /// Number of periods that a policy looks ahead, 1 to 520. Default: `every`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizon: Option<usize>,
    /// Miscoverages of the adaptive strategies: 1 to 3 different numbers from 0.001 to 0.999. The static strategy uses
    /// the second, or the only one. Default: 0.05, 0.1 and 0.5.
    #[serde(default = "defaults::alpha")]
    pub alpha: Vec<f64>,
    /// Factor on the radius of every ball. Default 1.
    #[serde(default = "defaults::scale")]
    pub scale: f64,
    /// Share of every radius that is used. A named level is found again for every training. Default: `paper`.
    #[serde(default = "defaults::caution")]
    pub caution: CautionLevel,
    /// The log-returns that the adversary may use. Default: `none`, which allows all.
    #[serde(default = "defaults::support")]
    pub support: Support,
    /// Centre of the balls. The strategy “Trusts the record” takes it as the true law. Default: `empirical`.
    #[serde(default)]
    pub centre: CentreSpecification,
    /// Relative risk aversion, 1 to 100: log utility at 1, power utility above. Default 3.
    #[serde(default = "defaults::risk_aversion")]
    pub risk_aversion: f64,
    /// Trading cost, as a share of the amount traded, 0 to 0.1. Policies are trained with it. Default 0.
    #[serde(default)]
    pub trading_cost: f64,
    /// If true, every policy is trained as if trading were free. Default false.
    #[serde(default)]
    pub cost_blind: bool,
    /// Strategies of your own by name, at most 10: the share of wealth that each holds in every period of the record,
    /// 0 to 1, or a formula for it over the returns before, such as `if(mean12 > bank, 1, 0)`. Shares of the first window
    /// are not used. Given shares may use only what was known before their period: nothing here can check that.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(value_type = std::collections::HashMap<String, OwnShares<f64>>)]
    pub weights: OwnWeights,
    /// Number of design points per step, 10 to 10,000. Default 100.
    #[serde(default = "defaults::count")]
    pub count: usize,
    /// Seed of all random draws. The same request and seed give the same report, bit for bit. Default 1.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

/// Return of the bank in each period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged, expecting = "must be a number or a list of numbers")]
pub enum Rates {
    /// One rate for all periods.
    Each(f64),
    /// One rate for each period.
    Listed(Vec<f64>),
}

/// Defaults of the fields that are left out.
pub mod defaults {
    use super::{CautionLevel, Support};

    /// Returns the default miscoverages.
    pub fn alpha() -> Vec<f64> {
        vec![0.05, 0.1, 0.5]
    }
    /// Returns the default factor on the radius: that of the bridge, unchanged.
    pub fn scale() -> f64 {
        1.0
    }
    /// Returns the default caution: the whole radius, as in the paper.
    pub fn caution() -> CautionLevel {
        CautionLevel::Paper
    }
    /// Returns the default support: all returns, as in the paper.
    pub fn support() -> Support {
        Support::None {}
    }
    /// Returns the default relative risk aversion.
    pub fn risk_aversion() -> f64 {
        3.0
    }
    /// Returns the default number of design points per step.
    pub fn count() -> usize {
        100
    }
}

impl Rates {
    /// Returns the rate of the period at `index`.
    pub fn at(&self, index: usize) -> f64 {
        match self {
            Rates::Each(rate) => *rate,
            Rates::Listed(rates) => rates.get(index).copied().unwrap_or_default(),
        }
    }

    /// Checks every rate, and that a list has one for each period.
    ///
    /// # Errors
    /// A field breaks its rule.
    pub fn check(&self, periods: usize) -> Result<(), FieldError> {
        match self {
            Rates::Each(rate) => within("rate", *rate, RATE.0, RATE.1),
            Rates::Listed(rates) => {
                same_length("rate", rates.len(), periods)?;
                let mut numbered = rates.iter().enumerate();
                numbered.try_for_each(|(index, &rate)| within(&format!("rate[{index}]"), rate, RATE.0, RATE.1))
            }
        }
    }
}

/// Returns `wanted` periods if a record of `found` periods leaves a year after them, else half of the record.
pub fn usual_window(wanted: usize, found: usize, year: usize) -> usize {
    if wanted + year <= found { wanted } else { found / 2 }
}

/// Returns the error for a requested window that leaves no year of the record to walk through.
pub fn too_long(window: usize, found: usize, year: usize) -> FieldError {
    let most = found.saturating_sub(year);
    let rule = match most {
        0 | 1 => format!(
            "must be followed by a year of {year} periods, but the record has only {found}; give a longer record"
        ),
        _ => format!(
            "must be at most {most}: the record has {found} periods, and a year of {year} must follow the window"
        ),
    };
    FieldError::new("window", window, rule)
}

/// Returns the frequency of the periods, from their dates.
///
/// # Errors
/// A text is not a date, or a date does not follow the one before.
pub fn frequency(dates: &[String]) -> Result<Frequency, FieldError> {
    if let Some(index) = dates.iter().position(|text| date(text).is_none()) {
        return Err(FieldError::new(format!("dates[{index}]"), &dates[index], dates::FORM));
    }
    let texts: Vec<&str> = dates.iter().map(String::as_str).collect();
    let found = Frequency::of(&days(dates), &texts);
    found.map_err(|wrong| FieldError::new(format!("dates[{}]", wrong.index), &dates[wrong.index], wrong.rule))
}

/// Returns the dates, leaving out texts that are none.
pub fn days(dates: &[String]) -> Vec<Date> {
    dates.iter().filter_map(|text| date(text)).collect()
}

impl Bounded for BacktestRequest {
    const BOUNDS: &'static [FieldBounds] = &[
        ("log_returns", ValueBounds::list(&PERIODS, &LOG_RETURNS)),
        ("simple_returns", ValueBounds::list(&PERIODS, &SIMPLE_RETURNS)),
        ("dates", ValueBounds::list(&PERIODS, &ValueBounds::Any)),
        ("periods_per_year", ValueBounds::count(&YEAR)),
        ("window", ValueBounds::count(&HISTORY_LENGTH)),
        ("every", ValueBounds::count(&HORIZON)),
        ("horizon", ValueBounds::count(&HORIZON)),
        ("alpha", ValueBounds::list(&LEVELS, &ValueBounds::number(ALPHA))),
        ("scale", ValueBounds::number(RADIUS_SCALE)),
        ("risk_aversion", ValueBounds::number(RELATIVE_RISK_AVERSION)),
        ("trading_cost", ValueBounds::number(TRADING_COST)),
        ("count", ValueBounds::count(&COUNT)),
    ];
}

impl BacktestRequest {
    /// Fills the defaults that depend on other fields, and checks every rule except those of each window's training.
    ///
    /// # Errors
    /// The first field that breaks its rule.
    pub fn completed(mut self) -> Result<Self, FieldError> {
        self.check_record()?;
        let frequency = self.frequency()?;
        if self.periods_per_year.is_none() {
            let dates = self.days();
            self.periods_per_year = frequency.map(|frequency| frequency.periods_per_year(&dates));
        }
        let rule = "must be given if there are no dates";
        let year = self.periods_per_year.ok_or_else(|| FieldError::new("periods_per_year", "null", rule))?;
        whole("periods_per_year", year, &YEAR)?;
        self.check_strategies()?;
        check_walked(&self.centre)?;
        check_weights(&self.weights, self.period_count())?;
        let every = self.every.unwrap_or_else(|| self.horizon.map_or(year, |horizon| year.min(horizon)));
        let horizon = self.horizon.unwrap_or(every);
        let window = self.window.unwrap_or_else(|| usual_window(WINDOW_YEARS * year, self.period_count(), year));
        if !(1..=horizon).contains(&every) {
            let rule = "must be at least 1 and at most horizon: each policy is used until the next is trained";
            return Err(FieldError::new("every", every, rule));
        }
        whole("horizon", horizon, &HORIZON)?;
        whole("window", window, &HISTORY_LENGTH)?;
        let (found, wanted) = (self.period_count(), window + year);
        if found < wanted {
            let rule = format!("must hold at least {wanted} periods: a window of {window} and then a year");
            let short = FieldError::new(self.returns().0, format!("{found} periods"), rule);
            return Err(self.window.map_or(short, |window| too_long(window, found, year)));
        }
        (self.every, self.horizon, self.window) = (Some(every), Some(horizon), Some(window));
        self.check_size(every, horizon, window)?;
        Ok(self)
    }

    /// Returns the name of the field that holds the returns, and its values. The values are empty if both fields or
    /// neither are given.
    pub fn returns(&self) -> (&'static str, &[f64]) {
        match (&self.log_returns, &self.simple_returns) {
            (Some(returns), None) => ("log_returns", returns),
            (None, Some(returns)) => ("simple_returns", returns),
            _ => ("log_returns", &[]),
        }
    }

    /// Returns the log-return of one of the values of [`Self::returns`].
    pub fn log_return(&self, value: f64) -> f64 {
        if self.simple_returns.is_some() { value.ln_1p() } else { value }
    }

    /// Returns the number of periods of the record.
    pub fn period_count(&self) -> usize {
        self.returns().1.len()
    }

    /// Returns the frequency of the periods; `None` without dates.
    ///
    /// # Errors
    /// A text is not a date, or a date does not follow the one before.
    pub fn frequency(&self) -> Result<Option<Frequency>, FieldError> {
        self.dates.as_deref().map(frequency).transpose()
    }

    /// Returns the dates, leaving out texts that are none.
    pub fn days(&self) -> Vec<Date> {
        days(self.dates.as_deref().unwrap_or_default())
    }

    fn check_record(&self) -> Result<(), FieldError> {
        if self.log_returns.is_some() == self.simple_returns.is_some() {
            let value = if self.log_returns.is_some() { "given with simple_returns" } else { "null" };
            return Err(FieldError::new("log_returns", value, "give either log_returns or simple_returns, not both"));
        }
        let (field, returns) = self.returns();
        if !PERIODS.contains(&returns.len()) {
            let rule = format!("must hold {} to {} returns", PERIODS.start(), PERIODS.end());
            return Err(FieldError::new(field, format!("{} periods", returns.len()), rule));
        }
        let (low, high) = return_bounds(self.simple_returns.is_some());
        for (index, &value) in returns.iter().enumerate() {
            within(&format!("{field}[{index}]"), value, low, high)?;
        }
        self.rate.check(returns.len())?;
        self.dates.as_ref().map_or(Ok(()), |dates| same_length("dates", dates.len(), returns.len()))
    }

    fn check_strategies(&self) -> Result<(), FieldError> {
        if !LEVELS.contains(&self.alpha.len()) {
            let rule = format!("must hold {} to {}", LEVELS.start(), LEVELS.end());
            return Err(FieldError::new("alpha", format!("{} levels", self.alpha.len()), rule));
        }
        for (index, alpha) in self.alpha.iter().enumerate() {
            let field = format!("alpha[{index}]");
            within(&field, *alpha, ALPHA.0, ALPHA.1)?;
            if self.alpha[..index].contains(alpha) {
                return Err(FieldError::new(field, alpha, "must not be named twice"));
            }
        }
        within("risk_aversion", self.risk_aversion, RELATIVE_RISK_AVERSION.0, RELATIVE_RISK_AVERSION.1)?;
        within("trading_cost", self.trading_cost, TRADING_COST.0, TRADING_COST.1)?;
        whole("count", self.count, &COUNT)
    }

    fn check_size(&self, every: usize, horizon: usize, window: usize) -> Result<(), FieldError> {
        // One adaptive strategy for each level, then cost-blind, static and plug-in.
        let strategies = self.alpha.len() + 3;
        let trainings = (self.period_count() - window).div_ceil(every).saturating_mul(strategies);
        if trainings > MOST_TRAININGS {
            let rule =
                format!("must be larger: it needs {trainings} trainings, and at most {MOST_TRAININGS} are allowed");
            return Err(FieldError::new("every", every, rule));
        }
        if trainings.saturating_mul(horizon) > MOST_STEPS {
            let rule = format!("must be smaller: multiplied by {trainings} trainings it may be at most {MOST_STEPS}");
            return Err(FieldError::new("horizon", horizon, rule));
        }
        Ok(())
    }
}
