//! A leaf beside the floors: reports to read, from data. It names no floor, and none below `service` names it.
//!
//! A page is one HTML file that loads nothing: the modules that draw it are those of the dashboard, so that a chart, a
//! colour and a word are the same in both. Tables of data are written as CSV.

mod csv;
mod file;

pub use self::csv::Csv;
pub use file::{FileError, Files, html};
