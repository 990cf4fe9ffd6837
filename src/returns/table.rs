//! The one table of a text: its headings and rows, and the lines above, between and below them.
//!
//! Rows of a table begin with dates in one form, line after line. Lines above the headings and below the last row are
//! left out and named. A row that only looks odd stays, so that it is refused and not skipped.

use jiff::civil::Date;

use super::cells::Cell;
use super::dates::{FORMS, Form, IN_DIGITS, YEAR, are_dates, heads_dates};
use super::number::is_number;
use super::outcome::Stop;
use super::unit::names_percent;
use super::words::counted;

type TableRow<'a> = Vec<Cell<'a>>;

/// The number of columns that are searched for dates, and of rows in which a form must occur at least once.
const COLUMNS: usize = 8;
const FIRST: usize = 200;
/// First words of rows that summarise others.
const TOTALS: [&str; 30] = [
    "total",
    "sum",
    "average",
    "avg",
    "mean",
    "median",
    "min",
    "max",
    "minimum",
    "maximum",
    "std",
    "stdev",
    "deviation",
    "volatility",
    "annual",
    "annualised",
    "annualized",
    "cagr",
    "ytd",
    "summe",
    "gesamt",
    "mittel",
    "mittelwert",
    "durchschnitt",
    "moyenne",
    "somme",
    "promedio",
    "media",
    "suma",
    "copyright",
];
/// Words that a dated row has instead of a price, after a number.
const EVENTS: [&str; 2] = ["dividend", "split"];

/// A table, and sentences about the lines around it that are left out.
pub struct Table<'a> {
    pub heading: Option<TableRow<'a>>,
    pub rows: Vec<TableRow<'a>>,
    pub remarks: Vec<String>,
}

/// Consecutive rows that have a date in one form in one column.
struct DatedBlock {
    column: usize,
    form: Form,
    start: usize,
    end: usize,
    count: usize,
    first: Date,
    last: Date,
}

impl<'a> Table<'a> {
    /// # Errors
    /// There are no numbers, or lines that are no rows split the table.
    pub fn of(rows: Vec<TableRow<'a>>) -> Result<Self, Stop> {
        if !rows.iter().flatten().any(|cell| has_digit(&cell.text)) {
            let word = rows.iter().flatten().find(|cell| !cell.text.is_empty()).map_or(String::new(), Cell::shown);
            return Err(Stop::refused(format!("There are no numbers in the text, only words such as {word:?}.")));
        }
        match DatedBlock::longest(&rows) {
            Some(block) => dated(rows, &block),
            None => Ok(undated(rows)),
        }
    }
}

/// Splits the rows of `block` from the lines around them.
fn dated<'a>(mut rows: Vec<TableRow<'a>>, block: &DatedBlock) -> Result<Table<'a>, Stop> {
    let mut remarks = Vec::new();
    let after = rows.split_off(block.end);
    if let Some(first) = after.first() {
        block.check_end(first, &after)?;
        remarks.push(remark_after(&after));
    }
    let start =
        block.start - rows[..block.start].iter().rev().take_while(|row| block.is_misdated(row, numbers(row))).count();
    let mut body = rows.split_off(start);
    let levels = block.levels(&rows, body.first().map_or(0, Vec::len));
    let levels = rows.split_off(rows.len() - levels);
    if !rows.is_empty() {
        remarks.insert(0, left_out(&rows, "before the table"));
    }
    let events: Vec<TableRow> = body.extract_if(.., |row| event(row).is_some()).collect();
    if let Some(cell) = events.first().and_then(|row| event(row)) {
        let what = counted(events.len(), "line");
        remarks.push(format!(
            "Left out {what} of dividends or splits, the first in line {}: {:?}.",
            cell.line(),
            cell.shown()
        ));
    }
    Ok(Table { heading: joined(levels, block.column), rows: body, remarks })
}

/// Builds a table without dates: the last of the first lines that hold words alone is the heading.
fn undated(mut rows: Vec<TableRow>) -> Table {
    let words = rows.iter().take_while(|row| row.iter().all(is_word)).count();
    let mut remarks = Vec::new();
    if words > 1 && words < rows.len() {
        let from = words - usize::from(rows[words - 1].len() == rows[words].len());
        let table = rows.split_off(from);
        remarks.push(left_out(&rows, "before the table"));
        rows = table;
    }
    let heading = is_heading(&rows).then(|| rows.remove(0));
    Table { heading, rows, remarks }
}

/// Returns true if the first row names the columns: it holds words alone, or has a blank cell above a column of dates.
fn is_heading(rows: &[TableRow]) -> bool {
    let [first, rest @ ..] = rows else { return false };
    let below =
        |index: usize| rest.iter().filter_map(|row| row.get(index)).map(|cell| cell.text.as_ref()).collect::<Vec<_>>();
    let is_above_dates = |(index, cell): (usize, &Cell)| cell.text.is_empty() && are_dates(&below(index), false);
    !rest.is_empty() && (first.iter().all(is_word) || first.iter().enumerate().any(is_above_dates))
}

/// Returns true if a cell can be part of a heading.
fn is_word(cell: &Cell) -> bool {
    let has_letters = cell.text.is_empty() || cell.text.contains(char::is_alphabetic);
    has_letters
        && !is_number(&cell.text)
        && (cell.text.is_empty() || !cell.is_missing())
        && !are_dates(&[cell.text.as_ref()], true)
}

fn has_digit(text: &str) -> bool {
    text.contains(|letter: char| letter.is_ascii_digit())
}

fn numbers(row: &TableRow) -> usize {
    row.iter().filter(|cell| is_number(&cell.text)).count()
}

fn filled(row: &TableRow) -> usize {
    row.iter().filter(|cell| !cell.text.is_empty()).count()
}

/// Returns the cell of a row that records a dividend or a split instead of a price.
fn event<'r, 'a>(row: &'r TableRow<'a>) -> Option<&'r Cell<'a>> {
    row.iter().find(|cell| {
        let text = cell.text.to_ascii_lowercase();
        text.starts_with(|letter: char| letter.is_ascii_digit()) && EVENTS.iter().any(|event| text.contains(event))
    })
}

fn is_total(text: &str) -> bool {
    let word = text.split(|letter: char| !letter.is_alphabetic()).next().unwrap_or_default().to_lowercase();
    TOTALS.contains(&word.as_str())
}

/// Returns for example "Lines 1 to 3 before the table are left out, from "Fund: Northern Lights" on."
fn left_out(rows: &[TableRow], place: &str) -> String {
    let line = |row: Option<&TableRow>| row.and_then(|row| row.first()).map_or(0, Cell::line);
    let (first, last) = (line(rows.first()), line(rows.last()));
    let words = rows.iter().flatten().find(|cell| !cell.text.is_empty()).map_or(String::new(), Cell::shown);
    if first == last {
        return format!("Line {first} {place} is left out: {words:?}.");
    }
    format!("Lines {first} to {last} {place} are left out, from {words:?} on.")
}

/// Describes the lines after the table. They are a second table if two rows have a number or a date, and a number next
/// to it.
fn remark_after(after: &[TableRow]) -> String {
    let is_row = |row: &&TableRow| {
        let starts = row.first().is_some_and(|cell| has_digit(&cell.text) && !is_total(&cell.text));
        starts && row[1..].iter().any(|cell| is_number(&cell.text))
    };
    if after.iter().filter(is_row).count() < 2 {
        return left_out(after, "after the table");
    }
    let line = after[0].first().map_or(0, Cell::line);
    format!("A second table begins at line {line} and is left out.")
}

impl DatedBlock {
    /// Finds the longest block in the text; of equal ones, the first form and the first column win.
    fn longest(rows: &[TableRow]) -> Option<Self> {
        let width = rows.iter().map(Vec::len).max().filter(|width| *width > 1)?;
        let numbers: Vec<usize> = rows.iter().map(numbers).collect();
        let numeric = numbers.iter().filter(|count| **count > 0).count();
        let mut best: Option<DatedBlock> = None;
        for form in FORMS {
            for column in 0..width.min(COLUMNS) {
                let occurs = |row: &TableRow| row.get(column).is_some_and(|cell| form.date(&cell.text).is_some());
                if !rows.iter().take(FIRST).any(occurs) {
                    continue;
                }
                // Numbers are dates only if nearly all rows of the block have one, and years only if they are most of
                // the text.
                let is_most = |found: &DatedBlock| {
                    let share = found.count as f64 / (found.end - found.start) as f64;
                    (!form.is_digits() || share >= IN_DIGITS) && (form != YEAR || 2 * found.count >= numeric)
                };
                best = longer(best, DatedBlock::in_column(rows, &numbers, column, form).filter(is_most));
            }
        }
        best.filter(|best| best.count > 1)
    }

    fn in_column(rows: &[TableRow], numbers: &[usize], column: usize, form: Form) -> Option<Self> {
        let (mut best, mut current): (Option<DatedBlock>, Option<DatedBlock>) = (None, None);
        for (index, row) in rows.iter().enumerate() {
            let date = row.get(column).filter(|_| row.len() > 1).and_then(|cell| form.date(&cell.text));
            match (date, &mut current) {
                (Some(date), Some(block)) if form != YEAR || (date.year() - block.last.year()).abs() == 1 => {
                    (block.end, block.count, block.last) = (index + 1, block.count + 1, date);
                }
                (Some(date), _) => {
                    let block =
                        DatedBlock { column, form, start: index, end: index + 1, count: 1, first: date, last: date };
                    best = longer(best, current.replace(block));
                }
                (None, Some(block)) if block.is_misdated(row, numbers[index]) => block.end = index + 1,
                (None, _) => best = longer(best, current.take()),
            }
        }
        longer(best, current)
    }

    /// Returns true if a row with `numbers` numbers has one besides its cell in the date column, which may be a date in
    /// another form.
    fn is_misdated(&self, row: &TableRow, numbers: usize) -> bool {
        let is_one = |cell: &Cell| has_digit(&cell.text) && !is_total(&cell.text);
        let date = row.get(self.column).filter(|cell| is_one(cell));
        date.is_some_and(|cell| numbers > usize::from(is_number(&cell.text)))
    }

    /// # Errors
    /// Rows of the table continue below the first line that is not a row.
    fn check_end(&self, first: &TableRow, after: &[TableRow]) -> Result<(), Stop> {
        let date = |row: &TableRow| Some((self.form.date(&row.get(self.column)?.text)?, row[self.column].line()));
        let Some((next, line)) = after.iter().filter(|row| row.len() > 1).find_map(date) else { return Ok(()) };
        let goes_on = if self.first <= self.last { next > self.last } else { next < self.last };
        let Some(cell) = first.get(self.column).or(first.first()).filter(|_| goes_on) else { return Ok(()) };
        let rule = format!(
            "must be a date in the same form as the others, because rows continue in line {line}; remove the line if it is \
             not a row"
        );
        Err(cell.refused("", &rule))
    }

    /// Counts the last rows before the table that are its headings, one above the other.
    fn levels(&self, before: &[TableRow], width: usize) -> usize {
        let is_words = |row: &TableRow| row.iter().all(is_word) && (filled(row) > 1 || width < 2);
        let Some(last) = before.last() else { return 0 };
        // A row is also a heading if only the dates have a name, or if its cell above the dates has their name or is
        // blank. The names of other columns may then be numbers.
        let is_index = row_is_index(last, self.column) && last.len() == width;
        let heads = |cell: &Cell| cell.text.is_empty() || heads_dates(&cell.text);
        let is_headed = last.len() == width && filled(last) > 0 && last.get(self.column).is_some_and(heads);
        if !(is_index || is_headed || is_words(last)) {
            return 0;
        }
        let mut count = 1;
        while let Some(above) = before.len().checked_sub(count + 1).map(|index| &before[index]) {
            let below = &before[before.len() - count];
            let has_room = is_index || below.iter().any(|cell| cell.text.is_empty());
            if !has_room || above.len() != width || !is_words(above) {
                break;
            }
            count += 1;
        }
        count
    }
}

/// Returns true if only the column of dates is named.
fn row_is_index(row: &TableRow, column: usize) -> bool {
    filled(row) == 1 && row.get(column).is_some_and(|cell| !cell.text.is_empty() && is_word(cell))
}

fn longer(one: Option<DatedBlock>, other: Option<DatedBlock>) -> Option<DatedBlock> {
    match (one, other) {
        (Some(one), Some(other)) => Some(if other.count > one.count { other } else { one }),
        (one, other) => one.or(other),
    }
}

/// Joins several headings into one: for each column, the names that differ between columns, and units.
fn joined(mut levels: Vec<TableRow>, dates: usize) -> Option<TableRow> {
    let mut heading = levels.pop()?;
    if levels.is_empty() {
        return Some(heading);
    }
    levels.push(heading.clone());
    let text = |level: &TableRow, index: usize| level.get(index).map_or(String::new(), |cell| cell.text.to_string());
    let differs = |level: &TableRow| {
        let mut names = level.iter().enumerate().filter(|(index, _)| *index != dates).map(|(_, cell)| &cell.text);
        let first = names.next();
        names.any(|name| Some(name) != first)
    };
    let kept: Vec<bool> = levels.iter().map(differs).collect();
    for (index, cell) in heading.iter_mut().enumerate().filter(|(index, _)| *index != dates) {
        let names: Vec<String> = levels.iter().map(|level| text(level, index)).collect();
        let is_kept = |(name, kept): &(&String, &bool)| !name.is_empty() && (**kept || says_unit(name));
        let found: Vec<&str> = names.iter().zip(&kept).filter(is_kept).map(|(name, _)| name.as_str()).collect();
        let first = names.iter().find(|name| !name.is_empty());
        cell.text = if found.is_empty() { first.cloned().unwrap_or_default() } else { found.join(" ") }.into();
    }
    Some(heading)
}

fn says_unit(name: &str) -> bool {
    names_percent(name) || name.to_lowercase().contains("log")
}
