//! The frequency of periods, found from the distances between their dates.

use std::ops::RangeInclusive;

use jiff::civil::{Date, Weekday};

/// Largest number of days from one trading day to the next: exchanges close for weekends, and for holidays as long as
/// the golden weeks of Asia or March 1933.
const LONGEST_REST: i32 = 12;
/// Number of days between the dates of adjacent weeks, either of which a holiday may move.
const WEEK: RangeInclusive<i32> = 4..=10;

/// Smallest number of days from a month's date to the next one's, if both move to trading days; less is no month.
const SHORTEST_MONTH: i32 = 20;

/// With at least this many periods in a year, a period is a day.
const LEAST_DAYS: f64 = 200.0;

/// The frequency of periods.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frequency {
    /// Days on which an exchange is open, or all days.
    Daily,
    /// Weeks.
    Weekly,
    /// Months.
    Monthly,
    /// Quarters of a year.
    Quarterly,
    /// Years.
    Yearly,
}

/// A date that does not follow the one before: its index, and the rule that it breaks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Misplaced {
    /// Index of the date, from 0.
    pub index: usize,
    /// The rule that it breaks, as a sentence without its subject.
    pub rule: String,
}

use Frequency::{Daily, Monthly, Quarterly, Weekly, Yearly};

/// Days between dates at each frequency; most gaps of a record lie in one of these ranges.
const DISTANCES: [(Frequency, RangeInclusive<i32>); 5] =
    [(Daily, 1..=4), (Weekly, 5..=9), (Monthly, 26..=33), (Quarterly, 85..=97), (Yearly, 350..=380)];

/// Returns the days from each date to the next.
fn gaps(dates: &[Date]) -> Vec<i32> {
    dates.windows(2).map(|pair| pair[0].until(pair[1]).map_or(0, |span| span.get_days())).collect()
}

/// With fewer dates than this, a weekday may be missing by chance.
const FEW_DAYS: usize = 14;
/// A weekday counts as usual if at least one in this many dates falls on it: half of the share of each of seven days.
const OFTEN: usize = 14;

/// Returns the number of days with a period in a year. Special sessions on a weekend now and then do not count.
fn days_a_year(dates: &[Date]) -> usize {
    let on = |day: Weekday| dates.iter().filter(|date| date.weekday() == day).count();
    if dates.len() < FEW_DAYS {
        let is_whole = on(Weekday::Saturday) > 0 && on(Weekday::Sunday) > 0;
        return if is_whole { 365 } else { 252 };
    }
    match Weekday::Monday.cycle_forward().take(7).filter(|day| OFTEN * on(*day) >= dates.len()).count() {
        7 => 365,
        6 => 300,
        _ => 252,
    }
}

/// The first day of weeks: Monday, or Sunday if most of a record's dates are Sundays.
struct Week {
    first: Weekday,
}

impl Week {
    fn of(dates: &[Date]) -> Self {
        let sundays = dates.iter().filter(|date| date.weekday() == Weekday::Sunday).count();
        Week { first: if 2 * sundays > dates.len() { Weekday::Sunday } else { Weekday::Monday } }
    }

    /// Returns true if one week has both dates; the second is later.
    fn holds_both(&self, before: Date, date: Date) -> bool {
        let days = before.until(date).map_or(0, |span| span.get_days());
        let since = i32::from(self.first.until(before.weekday()));
        days + since < 7
    }
}

impl Frequency {
    /// Returns the frequency that the median distance of increasing dates indicates.
    pub fn typical(dates: &[Date]) -> Option<Self> {
        let mut gaps = gaps(dates);
        gaps.sort_unstable();
        gaps.get(gaps.len().saturating_sub(1) / 2).and_then(|median| Self::by(*median))
    }

    fn by(gap: i32) -> Option<Self> {
        DISTANCES.iter().find(|(_, days)| days.contains(&gap)).map(|(frequency, _)| *frequency)
    }

    /// Returns the [`typical`](Self::typical) frequency if every date follows the one before; `written` holds the dates
    /// as given.
    ///
    /// # Errors
    /// A date that is not later than the one before, or is not the next one at that frequency.
    pub fn of(dates: &[Date], written: &[&str]) -> Result<Self, Misplaced> {
        let gaps = gaps(dates);
        let refused = |index: usize, rule: String| Err(Misplaced { index: index + 1, rule });
        if let Some(index) = gaps.iter().position(|gap| *gap <= 0) {
            let rule = "the row before: rows go from the oldest to the newest, one a date";
            return refused(index, format!("must be later than {}, {rule}", written[index]));
        }
        let Some(frequency) = Self::typical(dates) else {
            let index = gaps.iter().position(|gap| Self::by(*gap).is_none()).unwrap_or_default();
            let rule = "rows must be daily, weekly, monthly, quarterly or yearly";
            let (gap, before) = (gaps[index], written[index]);
            return refused(index, format!("is {gap} days after {before}, the row before: {rule}"));
        };
        let week = Week::of(dates);
        let is_again = |pair: &[Date]| frequency == Weekly && week.holds_both(pair[0], pair[1]);
        match dates.windows(2).position(|pair| is_again(pair) || !frequency.follows(pair[0], pair[1])) {
            None => Ok(frequency),
            Some(index) => {
                let (noun, adjective) = (frequency.noun(), frequency.adjective());
                let rest = if frequency == Daily { ", except for weekends and holidays" } else { "" };
                let (gap, before) = (gaps[index], written[index]);
                let days = if gap == 1 { "day" } else { "days" };
                refused(
                    index,
                    format!(
                        "must be the {noun} after {before}{rest}: it is {gap} {days} later, and the rows are {adjective}"
                    ),
                )
            }
        }
    }

    /// Returns true if no period lies between the dates.
    fn follows(self, before: Date, date: Date) -> bool {
        let days = before.until(date).map_or(0, |span| span.get_days());
        let months = |date: Date| 12 * i32::from(date.year()) + i32::from(date.month());
        let apart = months(date) - months(before);
        match self {
            Daily => days <= LONGEST_REST,
            Weekly => WEEK.contains(&days),
            Monthly => apart == 1 && days >= SHORTEST_MONTH,
            Quarterly => apart == 3 && days >= 3 * SHORTEST_MONTH,
            Yearly => apart == 12 && days >= 12 * SHORTEST_MONTH,
        }
    }

    /// Returns the noun for a period of which there are so many in a year; `period` if that is unknown or unusual.
    pub fn noun_for(periods_per_year: Option<f64>) -> &'static str {
        match periods_per_year.map_or(0.0, f64::round) {
            1.0 => Yearly.noun(),
            4.0 => Quarterly.noun(),
            12.0 => Monthly.noun(),
            52.0 => Weekly.noun(),
            days if days >= LEAST_DAYS => Daily.noun(),
            _ => "period",
        }
    }

    /// Returns the noun for one of its periods.
    pub fn noun(self) -> &'static str {
        match self {
            Daily => "day",
            Weekly => "week",
            Monthly => "month",
            Quarterly => "quarter",
            Yearly => "year",
        }
    }

    /// Returns the adjective for its returns.
    pub fn adjective(self) -> &'static str {
        match self {
            Daily => "daily",
            Weekly => "weekly",
            Monthly => "monthly",
            Quarterly => "quarterly",
            Yearly => "yearly",
        }
    }

    /// Returns the number of periods in a year. For days it is 252, the days on which exchanges are open. It is about
    /// 300 if one day of the weekend occurs as often as other days, and all days if both do.
    pub fn periods_per_year(self, dates: &[Date]) -> usize {
        match self {
            Daily => days_a_year(dates),
            Weekly => 52,
            Monthly => 12,
            Quarterly => 4,
            Yearly => 1,
        }
    }

    /// Formats a date as finely as the periods need.
    pub fn shown(self, date: Date) -> String {
        let format = match self {
            Daily | Weekly => "%Y-%m-%d",
            Monthly | Quarterly => "%Y-%m",
            Yearly => "%Y",
        };
        date.strftime(format).to_string()
    }
}
