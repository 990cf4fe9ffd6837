//! Sentences about the figures, flattering or not, by rules that treat all strategies alike; and the report of both.

use crate::control::evaluation::analysis::StrategyLine;
use crate::control::evaluation::backtest::{Backtest, Walked};
use crate::control::evaluation::backtest_report::{
    BacktestChoices, BacktestFigures, BacktestPeriods, BacktestReport, BootstrapEstimate, FORMAT,
};
use crate::control::evaluation::names::{StrategyKind, quoted};
use crate::control::evaluation::resampling::intervals;
use crate::control::evaluation::walk_forward::Decision;
use crate::control::evaluation::yearly_worth::CONFIDENCE;
use crate::control::policy::advice::AdviceSource;
use crate::numerics::machine::digits::{fixed, signed};

/// Fewer years say too little about the next one. A crash that comes once in ten years is missing from 35 % of ten-year
/// records, 12 % of twenty-year ones and 4 % of thirty-year ones. An interval counts only what is in the record.
const FEWEST_YEARS: usize = 30;
/// A hundredth of a millionth of the initial wealth: a smaller difference is rounding.
const ROUNDING: f64 = 1e-6;

/// Returns what the figures say in sentences, the most important first.
pub fn sentences(walked: &Walked) -> Vec<String> {
    let Walked { backtest, lines, analysis } = walked;
    let (figures, main) = (&analysis.figures, backtest.main_line());
    let mut sentences = vec![ranking(figures, main)];
    sentences.extend(uncounted(analysis.uncounted_periods, backtest.noun()));
    let others = figures.iter().enumerate().filter(|(index, _)| *index != main).map(|(_, other)| other);
    match few_years(analysis.years) {
        Some(sentence) => sentences.push(sentence),
        None => {
            sentences.push(against(others));
            sentences.extend(timing(figures, main));
            sentences.push(timing_of_others(figures, main));
        }
    }
    sentences.push(holding(&figures[main], backtest));
    sentences.extend(drawdown(figures, main));
    sentences.push(guard(&lines[main], backtest.noun()));
    let blind = backtest.request.cost_blind;
    let known =
        if blind { "no policy knows of it" } else { "policies are trained with it, except the one blind to costs" };
    sentences.push(cost(backtest.request.trading_cost, known));
    sentences
}

/// Returns the statement that replaces comparisons if there are too few years to compare.
pub fn few_years(years: usize) -> Option<String> {
    let sentence = || {
        format!(
            "Whole years: {years}. Comparing the strategies takes at least {FEWEST_YEARS}. A crash that comes once in \
             ten years is missing from one in eight records of 20 years, and intervals count only what was seen."
        )
    };
    (years < FEWEST_YEARS).then(sentence)
}

/// Describes the periods that belong to no year; none if there are none.
pub fn uncounted(periods: usize, noun: &str) -> Option<String> {
    let first = match periods {
        0 => return None,
        1 => format!("The first {noun} counts"),
        _ => format!("The first {periods} {noun}s count"),
    };
    Some(format!("{first} in no year: years end with the last {noun}."))
}

fn ranking(figures: &[BacktestFigures], main: usize) -> String {
    let value = |figures: &BacktestFigures| figures.performance.yearly_certainty_equivalent.value;
    let main = &figures[main];
    let placed = figures.iter().filter(|figures| figures.place.is_some()).count();
    let best = figures.iter().find(|figures| figures.place == Some(1)).filter(|_| main.place != Some(1));
    let best =
        best.map_or(String::new(), |best| format!(" The first is {} with {:.2}.", quoted(&best.strategy), value(best)));
    format!(
        "With {} a year that starts at 100 is worth {:.2} for certain, place {} of {placed}.{best}",
        quoted(&main.strategy),
        value(main),
        main.place.unwrap_or(placed)
    )
}

/// Names the strategies that are behind, ahead, or indistinguishable.
fn against<'a>(others: impl Iterator<Item = &'a BacktestFigures>) -> String {
    let groups = grouped(others.map(|other| (other.strategy.as_str(), other.adaptive_ahead)));
    let compared = all_at_once(groups.iter().map(Vec::len).sum());
    let [better, worse, unclear] = groups.map(|names| listed(&names));
    format!(
        "By the intervals of the differences, {compared}, it is better than: {better}. Worse than: {worse}. No clear difference from: {unclear}."
    )
}

/// Returns, in words, how many intervals hold simultaneously.
pub fn all_at_once(comparisons: usize) -> String {
    let percent = 100.0 * CONFIDENCE;
    match comparisons {
        1 => format!("which holds with {percent:.0} % confidence"),
        _ => format!("of which all {comparisons} hold at once with {percent:.0} % confidence"),
    }
}

/// Groups the names by intervals above zero, below zero and around zero.
pub fn grouped<'a>(differences: impl Iterator<Item = (&'a str, BootstrapEstimate)>) -> [Vec<&'a str>; 3] {
    let mut groups: [Vec<&str>; 3] = Default::default();
    for (name, BootstrapEstimate { interval: [low, high], .. }) in differences {
        let group = match () {
            () if low > ROUNDING => 0,
            () if high < -ROUNDING => 1,
            () => 2,
        };
        groups[group].push(name);
    }
    groups
}

/// Lists names, quoted.
pub fn listed(names: &[&str]) -> String {
    let names: Vec<String> = names.iter().map(|name| quoted(name)).collect();
    if names.is_empty() { "none".into() } else { names.join("; ") }
}

/// Describes the gain of a strategy over a constant mix of its own average allocation, and whether `witness` shows an
/// effect of changing the allocation.
pub fn beside_own_mix(strategy: &str, allocation: f64, value: f64, [low, high]: [f64; 2], witness: &str) -> String {
    let verdict = match () {
        () if low > 0.0 => "changing the allocation paid".into(),
        () if high < 0.0 => "changing the allocation cost".into(),
        () => format!("{witness} not show that changing the allocation did anything"),
    };
    format!(
        "Against a constant mix of its own average allocation, {:.1} %, which nobody knew beforehand, {} differs \
         by {} [{}, {}]: {verdict}.",
        100.0 * allocation,
        quoted(strategy),
        signed(value, 2),
        fixed(low, 2),
        fixed(high, 2)
    )
}

/// Describes whether changing the allocation did anything that its average would not have done.
fn timing(figures: &[BacktestFigures], main: usize) -> Option<String> {
    let main = &figures[main];
    let BootstrapEstimate { value, interval } = main.performance.beyond_own_mix?;
    Some(beside_own_mix(&main.strategy, main.performance.mean_allocation, value, interval, "the record does"))
}

/// Describes the timing of every other strategy that changes its allocation.
fn timing_of_others(figures: &[BacktestFigures], main: usize) -> String {
    let others = figures.iter().enumerate().filter(|(index, _)| *index != main);
    let [paid, cost, unclear] =
        grouped(others.filter_map(|(_, other)| Some((other.strategy.as_str(), other.performance.beyond_own_mix?))))
            .map(|names| listed(&names));
    format!(
        "Compared with such mixes of their own, by intervals that also hold at once, changing the allocation paid for: {paid}. It cost: {cost}. The record shows neither for: {unclear}."
    )
}

fn holding(figures: &BacktestFigures, backtest: &Backtest) -> String {
    let held = if figures.performance.mean_allocation <= 0.0 {
        "it never held stocks, so its returns are the bank's".into()
    } else {
        format!("on average {:.1} % in the risky asset", 100.0 * figures.performance.mean_allocation)
    };
    format!(
        "It held nothing but the bank in {:.0} % of {} {}s; {held}.",
        100.0 * figures.all_bank_share,
        backtest.lived().len(),
        backtest.noun()
    )
}

fn drawdown(figures: &[BacktestFigures], main: usize) -> Option<String> {
    let stock = figures.iter().find(|figures| figures.kind == StrategyKind::AllStock)?;
    Some(format!(
        "Its largest fall from a peak was {:.1} %, that of all in stocks {:.1} %; 100 became {:.0}, all in stocks {:.0}.",
        100.0 * figures[main].performance.max_drawdown,
        100.0 * stock.performance.max_drawdown,
        figures[main].performance.final_wealth,
        stock.performance.final_wealth
    ))
}

/// Describes how often the surrogate could not be trusted and the step was solved.
fn guard(line: &StrategyLine, noun: &str) -> String {
    let decisions = &line.decisions;
    let resolved = decisions.iter().filter(|one| one.source == Some(AdviceSource::ResolvedOutsideDesign)).count();
    format!(
        "In {:.0} % of the {noun}s the state lay outside the design and the robust step was solved anew.",
        100.0 * resolved as f64 / decisions.len() as f64
    )
}

/// Describes the cost of trading in every account; `known` states which strategies take it into account.
pub fn cost(cost: f64, known: &str) -> String {
    if cost > 0.0 {
        // Rounded to a millionth, because later digits come from binary fractions.
        let basis_points = (1e10 * cost).round() / 1e6;
        format!("Trading costs {basis_points} bp of what is traded in every account; {known}.")
    } else {
        "Trading costs nothing here: strategies that trade much look better than they would be.".into()
    }
}

impl BacktestReport {
    /// Builds the report of a finished walk-forward.
    pub fn new(walked: &Walked) -> Self {
        let Walked { backtest, lines, analysis } = walked;
        let (request, walk) = (&backtest.request, &backtest.walk);
        BacktestReport {
            format: FORMAT.to_owned(),
            frequency: backtest.frequency.map(|frequency| frequency.adjective().to_owned()),
            periods_per_year: backtest.periods_per_year,
            dates: backtest.dates(),
            whole_years: analysis.years,
            uncounted_periods: analysis.uncounted_periods,
            choices: BacktestChoices {
                window: walk.window,
                every: walk.every,
                horizon: walk.horizon,
                alpha: request.alpha.clone(),
                scale: request.scale,
                caution: request.caution,
                support: request.support,
                centre: request.centre.clone(),
                risk_aversion: request.risk_aversion,
                trading_cost: request.trading_cost,
                cost_blind: request.cost_blind,
                count: request.count,
                seed: request.seed,
            },
            intervals: intervals(backtest.periods_per_year, lines.len() - 1),
            strategies: analysis.figures.clone(),
            periods: lines.iter().map(BacktestPeriods::new).collect(),
            sentences: sentences(walked),
        }
    }
}

impl BacktestPeriods {
    fn new(line: &StrategyLine) -> Self {
        let decided = |of: fn(&Decision) -> f64| line.decisions.iter().map(of).collect();
        BacktestPeriods {
            strategy: line.name.clone(),
            allocation: line.account.allocations.clone(),
            low: decided(|decision| decision.band.low),
            high: decided(|decision| decision.band.high),
            radius: decided(|decision| decision.radius),
            traded: line.account.traded.clone(),
            wealth: line.account.wealth[1..].to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::evaluation::backtest_report::Performance;

    fn figures(strategy: &str, value: f64, ahead: [f64; 2], place: Option<usize>) -> BacktestFigures {
        let at = |value: f64, interval| BootstrapEstimate { value, interval };
        let none = at(0.0, [0.0; 2]);
        BacktestFigures {
            strategy: strategy.into(),
            kind: if place.is_none() { StrategyKind::OwnMix } else { StrategyKind::Adaptive },
            hindsight: place.is_none(),
            place,
            performance: Performance {
                yearly_certainty_equivalent: at(value, [value - 1.0, value + 1.0]),
                beyond_own_mix: None,
                annual_mean: none,
                annual_volatility: none,
                sharpe_ratio: none,
                annual_turnover: none,
                chance_of_loss: none,
                worst_twentieth: none,
                max_drawdown: 0.2,
                final_wealth: 120.0,
                mean_allocation: 0.25,
            },
            adaptive_ahead: at(0.5 * (ahead[0] + ahead[1]), ahead),
            all_bank_share: 0.5,
        }
    }

    #[test]
    fn the_verdict_follows_the_figures_either_way() {
        let all = [
            figures("Cautious, learns", 103.0, [0.0; 2], Some(3)),
            figures("All in the bank", 104.0, [-1.5, -0.5], Some(1)),
            figures("Trusts the record", 101.0, [1.0, 3.0], Some(4)),
            figures("60/40", 103.5, [-1.5, 0.5], Some(2)),
            figures("Hindsight: 25.0 % in stocks", 105.0, [-3.0, -1.0], None),
        ];
        assert_eq!(
            ranking(&all, 0),
            "With “Cautious, learns” a year that starts at 100 is worth 103.00 for certain, place 3 of 4. The first \
             is “All in the \
             bank” with 104.00."
        );
        assert_eq!(
            against(all[1..4].iter()),
            "By the intervals of the differences, of which all 3 hold at once with 90 % confidence, it is better than: “Trusts \
             the record”. Worse than: “All in the bank”. No clear difference from: “60/40”."
        );
        assert_eq!(timing(&all, 0), None);
        let timed = |low: f64, high: f64| {
            let beyond = BootstrapEstimate { value: 0.5 * (low + high), interval: [low, high] };
            let performance = Performance { beyond_own_mix: Some(beyond), ..all[0].performance.clone() };
            BacktestFigures { performance, ..all[0].clone() }
        };
        for (beyond, verdict) in [
            ([-3.0, -1.0], "-2.00 [-3.00, -1.00]: changing the allocation cost."),
            ([1.0, 2.0], "changing the allocation paid."),
            ([-1.0, 2.0], "did anything."),
        ] {
            assert!(timing(&[timed(beyond[0], beyond[1])], 0).unwrap().ends_with(verdict));
        }
        let named = |name: &str, low, high| BacktestFigures { strategy: name.into(), ..timed(low, high) };
        let some =
            [named("a", 1.0, 2.0), named("b", -2.0, -1.0), named("c", -1.0, 1.0), named("d", 0.5, 1.0), all[1].clone()];
        assert_eq!(
            timing_of_others(&some, 0),
            "Compared with such mixes of their own, by intervals that also hold at once, changing the allocation paid \
             for: “d”. It \
             cost: “b”. The record shows neither for: “c”."
        );
    }

    #[test]
    fn the_periods_that_count_in_no_year_are_named() {
        let of = |periods| uncounted(periods, "month");
        assert_eq!(of(0), None);
        assert_eq!(of(1).unwrap(), "The first month counts in no year: years end with the last month.");
        assert_eq!(of(11).unwrap(), "The first 11 months count in no year: years end with the last month.");
    }
}
