//! The columns of a file, found by their names.
//!
//! A name counts by its letters and digits alone, in any case: `Adj Close`, `adj_close` and `ADJ CLOSE` are one.

use csv::{Reader, ReaderBuilder, StringRecord, Trim};

use super::cell::Cell;
use super::error::ReturnsError;

/// Of dates, the best first.
const DATES: [&str; 8] = ["date", "datetime", "timestamp", "day", "week", "month", "quarter", "year"];
/// Of the risky asset, the best first: what counts dividends before what may not.
const VALUES: [(&str, Kind); 13] = [
    ("return", Kind::Return),
    ("returns", Kind::Return),
    ("riskyreturn", Kind::Return),
    ("marketreturn", Kind::Return),
    ("simplereturn", Kind::Return),
    ("totalreturn", Kind::Return),
    ("ret", Kind::Return),
    ("adjclose", Kind::Price),
    ("adjustedclose", Kind::Price),
    ("close", Kind::Price),
    ("closelast", Kind::Price),
    ("price", Kind::Price),
    ("nav", Kind::Price),
];
/// Of the bank, the best first.
const BANKS: [&str; 6] = ["riskfreereturn", "riskfreerate", "riskfree", "bankreturn", "rf", "rate"];
/// What a price may be of the one before.
const FACTOR: std::ops::RangeInclusive<f64> = 0.01..=100.0;
const SEPARATORS: [u8; 3] = [b',', b';', b'\t'];

/// What the column of the risky asset holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Return,
    Price,
}

/// Where a file keeps what, by place and name.
#[derive(Debug)]
pub struct Columns {
    count: usize,
    date: (usize, String),
    value: usize,
    pub kind: Kind,
    /// Of the risky asset.
    pub name: String,
    pub bank: Option<(usize, String)>,
}

/// The fields of a row that are used.
pub struct Line<'a> {
    pub date: Cell<'a>,
    pub value: Cell<'a>,
    pub bank: Option<Cell<'a>>,
}

/// Reads rows that are parted by what the first of them has most of.
pub fn reader(text: &str) -> Reader<&[u8]> {
    let header = text.lines().next().unwrap_or_default();
    let count = |separator: &u8| header.bytes().filter(|byte| byte == separator).count();
    // The first of the most frequent.
    let separator = SEPARATORS.into_iter().rev().max_by_key(count).unwrap_or(b',');
    ReaderBuilder::new().delimiter(separator).trim(Trim::All).flexible(true).from_reader(text.as_bytes())
}

impl Columns {
    /// # Errors
    /// No column of dates, or none of returns or prices.
    pub fn of(header: &StringRecord) -> Result<Self, ReturnsError> {
        let letters = |name: &str| name.to_lowercase().chars().filter(|letter| letter.is_alphanumeric()).collect();
        let names: Vec<String> = header.iter().map(letters).collect();
        let find = |name: &str| names.iter().position(|found| found == name);
        let named = |place: usize| (place, header[place].to_owned());
        let refused = |rule: &str| ReturnsError::Header { found: shown(header), rule: rule.into() };
        let date = DATES
            .iter()
            .find_map(|name| find(name))
            .ok_or_else(|| refused("must name a column of dates: date, month or another length of time"))?;
        let (value, kind) = VALUES.iter().find_map(|(name, kind)| Some((find(name)?, *kind))).ok_or_else(|| {
            refused("must name a column of returns (return, risky_return, market_return) or of prices (adj close, close, price)")
        })?;
        let bank = BANKS.iter().find_map(|name| find(name)).map(named);
        Ok(Columns { count: header.len(), date: named(date), value, kind, name: header[value].into(), bank })
    }

    /// # Errors
    /// A row of more or fewer fields than the header.
    pub fn line<'a>(&'a self, record: &'a StringRecord) -> Result<Line<'a>, ReturnsError> {
        let line = record.position().map_or(0, csv::Position::line);
        if record.len() != self.count {
            let (count, wanted) = (record.len(), self.count);
            return Err(ReturnsError::FieldCount { line, found: shown(record), count, wanted });
        }
        let cell = |place: usize, column: &'a str| Cell { line, column, text: &record[place] };
        Ok(Line {
            date: cell(self.date.0, &self.date.1),
            value: cell(self.value, &self.name),
            bank: self.bank.as_ref().map(|(place, name)| cell(*place, name)),
        })
    }
}

impl Kind {
    /// What stands before the name of a column that returns come from.
    pub fn source(self) -> &'static str {
        match self {
            Kind::Return => "as in",
            Kind::Price => "of prices in",
        }
    }

    /// Simple returns of a column: one fewer than prices.
    ///
    /// # Errors
    /// A cell that holds neither a return nor a price, or a price that no return leads to.
    pub fn returns(self, lines: &[Line]) -> Result<Vec<f64>, ReturnsError> {
        if self == Kind::Return {
            return lines.iter().map(|line| line.value.simple_return()).collect();
        }
        let prices = lines.iter().map(|line| line.value.price()).collect::<Result<Vec<f64>, _>>()?;
        let change = |(pair, line): (&[f64], &Line)| {
            let factor = pair[1] / pair[0];
            let rule = || format!("must be between a hundredth and a hundred times {}, the price before", pair[0]);
            if FACTOR.contains(&factor) { Ok(factor - 1.0) } else { Err(line.value.refused(rule())) }
        };
        prices.windows(2).zip(lines.iter().skip(1)).map(change).collect()
    }
}

fn shown(record: &StringRecord) -> String {
    record.iter().collect::<Vec<&str>>().join(",")
}
