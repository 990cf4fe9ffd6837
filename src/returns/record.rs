//! The record that was read, and the sentence by which a person checks it.

use jiff::civil::Date;
use serde::{Serialize, Serializer};
use utoipa::ToSchema;

use super::choices::{Kind, Unit};
use super::dates::in_words;
use super::kind::{ColumnReturns, called};
use super::moments::moments;
use super::sheet::ColumnFound;
use super::words::{percent, percent_a_year};
use crate::control::request::annualised::compounded;
use crate::control::request::frequency::Frequency;

/// Returns of one asset or several, oldest first.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Record {
    /// A sentence about the record, for a person to check.
    pub sentence: String,
    /// All columns of the text.
    pub columns: Vec<ColumnFound>,
    /// The columns that were read. They end together, and one may begin later.
    pub series: Vec<Series>,
    /// The number of returns in the text; the series hold fewer if `latest` limits them.
    pub count: usize,
    /// The end of each period in ISO 8601, to the precision of the frequency; absent if no dates were understood.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dates: Option<Vec<String>>,
    /// `daily`, `weekly`, `monthly`, `quarterly` or `yearly`, if the dates show it.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "in_a_word")]
    #[schema(value_type = Option<String>)]
    pub frequency: Option<Frequency>,
    /// Periods in a year, if the dates show it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub periods_per_year: Option<usize>,
    /// True if the first row was the newest, so that the rows were reversed. The dates decide this, or the choice
    /// `newest_first` if there are no dates.
    pub newest_first: bool,
    /// The rates that the bank paid, if a column holds them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<BankRate>,
    /// Sentences about anything that was changed or left out; `sentence` ends with them.
    pub remarks: Vec<String>,
}

/// Returns of one asset.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Series {
    /// The name of its column; empty if the text is one run of numbers.
    pub column: String,
    /// The kind of the numbers in the column.
    pub kind: Kind,
    /// The unit of the numbers; absent for prices.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// The number of periods of the record before its first return.
    #[serde(skip_serializing_if = "is_zero")]
    pub missing: usize,
    /// Log-returns, as the service accepts them.
    pub log_returns: Vec<f64>,
    /// Simple returns of the same periods, as fractions.
    #[serde(skip)]
    pub simple_returns: Vec<f64>,
    /// Mean of the simple returns of a period.
    pub mean: f64,
    /// Standard deviation of the simple returns of a period.
    pub deviation: f64,
    /// Mean per year, compounded: `(1 + mean)^p - 1` with p periods a year.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_per_year: Option<f64>,
    /// Deviation times the square root of the periods in a year.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviation_per_year: Option<f64>,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// The rate that the bank paid in each period, as a fraction.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct BankRate {
    /// The name of the column.
    pub column: String,
    /// Rates in the order of the returns.
    pub rates: Vec<f64>,
}

fn in_a_word<S: Serializer>(frequency: &Option<Frequency>, serializer: S) -> Result<S::Ok, S::Error> {
    frequency.map(Frequency::adjective).serialize(serializer)
}

/// The order of the rows, and how it was found.
pub struct Order {
    /// Dates, oldest first.
    pub dates: Option<Vec<Date>>,
    /// True if the newest row came first.
    pub is_turned: bool,
    pub frequency: Option<Frequency>,
    /// A sentence that says how numbers were read as dates.
    pub remark: Option<String>,
}

impl Order {
    /// Returns the periods in a year, if the dates show it.
    pub fn periods_per_year(&self) -> Option<usize> {
        self.frequency.zip(self.dates.as_ref()).map(|(frequency, dates)| frequency.periods_per_year(dates))
    }
}

/// The contents of the columns that are read.
pub struct ColumnContents {
    pub names: Vec<String>,
    pub order: Order,
    /// Returns by column, which end together.
    pub returns: Vec<ColumnReturns>,
    pub rate: Option<BankRate>,
    /// The number of latest returns to use.
    pub used: usize,
    /// Sentences about what was left out.
    pub remarks: Vec<String>,
}

impl ColumnContents {
    /// Returns the record of the latest periods, with the sentence that describes it.
    pub fn record(self, columns: Vec<ColumnFound>) -> Record {
        let ColumnContents { names, order, returns, rate, used, remarks } = self;
        let count = returns.iter().map(|returns| returns.simple.len()).max().unwrap_or(0);
        let periods_per_year = order.periods_per_year();
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
    /// Returns the kind and unit of its column, in words.
    pub fn what(&self) -> &'static str {
        called(self.kind, self.unit)
    }

    fn of(column: String, returns: ColumnReturns, used: usize, periods_per_year: Option<usize>) -> Self {
        let last = |values: Vec<f64>| values[values.len().saturating_sub(used)..].to_vec();
        let ColumnReturns { kind, unit, simple, logarithmic } = returns;
        let (simple_returns, log_returns) = (last(simple), last(logarithmic));
        let missing = used - log_returns.len();
        let (mean, deviation) = moments(&simple_returns);
        let mean_per_year = periods_per_year.map(|periods| compounded(mean, periods as f64));
        let deviation_per_year = periods_per_year.map(|periods| deviation * (periods as f64).sqrt());
        Series {
            column,
            kind,
            unit,
            missing,
            log_returns,
            simple_returns,
            mean,
            deviation,
            mean_per_year,
            deviation_per_year,
        }
    }
}

impl Record {
    /// Returns for example "240 monthly simple returns in percent, January 1999 to December 2018, as in column market."
    fn what(&self, span: Option<(Date, Date)>) -> String {
        let Series { missing, ref log_returns, .. } = self.series[0];
        let used = missing + log_returns.len();
        let latest = if used < self.count { format!("The latest {used} of {}", self.count) } else { used.to_string() };
        let adjective = self.frequency.map_or(String::new(), |frequency| format!(" {}", frequency.adjective()));
        let Series { kind, unit, .. } = self.series[0];
        let alike = self.series.iter().all(|other| (other.kind, other.unit) == (kind, unit));
        let what = if alike { self.series[0].what() } else { "returns" };
        let day = |date| in_words(date, self.frequency);
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
            (None, true) => ", without dates, read newest first and reversed",
            (None, false) => ", without dates, read oldest first",
        };
        format!("{latest}{adjective} {what}{span}{place}{turned}.")
    }

    /// Returns for example "Mean 0.51 % and deviation 4.30 % a month, 6.29 % and 14.90 % a year."
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
            format!("The bank rate is in column {column}: {last} in the last {noun}.")
        });
        self.series.iter().map(of).chain(bank).collect()
    }
}
