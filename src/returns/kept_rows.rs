//! The rows that have numbers in the columns that are read: blank rows around them are left out, and holes among them
//! found. A column may begin later than others.

use super::choices::Choices;
use super::outcome::Stop;
use super::sheet::Column;
use super::words::counted;

/// Fewer rows are left out without a question: a year of months.
const WORTH_ASKING: usize = 12;

/// Rows that have a number in every column that is read, or in every one that has begun.
pub struct KeptRows {
    pub rows: Vec<usize>,
    /// Those of each column from its oldest number on.
    pub own: Vec<Vec<usize>>,
    /// Rows in the same span that lack a number in some column.
    pub holes: Vec<usize>,
    /// Sentences about the rows before and after that are left out.
    pub remarks: Vec<String>,
}

impl KeptRows {
    /// Selects the rows that all columns share, or those of the longest with `unequal`. A column that begins much later than
    /// others is asked about.
    ///
    /// # Errors
    /// A column has no numbers, or ends before the others.
    pub fn of(chosen: &[&Column], is_newest_first: bool, unequal: Option<bool>) -> Result<Self, Stop> {
        let spans = chosen.iter().map(|column| span(column)).collect::<Result<Vec<_>, Stop>>()?;
        let outer = |of: fn(&(usize, usize)) -> usize| spans.iter().map(of);
        let (first, last) = (outer(|span| span.0).min().unwrap_or(0), outer(|span| span.1).max().unwrap_or(0));
        let (latest_first, earliest_last) =
            (outer(|span| span.0).max().unwrap_or(0), outer(|span| span.1).min().unwrap_or(0));
        let mut remarks = Vec::new();
        let blank = chosen[0].cells.len() - (last + 1 - first);
        if blank > 0 {
            remarks.push(format!("Left out {} before or after the numbers.", counted(blank, "blank row")));
        }
        let ends = |at: usize, of: fn(&(usize, usize)) -> usize| spans.iter().position(|span| of(span) == at);
        let (short, newest) = if is_newest_first {
            (ends(latest_first, |span| span.0).filter(|_| latest_first > first), first)
        } else {
            (ends(earliest_last, |span| span.1).filter(|_| earliest_last < last), last)
        };
        if let Some(short) = short {
            let rule = "must be a number, because the other columns have one in the newest row; leave out the column, or the \
                        rows that are newer than its last number";
            return Err(chosen[short].cells[newest].refused(&chosen[short].name, rule));
        }
        let (from, to) = if is_newest_first { (first, earliest_last) } else { (latest_first, last) };
        let cut = last - first - to.saturating_sub(from);
        let young = if is_newest_first { ends(to, |span| span.1) } else { ends(from, |span| span.0) };
        let column = chosen[young.unwrap_or(0)];
        let line = column.cells[if is_newest_first { to } else { from }].line();
        let (name, rows) = (&column.name, counted(cut, "older row"));
        let oldest = format!("Column {name} has its oldest number in line {line}");
        let all = match unequal {
            None if cut >= WORTH_ASKING && last - first - cut >= WORTH_ASKING => {
                return Err(ask(&format!("{oldest}, {rows} after others."), name, &rows));
            }
            Some(true) => cut > 0,
            _ => false,
        };
        if cut > 0 {
            let then = if all { "its returns before are estimated".to_owned() } else { format!("{rows} left out") };
            remarks.push(format!("{oldest}: {then}."));
        }
        let (from, to) = if all { (first, last) } else { (from, to) };
        let has_begun = |at: usize, row: usize| if is_newest_first { row <= spans[at].1 } else { row >= spans[at].0 };
        let is_hole = |row: &usize| {
            chosen.iter().enumerate().any(|(at, column)| has_begun(at, *row) && column.cells[*row].is_missing())
        };
        let (holes, rows): (Vec<usize>, Vec<usize>) = (from..=to).partition(is_hole);
        let own = |at: usize| rows.iter().copied().filter(|row| has_begun(at, *row)).collect();
        let own = (0..chosen.len()).map(own).collect();
        Ok(KeptRows { rows, own, holes, remarks })
    }

    /// Adds a remark about the holes that are skipped, or asks whether they may be.
    ///
    /// # Errors
    /// Among returns, and among prices that are not daily, a hole may be a missing period, so the caller is asked.
    pub fn check_holes(&mut self, chosen: &[&Column], are_daily_prices: bool, choices: &Choices) -> Result<(), Stop> {
        let Some(hole) = self.holes.first().copied() else { return Ok(()) };
        let odd = chosen.iter().find(|column| column.cells[hole].is_missing()).unwrap_or(&chosen[0]);
        let (count, all) = (self.holes.len(), self.rows.len() + self.holes.len());
        if are_daily_prices || choices.gaps == Some(true) {
            let (rows, line) = (counted(count, "row"), odd.cells[hole].line());
            self.remarks.push(format!("Skipped {rows} without a number, the first in line {line}."));
            return Ok(());
        }
        let question = format!(
            "{}: there is no number in {count} of {all} rows. Leave such rows out, although each may be a missing period?",
            odd.cells[hole].called(&odd.name)
        );
        let choices = Choices { gaps: Some(true), ..Choices::default() };
        Err(Stop::question("gaps", question, vec![("Leave the rows out".to_owned(), choices)]))
    }
}

/// Asks whether the column `name`, which begins later than others, limits the rows of all.
fn ask(what: &str, name: &str, rows: &str) -> Stop {
    let unequal = |unequal| Choices { unequal: Some(unequal), ..Choices::default() };
    let question = format!("{what} Leave these out for all columns, or keep them?");
    let options = vec![
        (format!("Leave {rows} out"), unequal(false)),
        (format!("Keep them: what {name} would have earned before is estimated from the others"), unequal(true)),
    ];
    Stop::question("unequal", question, options)
}

/// Returns the first and the last row in which a column has a number.
fn span(column: &Column) -> Result<(usize, usize), Stop> {
    let is_given = |row: &usize| !column.cells[*row].is_missing();
    let mut given = (0..column.cells.len()).filter(is_given);
    let blank = || Stop::refused(format!("Column {} is blank.", column.name));
    let first = given.next().ok_or_else(blank)?;
    Ok((first, given.next_back().unwrap_or(first)))
}
