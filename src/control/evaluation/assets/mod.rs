//! Walk-forward of several assets: the share of each to hold in every period, by the one-step problem and by common
//! rules.
//!
//! Before a period a strategy chooses shares of wealth in the assets, the rest in the bank, from the returns that it
//! knows. It holds them through the period; nothing later is used. *Robust* is the one-step problem
//! ([`crate::control::assets`]) under power or log utility. Its ball is that of `POST /advise` ([`FundsBall`]) at a
//! level of caution, recomputed at the start of every block of periods. *Static* solves once per block and keeps its
//! shares; *plug-in* has the radius 0. None of these takes the trading cost into account. *Policy* is trained: it holds what
//! a live session holds ([`policy`]), with the trading cost in its training.

use serde::{Deserialize, Serialize};

use self::choices::WINDOW_YEARS;
use self::policy::{FundWalk, HeldPeriod};
use self::report::AssetsChoices;
use self::rules::{AssetsStrategy, NONE, Rule, equal, strategies};
use crate::control::assets::advising::FundsBall;
use crate::control::cache::Cache;
use crate::control::error::{FieldError, TrainError};
use crate::control::evaluation::account::{Account, keep_assets};
use crate::control::evaluation::names::check_own_names;
use crate::control::evaluation::own::{NamedShares, shares_of_assets};
use crate::control::evaluation::yearly_worth::{INITIAL_WEALTH, MixBooks};
use crate::control::policy::one_period::OnePeriod;
use crate::control::pool;
use crate::control::progress::Watch;
use crate::control::request::asset_history::AssetHistory;
use crate::control::request::assets::{AssetsProblem, check_names, check_rows};
use crate::control::request::backtest::{too_long, usual_window};
use crate::control::request::backtest_assets::StrategyFamily;
use crate::control::request::caution::CautionLevel;
use crate::control::request::frequency::Frequency;
use crate::control::request::frontier::asked_of;
use crate::control::request::own_weights::{OwnAssetsWeights, check_assets_weights};
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::specification::{DesignSpecification, ProblemSpecification, UtilitySpecification};

mod choices;
mod figures;
mod from_request;
pub mod policy;
pub mod report;
pub mod rules;
mod words;

/// Returns of several assets and of the bank, period by period.
#[derive(Debug, Clone, PartialEq)]
pub struct AssetsRecord {
    /// Names of the assets.
    pub assets: Vec<String>,
    /// Log-returns, one row per period and one column per asset.
    pub rows: AssetHistory,
    /// Simple returns of the bank.
    pub bank: Vec<f64>,
    /// Dates, with the precision of the frequency.
    pub dates: Vec<String>,
    /// How often a period occurs.
    pub frequency: Frequency,
    /// Periods in a year.
    pub periods_per_year: usize,
}

/// A prepared walk-forward.
#[derive(Debug, Clone)]
pub struct AssetsBacktest {
    /// The whole record.
    pub record: AssetsRecord,
    /// The checked choices.
    pub choices: AssetsChoices,
    /// The first period that is decided: after the longest window, or after 20 years if all returns are known.
    pub first: usize,
    /// Strategies of the user's own by name, with their shares date by date.
    pub own: Vec<NamedShares>,
}

/// The decisions of one strategy, period by period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum AssetsDecisions {
    /// Shares of wealth in the assets, whose accounts are still to be computed.
    Shares(Vec<Vec<f64>>),
    /// Shares and results of a policy, as a session reports them.
    Lived(Vec<HeldPeriod>),
}

/// The decisions and results of one strategy.
pub struct AssetsLine {
    /// Name in words.
    pub name: String,
    /// How the strategy chooses its shares.
    pub strategy: AssetsStrategy,
    /// Shares of wealth in the assets, period by period.
    pub held: Vec<Vec<f64>>,
    /// Radius of the ball in each period; 0 if there is none.
    pub radii: Vec<f64>,
    /// Its account; an allocation is the share in all assets together.
    pub account: Account,
    /// The accounts of equal shares at the strategy's own average total; none for equal shares themselves.
    pub own_mix: Option<MixBooks>,
}

/// The decisions of all strategies and their results.
pub struct AssetsWalked {
    /// The walk-forward that was run.
    pub backtest: AssetsBacktest,
    /// Strategies in their order.
    pub lines: Vec<AssetsLine>,
}

impl AssetsRecord {
    /// Returns the log-returns before `period` that are within a window.
    fn known(&self, period: usize, window: Option<usize>) -> AssetHistory {
        self.rows.of(window.map_or(0, |window| period.saturating_sub(window))..period)
    }
}

impl AssetsBacktest {
    /// Checks the choices, and every window of the record.
    ///
    /// # Errors
    /// A field that breaks its rule; the record is `simple_returns`.
    pub fn new(record: AssetsRecord, choices: AssetsChoices) -> Result<Self, FieldError> {
        let choices = choices.with_policy();
        choices.check()?;
        check_names("assets", &record.assets)?;
        choices.check_limits(&record.assets)?;
        let (found, year) = (record.rows.len(), record.periods_per_year);
        let longest = choices.windows.iter().flatten().max();
        let first = longest.copied().unwrap_or(usual_window(WINDOW_YEARS[1] * year, found, year));
        if found < first + year {
            return Err(too_long(first, found, year));
        }
        let backtest = AssetsBacktest { record, choices, first, own: Vec::new() };
        let support = Some(backtest.choices.support);
        for window in &backtest.choices.windows {
            for start in backtest.starts() {
                let known = &backtest.record.known(start, *window);
                check_rows("simple_returns", known, &backtest.record.assets, support).map_err(|error| {
                    let rule = format!("{}, in the {} periods before period {}", error.rule, known.len(), start + 1);
                    FieldError::new(error.field, error.value, rule)
                })?;
            }
        }
        Ok(backtest)
    }

    /// Adds strategies of the user's own.
    ///
    /// # Errors
    /// A name or a share that breaks a rule.
    pub fn with_own(mut self, own: OwnAssetsWeights) -> Result<Self, FieldError> {
        check_assets_weights(&own, self.record.assets.len(), self.record.rows.len())?;
        check_own_names(own.keys(), self.strategies().into_iter().map(|strategy| self.name_of(strategy)))?;
        self.own = shares_of_assets(&own, &self.record.rows, &self.record.bank, self.first)?;
        Ok(self)
    }

    /// Returns the name of a strategy in words.
    fn name_of(&self, strategy: AssetsStrategy) -> String {
        match strategy.rule {
            Rule::Own { place } => self.own[place].0.clone(),
            _ => strategy.name(|window| self.window_in_words(window)),
        }
    }

    /// Returns the log-returns of the periods that are decided.
    pub fn lived(&self) -> &[Vec<f64>] {
        &self.record.rows[self.first..]
    }

    /// Returns what the bank paid in these periods.
    pub fn bank(&self) -> &[f64] {
        &self.record.bank[self.first..]
    }

    /// Returns the dates of these periods.
    pub fn dates(&self) -> &[String] {
        &self.record.dates[self.first..]
    }

    /// Returns the utility of terminal wealth, also used for yearly wealth in the figures.
    pub fn utility(&self) -> UtilitySpecification {
        UtilitySpecification::relative(self.choices.risk_aversion)
    }

    /// Returns, in words, how much of the past the strategies of a window know.
    pub fn window_in_words(&self, window: Option<usize>) -> String {
        words::window(window, self.record.periods_per_year, self.record.frequency.noun())
    }

    /// Returns the number of parts of the work: blocks of periods per strategy, and radii per window.
    pub fn parts(&self) -> usize {
        self.starts().count() * (self.strategies().len() + self.solved_windows().len())
    }

    /// Returns the strategies in their order.
    pub fn strategies(&self) -> Vec<AssetsStrategy> {
        let own = (0..self.own.len()).map(|place| AssetsStrategy { rule: Rule::Own { place }, window: None });
        strategies(&self.choices.windows, &self.choices.strategies).into_iter().chain(own).collect()
    }

    /// Returns the strategies, each with the number of its first step of work in a job.
    pub fn steps(&self) -> Vec<(usize, AssetsStrategy)> {
        let number = |next: &mut usize, strategy: AssetsStrategy| {
            let first = *next;
            *next += if strategy.rule.is_policy() { self.starts().count() } else { 1 };
            Some((first, strategy))
        };
        self.strategies().into_iter().scan(0, number).collect()
    }

    /// Returns the number of steps of work in a job: one for each policy that is trained, and for each other strategy.
    pub fn step_count(&self) -> usize {
        // The last strategy trains no policy.
        self.steps().last().map_or(0, |(first, _)| first + 1)
    }

    /// Returns the first period of each block.
    fn starts(&self) -> impl Iterator<Item = usize> + use<> {
        (self.first..self.record.rows.len()).step_by(self.choices.every)
    }

    /// Decides every period on the current pool and computes the accounts. `done` is called after each of the
    /// [`parts`](Self::parts). Cost: a one-step problem per period for each of the robust strategies.
    ///
    /// # Errors
    /// [`TrainError::Stopped`].
    pub fn run(self, watch: &Watch, done: &(dyn Fn() + Sync)) -> Result<AssetsWalked, TrainError> {
        let balls = self.balls(watch, done)?;
        let held = pool::map(self.strategies(), |strategy| self.decide(strategy, &balls, watch, done));
        Ok(self.walked(&balls, held.into_iter().collect::<Result<_, _>>()?))
    }

    /// Returns the ball that holds for all funds at once, for each window at the start of every block, as `POST
    /// /advise` finds it.
    ///
    /// # Errors
    /// [`TrainError::Stopped`].
    pub fn balls(&self, watch: &Watch, done: &(dyn Fn() + Sync)) -> Result<Vec<Vec<FundsBall>>, TrainError> {
        let ball = |(window, start): (Option<usize>, usize)| {
            watch.go_on()?;
            let problem = self.problem(start, window);
            let fund = problem.fund(self.choices.seed)?;
            let ball = FundsBall::of(&problem, &OnePeriod::new(&fund, Cache::default()))?;
            done();
            Ok(ball)
        };
        let of_window = |&window: &Option<usize>| {
            let starts = self.starts().map(|start| (window, start)).collect();
            pool::map(starts, ball).into_iter().collect()
        };
        self.solved_windows().iter().map(of_window).collect()
    }

    /// Returns the windows whose balls are needed: all, or none if no strategy solves the one-step problem.
    fn solved_windows(&self) -> &[Option<usize>] {
        match self.choices.strategies.contains(&StrategyFamily::OneStep) {
            true => &self.choices.windows,
            false => &[],
        }
    }

    /// Returns the walks of the strategies that follow a policy.
    pub fn fund_walks(&self) -> Vec<FundWalk<'_>> {
        self.strategies().into_iter().filter_map(|strategy| self.fund_walk(strategy)).collect()
    }

    /// Returns the walk of a strategy that follows a policy; `None` for the others.
    pub fn fund_walk(&self, strategy: AssetsStrategy) -> Option<FundWalk<'_>> {
        let Rule::Policy { caution } = strategy.rule else { return None };
        let AssetsChoices { every, horizon, count, trading_cost, seed, .. } = self.choices;
        let problem = AssetsProblem {
            horizon,
            trading_cost,
            caution: Some(caution),
            ..self.problem(self.first, strategy.window)
        };
        let design = DesignSpecification { count, ..DesignSpecification::default() };
        Some(FundWalk {
            record: &self.record,
            first: self.first,
            window: strategy.window,
            every,
            problem,
            design,
            seed,
        })
    }

    /// Returns the problem that `POST /advise` would solve before a period with a window of returns. The bank is
    /// assumed to keep paying its last rate.
    fn problem(&self, period: usize, window: Option<usize>) -> AssetsProblem {
        let specification = ProblemSpecification {
            utility: self.utility(),
            radius: Some(RadiusRule::bridge(self.choices.alpha)),
            caution: Some(CautionLevel::Balanced),
            support: Some(self.choices.support),
            ..ProblemSpecification::of(Vec::new(), self.record.bank[period - 1])
        };
        let rows = self.record.known(period, window);
        let (means, limits) = (self.choices.means, self.choices.limits.clone());
        AssetsProblem { means, limits, ..asked_of(self.record.assets.clone(), rows, &specification) }
    }

    /// Returns the decisions of a strategy in every period, given the balls.
    ///
    /// # Errors
    /// As [`AssetsStrategy::decide`].
    pub fn decide(
        &self,
        strategy: AssetsStrategy,
        balls: &[Vec<FundsBall>],
        watch: &Watch,
        done: &(dyn Fn() + Sync),
    ) -> Result<AssetsDecisions, TrainError> {
        strategy.decide(self, self.balls_of(strategy, balls), watch, done)
    }

    /// Computes the accounts of the decisions of every strategy.
    pub fn walked(self, balls: &[Vec<FundsBall>], decided: Vec<AssetsDecisions>) -> AssetsWalked {
        let line = |(strategy, decided)| self.line(strategy, decided, self.balls_of(strategy, balls));
        let lines = self.strategies().into_iter().zip(decided).map(line).collect();
        AssetsWalked { lines, backtest: self }
    }

    fn balls_of<'a>(&self, strategy: AssetsStrategy, balls: &'a [Vec<FundsBall>]) -> &'a [FundsBall] {
        let at = self.choices.windows.iter().position(|window| *window == strategy.window);
        at.and_then(|at| balls.get(at)).map_or(&[][..], |balls| balls)
    }

    fn line(&self, strategy: AssetsStrategy, decided: AssetsDecisions, balls: &[FundsBall]) -> AssetsLine {
        let keep =
            |held: &[Vec<f64>]| keep_assets(held, self.lived(), self.bank(), self.choices.trading_cost, INITIAL_WEALTH);
        let level = strategy.rule.caution().unwrap_or(NONE);
        let radius = |period: usize| balls.get(period / self.choices.every).map_or(0.0, |ball| ball.radius_at(level));
        let (held, account, radii) = match decided {
            AssetsDecisions::Shares(held) => {
                let (account, radii) = (keep(&held), (0..held.len()).map(radius).collect());
                (held, account, radii)
            }
            AssetsDecisions::Lived(periods) => {
                let (account, radii) = (Account::of_policy(&periods), periods.iter().map(|held| held.radius).collect());
                (periods.into_iter().map(|held| held.shares).collect::<Vec<_>>(), account, radii)
            }
        };
        let is_equal = matches!(strategy.rule, Rule::Equal { .. });
        let mix = |total| keep(&vec![self.allowed(equal(self.record.assets.len(), total)); held.len()]);
        let own_mix = (!is_equal).then(|| MixBooks::new(account.mean_allocation(), mix));
        AssetsLine { name: self.name_of(strategy), strategy, radii, held, account, own_mix }
    }
}

#[cfg(test)]
mod tests {
    use super::report::AssetsBacktestReport;
    use super::*;
    use crate::control::assets::advice::AssetsAdvice;
    use crate::control::evaluation::analysis::{Analysis, StrategyLine};
    use crate::control::evaluation::backtest_report::{BacktestFigures, BootstrapEstimate};
    use crate::control::evaluation::names::StrategyKind;
    use crate::control::evaluation::walk_forward::{ActualPeriod, Decision};
    use crate::control::evaluation::yearly_worth::Scale;
    use crate::control::problem::actions::Band;
    use crate::numerics::bridge::funds::FundBridges;

    const BANK: f64 = 0.002;
    const COST: f64 = 0.001;

    fn log_return(asset: usize, period: usize) -> f64 {
        let (asset, period) = (asset as f64, period as f64);
        0.012 + 0.002 * asset + 0.03 * (1.7 * period).sin() + 0.02 * ((2.3 + asset) * period + asset).cos()
    }

    fn record(assets: usize, periods: usize, of: impl Fn(usize, usize) -> f64) -> AssetsRecord {
        AssetsRecord {
            assets: (0..assets).map(|asset| format!("asset {asset}")).collect(),
            rows: (0..periods)
                .map(|period| (0..assets).map(|asset| of(asset, period)).collect())
                .collect::<Vec<_>>()
                .into(),
            bank: vec![BANK; periods],
            dates: (0..periods).map(|period| period.to_string()).collect(),
            frequency: Frequency::Quarterly,
            periods_per_year: 4,
        }
    }

    fn walk(record: AssetsRecord) -> AssetsWalked {
        walk_at(record, 0.9)
    }

    fn walk_at(record: AssetsRecord, alpha: f64) -> AssetsWalked {
        let choices = AssetsChoices {
            windows: vec![Some(12), None],
            alpha,
            trading_cost: COST,
            limits: None,
            ..AssetsChoices::usual(record.periods_per_year, record.rows.len())
        };
        AssetsBacktest::new(record, choices).unwrap().run(&Watch::unwatched(), &|| ()).unwrap()
    }

    fn named<'a>(walked: &'a AssetsWalked, name: &str) -> &'a AssetsLine {
        let names: Vec<&str> = walked.lines.iter().map(|line| line.name.as_str()).collect();
        walked.lines.iter().find(|line| line.name == name).unwrap_or_else(|| panic!("{name} is none of {names:?}"))
    }

    /// Checks the robust strategy also: half of three equal assets is half of one.
    #[test]
    fn assets_that_are_one_have_the_rows_of_one() {
        let walked = walk(record(3, 30, |_, period| log_return(0, period)));
        let lived: Vec<ActualPeriod> =
            (12..30).map(|period| ActualPeriod { log_return: log_return(0, period), bank_return: BANK }).collect();
        let names = ["Equal shares", "60 % in equal shares", "Robust, balanced, knows 3 years"];
        let line = |name: &str| {
            let decision = |share: &f64| Decision { band: Band::of(&[*share]), radius: 0.0, source: None };
            let decisions = named(&walked, name).account.allocations.iter().map(decision).collect();
            StrategyLine::new((StrategyKind::Adaptive, name.into()), decisions, &lived, COST)
        };
        let lines = names.map(line);
        assert!(lines[2].account.allocations.iter().all(|share| (0.05..1.0).contains(share)), "{:?}", lines[2].account);
        let scale =
            Scale { periods_per_year: 4, utility: walked.backtest.utility(), seed: walked.backtest.choices.seed };
        let expected = Analysis::of(&lines, 0, &lived, COST, &scale).figures;
        let report = AssetsBacktestReport::new(&walked);
        for BacktestFigures { strategy, performance, .. } in &expected {
            let beyond_own_mix = &performance.beyond_own_mix;
            let found = report.strategies.iter().find(|figures| figures.strategy == *strategy).unwrap();
            let one = expected.iter().find(|figures| figures.strategy == *strategy).unwrap();
            let estimates = [
                (found.performance.yearly_certainty_equivalent, one.performance.yearly_certainty_equivalent),
                (found.performance.annual_mean, one.performance.annual_mean),
                (found.performance.annual_volatility, one.performance.annual_volatility),
                (found.performance.annual_turnover, one.performance.annual_turnover),
            ];
            let beyond = found.performance.beyond_own_mix.zip(*beyond_own_mix);
            assert_eq!(
                (beyond.is_some(), found.performance.beyond_own_mix.is_some()),
                (strategy.starts_with("Robust"), beyond_own_mix.is_some())
            );
            // The interval is wider if there are more strategies.
            let value = |found: BootstrapEstimate| BootstrapEstimate { value: found.value, interval: [found.value; 2] };
            let beyond = beyond.map(|(found, one)| (value(found), value(one)));
            for (found, one) in estimates.into_iter().chain(beyond) {
                let ends = found.interval.iter().zip(one.interval);
                let apart =
                    ends.map(|(found, one)| (found - one).abs()).fold((found.value - one.value).abs(), f64::max);
                assert!(apart < 1e-4, "{strategy}: {found:?} {one:?}");
            }
            assert!(
                (found.performance.max_drawdown - one.performance.max_drawdown).abs() < 1e-6
                    && found.effective_assets.unwrap() > 2.99
            );
        }
    }

    /// Checks that plug-in attains the best mean utility over all funds of the known returns: no grid point has more.
    #[test]
    fn plug_in_is_best_by_direct_search_and_robust_holds_less() {
        let walked = walk(record(2, 24, log_return));
        let plug_in = &named(&walked, "Trusts the record, knows all").held[0];
        let rows = &walked.backtest.record.rows[..12];
        let mean = |shares: [f64; 2]| {
            let wealth = |row: &Vec<f64>| {
                let risky: f64 = shares.iter().zip(row).map(|(share, z)| share * z.exp()).sum();
                (1.0 - shares[0] - shares[1]) * (1.0 + BANK) + risky
            };
            -rows.iter().map(|row| wealth(row).powi(-2)).sum::<f64>()
        };
        let grid = (0..=100).flat_map(|i| (0..=100 - i).map(move |j| [i as f64 / 100.0, j as f64 / 100.0]));
        let best = grid.map(mean).fold(f64::NEG_INFINITY, f64::max);
        // Twelve periods of a hundredth of a basis point.
        assert!(mean([plug_in[0], plug_in[1]]) > best - 12.0 * 2.0 * 1e-6, "{plug_in:?}");
        // At a small radius all shares are equal, and the whole usual radius leaves little in the assets.
        let all: f64 = plug_in.iter().sum();
        let careful = walk_at(record(2, 24, log_return), 0.1);
        let total =
            |level: &str| named(&careful, &format!("Robust, sup norm, {level}, knows all")).account.allocations[0];
        let [full, balanced] = ["full caution", "balanced"].map(total);
        assert!(full < balanced && balanced <= all + 1e-6 && full < 0.9 * all, "{full} {balanced} {all}");
    }

    #[test]
    fn nothing_later_is_used_and_a_window_forgets() {
        let walked = walk(record(2, 28, log_return));
        let changed = |from: usize, to: usize| {
            walk(record(2, 28, |asset, period| {
                log_return(asset, period) - if (from..to).contains(&period) { 0.05 } else { 0.0 }
            }))
        };
        let later = changed(20, 28);
        for (line, other) in walked.lines.iter().zip(&later.lines) {
            assert_eq!(line.held[..=8], other.held[..=8], "{}", line.name);
            let knows = !matches!(line.strategy.rule, Rule::Equal { .. });
            assert_eq!(line.held[9..] != other.held[9..], knows, "{}", line.name);
        }
        let before = changed(0, 4);
        for (line, other) in walked.lines.iter().zip(&before.lines) {
            // Radii and static shares of a year date from its start, which is at least three years after the change.
            let forgets = line.strategy.window.is_some() || matches!(line.strategy.rule, Rule::Equal { .. });
            let apart = line.held[4..].iter().flatten().zip(other.held[4..].iter().flatten());
            let apart = apart.map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
            assert_eq!(apart < 1e-4, forgets, "{}: {apart}", line.name);
        }
    }

    #[test]
    fn static_keeps_its_shares_for_a_year_and_radii_are_those_of_its_start() {
        let walked = walk(record(2, 22, log_return));
        let kept = named(&walked, "Robust, rarely renewed, balanced, knows all");
        assert!(kept.held.len() == 10 && kept.held.chunks(4).all(|year| year.iter().all(|held| *held == year[0])));
        assert_ne!(kept.held[3], kept.held[4]);
        let robust = named(&walked, "Robust, balanced, knows all");
        assert_eq!((&kept.held[0], &kept.radii), (&robust.held[0], &robust.radii));
        let wide = named(&walked, "Robust, full caution, knows all");
        assert!(wide.radii.iter().zip(&robust.radii).all(|(whole, share)| share <= whole));
        // At least the radius of one fund: its bridges' quantile over the square root of the number of returns.
        let rows = &walked.backtest.record.rows[..16];
        let bridges = FundBridges::simulate(rows, 500, walked.backtest.choices.seed);
        let half = bridges.quantile(&[0.5, 0.5], 0.9).value / 4.0;
        assert!(wide.radii[4] > half && wide.radii[4] < 3.0 * half, "{} {half}", wide.radii[4]);
    }

    /// Checks each level against the shares that `POST /advise` holds at the start of the walk-forward.
    #[test]
    fn a_level_holds_what_advice_at_that_level_holds() {
        let walked = walk(record(3, 24, log_return));
        for (level, name) in
            [(CautionLevel::Bold, "bold"), (CautionLevel::Cautious, "cautious"), (CautionLevel::Paper, "full caution")]
        {
            let line = named(&walked, &format!("Robust, {name}, knows 3 years"));
            let problem = AssetsProblem { caution: Some(level), ..walked.backtest.problem(12, Some(12)) };
            let fund = OnePeriod::new(&problem.fund(walked.backtest.choices.seed).unwrap(), Cache::default());
            let (advice, _) = AssetsAdvice::of(&problem, &[0.0; 3], &fund).unwrap();
            assert_eq!(line.held[0], advice.allocation.into_values().collect::<Vec<f64>>(), "{name}");
            assert!((line.radii[0] - advice.radius).abs() < 1e-12, "{name}");
        }
    }

    #[test]
    fn choices_and_records_that_break_a_rule_are_named() {
        let record = |periods| record(2, periods, log_return);
        let usual = AssetsChoices { windows: vec![Some(8)], ..AssetsChoices::usual(4, 200) };
        let message = |record, choices| AssetsBacktest::new(record, choices).err().unwrap().to_string();
        let windows = |windows: &[Option<usize>]| AssetsChoices { windows: windows.to_vec(), ..usual.clone() };
        assert_eq!(message(record(30), windows(&[None, None])), "window is all: must not be named twice");
        assert_eq!(message(record(30), windows(&[Some(1)])), "window is 1: must lie in [2, 10000]");
        let usual_windows = |found| AssetsChoices::usual(4, found).windows;
        assert_eq!(usual_windows(84), [Some(40), Some(80), None]);
        assert_eq!(usual_windows(48), [Some(40), None]);
        assert_eq!(usual_windows(30), [Some(15), None]);
        let short = "window is 8: must be at most 7: the record has 11 periods, and a year of 4 must follow the window";
        assert_eq!(message(record(11), usual.clone()), short);
        assert_eq!(
            message(record(30), AssetsChoices { every: 0, ..usual.clone() }),
            "every is 0: must lie in [1, 10000]"
        );
        let still = AssetsRecord { rows: vec![vec![0.01, 0.02]; 30].into(), ..record(30) };
        let still = message(still, usual.clone());
        assert!(still.contains("must vary") && still.ends_with("in the 8 periods before period 9"), "{still}");
        let alike = AssetsRecord { assets: vec!["a".into(), "a".into()], ..record(30) };
        assert_eq!(message(alike, usual), "assets[1] is a: must differ from the other names");
    }
}
