//! The rows that have numbers in the columns that are read: blank rows around them are left out, and holes among them
//! found.

use super::choices::Choices;
use super::outcome::Stop;
use super::sheet::Column;
use super::words::counted;

/// Rows that have a number in every column that is read.
pub struct KeptRows {
    pub rows: Vec<usize>,
    /// Rows in the same span that lack a number in some column.
    pub holes: Vec<usize>,
    /// Sentences about the rows before and after that are left out.
    pub remarks: Vec<String>,
}

impl KeptRows {
    /// Selects the rows that all columns share. A column that begins later than others cuts the older rows of all.
    ///
    /// # Errors
    /// A column has no numbers, or ends before the others.
    pub fn of(chosen: &[&Column], is_newest_first: bool) -> Result<Self, Stop> {
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
        if cut > 0 {
            let young = if is_newest_first { ends(to, |span| span.1) } else { ends(from, |span| span.0) };
            let column = chosen[young.unwrap_or(0)];
            let line = column.cells[if is_newest_first { to } else { from }].line();
            let rows = counted(cut, "older row");
            remarks.push(format!("Column {} has its oldest number in line {line}: {rows} left out.", column.name));
        }
        let (holes, rows) = (from..=to).partition(|row| chosen.iter().any(|column| column.cells[*row].is_missing()));
        Ok(KeptRows { rows, holes, remarks })
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

/// Returns the first and the last row in which a column has a number.
fn span(column: &Column) -> Result<(usize, usize), Stop> {
    let is_given = |row: &usize| !column.cells[*row].is_missing();
    let mut given = (0..column.cells.len()).filter(is_given);
    let blank = || Stop::refused(format!("Column {} is blank.", column.name));
    let first = given.next().ok_or_else(blank)?;
    Ok((first, given.next_back().unwrap_or(first)))
}
