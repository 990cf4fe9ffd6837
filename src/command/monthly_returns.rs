//! Monthly returns of a risky asset and of the bank: those bundled, of the US stock market and Treasury bills, or a file's.
//!
//! A file is comma-separated, one month a row, oldest first, without a gap. Its first row is
//! `date,risky_return,risk_free_return`, or without the last column: then the bank pays nothing. `month` and
//! `market_return` are taken for the first two names as well. Dates read `2008-01` or `2008-01-31`; returns are simple,
//! as fractions.

use std::path::{Path, PathBuf};

use csv::{ReaderBuilder, StringRecord, Trim};
use jiff::civil::Date;
use thiserror::Error;

const CSV: &str = include_str!("../../data/us_market_monthly.csv");
const HEADER: &str = "date,risky_return[,risk_free_return]";

/// One month: simple returns, as fractions.
#[derive(Debug, Clone, PartialEq)]
pub struct Month {
    /// As in `2008-01`.
    pub month: String,
    pub risky_return: f64,
    pub risk_free_return: f64,
}

/// Months in calendar order, without a gap.
#[derive(Debug, Clone, PartialEq)]
pub struct MonthlyReturns {
    months: Vec<Month>,
}

#[derive(Debug, Error)]
pub enum ReturnsError {
    #[error("reading {}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("reading the rows")]
    Rows(#[from] csv::Error),
    #[error("line 1: the header is {found:?}: must be {HEADER:?}")]
    Header { found: String },
    #[error("line {line}: {found:?} has {count} fields: must have {wanted}")]
    FieldCount { line: u64, found: String, count: usize, wanted: usize },
    #[error("line {line}: {column} is {found:?}: must read as in 2008-01 or 2008-01-31")]
    Month { line: u64, column: String, found: String },
    #[error("line {line}: {column} is {found}: must be the month after {previous}")]
    Gap { line: u64, column: String, found: String, previous: String },
    #[error("line {line}: {column} is {found:?}: must be a number above -1")]
    Return { line: u64, column: String, found: String },
    #[error("{wanted} months before {month} are wanted: the file holds {found}")]
    TooShort { month: String, wanted: usize, found: usize },
}

impl MonthlyReturns {
    /// The file embedded in the binary.
    pub fn bundled() -> Result<Self, ReturnsError> {
        Self::parse(CSV)
    }

    /// # Errors
    /// The file cannot be read, or a line of it breaks a rule.
    pub fn read(path: &Path) -> Result<Self, ReturnsError> {
        let read = std::fs::read_to_string(path);
        Self::parse(&read.map_err(|source| ReturnsError::Read { path: path.into(), source })?)
    }

    fn parse(text: &str) -> Result<Self, ReturnsError> {
        let mut reader = ReaderBuilder::new().trim(Trim::All).flexible(true).from_reader(text.as_bytes());
        let columns = header(reader.headers()?.clone())?;
        let mut months: Vec<Month> = Vec::new();
        let mut previous: Option<u32> = None;
        for record in reader.records() {
            let record = record?;
            let line = record.position().map_or(0, csv::Position::line);
            let (number, month) = row(&columns, line, &record)?;
            if previous.is_some_and(|before| before + 1 != number) {
                let previous = months.last().map_or(String::new(), |month| month.month.clone());
                return Err(ReturnsError::Gap { line, column: columns[0].into(), found: month.month, previous });
            }
            previous = Some(number);
            months.push(month);
        }
        Ok(MonthlyReturns { months })
    }

    pub fn months(&self) -> &[Month] {
        &self.months
    }

    /// The `count` months before `month`, oldest first.
    pub fn before(&self, month: &str, count: usize) -> Result<&[Month], ReturnsError> {
        let end = self.months.partition_point(|row| row.month.as_str() < month);
        let too_short = || ReturnsError::TooShort { month: month.into(), wanted: count, found: end };
        let start = end.checked_sub(count).ok_or_else(too_short)?;
        Ok(&self.months[start..end])
    }

    /// The months of a calendar year.
    pub fn year(&self, year: &str) -> &[Month] {
        let start = self.months.partition_point(|row| row.month.as_str() < year);
        let length = self.months[start..].iter().take_while(|row| row.month.starts_with(year)).count();
        &self.months[start..start + length]
    }
}

/// The names of the columns, two or three.
fn header(columns: StringRecord) -> Result<StringRecord, ReturnsError> {
    match columns.iter().collect::<Vec<&str>>()[..] {
        ["date" | "month", "risky_return" | "market_return"]
        | ["date" | "month", "risky_return" | "market_return", "risk_free_return"] => Ok(columns),
        _ => Err(ReturnsError::Header { found: shown(&columns) }),
    }
}

fn shown(record: &StringRecord) -> String {
    record.iter().collect::<Vec<&str>>().join(",")
}

/// One row, and its month counted from year 0.
fn row(columns: &StringRecord, line: u64, fields: &StringRecord) -> Result<(u32, Month), ReturnsError> {
    if fields.len() != columns.len() {
        let (count, wanted) = (fields.len(), columns.len());
        return Err(ReturnsError::FieldCount { line, found: shown(fields), count, wanted });
    }
    let unreadable = || ReturnsError::Month { line, column: columns[0].into(), found: fields[0].into() };
    let number = month_number(&fields[0]).ok_or_else(unreadable)?;
    let month = format!("{:04}-{:02}", number / 12, number % 12 + 1);
    let risky_return = simple_return(line, &columns[1], &fields[1])?;
    let risk_free_return = match fields.get(2) {
        Some(field) => simple_return(line, &columns[2], field)?,
        None => 0.0,
    };
    Ok((number, Month { month, risky_return, risk_free_return }))
}

fn month_number(text: &str) -> Option<u32> {
    let date: Date = format!("{text}-01").parse().or_else(|_| text.parse()).ok()?;
    Some(12 * u32::try_from(date.year()).ok()? + u32::from(date.month().unsigned_abs()) - 1)
}

fn simple_return(line: u64, column: &str, text: &str) -> Result<f64, ReturnsError> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > -1.0);
    number.ok_or_else(|| ReturnsError::Return { line, column: column.into(), found: text.into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bundled_file_is_whole() {
        let market = MonthlyReturns::bundled().unwrap();
        assert_eq!(market.months.len(), 1109);
        assert_eq!(market.year("2008").len(), 12);
        let history = market.before("2008-01", 240).unwrap();
        assert_eq!((history[0].month.as_str(), history[239].month.as_str()), ("1988-01", "2007-12"));
        assert_eq!(history[239].risk_free_return, 0.0027);
        assert_eq!(market.year("2008")[9].risky_return, -0.1715);
    }

    #[test]
    fn a_file_with_dates_and_without_a_bank_is_taken() {
        let returns = MonthlyReturns::parse("date,risky_return\n2007-12-31,0.01\n2008-01-31, -0.02\n").unwrap();
        let expected = |month: &str, risky_return| Month { month: month.into(), risky_return, risk_free_return: 0.0 };
        assert_eq!(returns.months, [expected("2007-12", 0.01), expected("2008-01", -0.02)]);
    }

    #[test]
    fn a_bad_row_is_named_by_line_column_value_and_rule() {
        let message =
            |header: &str, rows: &str| MonthlyReturns::parse(&format!("{header}\n{rows}")).unwrap_err().to_string();
        let market = |rows: &str| message("month,market_return,risk_free_return", rows);
        let general = |rows: &str| message("date,risky_return", rows);
        let header = "line 1: the header is \"a,b\": must be \"date,risky_return[,risk_free_return]\"";
        assert_eq!(message("a,b", ""), header);
        assert!(MonthlyReturns::parse("").is_err());
        assert_eq!(market("2008-01,0.1"), "line 2: \"2008-01,0.1\" has 2 fields: must have 3");
        assert_eq!(market("2008-13,0.1,0"), "line 2: month is \"2008-13\": must read as in 2008-01 or 2008-01-31");
        assert_eq!(general("2008-01-32,0.1"), "line 2: date is \"2008-01-32\": must read as in 2008-01 or 2008-01-31");
        assert_eq!(market("2008-01,nan,0"), "line 2: market_return is \"nan\": must be a number above -1");
        assert_eq!(general("2008-01,-1"), "line 2: risky_return is \"-1\": must be a number above -1");
        assert_eq!(market("2008-01,0,x"), "line 2: risk_free_return is \"x\": must be a number above -1");
        assert_eq!(market("2008-01,0,0\n2008-03,0,0"), "line 3: month is 2008-03: must be the month after 2008-01");
        assert_eq!(general("2008-01,0\n2008-01,0"), "line 3: date is 2008-01: must be the month after 2008-01");
    }

    #[test]
    fn too_short_a_past_is_refused() {
        let market = MonthlyReturns::bundled().unwrap();
        let message = market.before("1927-01", 240).unwrap_err().to_string();
        assert_eq!(message, "240 months before 1927-01 are wanted: the file holds 6");
    }
}
