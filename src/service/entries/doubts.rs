//! Doubts about a report before it is recorded: a day that is not about one period after the last one, a day in the
//! future, a return far from the record, or one that differs from that of its peers.
//!
//! A doubt is not a refusal: the report is recorded once it comes with `confirm`. One answer names every doubt, so that
//! clients confirm only doubts that they were shown.

use std::fmt;

use jiff::civil::Date;
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use crate::control::request::support::LawExtent;
use crate::service::entries::days::{Days, days_between};
use crate::service::jobs::due::{DAILY, next_day};

/// A return further from the mean of the record than so many of its standard deviations is doubted.
const UNUSUAL_DEVIATIONS: f64 = 4.0;
/// So is one beyond this many deviations that is this many times as far from the mean as any other on its side.
const BEYOND_DEVIATIONS: f64 = 3.0;
const BEYOND_ALL: f64 = 1.5;
/// Log-returns this close count as equal: they may be rounded to two digits of a percent.
pub(in crate::service) const ROUNDING: f64 = 1e-4;
/// The most days from one trading day to the next, over a weekend and a holiday.
const LONGEST_WEEKEND: i32 = 4;
/// The most days of missing periods that are listed: ten years of months.
const LISTED: usize = 120;
/// The most missing periods that are counted.
const COUNTED: usize = 10_000;

/// Something in a report that is probably a mistake.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Doubt {
    pub reason: DoubtReason,
    /// Dotted path of the field.
    #[schema(example = "date")]
    pub field: String,
    /// Value of the field.
    pub value: Value,
    /// The doubt, in one sentence.
    pub sentence: String,
    /// Last days of the periods missing before the reported one, unless they are more than 120.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schema(value_type = Vec<String>, example = json!(["2026-06-30", "2026-07-31"]))]
    pub missing: Vec<Date>,
}

/// Why a report is doubted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DoubtReason {
    /// Its day is later than the next one due by more than half a period.
    MissingPeriods,
    /// Its day is earlier than the next one due by more than half a period.
    EarlyDay,
    /// Its day lies after tomorrow.
    FutureDay,
    /// Its return lies more than 4 standard deviations from the record, or more than 3 and far beyond all others.
    UnusualReturn,
    /// Its noise lies as far from those known.
    UnusualNoise,
    /// Its return is -100 %.
    TotalLoss,
    /// It was recorded under this number, and counts under another one since a period was removed.
    Repeated,
    /// Most reports in the list for the same policy and day have another return.
    DiffersFromPeers,
}

impl Doubt {
    pub(in crate::service) fn new(
        reason: DoubtReason,
        field: impl Into<String>,
        value: impl Into<Value>,
        sentence: String,
    ) -> Self {
        Doubt { reason, field: field.into(), value: value.into(), sentence, missing: Vec::new() }
    }

    /// Returns the rule that a doubted field breaks if the report is not confirmed.
    pub fn rule(&self) -> String {
        format!("must come with \"confirm\": true if it is meant: {}", self.sentence)
    }
}

/// All doubts about a report.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Doubts(pub Vec<Doubt>);

impl fmt::Display for Doubts {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        for doubt in &self.0 {
            write!(out, "{}. ", upper(&doubt.sentence))?;
        }
        out.write_str("If this is meant, send the report again with \"confirm\": true")?;
        match self.0.iter().any(|doubt| doubt.reason == DoubtReason::MissingPeriods) {
            true => out.write_str("; if not, report the missing periods first, or report them as missing"),
            false => Ok(()),
        }
    }
}

fn upper(sentence: &str) -> String {
    let mut letters = sentence.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Returns the doubts about the day of a report after `days`; `date` is `None` if the report gives none.
pub(in crate::service) fn of_day(days: &Days, date: Option<Date>, policy: Option<f64>, today: Date) -> Vec<Doubt> {
    let next = days.next(policy);
    let Some(day) = date.or(next) else { return Vec::new() };
    let calendar = days.last.zip(next).zip(days.periods_per_year(policy));
    let off = calendar.and_then(|((last, next), periods)| off_calendar(last, next, periods, day));
    off.into_iter().chain(in_the_future(day, date.is_none(), today)).collect()
}

fn in_the_future(day: Date, is_next: bool, today: Date) -> Option<Doubt> {
    if today.tomorrow().is_ok_and(|tomorrow| day <= tomorrow) || today == Date::MAX {
        return None;
    }
    let whose = if is_next { "no day is given, and the next one due, " } else { "the day " };
    let sentence = format!("{whose}{day}{} is in the future: today is {today}", if is_next { "," } else { "" });
    Some(Doubt::new(DoubtReason::FutureDay, "date", day.to_string(), sentence))
}

/// Returns a doubt if `day` is far from the next one due, in a session whose last reported day is `last`.
fn off_calendar(last: Date, next: Date, periods: f64, day: Date) -> Option<Doubt> {
    let (apart, half) = (days_between(last, day), days_between(last, next) / 2);
    let late = days_between(next, day);
    if periods >= DAILY && apart <= LONGEST_WEEKEND || late.abs() <= half {
        return None;
    }
    if late < 0 {
        let sentence =
            format!("{day} comes {apart} days after {last}, the last day reported, and {next} is the next one due");
        return Some(Doubt::new(DoubtReason::EarlyDay, "date", day.to_string(), sentence));
    }
    let mut missing = vec![next];
    while let Some(later) = next_day(missing[missing.len() - 1], periods).filter(|_| missing.len() < COUNTED) {
        // The day belongs to the period whose end is nearest.
        if days_between(day, later) > days_between(missing[missing.len() - 1], day) {
            break;
        }
        missing.push(later);
    }
    // The last of them is the reported period.
    missing.pop();
    let sentence = match missing[..] {
        [] => format!("{day} comes {apart} days after {last}, the last day reported, and {next} was the next one due"),
        [only] => format!("the period that ends {only} is missing between {last}, the last day reported, and {day}"),
        [first, .., end] => {
            format!(
                "{} periods, which end {first} to {end}, are missing between {last}, the last day reported, and {day}",
                missing.len()
            )
        }
    };
    let missing = if missing.len() > LISTED { Vec::new() } else { missing };
    Some(Doubt { missing, ..Doubt::new(DoubtReason::MissingPeriods, "date", day.to_string(), sentence) })
}

/// Doubts a report that was recorded as `period` and counts as another one since a period was removed.
/// Checked by: `tests/service/account.rs::a_report_sent_again_after_a_removal_is_doubted`.
pub(in crate::service) fn of_repeat(period: usize, counted: usize) -> Doubt {
    let sentence = format!(
        "the same report was recorded as period {period}, and counts as period {counted} since one was removed"
    );
    Doubt::new(DoubtReason::Repeated, "period", period, sentence)
}

/// Returns how many standard deviations `value` lies from the mean of a record, if that is unusual and the distance exceeds
/// `rounding`: with the mean m, the deviation s and the furthest value e on the side of the value,
///
///   |value - m| > min(4 s, max(3 s, 1.5 |e - m|))
///
/// They are infinite for a record whose values are all equal.
fn unusual(value: f64, record: &LawExtent, rounding: f64) -> Option<f64> {
    let (mean, deviation) = (record.mean, record.variance.max(0.0).sqrt());
    let [lowest, highest] = record.ends;
    let furthest = ((if value < mean { lowest } else { highest }) - mean).abs();
    let beyond = (BEYOND_ALL * furthest).max(BEYOND_DEVIATIONS * deviation);
    let distance = (value - mean).abs();
    if distance <= beyond.min(UNUSUAL_DEVIATIONS * deviation).max(rounding) {
        return None;
    }
    Some(distance / deviation)
}

/// Doubts the noise of a declared problem as [`of_return`] doubts a return.
pub(in crate::service) fn of_noise(noise: f64, known: &LawExtent) -> Option<Doubt> {
    let mean = known.mean;
    let deviations = unusual(noise, known, ROUNDING * mean.abs())?;
    let sentence = match deviations.is_finite() {
        true => format!("{noise} lies {deviations:.1} standard deviations from the noises known"),
        false => format!("{noise} differs from the noises known, which are all {mean}"),
    };
    Some(Doubt::new(DoubtReason::UnusualNoise, "noise", noise, sentence))
}

/// Doubts a total loss, and a log-return that lies far from the record, at any size.
/// Checked by: `tests/service/doubts.rs::a_return_far_from_the_record_is_doubted_at_any_size`.
pub(in crate::service) fn of_return(field: &str, value: f64, record: &LawExtent, log_return: f64) -> Option<Doubt> {
    if log_return == f64::NEG_INFINITY {
        let sentence = "a return of -100 % is a total loss: a total loss is always doubted".to_owned();
        return Some(Doubt::new(DoubtReason::TotalLoss, field, value, sentence));
    }
    let deviations = unusual(log_return, record, ROUNDING)?;
    let percent = 100.0 * log_return.exp_m1();
    let sentence = match deviations.is_finite() {
        true => format!("a return of {percent:.2} % lies {deviations:.1} standard deviations from the record"),
        false => {
            format!(
                "a return of {percent:.2} % differs from the record, in which every return is {:.2} %",
                100.0 * record.mean.exp_m1()
            )
        }
    };
    Some(Doubt::new(DoubtReason::UnusualReturn, field, value, sentence))
}
