//! Reports to read, from data. This module names none of the floors, and none below `service` names it.
//!
//! A page is one HTML file that loads nothing. The dashboard's modules draw it, so that charts, colours and words are
//! the same in both. Tables of data are written as CSV.

mod csv;
mod escape;
mod file;
mod modules;
mod terminal;

pub use self::csv::Csv;
pub use escape::escaped;
pub use file::{FileError, html};
pub use modules::{Files, joined};
pub use terminal::{end_where_nobody_reads, with_causes};
