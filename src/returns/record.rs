//! What was read, and the sentence by which a person checks it.

use jiff::civil::Date;
use serde::{Serialize, Serializer};
use utoipa::ToSchema;

use super::choices::{Kind, Unit};
use super::dates::told;
use super::kind::{Returns, called};
use super::moments::moments;
use super::sheet::ColumnFound;
use super::words::{percent, percent_a_year};
use crate::control::request::annualised::compounded;
use crate::control::request::frequency::Frequency;

/// Returns of one asset or several, oldest first.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Record {
    /// What was read, for a person to check.
    pub sentence: String,
    /// All that the text has.
    pub columns: Vec<ColumnFound>,
    /// Those that were read, all of one length.
    pub series: Vec<Series>,
    /// Returns there are, of which `latest` may have taken fewer.
    pub count: usize,
    /// When each period ended, in ISO 8601, as fine as the frequency; absent where no dates were understood.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dates: Option<Vec<String>>,
    /// `daily`, `weekly`, `monthly`, `quarterly` or `yearly`, where the dates say so.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "in_a_word")]
    #[schema(value_type = Option<String>)]
    pub frequency: Option<Frequency>,
    /// How many periods make a year, where the dates say so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub periods_per_year: Option<usize>,
    /// Whether the first row was the newest, so that the rows are turned round: as their dates tell, or as it was said where
    /// there are none.
    pub newest_first: bool,
    /// What the bank paid, where a column says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<BankRate>,
    /// What was changed or passed over, in sentences; the last of `sentence`.
    pub remarks: Vec<String>,
}

/// Returns of one asset.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Series {
    /// The name of its column; empty where the text is one run of numbers.
    pub column: String,
    /// What the column holds.
    pub kind: Kind,
    /// What it is counted in; absent of prices.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Returns as the service takes them.
    pub log_returns: Vec<f64>,
    /// The same as simple returns, as fractions.
    #[serde(skip)]
    pub simple_returns: Vec<f64>,
    /// Mean of the simple returns of a period.
    pub mean: f64,
    /// Their standard deviation.
    pub deviation: f64,
    /// Mean of a year, compounded: `(1 + mean)^p - 1` of p periods.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_per_year: Option<f64>,
    /// Deviation times the square root of the periods of a year.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviation_per_year: Option<f64>,
}

/// What the bank paid in each period, as fractions.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct BankRate {
    /// The name of the column.
    pub column: String,
    /// In the order of the returns.
    pub rates: Vec<f64>,
}

fn in_a_word<S: Serializer>(frequency: &Option<Frequency>, serializer: S) -> Result<S::Ok, S::Error> {
    frequency.map(Frequency::adjective).serialize(serializer)
}

/// How the rows are ordered, and how that was known.
pub struct Order {
    /// Oldest first.
    pub dates: Option<Vec<Date>>,
    /// Whether the newest row came first.
    pub is_turned: bool,
    pub frequency: Option<Frequency>,
    /// What numbers that stand for dates are taken for.
    pub remark: Option<String>,
}

impl Order {
    /// Where the dates say so.
    pub fn periods_per_year(&self) -> Option<usize> {
        self.frequency.zip(self.dates.as_ref()).map(|(frequency, dates)| frequency.periods_per_year(dates))
    }
}

/// What was found in the columns that are read.
pub struct Found {
    pub names: Vec<String>,
    pub order: Order,
    /// Of each column, all of one length.
    pub returns: Vec<Returns>,
    pub rate: Option<BankRate>,
    /// The last returns that count.
    pub used: usize,
    /// What was passed over, in sentences.
    pub remarks: Vec<String>,
}

impl Found {
    /// The last periods, and the sentence that tells what they are.
    pub fn record(self, columns: Vec<ColumnFound>) -> Record {
        let Found { names, order, returns, rate, used, remarks } = self;
        let (count, periods_per_year) = (returns[0].simple.len(), order.periods_per_year());
        let Order { dates, is_turned, frequency, .. } = order;
        let series =
            names.into_iter().zip(returns).map(|(column, returns)| Series::of(column, returns, used, periods_per_year));
        let days = dates.map(|dates| dates[dates.len() - used..].to_vec());
        let shown = |date: &Date| frequency.map_or_else(|| date.to_string(), |frequency| frequency.shown(*date));
        let mut record = Record {
            sentence: String::new(),
            columns,
            series: series.collect(),
            count,
            dates: days.as_ref().map(|days| days.iter().map(shown).collect()),
            frequency,
            periods_per_year,
            newest_first: is_turned,
            rate,
            remarks,
        };
        let span = days.as_deref().and_then(|days| Some((*days.first()?, *days.last()?)));
        record.sentence = [vec![record.what(span)], record.figures(), record.remarks.clone()].concat().join(" ");
        record
    }
}

impl Series {
    /// What its column holds, in words.
    pub fn what(&self) -> &'static str {
        called(self.kind, self.unit)
    }

    fn of(column: String, returns: Returns, used: usize, periods_per_year: Option<usize>) -> Self {
        let last = |values: Vec<f64>| values[values.len() - used..].to_vec();
        let Returns { kind, unit, simple, logarithmic } = returns;
        let (simple_returns, log_returns) = (last(simple), last(logarithmic));
        let (mean, deviation) = moments(&simple_returns);
        let mean_per_year = periods_per_year.map(|periods| compounded(mean, periods as f64));
        let deviation_per_year = periods_per_year.map(|periods| deviation * (periods as f64).sqrt());
        Series { column, kind, unit, log_returns, simple_returns, mean, deviation, mean_per_year, deviation_per_year }
    }
}

impl Record {
    /// "240 monthly simple returns in percent, January 1999 to December 2018, as in column market."
    fn what(&self, span: Option<(Date, Date)>) -> String {
        let used = self.series[0].log_returns.len();
        let latest = if used < self.count { format!("The latest {used} of {}", self.count) } else { used.to_string() };
        let adjective = self.frequency.map_or(String::new(), |frequency| format!(" {}", frequency.adjective()));
        let Series { kind, unit, .. } = self.series[0];
        let alike = self.series.iter().all(|other| (other.kind, other.unit) == (kind, unit));
        let what = if alike { self.series[0].what() } else { "returns" };
        let day = |date| told(date, self.frequency);
        let span = span.map_or(String::new(), |(first, last)| format!(", {} to {}", day(first), day(last)));
        let names: Vec<&str> = self.series.iter().map(|series| series.column.as_str()).collect();
        let place = match names[..] {
            [""] => String::new(),
            [name] if name.starts_with("column ") => format!(", as in {name}"),
            [name] => format!(", as in column {name}"),
            _ => format!(", as in columns {}", names.join(", ")),
        };
        let turned = match (&self.dates, self.newest_first) {
            (Some(_), _) => "",
            (None, true) => ", without dates, taken newest first and turned round",
            (None, false) => ", without dates, taken oldest first",
        };
        format!("{latest}{adjective} {what}{span}{place}{turned}.")
    }

    /// "Mean 0.51 % and deviation 4.30 % a month, 6.29 % and 14.90 % a year."
    fn figures(&self) -> Vec<String> {
        let noun = self.frequency.map_or("period", Frequency::noun);
        let of = |series: &Series| {
            let Series { column, mean, deviation, deviation_per_year, .. } = series;
            let of = if self.series.len() > 1 { format!("{column}: mean") } else { "Mean".to_owned() };
            let yearly = self.periods_per_year.zip(*deviation_per_year);
            let yearly = yearly.filter(|_| self.frequency != Some(Frequency::Yearly));
            let yearly = yearly.map_or(String::new(), |(periods, deviation)| {
                format!(", {} and {} a year", percent_a_year(*mean, periods as f64), percent(deviation))
            });
            format!("{of} {} and deviation {} a {noun}{yearly}.", percent(*mean), percent(*deviation))
        };
        let bank = self.rate.iter().map(|BankRate { column, rates }| {
            let last = rates.last().map_or(String::new(), |rate| percent(*rate));
            format!("What the bank pays is in column {column}: {last} in the last {noun}.")
        });
        self.series.iter().map(of).chain(bank).collect()
    }
}
