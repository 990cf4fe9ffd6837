//! A table with a row for each year and a column for each month, read row by row.

use super::cells::Cell;
use super::dates::{is_year, month};
use super::outcome::Stop;

const MONTHS_A_YEAR: usize = 12;
/// The heading of such a table's numbers once they are one column.
const NAME: &str = "Jan to Dec";

/// The columns of the year and of January in a table whose heading names the twelve months from January on.
pub struct MonthsOfYears {
    year: usize,
    january: usize,
}

impl MonthsOfYears {
    /// # Errors
    /// There are months, but no column of years before them.
    pub fn of(heading: &[Cell], rows: &[Vec<Cell>]) -> Result<Option<Self>, Stop> {
        let is_month = |(index, cell): (usize, &Cell)| month(&cell.text) == Some(index + 1);
        let is_january = |from: &usize| {
            let months = heading.get(*from..*from + MONTHS_A_YEAR);
            months.is_some_and(|months| months.iter().enumerate().all(is_month))
        };
        let Some(january) = (0..heading.len()).find(is_january) else { return Ok(None) };
        let is_years = |column: &usize| rows.iter().all(|row| row.get(*column).is_some_and(|cell| is_year(&cell.text)));
        match (0..january).find(is_years) {
            Some(year) => Ok(Some(MonthsOfYears { year, january })),
            None => Err(Stop::refused(
                "The columns are the months of a year, but no column of years such as 2008 comes before them. Add one.",
            )),
        }
    }

    /// Puts the months into one column, the oldest first; a column with the year's own return is left out.
    pub fn unfolded<'a>(&self, rows: Vec<Vec<Cell<'a>>>) -> (Vec<Cell<'static>>, Vec<Vec<Cell<'a>>>) {
        let falls =
            rows.first().zip(rows.last()).is_some_and(|(first, last)| first[self.year].text > last[self.year].text);
        let mut years = rows;
        if falls {
            years.reverse();
        }
        let months = years.into_iter().flat_map(|row| {
            let year = row[self.year].clone();
            let months = row.into_iter().skip(self.january).take(MONTHS_A_YEAR).zip(1..);
            let dated = move |(cell, month)| {
                let date = year.with_text(format!("{}-{month:02}", year.text));
                vec![date, cell]
            };
            months.map(dated).collect::<Vec<_>>()
        });
        (vec![Cell::heading("month"), Cell::heading(NAME)], months.collect())
    }
}
