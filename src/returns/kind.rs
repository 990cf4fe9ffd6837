//! What numbers of a record are: simple returns, log-returns or prices, in percent or as fractions.
//!
//! A heading or percent signs say so, or the numbers leave one choice; where they leave two, a person is asked. The bounds
//! are those of investments: returns of a tenth of a percent to a third a period.

use super::cells::Cell;
use super::choices::{Choices, Kind, Unit};
use super::number::has_percent;
use super::outcome::Stop;
use super::words::percent;

/// A standard deviation a period above which a reading holds only where a person confirms it.
const DOUBTFUL_DEVIATION: f64 = 0.3;
/// Numbers whose standard deviation, as written, is below the first are fractions, above the second percent.
const SURELY_FRACTIONS: f64 = 0.1;
const SURELY_PERCENT: f64 = 1.0;
/// Numbers above zero that average more than this, as a return a period, are rather prices.
const LARGEST_MEAN: f64 = 0.2;
/// Words of a heading of returns.
const RETURNS: [&str; 12] =
    ["ret", "return", "returns", "perf", "performance", "gain", "gains", "change", "chg", "pct", "percent", "yield"];
/// No fractions average as much a period.
const SURELY_NO_MEAN: f64 = 1.0;
/// The service's bound on a log-return.
const LARGEST_LOG_RETURN: f64 = 5.0;

/// Numbers of one column, oldest first, with the cells they stand in.
pub struct Numbers<'a> {
    pub name: &'a str,
    pub values: Vec<f64>,
    pub cells: Vec<&'a Cell<'a>>,
}

/// Returns of a period each, as fractions.
pub struct Returns {
    pub kind: Kind,
    /// None of prices.
    pub unit: Option<Unit>,
    pub simple: Vec<f64>,
    pub logarithmic: Vec<f64>,
}

/// Mean and sample standard deviation.
pub fn moments(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0).max(1.0)).sqrt())
}

impl Numbers<'_> {
    /// # Errors
    /// What is asked or refused.
    pub fn returns(&self, said: &Choices) -> Result<Returns, Stop> {
        let signs = self.percent_signs()?;
        let kind = said.kind.map_or_else(|| self.kind(signs), Ok)?;
        let unit = if kind == Kind::Price { None } else { Some(self.unit(signs, said)?) };
        let returns = self.read_as(kind, unit)?;
        let (_, deviation) = moments(&returns.simple);
        if deviation == 0.0 && returns.simple.len() > 1 {
            return Err(Stop::refused("The numbers do not vary: there is nothing to learn from them."));
        }
        if deviation > DOUBTFUL_DEVIATION && said.large_deviation != Some(true) {
            return Err(self.doubt(&returns, deviation));
        }
        Ok(returns)
    }

    /// A percent sign counts for the column; where some cells have one and others none, they cannot mean the same.
    fn percent_signs(&self) -> Result<bool, Stop> {
        let signs = self.cells.first().is_some_and(|cell| has_percent(&cell.text));
        let rule = if signs {
            "lacks a percent sign, unlike the cells before"
        } else {
            "has a percent sign, unlike the cells before"
        };
        let odd = self.cells.iter().find(|cell| has_percent(&cell.text) != signs);
        odd.map_or(Ok(signs), |odd| Err(odd.refused(self.name, rule)))
    }

    /// By its heading; numbers that are all above zero may be prices without one.
    fn kind(&self, signs: bool) -> Result<Kind, Stop> {
        let name = self.name.to_lowercase();
        let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
        let words: Vec<&str> = name.split(|letter: char| !letter.is_alphanumeric()).collect();
        let is_log = words.iter().any(|word| ["log", "ln"].contains(word) || word.starts_with("logret"));
        let is_return = name.contains('%') || words.iter().any(|word| RETURNS.contains(word));
        let is_price = !is_return && (has(&["price", "close"]) || name == "nav");
        if is_log || signs || (self.values.iter().any(|value| *value <= 0.0) && !is_price) {
            return Ok(if is_log { Kind::Log } else { Kind::Simple });
        }
        // An index of total return is none, though its heading says so.
        if is_return && moments(&self.values).0 / 100.0 <= LARGEST_MEAN {
            return Ok(Kind::Simple);
        }
        if is_price || has(&["level", "index", "value", "adj"]) {
            return Ok(Kind::Price);
        }
        let steps: Vec<f64> = self.values.windows(2).map(|pair| (pair[1] / pair[0]).ln()).collect();
        let (as_returns, as_prices) =
            (moments(&self.values).0 / 100.0 <= LARGEST_MEAN, moments(&steps).1 <= DOUBTFUL_DEVIATION);
        if as_returns && as_prices {
            let option = |label: &str, kind| (label.to_owned(), of_kind(kind));
            let options = vec![option("Prices", Kind::Price), option("Returns", Kind::Simple)];
            return Err(Stop::asked("kind", "Are these prices, or returns that are all above zero?", options));
        }
        Ok(if as_prices { Kind::Price } else { Kind::Simple })
    }

    /// As said or written, or by how much the numbers vary. A loss of all and more is in percent.
    fn unit(&self, signs: bool, said: &Choices) -> Result<Unit, Stop> {
        if signs || ["%", "pct", "percent"].iter().any(|word| self.name.to_lowercase().contains(word)) {
            return Ok(said.unit.filter(|_| !signs).unwrap_or(Unit::Percent));
        }
        if let Some(unit) = said.unit {
            return Ok(unit);
        }
        let (mean, deviation) = moments(&self.values);
        if deviation >= SURELY_PERCENT || mean.abs() > SURELY_NO_MEAN || self.values.iter().any(|value| *value <= -1.0)
        {
            return Ok(Unit::Percent);
        }
        if deviation < SURELY_FRACTIONS {
            return Ok(if mean.abs() <= LARGEST_MEAN { Unit::Fraction } else { Unit::Percent });
        }
        let index = self.values.iter().position(|value| *value != 0.0).unwrap_or_default();
        let (text, value) = (&self.cells[index].text, self.values[index]);
        let options = vec![
            (format!("Fractions: {text} is {}", percent(value)), of_unit(Unit::Fraction)),
            (format!("Percent: {text} is {}", percent(value / 100.0)), of_unit(Unit::Percent)),
        ];
        Err(Stop::asked("unit", format!("Are the returns fractions or percent? What is {text}?"), options))
    }

    /// Refuses the cell that cannot be what it is said to be.
    fn read_as(&self, kind: Kind, unit: Option<Unit>) -> Result<Returns, Stop> {
        let (simple, logarithmic): (Vec<f64>, Vec<f64>) = if kind == Kind::Price {
            self.refuse(0, &self.values, |value| value <= 0.0, "must be above 0, as a price is")?;
            self.values.windows(2).map(|pair| (pair[1] / pair[0] - 1.0, (pair[1] / pair[0]).ln())).unzip()
        } else {
            let fraction = |value: &f64| if unit == Some(Unit::Percent) { value / 100.0 } else { *value };
            let fractions: Vec<f64> = self.values.iter().map(fraction).collect();
            if kind == Kind::Log {
                fractions.into_iter().map(|value| (value.exp_m1(), value)).unzip()
            } else {
                let least = if unit == Some(Unit::Percent) { -100 } else { -1 };
                let rule = format!("must be above {least}: it would be a loss of all and more");
                self.refuse(0, &fractions, |value| value <= -1.0, &rule)?;
                fractions.into_iter().map(|value| (value, value.ln_1p())).unzip()
            }
        };
        let beyond = |value: f64| value.abs() > LARGEST_LOG_RETURN;
        let rule = format!("would be a log-return beyond {LARGEST_LOG_RETURN}");
        self.refuse(self.values.len() - logarithmic.len(), &logarithmic, beyond, &rule)?;
        Ok(Returns { kind, unit, simple, logarithmic })
    }

    fn refuse(&self, from: usize, values: &[f64], fails: impl Fn(f64) -> bool, rule: &str) -> Result<(), Stop> {
        let found = values.iter().position(|value| fails(*value)).map(|index| self.cells[from + index]);
        found.map_or(Ok(()), |cell| Err(cell.refused(self.name, rule)))
    }

    fn doubt(&self, Returns { kind, unit, .. }: &Returns, deviation: f64) -> Stop {
        let confirmed = Choices { large_deviation: Some(true), ..Choices::default() };
        let (otherwise, choices) = match (kind, unit) {
            (Kind::Price, _) => ("No, they are returns", of_kind(Kind::Simple)),
            (_, Some(Unit::Fraction)) => ("No, they are in percent", of_unit(Unit::Percent)),
            _ => ("No, they are prices", of_kind(Kind::Price)),
        };
        let question = format!(
            "Read as {}, the {} numbers give a standard deviation of {} a period. Is that right?",
            called(*kind, *unit),
            self.values.len(),
            percent(deviation)
        );
        let options = vec![("Yes, take them so".to_owned(), confirmed), (otherwise.to_owned(), choices)];
        Stop::asked("large_deviation", question, options)
    }
}

/// What numbers are, in words.
pub fn called(kind: Kind, unit: Option<Unit>) -> &'static str {
    match (kind, unit) {
        (Kind::Price, _) => "returns of prices",
        (Kind::Simple, Some(Unit::Percent)) => "simple returns in percent",
        (Kind::Simple, _) => "simple returns as fractions",
        (Kind::Log, Some(Unit::Percent)) => "log-returns in percent",
        (Kind::Log, _) => "log-returns as fractions",
    }
}

fn of_kind(kind: Kind) -> Choices {
    Choices { kind: Some(kind), ..Choices::default() }
}

fn of_unit(unit: Unit) -> Choices {
    Choices { unit: Some(unit), ..Choices::default() }
}
