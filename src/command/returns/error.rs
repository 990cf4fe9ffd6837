//! What is wrong with a file of returns: where, what was found, and the rule that it breaks.

use std::path::PathBuf;

use thiserror::Error;

#[derive(Debug, Error)]
pub enum ReturnsError {
    #[error("reading {}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("reading the rows")]
    Rows(#[from] csv::Error),
    #[error("line 1: the header is {found:?}: {rule}")]
    Header { found: String, rule: String },
    #[error(
        "line {line}: {found:?} has {count} fields: must have {wanted}, as the header (a decimal comma parts a number in two)"
    )]
    FieldCount { line: u64, found: String, count: usize, wanted: usize },
    #[error("line {line}: {column} is {found:?}: {rule}")]
    Cell { line: u64, column: String, found: String, rule: String },
    #[error(
        "the file does not say what the bank pays: must have a column risk_free_return, rf or rate, or --rate must be \
         given, as a fraction a period (0.002 is 0.2 %)"
    )]
    NoBank,
    #[error("the file holds {found} returns: must hold at least 2")]
    Few { found: usize },
    #[error(
        "the standard deviation of column {column} is {deviation:.2} a period: must be at most 0.5, since returns are \
         fractions (0.012 is 1.2 %); divide returns in per cent by 100, and name a column of prices price"
    )]
    Deviation { column: String, deviation: f64 },
    #[error("{option} is {value}: {rule}")]
    Option { option: &'static str, value: String, rule: &'static str },
    #[error("{wanted} {noun}s before {date} are wanted: the file holds {found}")]
    TooShort { date: String, wanted: usize, noun: &'static str, found: usize },
}
