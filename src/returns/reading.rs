//! Turns a text into one reading: a record, questions, or a refusal.

use serde::Serialize;
use utoipa::ToSchema;

use super::bank::Bank;
use super::cells::{Cell, mark};
use super::choices::{Choices, Kind, Unit};
use super::excess;
use super::kept_rows::KeptRows;
use super::kind::{ColumnReturns, Numbers, RecordContext, called};
use super::number::{Mark, number};
use super::order::{is_newest_first, ordered};
use super::outcome::{Answer, Question, Stop, TextPosition, both};
use super::record::{ColumnContents, Order, Record};
use super::sheet::{Column, ColumnFound, Holds, Sheet};
use crate::control::request::frequency::Frequency;

/// The fewest returns that the service accepts.
const FEWEST: usize = 2;
/// The most bytes of text that are read again to describe what each option of a question would give.
const TRIED: usize = 8_000_000;
/// The most rounds of questions that may follow from an answer.
const ROUNDS: usize = 6;

/// The outcome of reading a text.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum Reading {
    /// The text is this record.
    Read(Record),
    /// The text may be several records.
    Asked {
        /// The questions whose answers decide which record it is.
        questions: Vec<Question>,
        /// The columns, if they are known.
        columns: Vec<ColumnFound>,
    },
    /// The text is no record.
    Refused {
        /// A sentence that says what is wrong, and where.
        sentence: String,
        /// The place of the error, if it is at one place.
        #[serde(skip_serializing_if = "Option::is_none")]
        place: Option<TextPosition>,
    },
}

/// Reads `text`, given the `choices`. Reads at most 8 MB of text, in time proportional to its length.
pub fn read(text: &str, choices: &Choices) -> Reading {
    let (outcome, columns) = outcome(text, choices);
    match outcome {
        Ok(record) => Reading::Read(record),
        Err(Stop::Refused { sentence, place }) => Reading::Refused { sentence, place },
        Err(Stop::Asked(mut questions)) => {
            let count: usize = questions.iter().map(|question| question.options.len()).sum();
            if ROUNDS * count * text.len() <= TRIED {
                let options = questions.iter_mut().flat_map(|question| &mut question.options);
                options.for_each(|option| option.sentence = meaning(text, choices, option));
            }
            Reading::Asked { questions, columns }
        }
    }
}

/// Returns the sentence of the record that an answer leads to, taking the first option of every further question.
fn meaning(text: &str, choices: &Choices, option: &Answer) -> Option<String> {
    let mut choices = choices.with(&option.choices);
    for _ in 0..ROUNDS {
        match outcome(text, &choices).0 {
            Ok(record) => return Some(record.sentence),
            Err(Stop::Asked(questions)) => {
                let first = questions.into_iter().find_map(|question| question.options.into_iter().next())?;
                choices = first.choices.with(&choices);
            }
            Err(Stop::Refused { .. }) => return None,
        }
    }
    None
}

fn outcome(text: &str, choices: &Choices) -> (Result<Record, Stop>, Vec<ColumnFound>) {
    match Sheet::of(text, choices) {
        Ok(sheet) => (record(&sheet, choices), sheet.found()),
        Err(stop) => (Err(stop), Vec::new()),
    }
}

fn record(sheet: &Sheet, choices: &Choices) -> Result<Record, Stop> {
    let chosen = sheet.chosen(choices)?;
    let dates = sheet.column(Holds::Dates);
    let mut kept = KeptRows::of(&chosen, is_newest_first(dates, choices), choices.unequal)?;
    let cells = || chosen.iter().zip(&kept.own).map(|(column, rows)| (*column, column.at(rows)));
    let mark = mark(cells().flat_map(|(_, cells)| cells), choices)?;
    let numbers = cells().map(|(column, cells)| numbers(column, cells, mark));
    let mut numbers = numbers.collect::<Result<Vec<Numbers>, Stop>>()?;
    if kept.rows.len() < FEWEST {
        return Err(Stop::refused("One number is not a record of returns: give at least two."));
    }
    // The question about holes comes before the one about the periods that are missing because of them.
    let lenient = Choices { gaps: Some(true), ..choices.clone() };
    let order = ordered(dates, sheet.times(), &kept.rows, if kept.holes.is_empty() { choices } else { &lenient });
    let is_turned = order.as_ref().is_ok_and(|order| order.is_turned);
    if is_turned {
        numbers.iter_mut().for_each(|numbers| {
            numbers.values.reverse();
            numbers.cells.reverse();
        });
    }
    let mut beside = RecordContext::of(order.as_ref().ok().and_then(Order::periods_per_year), kept.rows.len());
    let bank = sheet.column(Holds::Rate).map(|column| {
        let mut cells = column.at(&kept.rows);
        if is_turned {
            cells.reverse();
        }
        Bank { column, cells, mark, periods: beside.periods }
    });
    beside.bank = bank.as_ref().filter(|_| choices.rate_unit.is_none()).and_then(Bank::beyond);
    let is_one = numbers.len() == 1;
    let of = |numbers: &Numbers| {
        let read = numbers
            .returns(choices, &beside)
            .and_then(|returns| excess::whole(numbers.name, returns, bank.as_ref(), choices));
        read.map_err(|stop| if is_one { stop } else { stop.about(numbers.name) })
    };
    let returns = numbers.iter().map(of).collect::<Result<Vec<ColumnReturns>, Stop>>();
    let (mut order, returns) = both(order, returns)?;
    if !kept.holes.is_empty() {
        let are_prices = returns.iter().all(|returns| returns.kind == Kind::Price);
        kept.check_holes(&chosen, are_prices && order.frequency == Some(Frequency::Daily), choices)?;
        order = ordered(dates, sheet.times(), &kept.rows, choices)?;
    }
    alike(&chosen, (&returns, &kept), choices)?;
    let count = longest(&chosen, &returns)?;
    let used = choices.latest.unwrap_or(count).clamp(FEWEST, count);
    let mut remarks = Vec::new();
    let rate = bank.as_ref().map(|bank| bank.rates(used, returns[0].unit, choices)).transpose()?.and_then(|found| {
        let name = bank.as_ref().map_or("", |bank| bank.column.name.as_str());
        found.map_err(|reason| remarks.push(format!("Column {name} is not used: {reason}."))).ok()
    });
    if let Some(name) = bank.as_ref().map(|bank| &bank.column.name).filter(|_| choices.excess == Some(true)) {
        remarks.push(format!("The bank rate in column {name} is added to the returns in excess of it."));
    }
    if order.is_turned && order.dates.is_some() {
        remarks.push("The rows came newest first and are reversed.".to_owned());
    }
    remarks.extend(order.remark.take().into_iter().chain(kept.remarks).chain(sheet.remarks.iter().cloned()));
    let names = chosen.iter().map(|column| column.name.clone()).collect();
    let found = ColumnContents { names, order, returns, rate, used, remarks };
    Ok(found.record(sheet.found()))
}

/// Returns the number of returns of the longest column. Requires enough of each.
fn longest(chosen: &[&Column], returns: &[ColumnReturns]) -> Result<usize, Stop> {
    let lengths = || returns.iter().map(|returns| returns.simple.len());
    let count = lengths().max().unwrap_or(0);
    if count < FEWEST {
        return Err(Stop::refused(
            "Two prices give one return, but at least two returns are needed. Give another price.",
        ));
    }
    match lengths().position(|length| length < FEWEST) {
        None => Ok(count),
        Some(at) => {
            let name = &chosen[at].name;
            Err(Stop::refused(format!("Column {name} needs at least two returns, or three prices.")))
        }
    }
}

/// Requires columns that are read together to be of one kind and in one unit.
fn alike(chosen: &[&Column], (returns, kept): (&[ColumnReturns], &KeptRows), choices: &Choices) -> Result<(), Stop> {
    let first = &returns[0];
    let other = |differs: &dyn Fn(&ColumnReturns) -> bool| returns.iter().position(differs);
    // Prices give one return less than they are.
    let lost = |at: usize| kept.own[at].len() - returns[at].simple.len();
    if let Some(index) = (0..returns.len()).find(|at| lost(*at) != lost(0)) {
        let what = |index: usize| called(returns[index].kind, returns[index].unit);
        return Err(Stop::refused(format!(
            "Column {} holds {}, and column {} holds {}. Read them one at a time, or give both in one form.",
            chosen[0].name,
            what(0),
            chosen[index].name,
            what(index)
        )));
    }
    let odd = other(&|other| other.unit != first.unit).filter(|_| choices.unit.is_none());
    let Some(odd) = odd else { return Ok(()) };
    let option = |label: &str, unit| (label.to_owned(), Choices { unit: Some(unit), ..Choices::default() });
    let options = vec![option("All in percent", Unit::Percent), option("All as fractions", Unit::Fraction)];
    let (percent, fractions) = if first.unit == Some(Unit::Percent) { (0, odd) } else { (odd, 0) };
    let question = format!(
        "Column {} looks like percent, and column {} like fractions. Which of the two are they all?",
        chosen[percent].name, chosen[fractions].name
    );
    Err(Stop::question("unit", question, options))
}

fn numbers<'a>(column: &'a Column, cells: Vec<&'a Cell<'a>>, mark: Mark) -> Result<Numbers<'a>, Stop> {
    let value = |cell: &&Cell| {
        let rule = match number(&cell.text, mark) {
            Some(value) if value.is_finite() => return Ok(value),
            Some(_) => "must be a finite number",
            None if mark == Mark::Comma && number(&cell.text, Mark::Point).is_some() => {
                "must be a number with a decimal comma, like the others"
            }
            None => "must be a number",
        };
        Err(cell.refused(&column.name, rule))
    };
    let values = cells.iter().map(value).collect::<Result<Vec<f64>, Stop>>()?;
    Ok(Numbers { name: &column.name, values, cells })
}
