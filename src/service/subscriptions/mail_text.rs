//! Events in words, for people who read them by e-mail.

use std::collections::BTreeSet;

use jiff::Timestamp;
use serde::Deserialize;
use serde_json::Value;

use crate::numerics::machine::digits::percent;
use crate::store::EventKind;

/// An event as it was stored for a delivery.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct StoredEvent {
    #[serde(rename = "type")]
    pub kind: EventKind,
    pub timestamp: Timestamp,
    pub data: Value,
}

/// The session that an event is about, as people know it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct MailedSession {
    /// Empty if it has none.
    pub name: String,
    /// True if figures of its advice are shares of wealth; those of a declared problem are plain numbers.
    pub has_account: bool,
}

/// The subject and the text of an e-mail. The subject is one line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct MailText {
    pub subject: String,
    pub text: String,
}

impl StoredEvent {
    /// Returns the session that it is about.
    pub fn session(&self) -> Option<&str> {
        self.data["session"].as_str()
    }

    /// Puts the event into words, with the reason why it is sent.
    pub fn in_words(&self, session: &MailedSession, subscription: &str) -> MailText {
        let (news, sentences) = match self.kind {
            EventKind::JobEnded => self.job_ended(),
            EventKind::AdviceChanged => self.advice_changed(session),
            EventKind::LeftBand => self.left_band(),
            EventKind::DriftAlarm => self.drift_alarm(),
            EventKind::RenewalFailed => self.renewal_failed(),
            EventKind::ReportDue => self.report_due(),
            EventKind::ReportLate => self.report_late(),
        };
        let (name, identifier) = (one_line(&session.name), self.words("session"));
        let (subject, about) = match (identifier.as_str(), name.as_str()) {
            ("", _) => (news, String::new()),
            (session, "") => (format!("{session}: {news}"), format!("Session: {session}\n")),
            (session, name) => (format!("{name}: {news}"), format!("Session: {name} ({session})\n")),
        };
        let at = self.timestamp.strftime("%Y-%m-%d %H:%M UTC");
        let why = format!(
            "Ballast sends these messages because {subscription} names this address. To end them, delete it on the page \
             Subscriptions, or ask the people who run Ballast for you."
        );
        MailText { subject, text: format!("{sentences}\n\n{about}Time: {at}\n\n{why}\n") }
    }

    fn job_ended(&self) -> (String, String) {
        let (kind, ended) = (self.words("kind"), self.ended());
        let mut text = format!("The job {} ({kind}) {ended}.", self.words("job"));
        if !self.words("policy").is_empty() {
            text += &format!(" Its policy is {}.", self.words("policy"));
        }
        (format!("A job ({kind}) {ended}"), text + &self.reason())
    }

    fn advice_changed(&self, session: &MailedSession) -> (String, String) {
        let amount = |value: &Value| {
            let value = value.as_f64().unwrap_or_default();
            if session.has_account { percent(value, 1) } else { six_digits(value) }
        };
        let of_wealth = if session.has_account { " of wealth" } else { "" };
        let [before, after] = ["before", "after"].map(|field| &self.data[field]);
        let names: BTreeSet<&String> =
            [before, after].into_iter().filter_map(Value::as_object).flat_map(|map| map.keys()).collect();
        let line = |name: &String| {
            format!("\n- {}: {} before, {} now", one_line(name), amount(&before[name]), amount(&after[name]))
        };
        let lines: String = names.into_iter().map(line).collect();
        let text = format!(
            "The advice for period {} differs from the advice before by {}{of_wealth}:{lines}",
            self.whole("period"),
            amount(&self.data["change"]),
        );
        ("the advice changed".to_owned(), text)
    }

    fn left_band(&self) -> (String, String) {
        let [low, high] = [0, 1].map(|end| percent(self.data["band"][end].as_f64().unwrap_or_default(), 1));
        let trade = self.data["trade"].as_f64().unwrap_or_default();
        let text = format!(
            "Before period {} the holding is {} of wealth. It is best kept between {low} and {high}, so the advice is to {} {} \
             of wealth.",
            self.whole("period"),
            percent(self.data["holding"].as_f64().unwrap_or_default(), 1),
            if trade < 0.0 { "sell" } else { "buy" },
            percent(trade.abs(), 1),
        );
        ("a trade is advised".to_owned(), text)
    }

    fn drift_alarm(&self) -> (String, String) {
        let text = format!(
            "The returns up to period {} are no longer like those before: the drift test reached {highest}. If nothing had \
             changed, at most one session in {highest} would ever reach that.",
            self.whole("period"),
            highest = six_digits(self.data["highest"].as_f64().unwrap_or_default().floor()),
        );
        ("its returns look different".to_owned(), text)
    }

    fn renewal_failed(&self) -> (String, String) {
        let text = format!(
            "The training of the next policy (renewal {}, {}) {}. The next attempt starts by itself.",
            self.whole("renewal"),
            self.words("job"),
            self.ended(),
        );
        ("its next policy could not be trained".to_owned(), text + &self.reason())
    }

    fn report_due(&self) -> (String, String) {
        (self.about_report("is due"), self.about_day("due", "Its day is"))
    }

    fn report_late(&self) -> (String, String) {
        (self.about_report("is late"), self.about_day("missing", "It was due on"))
    }

    fn about_report(&self, is: &str) -> String {
        format!("the report of period {} {is}", self.whole("period"))
    }

    fn about_day(&self, is: &str, its_day: &str) -> String {
        let text = format!("The report of period {} is {is}.", self.whole("period"));
        let due = self.words("due");
        if due.is_empty() { text } else { format!("{text} {its_day} {due}.") }
    }

    fn reason(&self) -> String {
        let error = self.words("error");
        if error.is_empty() { error } else { format!("\nThe reason is: {error}") }
    }

    fn ended(&self) -> &'static str {
        match self.data["state"].as_str() {
            Some("succeeded") => "succeeded",
            Some("cancelled") => "was cancelled",
            _ => "failed",
        }
    }

    /// Returns a text on one line; empty if there is none.
    fn words(&self, field: &str) -> String {
        one_line(self.data[field].as_str().unwrap_or_default())
    }

    fn whole(&self, field: &str) -> u64 {
        self.data[field].as_u64().unwrap_or_default()
    }
}

/// Replaces control characters by spaces, so that no text can begin a line of its own.
fn one_line(text: &str) -> String {
    text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}

fn six_digits(value: f64) -> String {
    format!("{value:.5e}").parse::<f64>().unwrap_or(value).to_string()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn in_words(kind: EventKind, session: &str, has_account: bool, data: Value) -> (String, String) {
        let event = json!({ "type": kind.as_str(), "timestamp": "2026-11-30T09:00:00.000Z", "data": data });
        let event: StoredEvent = serde_json::from_value(event).unwrap();
        let name = session.to_owned();
        let MailText { subject, text } = event.in_words(&MailedSession { name, has_account }, "subscription_1");
        let (sentences, rest) = text.split_once("\n\n").unwrap();
        assert!(rest.contains("Time: 2026-11-30 09:00 UTC") && rest.contains("subscription_1"), "{text}");
        assert_eq!(rest.contains("Session: "), data["session"].is_string(), "{text}");
        (subject, sentences.to_owned())
    }

    #[test]
    fn every_event_is_put_into_words() {
        let cases = [
            (
                EventKind::JobEnded,
                json!({ "job": "job_1", "kind": "train", "state": "succeeded", "policy": "policy_1", "error": null }),
                "A job (train) succeeded",
                "The job job_1 (train) succeeded. Its policy is policy_1.",
            ),
            (
                EventKind::AdviceChanged,
                json!({ "session": "session_1", "period": 3, "change": 0.12, "before": { "Bonds": 0.4, "Gold": 0.05 }, "after": { "Bonds": 0.52 } }),
                "Pension: the advice changed",
                "The advice for period 3 differs from the advice before by 12.0 % of wealth:\n- Bonds: 40.0 % before, 52.0 % now\n- Gold: 5.0 % before, 0.0 % now",
            ),
            (
                EventKind::LeftBand,
                json!({ "session": "session_1", "period": 3, "holding": 0.61, "band": [0.4, 0.55], "trade": -0.06 }),
                "Pension: a trade is advised",
                "Before period 3 the holding is 61.0 % of wealth. It is best kept between 40.0 % and 55.0 %, so the advice is to sell 6.0 % of wealth.",
            ),
            (
                EventKind::DriftAlarm,
                json!({ "session": "session_1", "period": 3, "highest": 120.7 }),
                "Pension: its returns look different",
                "The returns up to period 3 are no longer like those before: the drift test reached 120. If nothing had changed, at most one session in 120 would ever reach that.",
            ),
            (
                EventKind::RenewalFailed,
                json!({ "session": "session_1", "renewal": 2, "job": "job_1", "state": "cancelled", "error": null }),
                "Pension: its next policy could not be trained",
                "The training of the next policy (renewal 2, job_1) was cancelled. The next attempt starts by itself.",
            ),
            (
                EventKind::ReportDue,
                json!({ "session": "session_1", "period": 3, "due": "2026-11-30" }),
                "Pension: the report of period 3 is due",
                "The report of period 3 is due. Its day is 2026-11-30.",
            ),
            (
                EventKind::ReportLate,
                json!({ "session": "session_1", "period": 3, "due": "2026-11-29" }),
                "Pension: the report of period 3 is late",
                "The report of period 3 is missing. It was due on 2026-11-29.",
            ),
        ];
        assert_eq!(cases.len(), EventKind::ALL.len());
        for (kind, data, subject, sentences) in cases {
            assert_eq!(in_words(kind, "Pension", true, data), (subject.to_owned(), sentences.to_owned()));
        }
    }

    #[test]
    fn a_session_without_a_name_and_a_declared_problem_have_words_too() {
        let data = json!({ "session": "session_1", "period": 1, "change": 3.2, "before": { "units": 1.0 }, "after": { "units": 4.2 } });
        let (subject, sentences) = in_words(EventKind::AdviceChanged, "", false, data);
        assert_eq!(subject, "session_1: the advice changed");
        assert_eq!(
            sentences,
            "The advice for period 1 differs from the advice before by 3.2:\n- units: 1 before, 4.2 now"
        );
        let due = json!({ "session": "session_1", "period": 3, "due": null });
        assert_eq!(in_words(EventKind::ReportDue, "", true, due.clone()).1, "The report of period 3 is due.");
        assert_eq!(in_words(EventKind::ReportLate, "", true, due).1, "The report of period 3 is missing.");
    }

    #[test]
    fn a_text_with_line_breaks_stays_on_its_line() {
        let error = "first\r\nBcc: other@example.com\n\nlast";
        let data =
            json!({ "job": "job_1", "kind": "train\r\nX: y", "state": "failed", "policy": null, "error": error });
        let (subject, sentences) = in_words(EventKind::JobEnded, "", true, data);
        assert_eq!(subject, "A job (train  X: y) failed");
        assert_eq!(
            sentences,
            "The job job_1 (train  X: y) failed.\nThe reason is: first  Bcc: other@example.com  last"
        );
    }
}
