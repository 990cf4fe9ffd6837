//! The walk-forward request: the periods of a record, and how they are walked through.

use jiff::civil::Date;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::request::caution::CautionLevel;
use crate::control::request::centre::CentreSpecification;
use crate::control::request::dates::{self, date};
use crate::control::request::frequency::Frequency;
use crate::control::request::rules::{
    self, COUNT, HISTORY_LENGTH, HORIZON, RATE, RELATIVE_RISK_AVERSION, TRADING_COST, whole, within,
};
use crate::control::request::specification::default_seed;
use crate::control::request::support::Support;

/// Periods of a record.
pub const PERIODS: std::ops::RangeInclusive<usize> = 3..=20_000;
/// Of a year: a day at the shortest.
pub const YEAR: std::ops::RangeInclusive<usize> = 1..=366;
/// Levels; more would not be told apart on one chart.
pub const LEVELS: std::ops::RangeInclusive<usize> = 1..=3;
/// Miscoverages.
pub const ALPHA: (f64, f64) = (1e-3, 0.999);
/// Policies trained.
pub const MOST_TRAININGS: usize = 5_000;
/// Steps of all of them.
pub const MOST_STEPS: usize = 200_000;
/// Years of history that a policy is trained on.
const WINDOW_YEARS: usize = 20;

/// A walk-forward through a record of returns: every so many periods policies are trained on the window before, and lived by
/// until the next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BacktestRequest {
    /// Of the risky asset, oldest first, none left out. Exactly one of this and `simple_returns` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_returns: Option<Vec<f64>>,
    /// `price / previous price - 1`, likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simple_returns: Option<Vec<f64>>,
    /// What the bank pays a period, as a fraction: one number for all, or one for each.
    pub rate: Rates,
    /// One for each period, evenly apart: `2008-01-31`, `2008-01` or `2008`. They tell the periods of a year.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dates: Option<Vec<String>>,
    /// Default: what `dates` tell; required without them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub periods_per_year: Option<usize>,
    /// Periods of history that each policy is trained on. Default: 20 years of them, or half of a record that has no year beside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<usize>,
    /// Periods from one training to the next. Default: a year of them, at most `horizon`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every: Option<usize>,
    /// Periods that a policy looks ahead. Default: `every`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizon: Option<usize>,
    /// Levels of the adaptive strategies; the static one takes the second, or the only one.
    #[serde(default = "defaults::alpha")]
    pub alpha: Vec<f64>,
    /// Multiple of the radius of every ball.
    #[serde(default = "defaults::scale")]
    pub scale: f64,
    /// The share of every radius that is acted on: a level is found anew for every training.
    #[serde(default = "defaults::caution")]
    pub caution: CautionLevel,
    /// The log-returns that the adversary may use.
    #[serde(default = "defaults::support")]
    pub support: Support,
    /// What the balls are centred on, and what “Trusts the record” takes for the law.
    #[serde(default)]
    pub centre: CentreSpecification,
    /// Relative: 1 is log utility.
    #[serde(default = "defaults::risk_aversion")]
    pub risk_aversion: f64,
    /// Lost of what is traded, as a share of it; policies are trained with it.
    #[serde(default)]
    pub trading_cost: f64,
    /// Train every policy as if trading were free.
    #[serde(default)]
    pub cost_blind: bool,
    /// Design points per step.
    #[serde(default = "defaults::count")]
    pub count: usize,
    /// The same request and seed give the same report, bit for bit.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

/// What the bank pays in each period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged, expecting = "must be a number or a list of numbers")]
pub enum Rates {
    /// The same in every period.
    Each(f64),
    /// One for each period.
    Listed(Vec<f64>),
}

/// What stands for fields that are left out.
pub mod defaults {
    use super::{CautionLevel, Support};

    /// Levels.
    pub fn alpha() -> Vec<f64> {
        vec![0.05, 0.1, 0.5]
    }
    /// As the bridge says.
    pub fn scale() -> f64 {
        1.0
    }
    /// The whole radius, as in the paper.
    pub fn caution() -> CautionLevel {
        CautionLevel::Paper
    }
    /// All, as in the paper.
    pub fn support() -> Support {
        Support::None {}
    }
    /// Relative risk aversion.
    pub fn risk_aversion() -> f64 {
        3.0
    }
    /// Design points.
    pub fn count() -> usize {
        100
    }
}

impl Rates {
    /// Of the period at `index`.
    pub fn at(&self, index: usize) -> f64 {
        match self {
            Rates::Each(rate) => *rate,
            Rates::Listed(rates) => rates.get(index).copied().unwrap_or_default(),
        }
    }

    /// Checks that there is one for each of so many periods, and each of them.
    ///
    /// # Errors
    /// A field that breaks its rule.
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

/// So many periods where a record of `found` leaves a year beside them, else half of it.
pub fn usual_window(wanted: usize, found: usize, year: usize) -> usize {
    if wanted + year <= found { wanted } else { found / 2 }
}

/// Refuses a window that was asked for and leaves no year of the record to live through.
pub fn too_long(window: usize, found: usize, year: usize) -> FieldError {
    let most = found.saturating_sub(year);
    let rule = match most {
        0 | 1 => format!("has no room: the record has {found} periods, and a year of {year} is lived through"),
        _ => format!(
            "must be at most {most}: the record has {found} periods, of which a year of {year} is lived through"
        ),
    };
    FieldError::new("window", window, rule)
}

/// Between which returns lie, simple ones or log-returns.
pub fn bounds(are_simple: bool) -> (f64, f64) {
    let bound = rules::LOG_RETURN;
    if are_simple { ((-bound).exp_m1(), bound.exp_m1()) } else { (-bound, bound) }
}

/// How often there is a period, by its dates.
///
/// # Errors
/// A date that is none, or that does not follow the one before.
pub fn frequency(dates: &[String]) -> Result<Frequency, FieldError> {
    if let Some(index) = dates.iter().position(|text| date(text).is_none()) {
        return Err(FieldError::new(format!("dates[{index}]"), &dates[index], dates::FORM));
    }
    let texts: Vec<&str> = dates.iter().map(String::as_str).collect();
    let found = Frequency::of(&days(dates), &texts);
    found.map_err(|wrong| FieldError::new(format!("dates[{}]", wrong.index), &dates[wrong.index], wrong.rule))
}

/// Those that are dates.
pub fn days(dates: &[String]) -> Vec<Date> {
    dates.iter().filter_map(|text| date(text)).collect()
}

impl BacktestRequest {
    /// Fills the defaults that depend on other fields, and checks every rule but those of each window's training.
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
        let rule = "must be given where there are no dates, which would tell it";
        let year = self.periods_per_year.ok_or_else(|| FieldError::new("periods_per_year", "null", rule))?;
        whole("periods_per_year", year, &YEAR)?;
        self.check_strategies()?;
        let every = self.every.unwrap_or_else(|| self.horizon.map_or(year, |horizon| year.min(horizon)));
        let horizon = self.horizon.unwrap_or(every);
        let window = self.window.unwrap_or_else(|| usual_window(WINDOW_YEARS * year, self.period_count(), year));
        if !(1..=horizon).contains(&every) {
            let rule = "must be at least 1, and at most horizon: a policy is lived by until the next is trained";
            return Err(FieldError::new("every", every, rule));
        }
        whole("horizon", horizon, &HORIZON)?;
        whole("window", window, &HISTORY_LENGTH)?;
        let (found, wanted) = (self.period_count(), window + year);
        if found < wanted {
            let rule = format!("must hold at least {wanted}, the window of {window} and a year");
            let short = FieldError::new(self.returns().0, format!("{found} periods"), rule);
            return Err(self.window.map_or(short, |window| too_long(window, found, year)));
        }
        (self.every, self.horizon, self.window) = (Some(every), Some(horizon), Some(window));
        self.check_size(every, horizon, window)?;
        Ok(self)
    }

    /// The field of the returns, and what it holds; nothing is held where both or neither are given.
    pub fn returns(&self) -> (&'static str, &[f64]) {
        match (&self.log_returns, &self.simple_returns) {
            (Some(returns), None) => ("log_returns", returns),
            (None, Some(returns)) => ("simple_returns", returns),
            _ => ("log_returns", &[]),
        }
    }

    /// The log-return of the period at `index` of [`Self::returns`].
    pub fn log_return(&self, value: f64) -> f64 {
        if self.simple_returns.is_some() { value.ln_1p() } else { value }
    }

    /// Number of periods of the record.
    pub fn period_count(&self) -> usize {
        self.returns().1.len()
    }

    /// How often there is a period; `None` without dates.
    ///
    /// # Errors
    /// A date that is none, or that does not follow the one before.
    pub fn frequency(&self) -> Result<Option<Frequency>, FieldError> {
        self.dates.as_deref().map(frequency).transpose()
    }

    /// The dates that are dates.
    pub fn days(&self) -> Vec<Date> {
        days(self.dates.as_deref().unwrap_or_default())
    }

    fn check_record(&self) -> Result<(), FieldError> {
        if self.log_returns.is_some() == self.simple_returns.is_some() {
            let value = if self.log_returns.is_some() { "given with simple_returns" } else { "null" };
            return Err(FieldError::new("log_returns", value, "must be given, or simple_returns: exactly one of them"));
        }
        let (field, returns) = self.returns();
        if !PERIODS.contains(&returns.len()) {
            let rule = format!("must hold {} to {} returns", PERIODS.start(), PERIODS.end());
            return Err(FieldError::new(field, format!("{} periods", returns.len()), rule));
        }
        let (low, high) = bounds(self.simple_returns.is_some());
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
        // At each level, cost-blind, static and plug-in.
        let strategies = self.alpha.len() + 3;
        let trainings = (self.period_count() - window).div_ceil(every).saturating_mul(strategies);
        if trainings > MOST_TRAININGS {
            let rule = format!("must be larger: it makes {trainings} trainings, and {MOST_TRAININGS} is the most");
            return Err(FieldError::new("every", every, rule));
        }
        if trainings.saturating_mul(horizon) > MOST_STEPS {
            let rule = format!("times {trainings} trainings must be at most {MOST_STEPS}");
            return Err(FieldError::new("horizon", horizon, rule));
        }
        Ok(())
    }
}

/// # Errors
/// A list that is not as long as the record.
pub fn same_length(field: &str, found: usize, wanted: usize) -> Result<(), FieldError> {
    if found == wanted {
        return Ok(());
    }
    Err(FieldError::new(field, format!("{found} values"), format!("must hold {wanted}, as many as there are returns")))
}
