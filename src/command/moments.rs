//! Moments and durations as people write them.

use std::time::Duration;

use jiff::civil::Date;
use jiff::tz::TimeZone;
use jiff::{Span, SpanRelativeTo, Timestamp};

/// Parses a duration such as `90d`, `12h` or `1w 2d`; a day has 24 hours.
pub fn length(text: &str) -> Result<Duration, String> {
    let rule = || format!("'{text}' must be a length of time above zero, such as 90d or 12h");
    let span: Span = text.parse().map_err(|_| rule())?;
    let length = span.to_duration(SpanRelativeTo::days_are_24_hours()).map_err(|_| rule())?;
    Duration::try_from(length).ok().filter(|length| !length.is_zero()).ok_or_else(rule)
}

/// Parses a day, meaning its start in UTC, or a moment with its zone; returns milliseconds since 1970.
pub fn moment(text: &str) -> Result<i64, String> {
    let midnight = |day: Date| day.to_zoned(TimeZone::UTC).map(|start| start.timestamp());
    let moment = text.parse::<Timestamp>().or_else(|_| text.parse().and_then(midnight));
    moment
        .map(Timestamp::as_millisecond)
        .map_err(|_| format!("'{text}' must be a day or a time, such as 2027-01-31 or 2027-01-31T12:00:00Z"))
}

/// Formats a moment in UTC, to the second; `-` if there is none.
pub fn shown(milliseconds: Option<i64>) -> String {
    let moment = milliseconds.and_then(|milliseconds| Timestamp::from_second(milliseconds.div_euclid(1000)).ok());
    moment.map_or("-".to_owned(), |moment| moment.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_as_people_write_them() {
        const DAY: u64 = 86_400;
        for (text, seconds) in [("90d", 90 * DAY), ("12h", DAY / 2), ("1w 2d", 9 * DAY), ("30s", 30)] {
            assert_eq!(length(text), Ok(Duration::from_secs(seconds)), "{text}");
        }
        for text in ["", "90", "0d", "-1d", "1mo", "soon"] {
            assert!(length(text).is_err(), "{text}");
        }
        assert_eq!(moment("1970-01-02"), Ok(86_400_000));
        assert_eq!(moment("1970-01-01T01:00:00+01:00"), Ok(0));
        assert!(moment("2027-02-30").is_err() && moment("tomorrow").is_err());
        assert_eq!((shown(Some(86_400_999)).as_str(), shown(None).as_str()), ("1970-01-02T00:00:00Z", "-"));
    }
}
