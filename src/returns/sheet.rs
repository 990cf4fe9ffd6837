//! The contents of the columns of a text: dates, returns or prices, the bank's rates, or none of these.
//!
//! Headings are compared by their letters and digits alone, in any case: `Adj Close`, `adj_close` and `ADJ CLOSE` are
//! equal.

use std::collections::HashSet;

use serde::Serialize;
use utoipa::ToSchema;

use super::cells::{Cell, CellRows, MOST_LINES};
use super::choices::Choices;
use super::dates::{are_dates, heads_dates};
use super::heading::{aside, core, headings};
use super::months::MonthsOfYears;
use super::number::{is_number, looks_numeric, marked};
use super::outcome::Stop;
use super::table::Table;
use super::words::counted;

/// Headings of the bank's rates.
const BANKS: [&str; 6] = ["riskfreereturn", "riskfreerate", "riskfree", "bankreturn", "rf", "rate"];
/// The most columns that a question lists.
const OFFERED: usize = 50;
const MOST_COLUMNS: usize = 1000;

/// The contents of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Holds {
    /// The ends of the periods.
    Dates,
    /// Returns or prices.
    Values,
    /// The bank's rates.
    Rate,
    /// Words, row numbers, or further dates.
    Other,
}

/// A column that was found.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ColumnFound {
    /// The heading of the column, or its number; empty if the text is one run of numbers.
    pub name: String,
    /// The contents of the column.
    pub holds: Holds,
}

/// A column of a text.
pub struct Column<'a> {
    pub name: String,
    pub holds: Holds,
    pub cells: Vec<Cell<'a>>,
}

impl Column<'_> {
    pub fn texts(&self) -> Vec<&str> {
        self.cells.iter().map(|cell| cell.text.as_ref()).collect()
    }

    /// Returns the cells of these rows.
    pub fn at(&self, rows: &[usize]) -> Vec<&Cell<'_>> {
        rows.iter().map(|row| &self.cells[*row]).collect()
    }

    fn given(&self) -> Vec<&str> {
        self.cells.iter().filter(|cell| !cell.is_missing()).map(|cell| cell.text.as_ref()).collect()
    }

    /// Returns true if most cells are meant as numbers, including amounts in a currency that is not known.
    fn is_mostly_numbers(&self) -> bool {
        let given = self.given();
        let is_meant = |text: &&&str| looks_numeric(text) || is_number(text) || marked(text).is_some();
        2 * given.iter().filter(is_meant).count() > given.len()
    }

    /// Returns the refusal of the first cell that is no number.
    fn unread(&self) -> Stop {
        let is_odd = |cell: &&Cell| !cell.is_missing() && !is_number(&cell.text);
        match self.cells.iter().find(is_odd) {
            Some(cell) => cell.refused(&self.name, "must be a number"),
            None => Stop::refused(format!("Column {} holds no numbers.", self.name)),
        }
    }

    /// Returns true if every cell has a digit and no two are equal: most likely dates in an unknown form.
    fn is_labels(&self) -> bool {
        let texts = self.texts();
        let distinct: HashSet<&str> = texts.iter().copied().collect();
        distinct.len() == texts.len() && texts.iter().all(|text| text.contains(|letter: char| letter.is_ascii_digit()))
    }

    /// Returns true if the column only counts from 0 or 1, as spreadsheets and programs number their rows.
    fn counts(&self) -> bool {
        let from = self.cells.first().and_then(|cell| cell.text.parse::<usize>().ok()).filter(|from| *from <= 1);
        from.is_some_and(|from| self.cells.iter().zip(from..).all(|(cell, row)| cell.text == row.to_string()))
    }
}

/// A text split into columns of one length.
pub struct Sheet<'a> {
    pub columns: Vec<Column<'a>>,
    /// Sentences about what was left out.
    pub remarks: Vec<String>,
}

pub fn plain(name: &str) -> String {
    name.to_lowercase().chars().filter(|letter| letter.is_alphanumeric()).collect()
}

impl<'a> Sheet<'a> {
    /// # Errors
    /// Lines have different lengths, there are no numbers, or it is unclear whether the numbers form columns.
    pub fn of(text: &'a str, choices: &Choices) -> Result<Self, Stop> {
        let CellRows { rows, remarks: lines } = CellRows::of(text, choices)?;
        let Table { heading, rows, mut remarks } = Table::of(rows)?;
        if lines > 0 {
            remarks.push(format!("Skipped {} of comments.", counted(lines, "line")));
        }
        let widths: HashSet<usize> = rows.iter().map(Vec::len).collect();
        let is_narrow = widths.len() == 1 && widths.contains(&1);
        let is_plain =
            heading.is_none() && rows.iter().flatten().all(|cell| cell.is_missing() || is_number(&cell.text));
        let is_run = heading.is_none() && rows.len() == 1;
        if is_narrow || is_run || (is_plain && (widths.len() > 1 || choices.one_record == Some(true))) {
            return run(rows, heading).map(|column| Sheet { columns: vec![column], remarks });
        }
        let columns = columns(rows, heading)?;
        let is_open =
            is_plain && choices.one_record.is_none() && columns.iter().all(|column| column.holds == Holds::Values);
        if is_open { Err(layout(&columns)) } else { Ok(Sheet { columns, remarks }) }
    }

    pub fn found(&self) -> Vec<ColumnFound> {
        let found = |column: &Column| ColumnFound { name: column.name.clone(), holds: column.holds };
        self.columns.iter().map(found).collect()
    }

    pub fn column(&self, holds: Holds) -> Option<&Column<'a>> {
        self.columns.iter().find(|column| column.holds == holds)
    }

    /// Returns the column that holds the time of day of each row, as in 09:30.
    pub fn times(&self) -> Option<&Column<'a>> {
        let is_time = |text: &&str| text.len() <= 8 && text.find(':').is_some_and(|at| (1..=2).contains(&at));
        let holds_times = |column: &&Column| {
            let given = column.given();
            column.holds != Holds::Dates && !given.is_empty() && given.iter().all(is_time)
        };
        self.columns.iter().find(holds_times)
    }

    /// Returns the columns to read: the chosen ones, the one with the best heading, or the only one.
    pub fn chosen(&self, choices: &Choices) -> Result<Vec<&Column<'a>>, Stop> {
        let chosen = self.meant(choices)?;
        match chosen.iter().find_map(|column| Some((column, aside(&column.name)?))) {
            Some((column, reason)) => Err(set_aside(&column.name, reason)),
            None => Ok(chosen),
        }
    }

    fn meant(&self, choices: &Choices) -> Result<Vec<&Column<'a>>, Stop> {
        if choices.columns.len() > self.columns.len() {
            let (named, there) = (choices.columns.len(), self.columns.len());
            return Err(Stop::refused(format!("{named} columns are named, but there are {there}.")));
        }
        if !choices.columns.is_empty() {
            let named = choices.columns.iter().map(|name| self.named(name)).collect::<Result<Vec<_>, Stop>>()?;
            let again = |index: usize| named[..index].iter().any(|before| std::ptr::eq(*before, named[index]));
            return match (0..named.len()).find(|&index| again(index)) {
                Some(index) => Err(Stop::refused(format!("Column {} is named twice.", named[index].name))),
                None => Ok(named),
            };
        }
        // If a heading is known, no other column replaces its column.
        if let Some(best) = self.best() {
            return if best.holds == Holds::Values { Ok(vec![best]) } else { Err(best.unread()) };
        }
        let values: Vec<&Column> = self.columns.iter().filter(|column| column.holds == Holds::Values).collect();
        match values[..] {
            [] => Err(self.without_numbers()),
            [only] => Ok(vec![only]),
            _ => Err(ask(&values)),
        }
    }

    /// Returns the column with the best known heading; a blank column only if there is no other.
    fn best(&self) -> Option<&Column<'a>> {
        let may_be = |column: &&Column| column.holds == Holds::Values || column.holds == Holds::Other;
        let of = |is_blank: bool| {
            let named = |wanted: &str| {
                let is = |column: &&Column| column.given().is_empty() == is_blank && core(&column.name) == wanted;
                self.columns.iter().filter(may_be).find(is)
            };
            headings().find_map(named)
        };
        of(false).or_else(|| of(true))
    }

    fn named(&self, name: &str) -> Result<&Column<'a>, Stop> {
        let number = || self.columns.get(name.parse::<usize>().ok()?.checked_sub(1)?);
        let found = self.columns.iter().find(|column| column.name == name);
        let found = found.or_else(|| self.columns.iter().find(|column| plain(&column.name) == plain(name)));
        let names =
            || self.columns.iter().map(|column| column.name.as_str()).take(OFFERED).collect::<Vec<_>>().join(", ");
        found
            .or_else(number)
            .ok_or_else(|| Stop::refused(format!("There is no column {name}. The columns are {}.", names())))
    }

    fn without_numbers(&self) -> Stop {
        if let Some((name, reason)) = self.columns.iter().find_map(|column| Some((&column.name, aside(&column.name)?)))
        {
            return set_aside(name, reason);
        }
        let others = self.columns.iter().filter(|column| column.holds != Holds::Dates);
        let cell = others.flat_map(|column| column.cells.iter().map(|cell| (cell, column.name.as_str())));
        match cell.clone().find(|(cell, _)| !cell.text.is_empty()) {
            Some((cell, name)) => cell.refused(name, "must be a number in at least one column"),
            None => Stop::refused("There are dates, but no returns next to them."),
        }
    }
}

/// Reads numbers one after the other, line by line.
fn run<'a>(rows: Vec<Vec<Cell<'a>>>, heading: Option<Vec<Cell>>) -> Result<Column<'a>, Stop> {
    let name = heading.and_then(|heading| heading.first().map(|cell| cell.text.to_string())).unwrap_or_default();
    let cells: Vec<Cell> = rows.into_iter().flatten().filter(|cell| !cell.text.is_empty()).collect();
    if cells.len() > MOST_LINES {
        return Err(Stop::refused(format!("The text has {} numbers: it must have at most {MOST_LINES}.", cells.len())));
    }
    let column = Column { name, holds: Holds::Values, cells };
    if are_dates(&column.texts(), true) {
        let Some(first) = column.cells.first() else { return Err(Stop::refused("There are no numbers in the text.")) };
        return Err(first.refused(&column.name, "must have a return next to it, because it is a date"));
    }
    Ok(column)
}

fn columns<'a>(rows: Vec<Vec<Cell<'a>>>, heading: Option<Vec<Cell>>) -> Result<Vec<Column<'a>>, Stop> {
    let width = heading.as_ref().or(rows.first()).map_or(0, Vec::len);
    if let Some(odd) = rows.iter().find(|row| row.len() != width) {
        let rule = format!(
            "ends a line of {} cells, but the first line has {width}; put a number with a comma in quotes, or separate \
             cells by semicolons",
            odd.len()
        );
        return Err(odd[odd.len() - 1].refused("", &rule));
    }
    if width > MOST_COLUMNS {
        return Err(Stop::refused(format!("The text has {width} columns: it must have at most {MOST_COLUMNS}.")));
    }
    if let Some(heading) = &heading
        && let Some(months) = MonthsOfYears::of(heading, &rows)?
    {
        let (heading, rows) = months.unfolded(rows);
        return columns(rows, Some(heading));
    }
    let mut columns: Vec<Column> = Vec::with_capacity(width);
    for index in 0..width {
        let own = heading.as_ref().map(|heading| heading[index].text.to_string());
        let is_taken = |name: &String| name.is_empty() || columns.iter().any(|other| other.name == *name);
        let name = own.filter(|name| !is_taken(name)).unwrap_or_else(|| format!("column {}", index + 1));
        columns.push(Column { name, holds: Holds::Other, cells: Vec::new() });
    }
    for row in rows {
        columns.iter_mut().zip(row).for_each(|(column, cell)| column.cells.push(cell));
    }
    judge(&mut columns);
    Ok(columns)
}

/// Decides the contents of each column.
fn judge(columns: &mut [Column]) {
    let is_date = |column: &Column| {
        let given = column.given();
        let core = core(&column.name);
        !given.is_empty() && headings().all(|heading| heading != core) && are_dates(&given, false)
    };
    let is_dates: Vec<bool> = columns.iter().map(is_date).collect();
    // A column that looks like dates in no known form holds the dates if no other column does.
    let named = |column: &Column| heads_dates(&column.name) || (!column.is_mostly_numbers() && column.is_labels());
    let dates = is_dates.iter().position(|is| *is).or_else(|| columns.iter().position(&named));
    let is_numbers = |(column, is_dates): (&Column, &bool)| {
        !is_dates && !named(column) && aside(&column.name).is_none() && column.is_mostly_numbers()
    };
    let mut values: Vec<bool> = columns.iter().zip(&is_dates).map(is_numbers).collect();
    let many = |values: &[bool]| values.iter().filter(|is| **is).count() > 1;
    if many(&values) && values[0] && columns[0].counts() {
        values[0] = false;
    }
    for (index, column) in columns.iter_mut().enumerate() {
        if values[index] {
            let is_bank = BANKS.contains(&plain(&column.name).as_str()) && many(&values);
            values[index] = !is_bank;
            column.holds = if is_bank { Holds::Rate } else { Holds::Values };
        }
    }
    if let Some(dates) = dates {
        columns[dates].holds = Holds::Dates;
    }
}

fn set_aside(name: &str, reason: &str) -> Stop {
    Stop::refused(format!("Column {name} {reason}. Name another column, or change its heading if it is an asset."))
}

fn ask(values: &[&Column]) -> Stop {
    let option = |column: &&Column| {
        let first: Vec<&str> = column.given().into_iter().take(3).collect();
        let label = format!("{} ({} \u{2026})", column.name, first.join("; "));
        (label, Choices { columns: vec![column.name.clone()], ..Choices::default() })
    };
    let options = values.iter().take(OFFERED).map(option).collect();
    Stop::question("columns", "Which column holds the returns or prices?", options)
}

fn layout(columns: &[Column]) -> Stop {
    let count: usize = columns.iter().map(|column| column.cells.len()).sum();
    let option = |label: String, one_record| (label, Choices { one_record: Some(one_record), ..Choices::default() });
    let options =
        vec![option("One record, read line by line".into(), true), option(format!("{} columns", columns.len()), false)];
    let question = format!("Are these {count} numbers of one record, or columns of different records?");
    Stop::question("one_record", question, options)
}
