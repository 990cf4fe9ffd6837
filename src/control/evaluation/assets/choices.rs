//! The defaults and the rules of the choices of a walk-forward of several assets.

use super::report::AssetsChoices;
use crate::control::error::FieldError;
use crate::control::request::assets::DATES;
use crate::control::request::backtest::{defaults, usual_window};
use crate::control::request::backtest_assets::{MOST_FAMILIES, MOST_WINDOWS, StrategyFamily};
use crate::control::request::caution_rules::check_support;
use crate::control::request::means::MeansRule;
use crate::control::request::radius_rules::ALPHA;
use crate::control::request::rules::{COUNT, HORIZON, RELATIVE_RISK_AVERSION, TRADING_COST, whole, within};
use crate::control::request::specification::default_seed;
use crate::control::request::support::Support;

/// Lengths of the default windows in years, besides the window of all known returns.
pub(super) const WINDOW_YEARS: [usize; 2] = [10, 20];

impl AssetsChoices {
    /// Returns the default choices for a record of `found` periods with `periods_per_year` in a year. The windows are
    /// those that leave one year of the record, or else half of it.
    pub fn usual(periods_per_year: usize, found: usize) -> Self {
        let long = WINDOW_YEARS.map(|years| years * periods_per_year);
        let mut windows: Vec<_> =
            long.into_iter().filter(|window| window + periods_per_year <= found).map(Some).collect();
        if windows.is_empty() {
            windows.push(Some(usual_window(long[0], found, periods_per_year)));
        }
        AssetsChoices {
            strategies: vec![StrategyFamily::OneStep],
            windows: windows.into_iter().chain([None]).collect(),
            every: periods_per_year,
            horizon: None,
            count: None,
            alpha: 0.1,
            risk_aversion: defaults::risk_aversion(),
            support: Support::default(),
            means: MeansRule::default(),
            trading_cost: 0.0,
            limits: None,
            seed: default_seed(),
        }
    }

    pub(super) fn check(&self) -> Result<(), FieldError> {
        let count = self.windows.len();
        if !(1..=MOST_WINDOWS).contains(&count) {
            return Err(FieldError::new("window", format!("{count} windows"), format!("must be 1 to {MOST_WINDOWS}")));
        }
        for (index, window) in self.windows.iter().enumerate() {
            window.map_or(Ok(()), |window| whole("window", window, &DATES))?;
            if self.windows[..index].contains(window) {
                let value = window.map_or("all".to_owned(), |window| window.to_string());
                return Err(FieldError::new("window", value, "must not be named twice"));
            }
        }
        whole("every", self.every, &(1..=*DATES.end()))?;
        self.check_families()?;
        within("alpha", self.alpha, ALPHA.0, ALPHA.1)?;
        check_support("support", self.support)?;
        self.means.check("means", Some(self.support))?;
        within("risk_aversion", self.risk_aversion, RELATIVE_RISK_AVERSION.0, RELATIVE_RISK_AVERSION.1)?;
        within("trading_cost", self.trading_cost, TRADING_COST.0, TRADING_COST.1)
    }

    pub(super) fn check_limits(&self, assets: &[String]) -> Result<(), FieldError> {
        self.limits.as_ref().map_or(Ok(()), |limits| limits.check("limits", assets))
    }

    /// Returns the choices with the defaults of a policy, if one is trained.
    #[must_use]
    pub fn with_policy(mut self) -> Self {
        if self.trains() {
            self.horizon.get_or_insert(self.every);
            self.count.get_or_insert(defaults::count());
        }
        self
    }

    fn trains(&self) -> bool {
        self.strategies.contains(&StrategyFamily::Policy)
    }

    fn check_families(&self) -> Result<(), FieldError> {
        let families = &self.strategies;
        if families.is_empty() || families.len() > MOST_FAMILIES || families[1..].contains(&families[0]) {
            let rule = "must name policy, one_step or both, each once";
            return Err(FieldError::new("strategies", format!("{} names", families.len()), rule));
        }
        for (field, value, range) in [("horizon", self.horizon, &HORIZON), ("count", self.count, &COUNT)] {
            let Some(value) = value else { continue };
            if !self.trains() {
                let rule = "must be left out unless strategies has policy, because nothing else is trained";
                return Err(FieldError::new(field, value, rule));
            }
            whole(field, value, range)?;
        }
        if self.horizon.is_some_and(|horizon| self.every > horizon) {
            let rule = "must be at most horizon: each policy is used until the next is trained";
            return Err(FieldError::new("every", self.every, rule));
        }
        Ok(())
    }
}
