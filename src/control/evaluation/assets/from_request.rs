//! Turns a request for a walk-forward of several assets into a prepared walk-forward.

use super::report::AssetsChoices;
use super::rules::Rule;
use super::{AssetsBacktest, AssetsRecord};
use crate::control::error::FieldError;
use crate::control::request::backtest::{MOST_STEPS, MOST_TRAININGS, days};
use crate::control::request::backtest_assets::{AssetsBacktestRequest, MOST_HELD, MOST_READ};
use crate::control::request::specification::ProblemSpecification;
use crate::control::request::warnings::Warning;
use crate::numerics::bridge::funds::fund_returns;
use crate::numerics::transport::water_filling::inverse_volatility;

impl AssetsBacktest {
    /// Checks and completes a request, and bounds its size.
    ///
    /// # Errors
    /// A field that breaks its rule.
    pub fn from_request(request: &AssetsBacktestRequest) -> Result<Self, FieldError> {
        let (frequency, periods_per_year) = request.check()?;
        let (field, returns) = request.returns();
        let record = AssetsRecord {
            assets: request.assets.clone(),
            rows: request.log_rows(),
            bank: (0..returns.len()).map(|index| request.rate.at(index)).collect(),
            dates: days(&request.dates).into_iter().map(|date| frequency.shown(date)).collect(),
            frequency,
            periods_per_year,
        };
        let usual = AssetsChoices::usual(periods_per_year, request.dates.len());
        let choices = AssetsChoices {
            strategies: request.strategies.clone(),
            windows: request.windows.clone().unwrap_or(usual.windows),
            every: request.every.unwrap_or(usual.every.min(request.horizon.unwrap_or(usual.every))),
            horizon: request.horizon,
            count: request.count,
            alpha: request.alpha.unwrap_or(usual.alpha),
            support: request.support,
            means: request.means,
            risk_aversion: request.risk_aversion,
            trading_cost: request.trading_cost,
            limits: request.limits.clone(),
            seed: request.seed,
        };
        let backtest = AssetsBacktest::new(record, choices).map_err(|error| renamed(error, field))?;
        let backtest = backtest.with_own(request.weights.clone())?;
        backtest.check_size(field)?;
        Ok(backtest)
    }

    /// Returns the number of shares that all strategies hold over all periods.
    pub fn shares(&self) -> usize {
        let held = self.lived().len().saturating_mul(self.strategies().len());
        held.saturating_mul(self.record.assets.len())
    }

    fn check_size(&self, field: &str) -> Result<(), FieldError> {
        let (shares, solved) = (self.shares(), self.read());
        if shares > MOST_HELD {
            let rule = format!(
                "must be fewer: all strategies together would hold {shares} shares, and at most {MOST_HELD} are allowed"
            );
            return Err(FieldError::new(field, format!("{} periods", self.record.rows.len()), rule));
        }
        if solved > MOST_READ {
            let rule = format!(
                "must be fewer or shorter: their one-step problems would read {solved} log-returns, and at most {MOST_READ} are allowed"
            );
            return Err(FieldError::new("windows", format!("{} windows", self.choices.windows.len()), rule));
        }
        let trainings = self.trainings();
        let steps = trainings.saturating_mul(self.choices.horizon.unwrap_or_default());
        if trainings > MOST_TRAININGS || steps > MOST_STEPS {
            let rule = format!(
                "must be larger: {trainings} policies of {steps} steps in all would be trained, and at most {MOST_TRAININGS} of {MOST_STEPS} steps are allowed"
            );
            return Err(FieldError::new("every", self.choices.every, rule));
        }
        Ok(())
    }

    /// Returns the number of policies that are trained.
    fn trainings(&self) -> usize {
        let policies = self.strategies().into_iter().filter(|strategy| strategy.rule.is_policy());
        policies.count() * self.starts().count()
    }

    /// Returns how many log-returns the one-step problems of all periods read.
    fn read(&self) -> usize {
        let is_solved = |rule: &Rule| matches!(rule, Rule::Robust { .. } | Rule::Policy { .. });
        let periods = self.first..self.record.rows.len();
        let known = |window: Option<usize>| {
            periods.clone().map(|period| window.map_or(period, |window| window.min(period))).sum::<usize>()
        };
        let solved = self.strategies().into_iter().filter(|strategy| is_solved(&strategy.rule));
        solved.map(|strategy| known(strategy.window)).sum::<usize>().saturating_mul(self.record.assets.len())
    }

    /// Returns warnings about likely mistakes, judged on the inverse-volatility fund over the first periods that are
    /// decided. Fields are named as in `request`.
    pub fn warnings(&self, request: &AssetsBacktestRequest) -> Vec<Warning> {
        let rows = &self.record.known(self.first, self.choices.windows.iter().copied().flatten().max());
        let returns = fund_returns(&self.choices.means.applied(rows), &inverse_volatility(rows));
        let problem = ProblemSpecification {
            periods_per_year: Some(self.record.periods_per_year as f64),
            trading_cost: self.choices.trading_cost,
            support: Some(self.choices.support),
            ..ProblemSpecification::of(returns, self.record.bank[self.first - 1])
        };
        let estimated = rows.warning(&self.record.assets);
        problem.warnings().into_iter().chain(estimated).map(|warning| warning.of_walk(request.returns().0)).collect()
    }
}

/// Renames the field of a rule broken by the walk-forward to the request's name for it.
fn renamed(error: FieldError, returns: &str) -> FieldError {
    let field = match error.field.strip_prefix("simple_returns") {
        Some(at) => format!("{returns}{at}"),
        None if error.field == "window" => "windows".to_owned(),
        None => error.field,
    };
    FieldError { field, ..error }
}
