//! Returns of a risky asset and of the bank: the bundled ones, of the US stock market and Treasury bills, or a file's.
//!
//! A file is read by the one reader of returns ([`ballast::returns`]); its questions are answered by options. The
//! spacing of its dates determines the length of a period ([`Frequency`]).

use std::path::PathBuf;

use ballast::control::evaluation::account::Annual;
use ballast::control::evaluation::assets::AssetsRecord;
use ballast::control::evaluation::walk_forward::ActualPeriod;
use ballast::control::request::annualised::compounded;
use ballast::control::request::asset_history::AssetHistory;
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

/// The source of a command's returns.
#[derive(Debug, Clone, Args)]
pub struct ReturnsFile {
    /// File of dates with returns or prices: CSV, or what a spreadsheet or a person writes
    file: PathBuf,
    /// Interest of the bank per period, as a fraction; instead of a column such as risk_free_return
    #[arg(long)]
    rate: Option<f64>,
    /// Periods per year; determined by the dates unless given
    #[arg(long)]
    periods_per_year: Option<usize>,
    #[command(flatten)]
    choices: Choices,
}

/// One period: returns as fractions.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// End of the period, in ISO 8601, with the precision of the frequency: `2008-01` for a month. The number of the
    /// row if there are no dates.
    pub date: String,
    pub log_return: f64,
    pub risky_return: f64,
    pub risk_free_return: f64,
}

/// Periods in the order of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Returns {
    rows: Vec<Row>,
    /// `None` if the dates do not determine one.
    pub frequency: Option<Frequency>,
    pub periods_per_year: usize,
    /// Content of the risky asset's column, and its name.
    what: &'static str,
    column: String,
    /// Source of the bank's interest.
    bank: String,
    /// Sentences on what was changed or skipped.
    remarks: Vec<String>,
}

/// Periods of several assets.
#[derive(Debug, Clone, PartialEq)]
pub struct SeveralReturns {
    pub record: AssetsRecord,
    /// Description of what was read, so that users can check it.
    pub sentence: String,
}

/// Outcomes of trades.
#[derive(Debug, Clone, PartialEq)]
pub struct Trades {
    pub log_returns: Vec<f64>,
    /// Interest of the bank per trade.
    pub rate: f64,
    pub trades_per_year: Option<f64>,
    /// Description of what was read, so that users can check it.
    pub sentence: String,
}

/// The contents of a file.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyReturns {
    /// Returns of one asset.
    One(Returns),
    /// Returns of several assets.
    Several(SeveralReturns),
}

impl Row {
    pub fn period(&self) -> ActualPeriod {
        ActualPeriod { log_return: self.log_return, bank_return: self.risk_free_return }
    }
}

impl ReturnsFile {
    /// Reads the returns of one asset.
    ///
    /// # Errors
    /// The file cannot be read, a cell or an option breaks a rule, or an option must settle what the file leaves open.
    pub fn read(&self) -> Result<Returns, ReturnsError> {
        Returns::parse(&self.text()?, &self.choices, self.rate, self.periods_per_year)
    }

    /// Reads each column as an asset if the file does not show which one is meant.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_any(&self) -> Result<AnyReturns, ReturnsError> {
        AnyReturns::parse(&self.text()?, &self.choices, self.rate, self.periods_per_year)
    }

    /// Reads the outcomes of trades, one after another, each as a share of its stake. Dates do not count, and the bank pays
    /// nothing unless an option says so.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn trades(&self) -> Result<Trades, ReturnsError> {
        // Trades move more than periods do. Whether they are fractions or percent is asked as it is of returns.
        let choices = Choices {
            kind: self.choices.kind.or(Some(Kind::Simple)),
            unusual: self.choices.unusual.or(Some(true)),
            ..self.choices.clone()
        };
        let rate = self.rate.unwrap_or(0.0);
        let Record { series, mut sentence, .. } = record(&self.text()?, &choices, Some(rate), self.periods_per_year)?;
        let [Series { log_returns, .. }] = &series[..] else {
            return Err(ReturnsError::Several { found: series.len() });
        };
        sentence.push_str(" Each is a trade.");
        let trades_per_year = self.periods_per_year.map(|trades| trades as f64);
        Ok(Trades { log_returns: log_returns.clone(), rate, trades_per_year, sentence })
    }

    /// Returns true if options name the columns to read.
    pub fn names_columns(&self) -> bool {
        !self.choices.columns.is_empty()
    }

    fn text(&self) -> Result<String, ReturnsError> {
        let read = std::fs::read(&self.file);
        let bytes = read.map_err(|source| ReturnsError::Read { path: self.file.clone(), source })?;
        decoded(&bytes).map_err(|sentence| ReturnsError::Refused { sentence })
    }
}

impl Returns {
    /// Returns the returns of the file embedded in the binary.
    pub fn bundled() -> Result<Self, ReturnsError> {
        Self::parse(CSV, &Choices::default(), None, None)
    }

    /// Parses the text of a file; `rate` and `periods_per_year` replace what the text gives.
    ///
    /// # Errors
    /// A cell or an option breaks a rule, or an option must settle what the text leaves open.
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

    /// Returns the noun for one period.
    pub fn noun(&self) -> &'static str {
        self.frequency.map_or_else(|| Frequency::noun_for(Some(self.periods_per_year as f64)), Frequency::noun)
    }

    /// Keeps the last `count` periods.
    ///
    /// # Errors
    /// There are fewer.
    pub fn last(mut self, count: usize) -> Result<Self, ReturnsError> {
        let found = self.rows.len();
        let rule = "must be from 2 to the number of returns in the file";
        if !(2..=found).contains(&count) {
            return Err(ReturnsError::Option { option: "--window", value: format!("{count} of {found}"), rule });
        }
        self.rows.drain(..found - count);
        Ok(self)
    }

    /// Returns the `count` periods before `date`, oldest first.
    pub fn before(&self, date: &str, count: usize) -> Result<&[Row], ReturnsError> {
        let end = self.rows.partition_point(|row| row.date.as_str() < date);
        let noun = self.noun();
        let too_short = || ReturnsError::TooShort { date: date.into(), wanted: count, noun, found: end };
        let start = end.checked_sub(count).ok_or_else(too_short)?;
        Ok(&self.rows[start..end])
    }

    /// Returns the periods of a calendar year.
    pub fn year(&self, year: &str) -> &[Row] {
        let start = self.rows.partition_point(|row| row.date.as_str() < year);
        let length = self.rows[start..].iter().take_while(|row| row.date.starts_with(year)).count();
        &self.rows[start..start + length]
    }

    /// Returns the bank's rate in the last period, which is assumed to continue.
    pub fn rate(&self) -> f64 {
        self.rows.last().map_or(0.0, |row| row.risk_free_return)
    }

    fn annual(&self) -> Annual {
        let (risky, bank): (Vec<f64>, Vec<f64>) =
            self.rows.iter().map(|row| (row.risky_return, row.risk_free_return)).unzip();
        Annual::of(&risky, &bank, self.periods_per_year as f64)
    }

    /// Describes what was read, so that users can check it.
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
    /// Parses as [`Returns::parse`] does, but takes all columns if it is unclear which one is meant.
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
        let of = |series: &Series, period: usize| series.log_returns.get(period.checked_sub(series.missing)?).copied();
        let row = |period: usize| record.series.iter().map(|series| of(series, period)).collect();
        let by_option = rate.map_or(String::new(), |rate| format!(" The bank pays {:.3} % by --rate.", 100.0 * rate));
        Ok(AnyReturns::Several(SeveralReturns {
            sentence: format!(
                "{}{by_option} Each of the {} columns is an asset; --column takes one alone.",
                record.sentence,
                record.series.len()
            ),
            record: AssetsRecord {
                assets: record.series.iter().map(|series| series.column.clone()).collect(),
                rows: AssetHistory::new(&(0..dates.len()).map(row).collect::<Vec<_>>()),
                bank: rates,
                dates,
                frequency,
                periods_per_year,
            },
        }))
    }
}

/// Returns the record that is read, or the reason why there is none.
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
            Err(ReturnsError::open_questions(&questions, needs_year))
        }
        Reading::Refused { sentence, .. } => Err(ReturnsError::Refused { sentence }),
    }
}

/// Returns true if the first answer to each question gives a record whose dates do not determine the length of a
/// period.
fn leaves_frequency_open(text: &str, choices: &Choices, questions: &[Question]) -> bool {
    let answers = questions.iter().filter_map(|question| question.options.first());
    let choices = answers.fold(choices.clone(), |choices, answer| choices.with(&answer.choices));
    matches!(read(text, &choices), Reading::Read(Record { frequency: None, .. }))
}
