//! The days on which reports are due, as a calendar that calendar programs read (iCalendar, RFC 5545).

use jiff::Timestamp;

use crate::service::callers::keys::Caller;
use crate::service::catalogue::overview::Listed;
use crate::service::error::ServiceError;
use crate::service::sessions::Sessions;
use crate::store::{SessionFilter, SessionOrder, SessionQuery};

/// The most sessions of a calendar: far more than anybody reads in one.
pub const MOST_IN_CALENDAR: usize = 1_000;
/// The most bytes of a line, without its end.
const LONGEST_LINE: usize = 75;

impl Sessions {
    /// Returns the calendar of the next report of each active session of the tenant, those first that reported longest
    /// ago.
    ///
    /// # Errors
    /// The store does not answer, or no permit came in time.
    pub async fn calendar(&self, caller: &Caller) -> Result<String, ServiceError> {
        let query = SessionQuery {
            is: Some(SessionFilter::Active),
            order: SessionOrder::LastReport,
            limit: MOST_IN_CALENDAR,
            ..SessionQuery::default()
        };
        let found = self.list(caller, query).await?;
        Ok(calendar(&found.sessions, self.clock.now_milliseconds()))
    }
}

/// Writes one event for each session whose next report has a day. A report moves the event of its session: a program that
/// reads the calendar again knows it by `UID`, and that it is newer by `SEQUENCE`.
fn calendar(sessions: &[Listed], now_ms: i64) -> String {
    let now = Timestamp::from_millisecond(now_ms).unwrap_or_default().strftime("%Y%m%dT%H%M%SZ");
    let mut text = String::new();
    for line in ["BEGIN:VCALENDAR", "VERSION:2.0", "PRODID:-//Ballast//Reports//EN"] {
        add_line(&mut text, line);
    }
    for Listed { row, next, .. } in sessions {
        let Some(day) = next else { continue };
        let name = if row.labels.name.is_empty() { &row.session } else { &row.labels.name };
        let summary = format!("Report of period {}: {name}", row.observations + 1);
        for line in [
            "BEGIN:VEVENT".to_owned(),
            format!("UID:{}@ballast", row.session),
            format!("DTSTAMP:{now}"),
            format!("SEQUENCE:{}", row.observations),
            format!("DTSTART;VALUE=DATE:{}", day.strftime("%Y%m%d")),
            format!("SUMMARY:{}", escaped(&summary)),
            "TRANSP:TRANSPARENT".to_owned(),
            "END:VEVENT".to_owned(),
        ] {
            add_line(&mut text, &line);
        }
    }
    add_line(&mut text, "END:VCALENDAR");
    text
}

/// Escapes a text (section 3.3.11). Names have no line breaks.
fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\").replace(';', "\\;").replace(',', "\\,")
}

/// Adds a line, folded where it is too long (section 3.1): its continuation begins with a space. No letter is cut in two.
fn add_line(text: &mut String, line: &str) {
    let mut length = 0;
    for letter in line.chars() {
        if length + letter.len_utf8() > LONGEST_LINE {
            text.push_str("\r\n ");
            length = 1;
        }
        text.push(letter);
        length += letter.len_utf8();
    }
    text.push_str("\r\n");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_are_folded_and_read_back() {
        for line in ["SUMMARY:short", &"é,".repeat(90), &"a".repeat(75), &"a".repeat(76), &"\u{1F600}".repeat(40)] {
            let mut text = String::new();
            add_line(&mut text, &escaped(line));
            let lines: Vec<&str> = text.strip_suffix("\r\n").unwrap().split("\r\n").collect();
            assert!(lines.iter().all(|part| part.len() <= LONGEST_LINE), "{text}");
            assert_eq!(lines.join("\r\n").replace("\r\n ", "").replace("\\,", ","), *line);
            assert_eq!(lines.len() > 1, escaped(line).len() > LONGEST_LINE);
        }
        assert_eq!(escaped(r"a\b;c,d"), r"a\\b\;c\,d");
    }
}
