//! Returns of a risky asset and of the bank: those bundled, of the US stock market and Treasury bills, or a file's.
//!
//! A file is read by the one reader of returns ([`ballast::returns`]); what it asks is answered by options. How far apart its
//! dates are says what a period is ([`Frequency`]).

use std::path::PathBuf;

use ballast::control::evaluation::account::Annual;
use ballast::control::evaluation::assets::AssetsRecord;
use ballast::control::evaluation::rolling::Period;
use ballast::control::request::annualised::compounded;
pub use ballast::control::request::frequency::Frequency;
use ballast::returns::{Choices, Holds, Kind, Question, Reading, Record, Series, Unit, decoded, read};
use clap::Args;

use calendar::{Calendar, SEVERAL, check};
pub use error::ReturnsError;

mod calendar;
mod coarser;
mod error;
#[cfg(test)]
mod tests;

const CSV: &str = include_str!("../../data/us_market_monthly.csv");

/// Where the returns of a command come from.
#[derive(Debug, Clone, Args)]
pub struct ReturnsFile {
    /// File of dates beside returns or prices: CSV, or what a spreadsheet or a person writes
    file: PathBuf,
    /// What the bank pays a period, as a fraction; in place of a column such as risk_free_return
    #[arg(long)]
    rate: Option<f64>,
    /// Periods that make a year; the dates say so unless given
    #[arg(long)]
    periods_per_year: Option<usize>,
    #[command(flatten)]
    choices: Choices,
}

/// One period: returns as fractions.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Of the end of the period, in ISO 8601, as fine as the frequency: `2008-01` of a month; the number of the row without dates.
    pub date: String,
    pub log_return: f64,
    pub risky_return: f64,
    pub risk_free_return: f64,
}

/// Periods in the order of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Returns {
    rows: Vec<Row>,
    /// `None` if the dates do not tell one.
    pub frequency: Option<Frequency>,
    pub periods_per_year: usize,
    /// What the column of the risky asset holds, and its name.
    what: &'static str,
    column: String,
    /// Where it is said what the bank pays.
    bank: String,
    /// What was changed or passed over, in sentences.
    remarks: Vec<String>,
}

/// Periods of several assets.
#[derive(Debug, Clone, PartialEq)]
pub struct SeveralReturns {
    pub record: AssetsRecord,
    /// What was read, for a reader to see whether it is what he meant.
    pub sentence: String,
}

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyReturns {
    /// Of one asset.
    One(Returns),
    /// Of several.
    Several(SeveralReturns),
}

impl Row {
    pub fn period(&self) -> Period {
        Period { log_return: self.log_return, bank_return: self.risk_free_return }
    }
}

impl ReturnsFile {
    /// # Errors
    /// The file cannot be read, a place in it or an option breaks a rule, or an option must say what the file does not.
    pub fn read(&self) -> Result<Returns, ReturnsError> {
        Returns::parse(&self.text()?, &self.choices, self.rate, self.periods_per_year)
    }

    /// Columns that nothing tells apart are an asset each.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_any(&self) -> Result<AnyReturns, ReturnsError> {
        AnyReturns::parse(&self.text()?, &self.choices, self.rate, self.periods_per_year)
    }

    /// Whether options say which columns are read.
    pub fn names_columns(&self) -> bool {
        !self.choices.columns.is_empty()
    }

    fn text(&self) -> Result<String, ReturnsError> {
        let read = std::fs::read(&self.file);
        let bytes = read.map_err(|source| ReturnsError::Read { path: self.file.clone(), source })?;
        decoded(&bytes).map_err(|said| ReturnsError::Refused { said })
    }
}

impl Returns {
    /// The file embedded in the binary.
    pub fn bundled() -> Result<Self, ReturnsError> {
        Self::parse(CSV, &Choices::default(), None, None)
    }

    /// Of the text of a file, with what is said of it; `rate` and `periods_per_year` take the place of what it says.
    ///
    /// # Errors
    /// A place or an option breaks a rule, or an option must say what the text does not.
    pub fn parse(
        text: &str,
        choices: &Choices,
        rate: Option<f64>,
        periods_per_year: Option<usize>,
    ) -> Result<Self, ReturnsError> {
        Self::of(record(text, choices, rate, periods_per_year)?, rate, periods_per_year)
    }

    fn of(record: Record, rate: Option<f64>, periods_per_year: Option<usize>) -> Result<Self, ReturnsError> {
        let Calendar { dates, frequency, periods_per_year, rates, bank } =
            Calendar::of(&record, rate, periods_per_year)?;
        let [series] = &record.series[..] else { return Err(ReturnsError::Several { found: record.series.len() }) };
        let rows = dates.into_iter().zip(&series.log_returns).zip(&series.simple_returns).zip(rates);
        let row = |(((date, log_return), risky_return), risk_free_return): (((String, &f64), &f64), f64)| Row {
            date,
            log_return: *log_return,
            risky_return: *risky_return,
            risk_free_return,
        };
        let what = match series {
            Series { kind: Kind::Simple, unit: Some(Unit::Fraction), .. } => "returns",
            series => series.what(),
        };
        let (rows, column) = (rows.map(row).collect(), series.column.clone());
        Ok(Returns { rows, frequency, periods_per_year, what, column, bank, remarks: record.remarks })
    }

    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// One period, in a word.
    pub fn noun(&self) -> &'static str {
        self.frequency.map_or("period", Frequency::noun)
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
        let noun = self.noun();
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
        let (Annual { mean, volatility, .. }, periods) = (self.annual(), self.periods_per_year as f64);
        let date = |row: Option<&Row>| row.map_or(String::new(), |row| row.date.clone());
        let noun = self.noun();
        let adjective = self.frequency.map_or(String::new(), |frequency| format!("{} ", frequency.adjective()));
        let remarks: String = self.remarks.iter().map(|remark| format!(" {remark}")).collect();
        format!(
            "{} {adjective}{}, {} to {}, as in column {}.\nA year of {} {noun}{} has a mean of {:.1} % and a deviation of {:.1} %. \
             The bank pays {:.3} % a {noun}, {:.1} % a year, by {}.{remarks}",
            self.rows.len(),
            self.what,
            date(self.rows.first()),
            date(self.rows.last()),
            self.column,
            self.periods_per_year,
            if self.periods_per_year == 1 { "" } else { "s" },
            100.0 * mean,
            100.0 * volatility,
            100.0 * self.rate(),
            100.0 * compounded(self.rate(), periods),
            self.bank
        )
    }
}

impl AnyReturns {
    /// As [`Returns::parse`]; where it would be asked which column is meant, all of them are.
    ///
    /// # Errors
    /// As [`Returns::parse`].
    pub fn parse(
        text: &str,
        choices: &Choices,
        rate: Option<f64>,
        periods_per_year: Option<usize>,
    ) -> Result<Self, ReturnsError> {
        let all = match read(text, choices) {
            Reading::Asked { questions, columns } if questions.iter().any(|question| question.asks == "columns") => {
                let values = columns.into_iter().filter(|column| column.holds == Holds::Values);
                Choices { columns: values.map(|column| column.name).collect(), ..choices.clone() }
            }
            _ => choices.clone(),
        };
        let record = record(text, &all, rate, periods_per_year)?;
        if record.series.len() == 1 {
            return Returns::of(record, rate, periods_per_year).map(AnyReturns::One);
        }
        let calendar = Calendar::of(&record, rate, periods_per_year)?;
        let Calendar { dates, frequency: Some(frequency), periods_per_year, rates, .. } = calendar else {
            return Err(ReturnsError::NoFrequency { rule: SEVERAL });
        };
        let row = |period: usize| record.series.iter().map(|series| series.log_returns[period]).collect();
        let by_option = rate.map_or(String::new(), |rate| format!(" The bank pays {:.3} % by --rate.", 100.0 * rate));
        Ok(AnyReturns::Several(SeveralReturns {
            sentence: format!(
                "{}{by_option} Each of the {} columns is an asset; --column takes one alone.",
                record.sentence,
                record.series.len()
            ),
            record: AssetsRecord {
                assets: record.series.iter().map(|series| series.column.clone()).collect(),
                rows: (0..dates.len()).map(row).collect(),
                bank: rates,
                dates,
                frequency,
                periods_per_year,
            },
        }))
    }
}

/// What is read, or why nothing is.
fn record(
    text: &str,
    choices: &Choices,
    rate: Option<f64>,
    periods_per_year: Option<usize>,
) -> Result<Record, ReturnsError> {
    check(rate, periods_per_year)?;
    let reading = read(text, choices);
    if let Reading::Read(Record { columns, .. }) | Reading::Asked { columns, .. } = &reading
        && rate.is_none()
        && !columns.is_empty()
        && columns.iter().all(|column| column.holds != Holds::Rate)
    {
        return Err(ReturnsError::NoBank { remarks: String::new() });
    }
    match reading {
        Reading::Read(record) => Ok(record),
        Reading::Asked { questions, .. } => {
            let needs_year = periods_per_year.is_none() && leaves_frequency_open(text, choices, &questions);
            Err(ReturnsError::asked(&questions, needs_year))
        }
        Reading::Refused { sentence, .. } => Err(ReturnsError::Refused { said: sentence }),
    }
}

/// Whether the first answer to each question gives a record of which the dates do not say what a period is.
fn leaves_frequency_open(text: &str, choices: &Choices, questions: &[Question]) -> bool {
    let answers = questions.iter().filter_map(|question| question.options.first());
    let choices = answers.fold(choices.clone(), |choices, answer| choices.with(&answer.choices));
    matches!(read(text, &choices), Reading::Read(Record { frequency: None, .. }))
}
