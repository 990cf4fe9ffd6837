//! Floor 2: reads returns from text that people paste or programs write. The page, the command line and every client
//! use this one reader.
//!
//! Text does not say what its numbers are. If their meaning follows from the text, it is used and stated in a sentence;
//! if it does not follow, the caller is asked. A cell that cannot be right is refused by its line, its column and its
//! value. Nothing is skipped silently, because a misread record gives wrong advice that looks right. Checked by:
//! `tests/service/returns.rs`.

mod bank;
mod cells;
mod choices;
mod dates;
mod doubt;
mod excess;
mod heading;
mod kept_rows;
mod kind;
mod moments;
mod month_names;
mod months;
mod number;
mod numbered_dates;
mod order;
mod outcome;
mod reading;
mod record;
mod sheet;
mod table;
mod unit;
mod windows_1252;
mod words;

pub use cells::MOST_BYTES;
pub use choices::{Choices, Kind, RateUnit, Unit};
pub use outcome::{Answer, Question, TextPosition};
pub use reading::{Reading, read};
pub use record::{BankRate, Record, Series};
pub use sheet::{ColumnFound, Holds};

/// Returns the text of a file: UTF-16 if its first bytes say so, else UTF-8, else Windows-1252, which spreadsheets in
/// Europe save.
///
/// # Errors
/// A sentence that says what kind of file it is instead.
pub fn decoded(bytes: &[u8]) -> Result<String, String> {
    let units = |of: fn([u8; 2]) -> u16| bytes[2..].chunks_exact(2).map(|pair| of([pair[0], pair[1]])).collect();
    let utf_16: Option<Vec<u16>> = match bytes {
        [0xff, 0xfe, ..] => Some(units(u16::from_le_bytes)),
        [0xfe, 0xff, ..] => Some(units(u16::from_be_bytes)),
        _ => None,
    };
    let eight_bits = || String::from_utf8(bytes.to_vec()).ok().or_else(|| windows_1252::decoded(bytes));
    let text = utf_16.map_or_else(eight_bits, |units| String::from_utf16(&units).ok());
    text.ok_or_else(|| if bytes.starts_with(b"PK") { cells::SPREADSHEET } else { cells::NO_TEXT }.to_owned())
}
