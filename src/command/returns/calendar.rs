//! The dates of a record's periods, the number of periods per year, and the bank's interest in them.

use ballast::control::request::frequency::Frequency;
use ballast::returns::Record;

use super::error::ReturnsError;

/// Information the user must give to determine the length of a period: for one asset, and for several.
const ONE: &str =
    "give --periods-per-year, such as 12, or a column of dates that are daily, weekly, monthly, quarterly or yearly";
pub const SEVERAL: &str = "several assets need a column of dates that are daily, weekly, monthly, quarterly or yearly";
/// Accepted periods per year: a period is at least a day.
const PERIODS_PER_YEAR: std::ops::RangeInclusive<usize> = 1..=366;
/// Accepted interest of the bank per period, as for `problem.rate_per_step`.
const RATE: std::ops::RangeInclusive<f64> = -0.5..=0.5;

/// The dates and rates of the periods.
pub struct Calendar {
    pub dates: Vec<String>,
    pub frequency: Option<Frequency>,
    pub periods_per_year: usize,
    /// The bank's interest, and its source.
    pub rates: Vec<f64>,
    pub bank: String,
}

impl Calendar {
    /// Builds the calendar of a record.
    ///
    /// # Errors
    /// Neither the record nor an option gives the length of a period, or the bank's interest.
    pub fn of(record: &Record, rate: Option<f64>, periods_per_year: Option<usize>) -> Result<Self, ReturnsError> {
        let Some(periods_per_year) = periods_per_year.or(record.periods_per_year) else {
            return Err(ReturnsError::NoFrequency { rule: ONE });
        };
        let count = record.series.first().map_or(0, |series| series.missing + series.log_returns.len());
        let numbered = || (1..=count).map(|row| format!("row {row}")).collect();
        let (dates, frequency) = (record.dates.clone().unwrap_or_else(numbered), record.frequency);
        let (bank, rates) = match (rate, &record.rate) {
            (Some(rate), _) => ("--rate".to_owned(), vec![rate; dates.len()]),
            (None, Some(column)) => (format!("the last row of column {}", column.column), column.rates.clone()),
            (None, None) => return Err(ReturnsError::NoBank { remarks: format!("\n{}", record.remarks.join(" ")) }),
        };
        Ok(Calendar { dates, frequency, periods_per_year, rates, bank })
    }
}

/// Checks the options.
///
/// # Errors
/// An option breaks its rule.
pub fn check(rate: Option<f64>, periods_per_year: Option<usize>) -> Result<(), ReturnsError> {
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
