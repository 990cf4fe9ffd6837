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
/// A deviation a year that no asset has, and one that few have, taken as fractions; and one that hardly any has as percent.
const NO_DEVIATION: f64 = 3.0;
const LARGE_DEVIATION: f64 = 0.75;
const SMALL_DEVIATION: f64 = 0.001;
/// A mean a year that few assets have, taken as fractions, and how far from nothing it must lie, in standard errors.
const LARGE_YEARLY_MEAN: f64 = 0.35;
const SURE_ERRORS: f64 = 2.0;
/// So few numbers may all have two decimals by chance.
const FEW: usize = 6;
/// More months are no record of an asset: without dates, so many numbers are rather days.
const MOST_MONTHS: usize = 1300;
const MONTHS_A_YEAR: f64 = 12.0;
const DAYS_A_YEAR: f64 = 252.0;
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

/// What stands beside numbers and tells what they may be.
pub struct Beside {
    /// In a year: as the dates say, or else as most likely.
    pub periods: f64,
    /// Whether the dates say so.
    pub is_dated: bool,
    /// What the bank would pay a year, taken as fractions, where that is more than banks do.
    pub bank: Option<f64>,
}

impl Beside {
    /// Beside `count` numbers, with the periods of a year where dates say so.
    pub fn of(dated: Option<usize>, count: usize) -> Self {
        let likely = if count > MOST_MONTHS { DAYS_A_YEAR } else { MONTHS_A_YEAR };
        Beside { periods: dated.map_or(likely, |periods| periods as f64), is_dated: dated.is_some(), bank: None }
    }
}

/// Whether all of enough numbers are written with two decimals at most: fractions would tell whole percents alone.
pub fn is_coarse(cells: &[&Cell]) -> bool {
    let decimals = |cell: &&Cell| {
        let text = cell.text.trim_end_matches(['%', ' ']);
        !text.contains(['e', 'E']) && text.rfind(['.', ',']).is_none_or(|mark| text.len() - mark - 1 <= 2)
    };
    cells.len() >= FEW && cells.iter().all(decimals)
}

/// Whether a heading says that what it heads is in percent.
pub fn names_percent(name: &str) -> bool {
    ["%", "pct", "percent"].iter().any(|word| name.to_lowercase().contains(word))
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
    pub fn returns(&self, said: &Choices, beside: &Beside) -> Result<Returns, Stop> {
        let signs = self.percent_signs()?;
        let kind = said.kind.map_or_else(|| self.kind(signs), Ok)?;
        let unit = if kind == Kind::Price { None } else { Some(self.unit(signs, said, beside)?) };
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

    /// As said or written, or by how much the numbers vary and average in a year. A loss of all and more is in percent.
    fn unit(&self, signs: bool, said: &Choices, beside: &Beside) -> Result<Unit, Stop> {
        if signs || names_percent(self.name) {
            return Ok(said.unit.filter(|_| !signs).unwrap_or(Unit::Percent));
        }
        if let Some(unit) = said.unit {
            return Ok(unit);
        }
        let (mean, deviation) = moments(&self.values);
        let is_percent = deviation >= SURELY_PERCENT
            || mean.abs() > SURELY_NO_MEAN
            || (beside.is_dated && deviation * beside.periods.sqrt() > NO_DEVIATION)
            || self.values.iter().any(|value| *value <= -1.0)
            || (deviation < SURELY_FRACTIONS && mean.abs() > LARGEST_MEAN);
        if is_percent {
            return Ok(Unit::Percent);
        }
        let doubt = if deviation < SURELY_FRACTIONS { self.calm(mean, deviation, beside) } else { Some(String::new()) };
        let Some(doubt) = doubt else { return Ok(Unit::Fraction) };
        let index = self.values.iter().position(|value| *value != 0.0).unwrap_or_default();
        let (text, value) = (&self.cells[index].text, self.values[index]);
        let options = vec![
            (format!("Fractions: {text} is {}", percent(value)), of_unit(Unit::Fraction)),
            (format!("Percent: {text} is {}", percent(value / 100.0)), of_unit(Unit::Percent)),
        ];
        Err(Stop::asked("unit", format!("Are the returns fractions or percent? What is {text}?{doubt}"), options))
    }

    /// Why numbers that vary little may be a calm record in percent, as a sentence: what they would come to as fractions is
    /// more than assets and banks do, or they are written as percents are. `None` where they are what fractions look like.
    fn calm(&self, mean: f64, deviation: f64, beside: &Beside) -> Option<String> {
        let Beside { periods, is_dated, bank } = *beside;
        let (mean_per_year, deviation_per_year) = (mean * periods, deviation * periods.sqrt());
        let error = deviation / (self.values.len() as f64).sqrt();
        let is_period = if periods == DAYS_A_YEAR { "day" } else { "month" };
        let told = |what: String| {
            let of = if is_dated { String::new() } else { format!(", if each is of a {is_period}") };
            Some(format!(" As fractions {what}{of}."))
        };
        if mean_per_year.abs() > LARGE_YEARLY_MEAN && mean.abs() > SURE_ERRORS * error {
            return told(format!("they average {} a year", percent(mean_per_year)));
        }
        if is_dated && deviation_per_year > LARGE_DEVIATION {
            return told(format!("their deviation is {} a year", percent(deviation_per_year)));
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
