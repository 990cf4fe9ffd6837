//! Dates of periods, in forms that can be read in only one way: the year comes first.

use jiff::civil::Date;

/// Allowed years of a record's dates. Text with another year is a number that looks like a date.
const YEARS: std::ops::RangeInclusive<i16> = 1700..=2200;
/// Rule for the text that [`date`] reads.
pub const FORM: &str = "must be a date with the year first, as 2008-01-31, 2008/01/31, 2008-01 or 2008";

/// Reads the day from a text; the first day of a month or a year. A time and a zone after the day are ignored. Returns
/// `None` for another form, or a day that no calendar has.
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
