//! A whole walk-forward: turns the request into strategies and periods, and their decisions into accounts.

use jiff::civil::Date;

use crate::control::error::{FieldError, TrainError};
use crate::control::evaluation::analysis::{Analysis, StrategyLine};
use crate::control::evaluation::names::{StrategyKind, at_level, check_own_names, mix_name};
use crate::control::evaluation::own::shares_of_one;
use crate::control::evaluation::walk_forward::{ActualPeriod, Decision, Strategy, WalkForward};
use crate::control::evaluation::yearly_worth::Scale;
use crate::control::problem::actions::Band;
use crate::control::progress::Watch;
use crate::control::request::backtest::BacktestRequest;
use crate::control::request::framework::Framework;
use crate::control::request::frequency::Frequency;
use crate::control::request::learning::Learning;
use crate::control::request::rules;
use crate::control::request::specification::ProblemSpecification;
use crate::control::request::warnings::Warning;

/// A prepared walk-forward.
#[derive(Debug, Clone)]
pub struct Backtest {
    /// The completed request.
    pub request: BacktestRequest,
    /// How policies are trained.
    pub walk: WalkForward,
    /// Frequency of the dates; none if the periods have no dates.
    pub frequency: Option<Frequency>,
    /// Periods in a year.
    pub periods_per_year: usize,
    /// The whole record.
    pub periods: Vec<ActualPeriod>,
    /// Strategies with their kinds and names: the adaptive ones first, in the order of their levels.
    pub strategies: Vec<((StrategyKind, String), Strategy)>,
    /// Strategies of the user's own by name, with their shares in the periods that are decided.
    own: Vec<(String, Vec<f64>)>,
    days: Vec<Date>,
}

/// The decisions of all strategies and their results.
pub struct Walked {
    /// The walk-forward that was run.
    pub backtest: Backtest,
    /// Strategies in their order, then the mix against which the timing of the main one is measured.
    pub lines: Vec<StrategyLine>,
    /// The figures.
    pub analysis: Analysis,
}

impl Backtest {
    /// Completes and checks the request, including the training of every window.
    ///
    /// # Errors
    /// A field that breaks its rule.
    pub fn new(request: BacktestRequest) -> Result<Self, FieldError> {
        let request = request.completed()?;
        let given = |field: Option<usize>| field.unwrap_or_default();
        let walk = WalkForward {
            window: given(request.window),
            every: given(request.every),
            horizon: given(request.horizon),
            scale: request.scale,
            caution: request.caution,
            support: request.support,
            centre: request.centre.clone(),
            risk_aversion: request.risk_aversion,
            trading_cost: if request.cost_blind { 0.0 } else { request.trading_cost },
            count: request.count,
            seed: request.seed,
        };
        let (field, returns) = request.returns();
        let period = |(index, &value): (usize, &f64)| ActualPeriod {
            log_return: request.log_return(value),
            bank_return: request.rate.at(index),
        };
        let periods: Vec<ActualPeriod> = returns.iter().enumerate().map(period).collect();
        for stretch in 0..walk.stretches(periods.len()) {
            let start = stretch * walk.every;
            let past: Vec<f64> = periods[start..start + walk.window].iter().map(|period| period.log_return).collect();
            rules::history(field, &past, Learning::default()).map_err(|error| {
                let rule = format!("{}, in the window from period {} on", error.rule, start + 1);
                FieldError::new(error.field, error.value, rule)
            })?;
        }
        walk.specification(Framework::Adaptive, request.alpha[0], &periods[..walk.window])
            .completed()
            .map_err(|error| renamed(error, field))?;
        let strategies = strategies(&request);
        check_own_names(request.weights.keys(), strategies.iter().map(|((_, name), _)| name.clone()))?;
        let log_returns: Vec<f64> = periods.iter().map(|period| period.log_return).collect();
        let bank = |period: usize| periods[period].bank_return;
        let own = shares_of_one(&request.weights, &log_returns, bank, walk.window)?;
        Ok(Backtest {
            own,
            frequency: request.frequency()?,
            periods_per_year: given(request.periods_per_year),
            days: request.days(),
            strategies,
            request,
            walk,
            periods,
        })
    }

    /// Returns the periods that are decided, after the first window.
    pub fn lived(&self) -> &[ActualPeriod] {
        &self.periods[self.walk.window..]
    }

    /// Returns their dates, with the precision of the frequency.
    pub fn dates(&self) -> Option<Vec<String>> {
        let frequency = self.frequency?;
        Some(self.days.iter().skip(self.walk.window).map(|date| frequency.shown(*date)).collect())
    }

    /// Returns the noun for a period.
    pub fn noun(&self) -> &'static str {
        self.frequency.map_or("period", Frequency::noun)
    }

    /// Returns the index of the main line: the second adaptive strategy, or the only one.
    pub fn main_line(&self) -> usize {
        main_level(&self.request)
    }

    /// Returns the strategies without their names.
    pub fn plain_strategies(&self) -> Vec<Strategy> {
        self.strategies.iter().map(|(_, strategy)| *strategy).collect()
    }

    /// Returns the number of policies to train.
    pub fn trainings(&self) -> usize {
        self.walk.trainings(&self.plain_strategies(), &self.periods)
    }

    /// Returns warnings about likely mistakes, judged on the last window; fields are named as in the request.
    pub fn warnings(&self) -> Vec<Warning> {
        let last = &self.periods[self.periods.len() - self.walk.window..];
        let problem = ProblemSpecification {
            periods_per_year: Some(self.periods_per_year as f64),
            trading_cost: self.request.trading_cost,
            ..self.walk.specification(Framework::Adaptive, self.request.alpha[0], last).problem
        };
        problem.warnings().into_iter().map(|warning| warning.of_walk(self.request.returns().0)).collect()
    }

    /// Returns the number of steps of all their trainings.
    pub fn steps(&self) -> usize {
        self.walk.steps(&self.plain_strategies(), &self.periods)
    }

    /// Decides every period on the current pool and computes the accounts; `solved` is called after each of the
    /// [`steps`](Self::steps).
    ///
    /// # Errors
    /// As [`WalkForward::decide`].
    pub fn run(self, watch: &Watch, solved: &(dyn Fn() + Sync)) -> Result<Walked, TrainError> {
        let decisions = self.walk.decide(&self.plain_strategies(), &self.periods, watch, solved)?;
        Ok(self.walked(decisions))
    }

    /// Computes the accounts and figures of the decisions of each strategy.
    pub fn walked(self, decisions: Vec<Vec<Decision>>) -> Walked {
        let (cost, main, lived) = (self.request.trading_cost, self.main_line(), self.lived());
        let names = self.strategies.iter().map(|(name, _)| name.clone());
        let mut lines: Vec<StrategyLine> =
            names.zip(decisions).map(|(name, decisions)| StrategyLine::new(name, decisions, lived, cost)).collect();
        let own = self.own.iter().map(|(name, shares)| {
            let decision = |share: &f64| Decision { band: Band::of(&[*share]), radius: 0.0, source: None };
            let decisions = shares.iter().map(decision).collect();
            StrategyLine::new((StrategyKind::Own, name.clone()), decisions, lived, cost)
        });
        lines.extend(own);
        lines.push(lines[main].hindsight(lived, cost));
        let (periods_per_year, seed) = (self.periods_per_year, self.walk.seed);
        let scale = Scale { periods_per_year, utility: self.walk.utility(), seed };
        let analysis = Analysis::of(&lines, main, lived, cost, &scale);
        Walked { backtest: self, lines, analysis }
    }
}

fn main_level(request: &BacktestRequest) -> usize {
    usize::from(request.alpha.len() > 1)
}

fn strategies(request: &BacktestRequest) -> Vec<((StrategyKind, String), Strategy)> {
    let plain = |kind: StrategyKind, strategy: Strategy| ((kind, kind.name().to_owned()), strategy);
    let adaptive = request.alpha.iter().map(|&alpha| match request.alpha[..] {
        [_] => plain(StrategyKind::Adaptive, Strategy::Adaptive { alpha }),
        _ => ((StrategyKind::Adaptive, at_level(alpha)), Strategy::Adaptive { alpha }),
    });
    let mix = |kind: StrategyKind, share: f64| ((kind, mix_name(share)), Strategy::Mix { share });
    let alpha = request.alpha[main_level(request)];
    let knows_cost = request.trading_cost > 0.0 && !request.cost_blind;
    let blind = knows_cost.then(|| plain(StrategyKind::CostBlind, Strategy::CostBlind { alpha }));
    adaptive
        .chain(blind)
        .chain([
            plain(StrategyKind::Static, Strategy::Static { alpha }),
            plain(StrategyKind::PlugIn, Strategy::PlugIn),
            mix(StrategyKind::SixtyForty, 0.6),
            mix(StrategyKind::AllStock, 1.0),
            mix(StrategyKind::AllBank, 0.0),
        ])
        .collect()
}

/// Renames the field of a rule broken by a training to the request's name for it.
fn renamed(error: FieldError, returns: &str) -> FieldError {
    let field = match error.field.as_str() {
        "problem.history" => returns.to_owned(),
        // The rule is about the bridges of a window.
        "problem.radius.paths" => "window".to_owned(),
        other if ["centre", "caution", "support"].iter().any(|part| other.starts_with(&format!("problem.{part}"))) => {
            other.trim_start_matches("problem.").to_owned()
        }
        other => other.rsplit('.').next().unwrap_or(other).to_owned(),
    };
    FieldError { field, ..error }
}
