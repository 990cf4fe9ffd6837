//! What returns are counted in: percent or fractions.

use super::cells::Cell;
use super::choices::{Choices, Unit};
use super::kind::{Beside, Numbers};
use super::moments::{bulk, middle, moments, odd, sure_mean};
use super::number::significant;
use super::outcome::Stop;
use super::words::{percent, percent_a_year};

/// Numbers whose standard deviation, as written, is below the first are fractions, above the second percent.
const SURELY_FRACTIONS: f64 = 0.1;
const SURELY_PERCENT: f64 = 1.0;
/// Nor do numbers that vary so little average more than this as fractions.
const LARGEST_MEAN: f64 = 0.2;
/// A deviation a year that no asset has, and one that few have, taken as fractions; and one that hardly any has as percent.
const NO_DEVIATION: f64 = 3.0;
const LARGE_DEVIATION: f64 = 0.75;
const SMALL_DEVIATION: f64 = 0.001;
/// A mean a year that few assets have, taken as fractions.
const LARGE_YEARLY_MEAN: f64 = 0.35;
/// So few numbers may all have two decimals by chance.
const FEW: usize = 6;
/// No gains since the start are in the middle of a record so large as fractions.
const SURELY_CUMULATED_PERCENT: f64 = 5.0;
/// No fractions average as much a period.
const SURELY_NO_MEAN: f64 = 1.0;

/// Whether all of enough numbers are written with two decimals at most: fractions would tell whole percents alone.
pub fn is_coarse(cells: &[&Cell]) -> bool {
    let decimals = |cell: &&Cell| {
        let text = significant(&cell.text);
        !text.contains(['e', 'E']) && text.rfind(['.', ',']).is_none_or(|mark| text.len() - mark - 1 <= 2)
    };
    cells.len() >= FEW && cells.iter().all(decimals)
}

/// Whether a heading says that what it heads is in percent.
pub fn names_percent(name: &str) -> bool {
    ["%", "pct", "percent"].iter().any(|word| name.to_lowercase().contains(word))
}

impl Numbers<'_> {
    /// Gains since a start in percent reach more than fractions do.
    pub fn cumulated_unit(&self, signs: bool, said: &Choices) -> Result<Unit, Stop> {
        if signs || names_percent(self.name) {
            return Ok(said.unit.filter(|_| !signs).unwrap_or(Unit::Percent));
        }
        match said.unit {
            Some(unit) => Ok(unit),
            None if middle(&self.values).abs() > SURELY_CUMULATED_PERCENT => Ok(Unit::Percent),
            None => Err(self.ask_unit("")),
        }
    }

    /// Decides as said or written, or by how much the numbers vary and average in a year: fractions where their bulk is, and percent only
    /// where all of them are as well, so that no odd number makes it so.
    pub fn unit(&self, signs: bool, said: &Choices, beside: &Beside) -> Result<Unit, Stop> {
        if signs || names_percent(self.name) {
            return Ok(said.unit.filter(|_| !signs).unwrap_or(Unit::Percent));
        }
        if let Some(unit) = said.unit {
            return Ok(unit);
        }
        let bulk = bulk(&self.values);
        if self.is_percent(&bulk, beside) && self.is_percent(&self.values, beside) {
            return Ok(Unit::Percent);
        }
        let is_calm = moments(&bulk).1 < SURELY_FRACTIONS && !self.is_percent(&bulk, beside);
        let doubt = if is_calm { self.calm(&bulk, beside) } else { Some(String::new()) };
        doubt.map_or(Ok(Unit::Fraction), |doubt| Err(self.ask_unit(&doubt)))
    }

    /// Tells whether `values` are no fractions; losses of all and more tell it where they are too many to be odd.
    fn is_percent(&self, values: &[f64], beside: &Beside) -> bool {
        let (mean, deviation) = moments(values);
        let beyond_all = self.values.iter().filter(|value| **value <= -1.0).count();
        deviation >= SURELY_PERCENT
            || mean.abs() > SURELY_NO_MEAN
            || (beside.is_dated && deviation * beside.periods.sqrt() > NO_DEVIATION)
            || beyond_all > odd(self.values.len())
            || (deviation < SURELY_FRACTIONS && mean.abs() > LARGEST_MEAN)
    }

    fn ask_unit(&self, doubt: &str) -> Stop {
        let index = self.values.iter().position(|value| *value != 0.0).unwrap_or_default();
        let (text, value) = (&self.cells[index].text, self.values[index]);
        let options = vec![
            (format!("Fractions: {text} is {}", percent(value)), Choices::from(Unit::Fraction)),
            (format!("Percent: {text} is {}", percent(value / 100.0)), Choices::from(Unit::Percent)),
        ];
        Stop::asked("unit", format!("Are the returns fractions or percent? What is {text}?{doubt}"), options)
    }

    /// Why numbers that vary little may be a calm record in percent, as a sentence: what they would come to as fractions is
    /// more than assets and banks do, or they are written as percents are. `None` where they are what fractions look like.
    /// The `bulk` of them decides.
    fn calm(&self, bulk: &[f64], beside: &Beside) -> Option<String> {
        let Beside { periods, is_dated, bank } = *beside;
        let deviation_per_year = moments(bulk).1 * periods.sqrt();
        let (all_mean, all_deviation) = moments(&self.values);
        let is_period = beside.noun();
        let told = |what: String| {
            let of = if is_dated { String::new() } else { format!(", if each is of a {is_period}") };
            Some(format!(" As fractions {what}{of}."))
        };
        if self.earns_too_much(bulk, periods) {
            return told(format!("they average {} a year", percent_a_year(all_mean, periods)));
        }
        if is_dated && deviation_per_year > LARGE_DEVIATION {
            return told(format!("their deviation is {} a year", percent(all_deviation * periods.sqrt())));
        }
        if deviation_per_year / 100.0 < SMALL_DEVIATION {
            return None;
        }
        match bank {
            Some(rate) => told(format!("the bank pays {} a year", percent(rate))),
            None if is_coarse(&self.cells) => told("all of them are whole percents".to_owned()),
            None => None,
        }
    }
    /// Tells whether numbers as fractions average more a year than few assets do, and that beyond chance, or beyond chance more than
    /// they deviate in a year, which only what hardly earns does. A handful of returns averages more by chance alone; an odd one
    /// among them hides nothing, since the first is told of the bulk.
    fn earns_too_much(&self, bulk: &[f64], periods: f64) -> bool {
        let beyond_chance = |values: &[f64]| sure_mean(values) * periods;
        let deviation_per_year = moments(&self.values).1 * periods.sqrt();
        moments(bulk).0.abs() * periods > LARGE_YEARLY_MEAN
            && (beyond_chance(bulk) > LARGE_YEARLY_MEAN || beyond_chance(&self.values) > deviation_per_year)
    }
}
