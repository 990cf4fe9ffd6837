//! The unit of returns: percent or fractions.

use super::cells::Cell;
use super::choices::{Choices, Unit};
use super::kind::{Numbers, RecordContext};
use super::moments::{bulk, middle, moments, odd, sure_mean};
use super::number::significant;
use super::outcome::Stop;
use super::words::{percent, percent_a_year};

/// Numbers with a standard deviation, as written, below the first bound are fractions, and above the second are
/// percent.
const SURELY_FRACTIONS: f64 = 0.1;
const SURELY_PERCENT: f64 = 1.0;
/// The largest mean that such calm numbers can have as fractions.
const LARGEST_MEAN: f64 = 0.2;
/// Standard deviations a year, read as fractions: one that no asset has and one that few have. The third is one so low,
/// read as percent, that hardly any asset has it.
const NO_DEVIATION: f64 = 3.0;
const LARGE_DEVIATION: f64 = 0.75;
const SMALL_DEVIATION: f64 = 0.001;
/// A mean a year that few assets have, read as fractions.
const LARGE_YEARLY_MEAN: f64 = 0.35;
/// Fewer numbers than this may all have two decimals by chance.
const FEW: usize = 6;
/// If gains since the start, read as fractions, had a median above this, they are in percent.
const SURELY_CUMULATED_PERCENT: f64 = 5.0;
/// Fractions never average more than this a period.
const SURELY_NO_MEAN: f64 = 1.0;

/// Returns true if there are enough numbers and all are written with at most two decimals. As fractions they would be
/// whole percents.
pub fn is_coarse(cells: &[&Cell]) -> bool {
    let decimals = |cell: &&Cell| {
        let text = significant(&cell.text);
        !text.contains(['e', 'E']) && text.rfind(['.', ',']).is_none_or(|mark| text.len() - mark - 1 <= 2)
    };
    cells.len() >= FEW && cells.iter().all(decimals)
}

/// Returns true if a heading says that its numbers are in percent.
pub fn names_percent(name: &str) -> bool {
    ["%", "pct", "percent"].iter().any(|word| name.to_lowercase().contains(word))
}

impl Numbers<'_> {
    /// Decides the unit of gains since a start: in percent they reach larger numbers than fractions do.
    pub fn cumulated_unit(&self, signs: bool, choices: &Choices) -> Result<Unit, Stop> {
        if signs || names_percent(self.name) {
            return Ok(choices.unit.filter(|_| !signs).unwrap_or(Unit::Percent));
        }
        match choices.unit {
            Some(unit) => Ok(unit),
            None if middle(&self.values).abs() > SURELY_CUMULATED_PERCENT => Ok(Unit::Percent),
            None => Err(self.ask_unit("")),
        }
    }

    /// Decides the unit as chosen or as written, or else by how much the numbers vary and average in a year. The bulk
    /// of the numbers decides for fractions; percent must also hold for all of them, so that no odd number decides it.
    pub fn unit(&self, signs: bool, choices: &Choices, beside: &RecordContext) -> Result<Unit, Stop> {
        if signs || names_percent(self.name) {
            return Ok(choices.unit.filter(|_| !signs).unwrap_or(Unit::Percent));
        }
        if let Some(unit) = choices.unit {
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

    /// Returns true if `values` cannot be fractions. Losses of everything or more also show this if they are too many
    /// to be odd.
    fn is_percent(&self, values: &[f64], beside: &RecordContext) -> bool {
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
        Stop::question("unit", format!("Are the returns fractions or percent? What is {text}?{doubt}"), options)
    }

    /// Returns a sentence why numbers that vary little may be a calm record in percent, or `None` if they look like
    /// fractions. The reason is that as fractions they exceed what assets and banks do, or that they are written as
    /// percents are. The `bulk` of the numbers decides.
    fn calm(&self, bulk: &[f64], beside: &RecordContext) -> Option<String> {
        let RecordContext { periods, is_dated, bank } = *beside;
        let deviation_per_year = moments(bulk).1 * periods.sqrt();
        let (all_mean, all_deviation) = moments(&self.values);
        let is_period = beside.noun();
        let doubt = |what: String| {
            let of = if is_dated { String::new() } else { format!(", if each covers a {is_period}") };
            Some(format!(" As fractions {what}{of}."))
        };
        if self.earns_too_much(bulk, periods) {
            return doubt(format!("they average {} a year", percent_a_year(all_mean, periods)));
        }
        if is_dated && deviation_per_year > LARGE_DEVIATION {
            return doubt(format!("their deviation is {} a year", percent(all_deviation * periods.sqrt())));
        }
        if deviation_per_year / 100.0 < SMALL_DEVIATION {
            return None;
        }
        match bank {
            Some(rate) => doubt(format!("the bank pays {} a year", percent(rate))),
            None if is_coarse(&self.cells) => doubt("all of them are whole percents".to_owned()),
            None => None,
        }
    }
    /// Returns true if the numbers, read as fractions, average more a year than few assets do, and this is beyond
    /// chance. The mean beyond chance must exceed that bound for the bulk, or the deviation a year for all numbers, as
    /// with assets that earn hardly anything. A handful of returns may average more by chance alone. The first test
    /// uses the bulk, so an odd return cannot hide the mean.
    fn earns_too_much(&self, bulk: &[f64], periods: f64) -> bool {
        let beyond_chance = |values: &[f64]| sure_mean(values) * periods;
        let deviation_per_year = moments(&self.values).1 * periods.sqrt();
        moments(bulk).0.abs() * periods > LARGE_YEARLY_MEAN
            && (beyond_chance(bulk) > LARGE_YEARLY_MEAN || beyond_chance(&self.values) > deviation_per_year)
    }
}
