//! The bank's rates in a column next to returns or prices. Their unit is as written, as chosen, or inferred from the
//! yearly rate.

use super::cells::Cell;
use super::choices::{Choices, RateUnit, Unit};
use super::number::{Mark, has_percent, number};
use super::outcome::Stop;
use super::record::BankRate;
use super::sheet::Column;
use super::unit::{is_coarse, names_percent};
use super::words::percent;

/// The range of the bank's rate a period; the same as for `problem.rate_per_step`.
const RATE: std::ops::RangeInclusive<f64> = -0.5..=0.5;
/// The most that any bank has paid a year on average over many years.
pub const LARGEST_RATE: f64 = 0.1;

/// A column of rates, oldest first, and the number of periods in a year as far as it is known.
pub struct Bank<'a> {
    pub column: &'a Column<'a>,
    pub cells: Vec<&'a Cell<'a>>,
    pub mark: Mark,
    pub periods: f64,
}

impl Bank<'_> {
    /// Returns the median of the cells that are numbers, as written and without sign; one odd cell does not move it.
    fn middle(&self, cells: &[&Cell]) -> f64 {
        let mut values: Vec<f64> =
            cells.iter().filter_map(|cell| number(&cell.text, self.mark)).map(f64::abs).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or_default()
    }

    fn says_percent(&self) -> bool {
        names_percent(&self.column.name) || self.cells.iter().any(|cell| has_percent(&cell.text))
    }

    /// Returns the rate a year, read as fractions, if it is more than banks pay.
    pub fn beyond(&self) -> Option<f64> {
        let yearly = self.middle(&self.cells) * self.periods;
        (!self.says_percent() && yearly > LARGEST_RATE).then_some(yearly)
    }

    /// Returns the rates of the last `used` periods next to returns in `unit`, or the reason why they are not used.
    ///
    /// # Errors
    /// A question about the unit of the rates.
    pub fn rates(&self, used: usize, unit: Option<Unit>, choices: &Choices) -> Result<Result<BankRate, String>, Stop> {
        let cells = &self.cells[self.cells.len() - used..];
        let is_percent = self.says_percent() || unit == Some(Unit::Percent);
        let by_hundred = match choices.rate_unit {
            Some(RateUnit::Unused) => return Ok(Err("your choices leave it out".to_owned())),
            Some(rate_unit) => rate_unit == RateUnit::Percent,
            None if is_percent && self.middle(cells) * self.periods / 100.0 > LARGEST_RATE => {
                return Err(self.ask(cells));
            }
            None if is_percent => true,
            None if self.may_be_percent(cells) => return Err(self.ask(cells)),
            None => false,
        };
        let rate = |cell: &&Cell| {
            let divisor = if by_hundred { 100.0 } else { 1.0 };
            let found = number(&cell.text, self.mark).map(|value| value / divisor).filter(|rate| RATE.contains(rate));
            let rule = if by_hundred {
                "must be from -50 to 50 percent a period"
            } else {
                "must be a fraction a period from -0.5 to 0.5: 0.002 is 0.2 %"
            };
            found.ok_or_else(|| format!("{}: {rule}", cell.called(&self.column.name)))
        };
        let rates = cells.iter().map(rate).collect::<Result<Vec<f64>, String>>();
        Ok(rates.map(|rates| BankRate { column: self.column.name.clone(), rates }))
    }

    /// Returns true if the rates could be percent: as fractions they exceed what banks pay, or are coarser than
    /// fractions are written.
    fn may_be_percent(&self, cells: &[&Cell]) -> bool {
        let values: Option<Vec<f64>> = cells.iter().map(|cell| number(&cell.text, self.mark)).collect();
        let Some(values) = values else { return false };
        let yearly = self.middle(cells) * self.periods;
        let is_coarse = is_coarse(cells) && values.iter().any(|value| *value != 0.0);
        let is_percent = yearly / 100.0 <= LARGEST_RATE && values.iter().all(|value| RATE.contains(&(value / 100.0)));
        let is_fraction = values.iter().all(|value| RATE.contains(value));
        (yearly > LARGEST_RATE && (is_percent || is_fraction)) || (is_coarse && self.periods > 1.0)
    }

    fn ask(&self, cells: &[&Cell]) -> Stop {
        let last = cells.iter().rev().find(|cell| number(&cell.text, self.mark).is_some_and(|value| value != 0.0));
        let (text, middle) = (last.map_or("", |cell| cell.text.as_ref()), self.middle(cells));
        let value = number(text, self.mark).unwrap_or_default();
        let option = |word: &str, divisor: f64, rate_unit| {
            let (one, yearly) = (percent(value / divisor), percent(middle * self.periods / divisor));
            let choices = Choices { rate_unit: Some(rate_unit), ..Choices::default() };
            (format!("{word}: {text} is {one} a period, and the bank pays about {yearly} a year"), choices)
        };
        let unused = Choices { rate_unit: Some(RateUnit::Unused), ..Choices::default() };
        let mut options = vec![option("Percent", 100.0, RateUnit::Percent)];
        let fits = |cell: &&Cell| number(&cell.text, self.mark).is_some_and(|value| RATE.contains(&value));
        if cells.iter().all(fits) {
            options.push(option("Fractions", 1.0, RateUnit::Fraction));
        }
        options.push(("Neither: ignore the column".to_owned(), unused));
        let question =
            format!("What is {text} in column {}, which holds the bank rate of each period?", self.column.name);
        Stop::question("rate_unit", question, options)
    }
}
