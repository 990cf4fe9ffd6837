//! The last days of a session's periods: the reported ones, and for the others those of its calendar.
//!
//! A session has one calendar: that of its policy's periods a year, else the one that its own days follow. A report
//! without a day takes the next one due. So the session and every list of sessions agree on the next day.

use std::ops::RangeInclusive;

use jiff::civil::Date;

use crate::control::error::FieldError;
use crate::service::jobs::due::next_day;

/// Days from one last day to the next, and the number of such periods in a year.
const UNITS: [(RangeInclusive<i32>, f64); 5] =
    [(1..=4, 252.0), (6..=8, 52.0), (26..=33, 12.0), (86..=95, 4.0), (360..=371, 1.0)];

/// How often the days of a session lay a day, a week, a month, a quarter and a year apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Rhythm([u32; UNITS.len()]);

impl Rhythm {
    fn after(mut self, days: i32) -> Self {
        if let Some(unit) = UNITS.iter().position(|(apart, _)| apart.contains(&days)) {
            self.0[unit] += 1;
        }
        self
    }

    /// Returns the periods a year of the most frequent unit; ties go to the shortest.
    fn periods_per_year(self) -> Option<f64> {
        let most = self.0.into_iter().max().filter(|most| *most > 0)?;
        UNITS.iter().zip(self.0).find(|(_, count)| *count == most).map(|((_, periods), _)| *periods)
    }
}

/// The last day of a session's last period, and the calendar that its days follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Days {
    /// The last day known.
    pub last: Option<Date>,
    /// Periods since then with unknown days.
    undated: usize,
    rhythm: Rhythm,
}

impl Days {
    /// Returns the periods a year of the policy, else of the days.
    pub(in crate::service) fn periods_per_year(&self, policy: Option<f64>) -> Option<f64> {
        policy.or_else(|| self.rhythm.periods_per_year())
    }

    /// Returns the last day of the coming period by the calendar; `None` before the first day or without a calendar.
    pub(in crate::service) fn next(&self, policy: Option<f64>) -> Option<Date> {
        let periods = self.periods_per_year(policy)?;
        (0..=self.undated).try_fold(self.last?, |day, _| next_day(day, periods))
    }

    /// Checks that a reported day is later than the last one.
    ///
    /// # Errors
    /// It is not.
    pub(in crate::service) fn check_later(&self, date: Option<Date>) -> Result<(), FieldError> {
        match (date, self.last) {
            (Some(date), Some(last)) if date <= last => {
                let rule = format!("must be later than {last}, the date of an earlier period");
                Err(FieldError::new("date", date, rule))
            }
            _ => Ok(()),
        }
    }

    /// Returns the days after a period reported with this day, or without one.
    pub(in crate::service) fn after(self, date: Option<Date>, policy: Option<f64>) -> Self {
        match (date, self.last) {
            (Some(date), Some(last)) => {
                let periods = i32::try_from(self.undated + 1).unwrap_or(i32::MAX);
                Days { last: Some(date), undated: 0, rhythm: self.rhythm.after(days_between(last, date) / periods) }
            }
            (Some(_), None) => Days { last: date, ..self },
            (None, Some(_)) => match self.next(policy) {
                Some(next) => Days { last: Some(next), undated: 0, ..self },
                None => Days { undated: self.undated + 1, ..self },
            },
            (None, None) => self,
        }
    }
}

/// Returns the days from one date to a later one; negative if it is earlier.
pub(super) fn days_between(from: Date, to: Date) -> i32 {
    // No two days of the calendar lie further apart than an i32 can count.
    (to - from).get_days()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn day(text: &str) -> Date {
        text.parse().unwrap()
    }

    fn after(days: &[&str]) -> Days {
        days.iter().fold(Days::default(), |days, date| days.after(Some(day(date)), None))
    }

    #[test]
    fn a_period_without_a_day_takes_the_next_one_due() {
        let monthly = Days::default().after(Some(day("2026-10-31")), Some(12.0));
        assert_eq!(monthly.next(Some(12.0)), Some(day("2026-11-30")));
        let undated = monthly.after(None, Some(12.0)).after(None, Some(12.0));
        assert_eq!((undated.last, undated.next(Some(12.0))), (Some(day("2026-12-31")), Some(day("2027-01-31"))));
        // Before the first day there is no next one.
        assert_eq!(Days::default().after(None, Some(12.0)).next(Some(12.0)), None);
    }

    #[test]
    fn the_days_of_a_session_are_its_calendar_where_the_policy_says_none() {
        for (days, next) in [
            (&["2026-01-31", "2026-02-28"][..], "2026-03-31"),
            (&["2026-01-02", "2026-01-09"], "2026-01-16"),
            (&["2026-01-02", "2026-01-05"], "2026-01-06"),
            (&["2025-12-31", "2026-03-31"], "2026-06-30"),
            // A gap does not set the rhythm if more of the days follow another.
            (&["2026-01-31", "2026-02-28", "2026-05-31", "2026-06-30"], "2026-07-31"),
        ] {
            assert_eq!(after(days).next(None), Some(day(next)), "{days:?}");
        }
        assert_eq!(after(&["2026-01-31"]).next(None), None);
        // Two periods over two months count as one month each.
        let undated = after(&["2026-01-31"]).after(None, None).after(Some(day("2026-03-31")), None);
        assert_eq!(undated.next(None), Some(day("2026-04-30")));
    }
}
