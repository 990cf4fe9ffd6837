//! The names of a session's periods in a letter: their dates if those are known, and otherwise their numbers.

use std::collections::BTreeSet;

use jiff::civil::Date;

use crate::control::request::frequency::Frequency;
use crate::service::jobs::due::next_day;

/// The names of a session's periods, counted from 1.
#[derive(Debug, Clone)]
pub(super) struct PeriodNames {
    /// The last day of each observed period, if it is known.
    dates: Vec<Option<Date>>,
    /// The periods a year of the session's calendar.
    periods_per_year: Option<f64>,
    /// True if periods are named by month: no two of them end in one.
    by_month: bool,
}

impl PeriodNames {
    /// Names the periods that have these last days, and those that follow by the calendar.
    pub fn new(dates: Vec<Option<Date>>, periods_per_year: Option<f64>) -> Self {
        let known: Vec<Date> = dates.iter().flatten().copied().collect();
        let months: BTreeSet<(i16, i8)> = known.iter().map(|date| (date.year(), date.month())).collect();
        let by_month = Frequency::noun_for(periods_per_year) == "month" && months.len() == known.len();
        PeriodNames { dates, periods_per_year, by_month }
    }

    /// Returns the noun for a period, such as `month`.
    pub fn unit(&self) -> &'static str {
        Frequency::noun_for(self.periods_per_year)
    }

    /// Returns whether any day is known.
    fn is_dated(&self) -> bool {
        self.dates.iter().any(Option::is_some)
    }

    /// Returns the last day of a period: as reported, and for a later one by the calendar.
    pub fn date(&self, period: usize) -> Option<Date> {
        if period <= self.dates.len() {
            return self.dates.get(period.checked_sub(1)?).copied().flatten();
        }
        let (last, date) = self.dates.iter().enumerate().rev().find_map(|(index, date)| Some((index + 1, (*date)?)))?;
        let periods = self.periods_per_year?;
        (last..period).try_fold(date, |day, _| next_day(day, periods))
    }

    /// Returns the name of a period, such as `March 2026`, `Week to 6 Mar 2026` or `Period 3`.
    pub fn name(&self, period: usize) -> String {
        let name = self.in_text(period);
        let mut letters = name.chars();
        letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
    }

    /// Returns the name of a period within a sentence.
    pub fn in_text(&self, period: usize) -> String {
        let Some(date) = self.date(period) else { return format!("period {period}") };
        match self.unit() {
            "month" if self.by_month => date.strftime("%B %Y").to_string(),
            "day" | "period" => day(date),
            unit => format!("{unit} to {}", day(date)),
        }
    }

    /// Returns the short name of the end of a period on an axis; period 0 is the start.
    pub fn brief(&self, period: usize) -> String {
        match self.date(period) {
            Some(date) if self.by_month => date.strftime("%b %y").to_string(),
            Some(date) => date.strftime("%-d %b %y").to_string(),
            None if period == 0 && self.is_dated() => "Start".to_owned(),
            None => period.to_string(),
        }
    }
}

/// Writes a day as 30 Sep 2008.
pub(super) fn day(date: Date) -> String {
    date.strftime("%-d %b %Y").to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(days: &[&str], periods_per_year: Option<f64>) -> PeriodNames {
        PeriodNames::new(days.iter().map(|day| day.parse().ok()).collect(), periods_per_year)
    }

    #[test]
    fn months_have_names_and_the_coming_ones_follow_the_calendar() {
        let months = names(&["", "2025-12-31", "2026-01-31"], Some(12.0));
        assert_eq!([1, 2, 4].map(|period| months.name(period)), ["Period 1", "December 2025", "February 2026"]);
        assert_eq!([1, 3].map(|period| months.in_text(period)), ["period 1", "January 2026"]);
        assert_eq!([0, 1, 2].map(|period| months.brief(period)), ["Start", "1", "Dec 25"]);
        assert_eq!(months.unit(), "month");
        // Two periods end in one month, so each has its day.
        let twice = names(&["2026-01-02", "2026-01-30"], Some(12.0));
        assert_eq!((twice.name(2), twice.in_text(2)), ("Month to 30 Jan 2026".into(), "month to 30 Jan 2026".into()));
    }

    #[test]
    fn other_periods_have_the_day_they_end_on_or_a_number() {
        assert_eq!(names(&["2026-03-06"], Some(52.0)).name(2), "Week to 13 Mar 2026");
        assert_eq!(names(&["2026-03-06"], Some(252.0)).name(2), "9 Mar 2026");
        assert_eq!(names(&["2026-03-06"], Some(252.0)).brief(1), "6 Mar 26");
        let bare = names(&["", ""], Some(12.0));
        assert_eq!((bare.name(3), bare.brief(0), bare.date(0)), ("Period 3".into(), "0".into(), None));
        assert_eq!(names(&["2026-03-06"], None).name(2), "Period 2");
        assert_eq!(names(&[], Some(4.0)).name(1), "Period 1");
    }
}
