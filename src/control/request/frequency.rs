//! What a period is: told by how far apart dates are.

use std::ops::RangeInclusive;

use jiff::civil::{Date, Weekday};

/// Days that an exchange may rest: weekends, and holidays as long as the golden weeks of Asia or March 1933.
const LONGEST_REST: i32 = 12;
/// Days from a week's date to the next one's, where a holiday moves either.
const WEEK: RangeInclusive<i32> = 4..=10;

/// Days from a month's date to the next one's, where both move to days on which exchanges are open; less is no month.
const SHORTEST_MONTH: i32 = 20;

/// How often there is a period.
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
    /// From 0.
    pub index: usize,
    /// As a sentence without its subject.
    pub rule: String,
}

use Frequency::{Daily, Monthly, Quarterly, Weekly, Yearly};

/// Days between dates by which most rows tell each.
const DISTANCES: [(Frequency, RangeInclusive<i32>); 5] =
    [(Daily, 1..=4), (Weekly, 5..=9), (Monthly, 26..=33), (Quarterly, 85..=97), (Yearly, 350..=380)];

/// Days from each date to the next.
fn gaps(dates: &[Date]) -> Vec<i32> {
    dates.windows(2).map(|pair| pair[0].until(pair[1]).map_or(0, |span| span.get_days())).collect()
}

/// Of so few days a weekday may be missing by chance.
const FEW_DAYS: usize = 14;
/// Days a week has often where it has one in fourteen of all: half of what each of seven has.
const OFTEN: usize = 14;

/// Special sessions on a weekend now and then do not count.
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

/// Where weeks begin: on Mondays, or on Sundays if most of a record's dates are those.
struct Week {
    first: Weekday,
}

impl Week {
    fn of(dates: &[Date]) -> Self {
        let sundays = dates.iter().filter(|date| date.weekday() == Weekday::Sunday).count();
        Week { first: if 2 * sundays > dates.len() { Weekday::Sunday } else { Weekday::Monday } }
    }

    /// Whether one week has both dates, of which the second is later.
    fn holds_both(&self, before: Date, date: Date) -> bool {
        let days = before.until(date).map_or(0, |span| span.get_days());
        let since = i32::from(self.first.until(before.weekday()));
        days + since < 7
    }
}

impl Frequency {
    /// The one that the median distance of dates tells, where they increase.
    pub fn typical(dates: &[Date]) -> Option<Self> {
        let mut gaps = gaps(dates);
        gaps.sort_unstable();
        gaps.get(gaps.len().saturating_sub(1) / 2).and_then(|median| Self::by(*median))
    }

    fn by(gap: i32) -> Option<Self> {
        DISTANCES.iter().find(|(_, days)| days.contains(&gap)).map(|(frequency, _)| *frequency)
    }

    /// The [`typical`](Self::typical) one; `written` is how each of them was given.
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
            let rule = "where rows must be daily, weekly, monthly, quarterly or yearly";
            let (gap, before) = (gaps[index], written[index]);
            return refused(index, format!("is {gap} days after {before}, the row before, {rule}"));
        };
        let week = Week::of(dates);
        let is_again = |pair: &[Date]| frequency == Weekly && week.holds_both(pair[0], pair[1]);
        match dates.windows(2).position(|pair| is_again(pair) || !frequency.follows(pair[0], pair[1])) {
            None => Ok(frequency),
            Some(index) => {
                let (noun, adjective) = (frequency.noun(), frequency.adjective());
                let rest = if frequency == Daily { ", but for weekends and holidays" } else { "" };
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

    /// Whether no period lies between.
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

    /// One of its periods, in a word.
    pub fn noun(self) -> &'static str {
        match self {
            Daily => "day",
            Weekly => "week",
            Monthly => "month",
            Quarterly => "quarter",
            Yearly => "year",
        }
    }

    /// What its returns are called.
    pub fn adjective(self) -> &'static str {
        match self {
            Daily => "daily",
            Weekly => "weekly",
            Monthly => "monthly",
            Quarterly => "quarterly",
            Yearly => "yearly",
        }
    }

    /// Periods in a year. Of days: those on which exchanges are open, 252; about 300 if one day of the weekend is among the days
    /// as often as others are; all of them if both are.
    pub fn periods_per_year(self, dates: &[Date]) -> usize {
        match self {
            Daily => days_a_year(dates),
            Weekly => 52,
            Monthly => 12,
            Quarterly => 4,
            Yearly => 1,
        }
    }

    /// A date, as fine as the periods are.
    pub fn shown(self, date: Date) -> String {
        let format = match self {
            Daily | Weekly => "%Y-%m-%d",
            Monthly | Quarterly => "%Y-%m",
            Yearly => "%Y",
        };
        date.strftime(format).to_string()
    }
}
