//! Dates that are written as plain numbers: days since 1900, as spreadsheets count them, and seconds since 1970.

use jiff::Span;
use jiff::civil::Date;

/// Day numbers from 1954 to 2119. Smaller and larger numbers are more likely something else.
const SERIALS: std::ops::RangeInclusive<i64> = 20_000..=80_000;
/// The day that spreadsheets number 0, because they treat 1900 as a leap year.
const SERIAL_START: Date = Date::constant(1899, 12, 30);
const EPOCH_START: Date = Date::constant(1970, 1, 1);
/// Digits of a count of seconds, or of their thousandths, millionths or billionths, since 1970, for dates from 2001 to
/// 2286.
const EPOCH_DIGITS: [(usize, i64); 4] = [(10, 1), (13, 1_000), (16, 1_000_000), (19, 1_000_000_000)];
const SECONDS_A_DAY: i64 = 86_400;

fn whole(text: &str) -> Option<i64> {
    (!text.starts_with('0') && text.bytes().all(|byte| byte.is_ascii_digit())).then(|| text.parse().ok())?
}

/// Returns the day that a spreadsheet shows for the number `text`.
pub fn serial(text: &str) -> Option<Date> {
    let days = whole(text).filter(|days| SERIALS.contains(days))?;
    SERIAL_START.checked_add(Span::new().days(days)).ok()
}

/// Returns the day of an instant that is counted from 1970.
pub fn epoch(text: &str) -> Option<Date> {
    let (_, unit) = EPOCH_DIGITS.into_iter().find(|(digits, _)| *digits == text.len())?;
    let days = whole(text)? / unit / SECONDS_A_DAY;
    EPOCH_START.checked_add(Span::new().days(days)).ok()
}

/// Returns true if the dates all go one way, forward or back.
pub fn go_one_way(dates: &[Date]) -> bool {
    dates.windows(2).all(|pair| pair[0] <= pair[1]) || dates.windows(2).all(|pair| pair[0] >= pair[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_the_days_that_spreadsheets_and_clocks_count() {
        let last = Some(Date::constant(2020, 1, 31));
        assert_eq!(serial("43861"), last);
        for text in ["1580428800", "1580428800000", "1580428800000000", "1580428800000000000"] {
            assert_eq!(epoch(text), last, "{text}");
        }
        for text in ["", "4386", "99999", "43861.5", "0043861", "158042880", "abcdefghij"] {
            assert_eq!((serial(text), epoch(text)), (None, None), "{text}");
        }
    }
}
