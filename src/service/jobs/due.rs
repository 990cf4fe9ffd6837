//! The day a session's next report is due: one period after its last reported day, by the periods a year of its policy.

use jiff::ToSpan;
use jiff::civil::{Date, Weekday};
use jiff::tz::TimeZone;

use crate::store::FirstDay;

const DAYS_A_YEAR: f64 = 365.25;
/// The least number of periods a year that counts as trading days.
pub(in crate::service) const DAILY: f64 = 200.0;
/// The longest period in days, for policies with very few periods a year.
const LONGEST_DAYS: f64 = 3_650.0;

/// Returns the last day of the period after the one that ended on `date`. The last day of a month is followed by the
/// last day of a month. Markets are closed on Saturdays and Sundays.
pub fn next_day(date: Date, periods_per_year: f64) -> Option<Date> {
    if periods_per_year <= 0.0 {
        return None;
    }
    let later = |months: i64| {
        let next = date.checked_add(months.months()).ok()?;
        Some(if date == date.last_of_month() { next.last_of_month() } else { next })
    };
    if periods_per_year >= DAILY {
        let rest = match date.weekday() {
            Weekday::Friday => 3,
            Weekday::Saturday => 2,
            _ => 1,
        };
        return date.checked_add(rest.days()).ok();
    }
    match periods_per_year.round() {
        1.0 => later(12),
        4.0 => later(3),
        12.0 => later(1),
        52.0 => date.checked_add(7.days()).ok(),
        _ => {
            let days = (DAYS_A_YEAR / periods_per_year).round().clamp(1.0, LONGEST_DAYS);
            date.checked_add((days as i64).days()).ok()
        }
    }
}

/// Returns the first day whose next one is not before `today`: a report is late if its last reported day lies before
/// it.
pub fn first_day(today: Date, periods_per_year: f64) -> Option<FirstDay> {
    let is_late = |date: Date| next_day(date, periods_per_year).is_some_and(|next| next < today);
    let before = |date: Date| date.yesterday().ok();
    next_day(today, periods_per_year)?;
    let mut date = today;
    while let Some(earlier) = before(date).filter(|earlier| !is_late(*earlier)) {
        date = earlier;
    }
    let begin_ms = date.to_zoned(TimeZone::UTC).ok()?.timestamp().as_millisecond();
    Some(FirstDay { periods_per_year, date: date.to_string(), begin_ms })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every day of two years.
    #[test]
    fn a_report_is_late_where_its_next_day_is_past() {
        let today: Date = "2024-03-30".parse().unwrap();
        for periods_per_year in [1.0, 4.0, 12.0, 52.0, 252.0, 26.0, 6.0] {
            let first = first_day(today, periods_per_year).unwrap();
            let mut date: Date = "2022-09-01".parse().unwrap();
            while date <= today {
                let is_late = next_day(date, periods_per_year).unwrap() < today;
                assert_eq!(date.to_string() < first.date, is_late, "{date} {periods_per_year} {first:?}");
                date = date.tomorrow().unwrap();
            }
        }
        let next = |date: &str, periods| next_day(date.parse().unwrap(), periods).unwrap().to_string();
        assert_eq!(next("2024-02-29", 12.0), "2024-03-31");
        assert_eq!(next("2024-01-30", 12.0), "2024-02-29");
        assert_eq!(next("2024-03-29", 252.0), "2024-04-01");
        assert_eq!(next("2023-12-31", 4.0), "2024-03-31");
        assert_eq!(first_day(today, 0.0), None);
    }
}
