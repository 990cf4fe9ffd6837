//! How a session went: time-weighted returns, the worst fall, and fixed shares through the same periods.
//!
//! Money added at the end of a period, and money spent at its start, is neither a gain nor a loss. With wealth W, money
//! added F and money spent S, the time-weighted return of period t is
//!
//!   (W_t - F_t) / (W_{t-1} - S_t) - 1.

use super::periods::PeriodNames;

/// An observed period, with corrections applied.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LivedPeriod {
    /// Wealth at its end.
    pub wealth: f64,
    /// Money added at its end; negative if withdrawn.
    pub flow: f64,
    /// Money spent at its start.
    pub spent: f64,
    /// Rate that the bank paid.
    pub rate: f64,
    /// Cost of trading, as a share of what is traded.
    pub trading_cost: f64,
    /// Growth of the asset, 0 after a total loss; for several assets of what was held of them.
    pub growth: f64,
}

/// Returns the level after each period, 1 at the start, of time-weighted returns.
pub(super) fn levels(initial_wealth: f64, periods: &[LivedPeriod]) -> Vec<f64> {
    let mut levels = vec![1.0];
    let (mut level, mut before) = (1.0, initial_wealth);
    for period in periods {
        level *= (period.wealth - period.flow) / (before - period.spent);
        before = period.wealth;
        levels.push(level);
    }
    levels
}

/// A fall below the highest level so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LevelFall {
    /// Depth, below 0.
    pub depth: f64,
    /// The position of the highest level.
    pub from: usize,
    /// The position of the lowest after it.
    pub to: usize,
}

/// Returns the deepest fall, the first of equal ones; `None` if the levels never fell.
pub(super) fn worst_fall(levels: &[f64]) -> Option<LevelFall> {
    let (mut highest, mut from) = (f64::NEG_INFINITY, 0);
    let mut worst: Option<LevelFall> = None;
    for (to, level) in levels.iter().copied().enumerate() {
        if level >= highest {
            (highest, from) = (level, to);
            continue;
        }
        let depth = level / highest - 1.0;
        if worst.is_none_or(|fall| depth < fall.depth) {
            worst = Some(LevelFall { depth, from, to });
        }
    }
    worst
}

/// A return over some periods up to the last one.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NamedReturn {
    pub name: String,
    pub value: f64,
    /// The return a year, if the periods are more than one.
    pub a_year: Option<f64>,
}

/// Returns the returns of the last period, of its calendar year and since the start. The year is left out without dates,
/// and if the start lies in it.
pub(super) fn returns_so_far(levels: &[f64], names: &PeriodNames, periods_per_year: Option<f64>) -> Vec<NamedReturn> {
    let last = levels.len() - 1;
    let since = |from: usize| levels[last] / levels[from] - 1.0;
    let year_of = |period| names.date(period).map(|date| date.year());
    let mut found = Vec::new();
    if last > 1 {
        found.push(NamedReturn { name: names.name(last), value: since(last - 1), a_year: None });
    }
    if let Some(year) = year_of(last) {
        let from = (0..last).rev().find(|period| year_of(*period) != Some(year)).unwrap_or(0);
        if from > 0 {
            let name = if year_of(last + 1) == Some(year) { format!("{year} so far") } else { year.to_string() };
            found.push(NamedReturn { name, value: since(from), a_year: None });
        }
    }
    let years = periods_per_year.map_or(0.0, |periods| last as f64 / periods);
    let a_year = (years > 1.0).then(|| (1.0 + since(0)).powf(1.0 / years) - 1.0);
    found.push(NamedReturn { name: "Since the start".to_owned(), value: since(0), a_year });
    found
}

/// Returns wealth at the start and after each period, if `share` of it is put into the risky holdings before each:
/// `None` once the money added and spent leaves none. Money added goes to the bank.
pub(super) fn fixed_share((wealth, holding): (f64, f64), periods: &[LivedPeriod], share: f64) -> Vec<Option<f64>> {
    let mut wealths = vec![Some(wealth)];
    let (mut wealth, mut holding) = (Some(wealth), holding);
    for period in periods {
        wealth = wealth.and_then(|wealth| {
            let left = Some(wealth - period.spent).filter(|left| *left > 0.0)?;
            let invested = left * (1.0 - period.trading_cost * (share - holding).abs());
            let risky = invested * share * period.growth;
            let next = invested * (1.0 - share) * (1.0 + period.rate) + risky + period.flow;
            holding = risky / next;
            Some(next).filter(|next| *next > 0.0)
        });
        wealths.push(wealth);
    }
    wealths
}

#[cfg(test)]
mod tests {
    use super::*;

    const CALM: LivedPeriod =
        LivedPeriod { wealth: 0.0, flow: 0.0, spent: 0.0, rate: 0.0, trading_cost: 0.0, growth: 1.0 };

    fn near(one: f64, other: f64) -> bool {
        (one - other).abs() < 1e-12
    }

    #[test]
    fn money_that_comes_and_goes_is_no_gain() {
        let periods = [
            LivedPeriod { wealth: 160.0, flow: 50.0, ..CALM },
            LivedPeriod { wealth: 120.0, spent: 10.0, flow: -15.0, ..CALM },
        ];
        // 100 becomes 110; then 150 becomes 135.
        let found = levels(100.0, &periods);
        assert!(near(found[1], 1.1) && near(found[2], 1.1 * 0.9), "{found:?}");
    }

    #[test]
    fn the_worst_fall_is_the_deepest_and_the_first_of_equal_ones() {
        let fall = worst_fall(&[1.0, 1.2, 0.9, 1.3, 0.975, 1.1]).unwrap();
        assert_eq!((fall.from, fall.to), (1, 2));
        assert!(near(fall.depth, -0.25));
        let deeper = worst_fall(&[1.0, 0.9, 1.0, 0.95, 0.8]).unwrap();
        assert_eq!((deeper.from, deeper.to), (2, 4));
        assert_eq!(worst_fall(&[1.0, 1.0, 1.1]), None);
    }

    fn so_far(levels: &[f64], days: &[&str], periods: Option<f64>) -> Vec<(String, f64, Option<f64>)> {
        let rounded = |value: f64| (1e4 * value).round() / 1e4;
        let names = PeriodNames::new(days.iter().map(|day| day.parse().ok()).collect(), Some(periods.unwrap_or(12.0)));
        let found = returns_so_far(levels, &names, periods);
        found.into_iter().map(|found| (found.name, rounded(found.value), found.a_year.map(rounded))).collect()
    }

    #[test]
    fn the_parts_of_the_calendar_that_a_letter_names() {
        let named = |name: &str, value, a_year| (name.to_owned(), value, a_year);
        let days = ["2025-12-31", "2026-01-31", "2026-02-28"];
        assert_eq!(
            so_far(&[100.0, 110.0, 99.0, 108.9], &days, Some(12.0)),
            [
                named("February 2026", 0.1, None),
                named("2026 so far", -0.01, None),
                named("Since the start", 0.089, None)
            ]
        );
        // A year that has ended, a start in the year, no dates, and more than a year.
        assert_eq!(
            so_far(&[100.0, 110.0, 121.0], &["2025-12-31", "2026-12-31"], Some(1.0)),
            [
                named("Year to 31 Dec 2026", 0.1, None),
                named("2026", 0.1, None),
                named("Since the start", 0.21, Some(0.1))
            ]
        );
        let words =
            |found: Vec<(String, f64, Option<f64>)>| found.into_iter().map(|(name, ..)| name).collect::<Vec<_>>();
        let from_january = so_far(&[100.0, 110.0, 121.0], &["2026-01-31", "2026-02-28"], Some(12.0));
        assert_eq!(words(from_january), ["February 2026", "Since the start"]);
        let undated = so_far(&[100.0, 110.0, 121.0], &["", ""], None);
        assert_eq!(undated, [named("Period 2", 0.1, None), named("Since the start", 0.21, None)]);
        assert_eq!(words(so_far(&[100.0, 110.0], &[""], Some(12.0))), ["Since the start"]);
    }

    #[test]
    fn a_fixed_share_pays_its_trades_and_ends_when_it_cannot_pay() {
        let up = LivedPeriod { growth: 1.5, rate: 0.1, trading_cost: 0.01, ..CALM };
        // From nothing to half: 100 less 0.5, of which half grows by 50 % and half by 10 %.
        let found = fixed_share((100.0, 0.0), &[up], 0.5);
        assert!(near(found[1].unwrap(), 99.5 * 1.3), "{found:?}");
        // Of the gain and of what was paid in to the bank a little goes into the asset.
        let next = fixed_share((100.0, 0.0), &[LivedPeriod { flow: 20.0, ..up }, up], 0.5);
        let before = 99.5 * 1.3 + 20.0;
        let held = 99.5 * 0.75 / before;
        assert!(near(next[2].unwrap(), before * (1.0 - 0.01 * (0.5 - held)) * 1.3), "{next:?}");
        let poor = fixed_share((100.0, 0.0), &[LivedPeriod { flow: -200.0, ..up }, up], 0.5);
        assert_eq!(poor, [Some(100.0), None, None]);
        // In the bank alone 100 less 40 becomes 66.
        let spending = fixed_share((100.0, 0.0), &[LivedPeriod { spent: 40.0, ..up }], 0.0);
        assert!(near(spending[1].unwrap(), 66.0));
    }
}
