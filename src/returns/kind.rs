//! The kind of the numbers in a record: simple returns, log-returns, prices, or forms that some files have instead.
//!
//! A heading, percent signs or marks of money decide, or the bulk of the numbers if it leaves one kind. If it leaves
//! two, a person is asked. No single number decides: one that does not fit the others is refused by its cell. The
//! bounds are those of investments: returns of a tenth of a percent to a third a period.

use super::cells::Cell;
use super::choices::{Choices, Kind, Unit};
use super::doubt::{is_around_one, is_slow, jump, unusual_moments};
use super::heading::{ColumnHeading, GainSpan};
use super::moments::{bulk, middle, moments, odd, spread};
use super::number::{has_percent, money};
use super::outcome::Stop;
use super::words::percent;

/// If numbers above zero average more than this when read as returns a period, they are more likely prices.
const LARGEST_MEAN: f64 = 0.2;
/// No record of an asset has more months: without dates, more numbers than this are more likely days.
const MOST_MONTHS: usize = 1300;
const MONTHS_A_YEAR: f64 = 12.0;
const DAYS_A_YEAR: f64 = 252.0;
/// The largest deviation of the steps of prices, as logarithms.
const LARGEST_STEP: f64 = 0.3;
/// The service's bound on the size of a log-return.
const LARGEST_LOG_RETURN: f64 = 5.0;

const SINCE_START: &str = "Cumulative gains since the start";

/// Numbers of one column, oldest first, with their cells.
pub struct Numbers<'a> {
    pub name: &'a str,
    pub values: Vec<f64>,
    pub cells: Vec<&'a Cell<'a>>,
}

/// The facts about a record that help to interpret its numbers.
pub struct RecordContext {
    /// Periods in a year: as the dates show, or else the most likely number.
    pub periods: f64,
    /// True if the dates show the periods.
    pub is_dated: bool,
    /// The bank's rate a year, read as fractions, if it is more than banks pay.
    pub bank: Option<f64>,
}

impl RecordContext {
    /// Creates the facts for `count` numbers, with the periods in a year if dates show them.
    pub fn of(dated: Option<usize>, count: usize) -> Self {
        let likely = if count > MOST_MONTHS { DAYS_A_YEAR } else { MONTHS_A_YEAR };
        RecordContext { periods: dated.map_or(likely, |periods| periods as f64), is_dated: dated.is_some(), bank: None }
    }

    /// Returns the noun for a period, if only its likely length is known.
    pub fn noun(&self) -> &'static str {
        if self.periods == DAYS_A_YEAR { "day" } else { "month" }
    }
}

/// Returns by period, as fractions.
pub struct ColumnReturns {
    pub kind: Kind,
    /// Unit of the numbers; `None` for prices and for the value that 1 grows to.
    pub unit: Option<Unit>,
    pub simple: Vec<f64>,
    pub logarithmic: Vec<f64>,
}

impl Numbers<'_> {
    /// # Errors
    /// A question or a refusal.
    pub fn returns(&self, choices: &Choices, beside: &RecordContext) -> Result<ColumnReturns, Stop> {
        let signs = self.percent_signs()?;
        let is_money = self.marks_of_money()?;
        let kind = choices.kind.map_or_else(|| self.kind(signs, is_money), Ok)?;
        let unit = match kind {
            Kind::Price | Kind::Gross => None,
            Kind::Cumulated => Some(self.cumulated_unit(signs, choices)?),
            Kind::Simple | Kind::Log => Some(self.unit(signs, choices, beside)?),
        };
        let returns = self.read_as(kind, unit)?;
        let (_, deviation) = moments(&returns.simple);
        if deviation == 0.0 && returns.simple.len() > 1 {
            return Err(Stop::refused("The numbers do not vary: there is nothing to learn from them."));
        }
        if choices.unusual == Some(true) { Ok(returns) } else { self.doubted(returns, beside) }
    }

    /// Returns true if the cells have percent signs. If some cells have one and others have none, they cannot mean the
    /// same, so the first that differs is refused.
    fn percent_signs(&self) -> Result<bool, Stop> {
        let signs = self.cells.first().is_some_and(|cell| has_percent(&cell.text));
        let rule = if signs {
            "must have a percent sign, like the cells before it"
        } else {
            "must have no percent sign, like the cells before it"
        };
        let odd = self.cells.iter().find(|cell| has_percent(&cell.text) != signs);
        odd.map_or(Ok(signs), |odd| Err(odd.refused(self.name, rule)))
    }

    /// Returns true if cells carry a mark of money, which must be the same in all of them.
    fn marks_of_money(&self) -> Result<bool, Stop> {
        let mut marked = self.cells.iter().filter_map(|cell| Some((cell, money(&cell.text)?)));
        let Some((_, first)) = marked.next() else { return Ok(false) };
        match marked.find(|(_, mark)| *mark != first) {
            Some((cell, _)) => Err(cell.refused(self.name, &format!("must be in {first}, like the cells before it"))),
            None => Ok(true),
        }
    }

    /// Decides the kind by the heading. Without a heading of prices, numbers that are above zero except for odd ones
    /// may still be prices.
    fn kind(&self, signs: bool, is_money: bool) -> Result<Kind, Stop> {
        let heading = ColumnHeading::of(self.name);
        if let Some(span) = heading.span {
            return Err(self.ask_span(span));
        }
        if heading.is_log {
            return Ok(Kind::Log);
        }
        if is_money || heading.is_price {
            return Ok(Kind::Price);
        }
        if signs || !self.is_positive() {
            return if is_slow(&self.values) { Err(self.ask_slow()) } else { Ok(Kind::Simple) };
        }
        if is_around_one(&bulk(&self.values)) && !heading.is_level {
            return Err(self.ask_kind("Are these prices, growth factors, or returns that are all above zero?"));
        }
        // An index of total return holds no returns, even if its heading says so.
        let as_returns = middle(&self.values) / 100.0 <= LARGEST_MEAN;
        if heading.is_return && as_returns {
            return if is_slow(&self.values) { Err(self.ask_slow()) } else { Ok(Kind::Simple) };
        }
        if heading.is_level {
            return Ok(Kind::Price);
        }
        match (as_returns, self.steps_as_prices()) {
            (true, true) => Err(self.ask_kind("Are these prices, or returns that are all above zero?")),
            (_, true) => Ok(Kind::Price),
            _ => Ok(Kind::Simple),
        }
    }

    /// Returns true if the numbers are above zero, except for odd ones and for zeros before a listing or after its end.
    fn is_positive(&self) -> bool {
        let given = |value: &f64| *value != 0.0;
        let Some(first) = self.values.iter().position(given) else { return false };
        let last = self.values.iter().rposition(given).unwrap_or(first);
        let listed = &self.values[first..=last];
        let not_above = listed.iter().filter(|value| **value <= 0.0).count();
        not_above == 0 || (not_above <= odd(listed.len()) && self.steps_as_prices())
    }

    /// Returns true if most steps between consecutive numbers above zero are as small as those of prices.
    fn steps_as_prices(&self) -> bool {
        let steps = self.values.windows(2).filter(|pair| pair[0] > 0.0 && pair[1] > 0.0);
        let steps: Vec<f64> = steps.map(|pair| (pair[1] / pair[0]).ln()).collect();
        !steps.is_empty() && spread(&steps, 0.0) <= LARGEST_STEP
    }

    fn ask_kind(&self, question: &str) -> Stop {
        let option = |label: &str, kind| (label.to_owned(), Choices::from(kind));
        let mut options = vec![option("Prices", Kind::Price), option("Returns", Kind::Simple)];
        if is_around_one(&bulk(&self.values)) {
            options.insert(1, option("Growth factors: 1.01 is a return of 1 %", Kind::Gross));
        }
        if is_slow(&self.values) {
            options.insert(1, option(SINCE_START, Kind::Cumulated));
        }
        Stop::question("kind", question, options)
    }

    fn ask_slow(&self) -> Stop {
        let question = "Each number is near the one before. That is usual for cumulative gains since the start, but not for \
                        returns of one period. What are these numbers?";
        self.ask_gains(question, GainSpan::SinceStart)
    }

    fn ask_span(&self, span: GainSpan) -> Stop {
        let question = match span {
            GainSpan::SinceStart => {
                format!("Column {} is headed as cumulative gains since the start. What are its numbers?", self.name)
            }
            GainSpan::Other => format!(
                "Column {} is headed as gains over a span other than that of its row. Are they returns of one period each?",
                self.name
            ),
        };
        self.ask_gains(&question, span)
    }

    fn ask_gains(&self, question: &str, span: GainSpan) -> Stop {
        let option = |label: &str, kind| (label.to_owned(), Choices::from(kind));
        let mut options = Vec::new();
        if span == GainSpan::SinceStart {
            options.push(option(SINCE_START, Kind::Cumulated));
            if self.is_positive() {
                options.push(option("Prices or levels", Kind::Price));
            }
        }
        options.push(option("Returns of one period each", Kind::Simple));
        Stop::question("kind", question, options)
    }

    /// Converts the numbers to returns, and refuses the first cell that cannot be of this kind.
    fn read_as(&self, kind: Kind, unit: Option<Unit>) -> Result<ColumnReturns, Stop> {
        let hundred = if unit == Some(Unit::Percent) { 100.0 } else { 1.0 };
        let simple: Vec<f64> = match kind {
            Kind::Price => {
                self.refuse(&self.values, |value| value <= 0.0, "must be above 0; remove the row or give a price")?;
                self.values.windows(2).map(|pair| pair[1] / pair[0] - 1.0).collect()
            }
            Kind::Cumulated => {
                let level = |value: f64| 1.0 + value / hundred;
                let rule = format!("must be above -{hundred}; this is a loss of 100 % or more");
                self.refuse(&self.values, |value| level(value) <= 0.0, &rule)?;
                self.values.windows(2).map(|pair| level(pair[1]) / level(pair[0]) - 1.0).collect()
            }
            Kind::Gross => {
                self.refuse(
                    &self.values,
                    |value| value <= 0.0,
                    "must be above 0; give a growth factor, such as 1.01 for a return of 1 %",
                )?;
                self.values.iter().map(|value| value - 1.0).collect()
            }
            Kind::Log => self.values.iter().map(|value| (value / hundred).exp_m1()).collect(),
            Kind::Simple => {
                let rule = format!("must be above -{hundred}; this is a loss of 100 % or more");
                self.refuse(&self.values, |value| value / hundred <= -1.0, &rule)?;
                self.values.iter().map(|value| value / hundred).collect()
            }
        };
        let logarithmic: Vec<f64> = match kind {
            Kind::Log => self.values.iter().map(|value| value / hundred).collect(),
            Kind::Price => self.values.windows(2).map(|pair| (pair[1] / pair[0]).ln()).collect(),
            _ => simple.iter().map(|value| value.ln_1p()).collect(),
        };
        let rule = format!("must give a log-return between -{LARGEST_LOG_RETURN} and {LARGEST_LOG_RETURN}");
        self.refuse(&logarithmic, |value| value.abs() > LARGEST_LOG_RETURN, &rule)?;
        Ok(ColumnReturns { kind, unit, simple, logarithmic })
    }

    /// Refuses the first cell whose value `fails`. There may be fewer returns than cells; they then belong to the last
    /// cells.
    fn refuse(&self, values: &[f64], fails: impl Fn(f64) -> bool, rule: &str) -> Result<(), Stop> {
        let from = self.cells.len() - values.len();
        let found = values.iter().position(|value| fails(*value)).map(|index| self.cells[from + index]);
        found.map_or(Ok(()), |cell| Err(cell.refused(self.name, rule)))
    }

    /// Asks whether numbers that are unusual for an asset are right.
    fn doubted(&self, returns: ColumnReturns, beside: &RecordContext) -> Result<ColumnReturns, Stop> {
        let ColumnReturns { kind, unit, ref simple, ref logarithmic } = returns;
        let from = self.cells.len() - logarithmic.len();
        // Log-returns are not checked for jumps: files that hold logarithms record crashes as they were.
        let jump = jump(logarithmic).filter(|_| kind != Kind::Log).map(|index| {
            let (cell, gain) = (self.cells[from + index].called(self.name), percent(simple[index]));
            format!("{cell}: a return of {gain} is far from all others, as after a split or a typing error.")
        });
        let moments = unusual_moments(simple, beside.periods).map(|moments| {
            let of = if beside.is_dated { String::new() } else { format!(", if each covers a {}", beside.noun()) };
            format!("Read as {}, the {} numbers give {moments}{of}.", called(kind, unit), self.values.len())
        });
        let found: Vec<String> = jump.into_iter().chain(moments).collect();
        if found.is_empty() || simple.len() < 2 {
            return Ok(returns);
        }
        let confirmed = Choices { unusual: Some(true), ..Choices::default() };
        let (otherwise, choices) = match (kind, unit) {
            (Kind::Price, _) => ("No, they are returns", Choices::from(Kind::Simple)),
            (_, Some(Unit::Fraction)) => ("No, they are in percent", Choices::from(Unit::Percent)),
            _ => ("No, they are prices", Choices::from(Kind::Price)),
        };
        let mut options = vec![("Yes, that is right".to_owned(), confirmed)];
        if self.read_as(choices.kind.unwrap_or(kind), choices.unit.or(unit)).is_ok() {
            options.push((otherwise.to_owned(), choices));
        }
        Err(Stop::question("unusual", format!("{} Is that right?", found.join(" ")), options))
    }
}

/// Returns the kind and unit of numbers, in words.
pub fn called(kind: Kind, unit: Option<Unit>) -> &'static str {
    match (kind, unit) {
        (Kind::Price, _) => "returns of prices",
        (Kind::Gross, _) => "returns of growth factors",
        (Kind::Cumulated, _) => "returns of cumulative gains",
        (Kind::Simple, Some(Unit::Percent)) => "simple returns in percent",
        (Kind::Simple, _) => "simple returns as fractions",
        (Kind::Log, Some(Unit::Percent)) => "log-returns in percent",
        (Kind::Log, _) => "log-returns as fractions",
    }
}
