//! Dates of periods, in forms that nobody reads in two ways: the year stands first.

use jiff::civil::Date;

/// Of records of returns; what lies outside is a number that looks like a date.
const YEARS: std::ops::RangeInclusive<i16> = 1700..=2200;
/// What [`date`] reads.
pub const FORM: &str = "must be a date with the year first, as 2008-01-31, 2008/01/31, 2008-01 or 2008";

/// The day of a text; the first one of a month or a year. What follows the day, a time and a zone, is not used. `None` for
/// another form, or a day that no calendar has.
pub fn date(text: &str) -> Option<Date> {
    let text = text.replace('/', "-");
    let text = text.trim_end_matches('Z');
    let whole = match text.len() {
        4 => format!("{text}-01-01"),
        7 => format!("{text}-01"),
        _ => text.to_owned(),
    };
    whole.parse().ok().filter(|date: &Date| YEARS.contains(&date.year()))
}
