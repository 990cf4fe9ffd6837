//! Returns of a risky asset and of the bank: those bundled, of the US stock market and Treasury bills, or a file's.
//!
//! A file has one period a row, oldest first, and columns that are found by their names ([`columns`]). How far apart its
//! dates are says what a period is ([`Frequency`]). What breaks a rule is refused with its line, column and value: a file
//! that is misread would give advice all the same.

use std::path::PathBuf;

use ballast::control::evaluation::account::Annual;
use ballast::control::evaluation::rolling::Period;
use ballast::control::request::dates;
pub use ballast::control::request::frequency::Frequency;
use clap::Args;
use csv::StringRecord;
use jiff::civil::Date;

use cell::Cell;
use columns::{Columns, Kind, Line};
pub use error::ReturnsError;

mod cell;
mod columns;
mod error;
#[cfg(test)]
mod tests;

const CSV: &str = include_str!("../../data/us_market_monthly.csv");
/// A column of fractions that varies more than this in a period holds something else: per cent, or prices.
const LARGEST_DEVIATION: f64 = 0.5;
/// Of periods in a year: a day at the shortest.
const PERIODS_PER_YEAR: std::ops::RangeInclusive<usize> = 1..=366;
/// Of what the bank pays a period; as `problem.rate_per_step`.
const RATE: std::ops::RangeInclusive<f64> = -0.5..=0.5;

/// Where the returns of a command come from.
#[derive(Debug, Clone, Args)]
pub struct ReturnsFile {
    /// CSV file: a column of dates, and one of returns (fractions) or prices; oldest row first
    file: PathBuf,
    /// What the bank pays a period, as a fraction; in place of a column such as risk_free_return
    #[arg(long)]
    rate: Option<f64>,
    /// Periods that make a year; the dates say so unless given
    #[arg(long)]
    periods_per_year: Option<usize>,
}

/// One period: simple returns, as fractions.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Of the end of the period, in ISO 8601, as fine as the frequency: `2008-01` of a month.
    pub date: String,
    /// The same in years.
    pub time: f64,
    pub risky_return: f64,
    pub risk_free_return: f64,
}

/// Periods in the order of time, without a gap.
#[derive(Debug, Clone, PartialEq)]
pub struct Returns {
    rows: Vec<Row>,
    pub frequency: Frequency,
    pub periods_per_year: usize,
    /// What the returns were read from.
    source: String,
    /// Where it is said what the bank pays.
    bank: String,
}

impl Row {
    pub fn period(&self) -> Period {
        Period { log_return: self.risky_return.ln_1p(), bank_return: self.risk_free_return }
    }
}

impl ReturnsFile {
    /// # Errors
    /// The file cannot be read, or a line of it or an option breaks a rule.
    pub fn read(&self) -> Result<Returns, ReturnsError> {
        let read = std::fs::read_to_string(&self.file);
        let text = read.map_err(|source| ReturnsError::Read { path: self.file.clone(), source })?;
        Returns::parse(&text, self.rate, self.periods_per_year)
    }
}

impl Returns {
    /// The file embedded in the binary.
    pub fn bundled() -> Result<Self, ReturnsError> {
        Self::parse(CSV, None, None)
    }

    /// Of the text of a file; `rate` and `periods_per_year` take the place of what it says.
    ///
    /// # Errors
    /// A line or an option breaks a rule.
    pub fn parse(text: &str, rate: Option<f64>, periods_per_year: Option<usize>) -> Result<Self, ReturnsError> {
        check(rate, periods_per_year)?;
        let mut reader = columns::reader(text.trim_start_matches('\u{feff}'));
        let columns = Columns::of(reader.headers()?)?;
        let bank = match (rate, &columns.bank) {
            (Some(_), _) => "--rate".to_owned(),
            (None, Some((_, name))) => format!("the last row of column {name}"),
            (None, None) => return Err(ReturnsError::NoBank),
        };
        let records: Vec<StringRecord> = reader.records().collect::<Result<_, _>>()?;
        let lines: Vec<Line> = records.iter().map(|record| columns.line(record)).collect::<Result<_, _>>()?;
        let date = |line: &Line| dates::date(line.date.text).ok_or_else(|| line.date.refused(dates::FORM));
        let dates: Vec<Date> = lines.iter().map(date).collect::<Result<_, _>>()?;
        let risky_returns = columns.kind.returns(&lines)?;
        if risky_returns.len() < 2 {
            return Err(ReturnsError::Few { found: risky_returns.len() });
        }
        let written: Vec<&str> = lines.iter().map(|line| line.date.text).collect();
        let frequency = Frequency::of(&dates, &written).map_err(|found| lines[found.index].date.refused(found.rule))?;
        // The first price has no return.
        let first = lines.len() - risky_returns.len();
        let rows = dates[first..].iter().zip(&lines[first..]).zip(risky_returns);
        let row = |((date, line), risky_return): ((&Date, &Line), f64)| {
            let said = || line.bank.map_or(Ok(0.0), Cell::rate);
            let risk_free_return = rate.map_or_else(said, Ok)?;
            Ok(Row { date: frequency.shown(*date), time: frequency.time(*date), risky_return, risk_free_return })
        };
        let rows = rows.map(row).collect::<Result<Vec<Row>, ReturnsError>>()?;
        let periods_per_year = periods_per_year.unwrap_or_else(|| frequency.periods_per_year(&dates));
        let source = format!("{} column {}", columns.kind.source(), columns.name);
        let returns = Returns { rows, frequency, periods_per_year, source, bank };
        let deviation = returns.annual().volatility / (periods_per_year as f64).sqrt();
        if columns.kind == Kind::Return && deviation > LARGEST_DEVIATION {
            return Err(ReturnsError::Deviation { column: columns.name, deviation });
        }
        Ok(returns)
    }

    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The last `count` periods.
    ///
    /// # Errors
    /// There are not so many.
    pub fn last(mut self, count: usize) -> Result<Self, ReturnsError> {
        let found = self.rows.len();
        let rule = "must be at most the returns of the file, and 2 or more";
        if !(2..=found).contains(&count) {
            return Err(ReturnsError::Option { option: "--window", value: format!("{count} of {found}"), rule });
        }
        self.rows.drain(..found - count);
        Ok(self)
    }

    /// The `count` periods before `date`, oldest first.
    pub fn before(&self, date: &str, count: usize) -> Result<&[Row], ReturnsError> {
        let end = self.rows.partition_point(|row| row.date.as_str() < date);
        let noun = self.frequency.noun();
        let too_short = || ReturnsError::TooShort { date: date.into(), wanted: count, noun, found: end };
        let start = end.checked_sub(count).ok_or_else(too_short)?;
        Ok(&self.rows[start..end])
    }

    /// The periods of a calendar year.
    pub fn year(&self, year: &str) -> &[Row] {
        let start = self.rows.partition_point(|row| row.date.as_str() < year);
        let length = self.rows[start..].iter().take_while(|row| row.date.starts_with(year)).count();
        &self.rows[start..start + length]
    }

    /// What the bank paid in the last period, and is taken to go on paying.
    pub fn rate(&self) -> f64 {
        self.rows.last().map_or(0.0, |row| row.risk_free_return)
    }

    fn annual(&self) -> Annual {
        let (risky, bank): (Vec<f64>, Vec<f64>) =
            self.rows.iter().map(|row| (row.risky_return, row.risk_free_return)).unzip();
        Annual::of(&risky, &bank, self.periods_per_year as f64)
    }

    /// What was read, for a reader to see whether it is what he meant.
    pub fn sentence(&self) -> String {
        let Annual { mean, volatility, .. } = self.annual();
        let date = |row: Option<&Row>| row.map_or(String::new(), |row| row.date.clone());
        let noun = self.frequency.noun();
        format!(
            "{} {} returns, {} to {}, {}.\nA year of {} {noun}{} has a mean of {:.1} % and a deviation of {:.1} %. \
             The bank pays {:.3} % a {noun}, {:.1} % a year, by {}.",
            self.rows.len(),
            self.frequency.adjective(),
            date(self.rows.first()),
            date(self.rows.last()),
            self.source,
            self.periods_per_year,
            if self.periods_per_year == 1 { "" } else { "s" },
            100.0 * mean,
            100.0 * volatility,
            100.0 * self.rate(),
            100.0 * self.rate() * self.periods_per_year as f64,
            self.bank
        )
    }
}

/// The rules of the options.
fn check(rate: Option<f64>, periods_per_year: Option<usize>) -> Result<(), ReturnsError> {
    if let Some(rate) = rate.filter(|rate| !RATE.contains(rate)) {
        let rule = "must be a fraction a period from -0.5 to 0.5: 0.002 is 0.2 %";
        return Err(ReturnsError::Option { option: "--rate", value: rate.to_string(), rule });
    }
    if let Some(periods) = periods_per_year.filter(|periods| !PERIODS_PER_YEAR.contains(periods)) {
        let (option, rule) = ("--periods-per-year", "must be 1 to 366");
        return Err(ReturnsError::Option { option, value: periods.to_string(), rule });
    }
    Ok(())
}
