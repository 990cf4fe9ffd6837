//! Dates of rows, in forms that nobody reads in two ways: the year stands first.

use jiff::civil::Date;

use super::cell::Cell;
use super::error::ReturnsError;

/// Of records of returns; what lies outside is a number that looks like a date.
const YEARS: std::ops::RangeInclusive<i16> = 1700..=2200;

/// The day of a cell; the first one of a month or a year. What follows the day, a time and a zone, is not used.
///
/// # Errors
/// Another form, or a day that no calendar has.
pub fn date(cell: Cell) -> Result<Date, ReturnsError> {
    let text = cell.text.replace('/', "-");
    let text = text.trim_end_matches('Z');
    let whole = match text.len() {
        4 => format!("{text}-01-01"),
        7 => format!("{text}-01"),
        _ => text.to_owned(),
    };
    let date = whole.parse().ok().filter(|date: &Date| YEARS.contains(&date.year()));
    date.ok_or_else(|| cell.refused("must be a date with the year first, as 2008-01-31, 2008/01/31, 2008-01 or 2008"))
}
