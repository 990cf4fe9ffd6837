//! A text in, one reading out: what was read, what must be asked, or what is refused.

use jiff::civil::Date;
use serde::Serialize;
use utoipa::ToSchema;

use super::bank::Bank;
use super::cells::{Cell, mark};
use super::choices::{Choices, Unit};
use super::dates::{are_dates, form};
use super::excess;
use super::kind::{Beside, Numbers, Returns, called};
use super::number::{Mark, number};
use super::outcome::{Answer, Place, Question, Stop, both};
use super::record::{Found, Order, Record};
use super::sheet::{Column, ColumnFound, Holds, Sheet};
use super::words::counted;
use crate::control::request::frequency::Frequency;

/// What a service takes.
const FEWEST: usize = 2;
/// Of a text and all that is tried on it to tell what an option would mean, in bytes.
const TRIED: usize = 8_000_000;
/// Questions that may follow from an answer.
const ROUNDS: usize = 6;

/// What is made of a text.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum Reading {
    /// It is this record.
    Read(Record),
    /// It may be several.
    Asked {
        /// What would settle it.
        questions: Vec<Question>,
        /// The columns, where they are known.
        columns: Vec<ColumnFound>,
    },
    /// It is none.
    Refused {
        /// What is wrong, and where.
        sentence: String,
        /// Where it is wrong, if at one place.
        #[serde(skip_serializing_if = "Option::is_none")]
        place: Option<Place>,
    },
}

/// Reads `text`, with what was `said` of it. At most 8 MB of text are looked at, in time that grows as they do.
pub fn read(text: &str, said: &Choices) -> Reading {
    let (outcome, columns) = outcome(text, said);
    match outcome {
        Ok(record) => Reading::Read(record),
        Err(Stop::Refused { sentence, place }) => Reading::Refused { sentence, place },
        Err(Stop::Asked(mut questions)) => {
            let count: usize = questions.iter().map(|question| question.options.len()).sum();
            if ROUNDS * count * text.len() <= TRIED {
                let options = questions.iter_mut().flat_map(|question| &mut question.options);
                options.for_each(|option| option.sentence = meaning(text, said, option));
            }
            Reading::Asked { questions, columns }
        }
    }
}

/// What would be read after an answer, with the first answer to whatever else is asked.
fn meaning(text: &str, said: &Choices, option: &Answer) -> Option<String> {
    let mut said = said.with(&option.choices);
    for _ in 0..ROUNDS {
        match outcome(text, &said).0 {
            Ok(record) => return Some(record.sentence),
            Err(Stop::Asked(questions)) => {
                let first = questions.into_iter().find_map(|question| question.options.into_iter().next())?;
                said = first.choices.with(&said);
            }
            Err(Stop::Refused { .. }) => return None,
        }
    }
    None
}

fn outcome(text: &str, said: &Choices) -> (Result<Record, Stop>, Vec<ColumnFound>) {
    match Sheet::of(text, said) {
        Ok(sheet) => (record(&sheet, said), sheet.found()),
        Err(stop) => (Err(stop), Vec::new()),
    }
}

fn record(sheet: &Sheet, said: &Choices) -> Result<Record, Stop> {
    let chosen = sheet.chosen(said)?;
    let rows = filled(&chosen)?;
    let blank = chosen[0].cells.len() - rows.len();
    let mark = mark(chosen.iter().flat_map(|column| &column.cells[rows.clone()]), said)?;
    let numbers = chosen.iter().map(|column| numbers(column, &column.cells[rows.clone()], mark));
    let mut numbers = numbers.collect::<Result<Vec<Numbers>, Stop>>()?;
    if rows.len() < FEWEST {
        return Err(Stop::refused("One number is no record of returns: at least two are needed."));
    }
    let order = order(sheet.column(Holds::Dates), rows.clone(), said);
    let is_turned = order.as_ref().is_ok_and(|order| order.is_turned);
    if is_turned {
        numbers.iter_mut().for_each(|numbers| {
            numbers.values.reverse();
            numbers.cells.reverse();
        });
    }
    let mut beside = Beside::of(order.as_ref().ok().and_then(Order::periods_per_year), rows.len());
    let bank = sheet.column(Holds::Rate).map(|column| {
        let mut cells: Vec<&Cell> = column.cells[rows.clone()].iter().collect();
        if is_turned {
            cells.reverse();
        }
        Bank { column, cells, mark, periods: beside.periods }
    });
    beside.bank = bank.as_ref().filter(|_| said.rate_unit.is_none()).and_then(Bank::beyond);
    let is_one = numbers.len() == 1;
    let of = |numbers: &Numbers| {
        let read = numbers
            .returns(said, &beside)
            .and_then(|returns| excess::whole(numbers.name, returns, bank.as_ref(), said));
        read.map_err(|stop| if is_one { stop } else { stop.about(numbers.name) })
    };
    let returns = numbers.iter().map(of).collect::<Result<Vec<Returns>, Stop>>();
    let (order, returns) = both(order, returns)?;
    let count = returns[0].simple.len();
    alike(&chosen, &returns, said)?;
    if count < FEWEST {
        return Err(Stop::refused("Two prices make one return: at least two returns are needed."));
    }
    let used = said.latest.unwrap_or(count).clamp(FEWEST, count);
    let mut remarks = Vec::new();
    let rate = bank.as_ref().map(|bank| bank.rates(used, returns[0].unit, said)).transpose()?.and_then(|found| {
        let name = bank.as_ref().map_or("", |bank| bank.column.name.as_str());
        found.map_err(|reason| remarks.push(format!("Column {name} is not used: {reason}."))).ok()
    });
    if let Some(name) = bank.as_ref().map(|bank| &bank.column.name).filter(|_| said.excess == Some(true)) {
        remarks.push(format!("What the bank paid, in column {name}, is added to returns beyond it."));
    }
    if order.is_turned && order.dates.is_some() {
        remarks.push("The rows came newest first and are turned round.".to_owned());
    }
    if blank > 0 {
        remarks.push(format!("{} before or after the numbers left out.", counted(blank, "blank row")));
    }
    if sheet.remarks > 0 {
        remarks.push(format!("{} of remarks passed over.", counted(sheet.remarks, "line")));
    }
    let found =
        Found { names: chosen.iter().map(|column| column.name.clone()).collect(), order, returns, rate, used, remarks };
    Ok(found.record(sheet.found()))
}

/// Columns that are read together are of one kind and in one unit.
fn alike(chosen: &[&Column], returns: &[Returns], said: &Choices) -> Result<(), Stop> {
    let first = &returns[0];
    let other = |differs: &dyn Fn(&Returns) -> bool| returns.iter().position(differs);
    if let Some(index) = other(&|other| other.simple.len() != first.simple.len()) {
        let what = |index: usize| called(returns[index].kind, returns[index].unit);
        return Err(Stop::refused(format!(
            "Column {} reads as {} and column {} as {}: read them one at a time, or make them alike.",
            chosen[0].name,
            what(0),
            chosen[index].name,
            what(index)
        )));
    }
    let odd = other(&|other| other.unit != first.unit).filter(|_| said.unit.is_none());
    let Some(odd) = odd else { return Ok(()) };
    let option = |label: &str, unit| (label.to_owned(), Choices { unit: Some(unit), ..Choices::default() });
    let options = vec![option("Percent, all of them", Unit::Percent), option("Fractions, all of them", Unit::Fraction)];
    let (percent, fractions) = if first.unit == Some(Unit::Percent) { (0, odd) } else { (odd, 0) };
    let question = format!(
        "Column {} looks like percent and column {} like fractions. What are they all?",
        chosen[percent].name, chosen[fractions].name
    );
    Err(Stop::asked("unit", question, options))
}

/// The rows from the first number to the last; a blank cell among them is a hole in the record.
fn filled(chosen: &[&Column]) -> Result<std::ops::Range<usize>, Stop> {
    let is_given = |row: &usize| chosen.iter().any(|column| !column.cells[*row].text.is_empty());
    let mut given = (0..chosen[0].cells.len()).filter(is_given);
    let Some(first) = given.next() else {
        return Err(Stop::refused(format!("Column {} is blank.", chosen[0].name)));
    };
    Ok(first..given.next_back().unwrap_or(first) + 1)
}

fn numbers<'a>(column: &'a Column, cells: &'a [Cell<'a>], mark: Mark) -> Result<Numbers<'a>, Stop> {
    let value = |cell: &Cell| {
        let rule = match number(&cell.text, mark) {
            Some(value) if value.is_finite() => return Ok(value),
            Some(_) => "must be a finite number",
            None if mark == Mark::Comma && number(&cell.text, Mark::Point).is_some() => {
                "must be a number with a decimal comma, as the others are"
            }
            None if cell.text.is_empty() => "must be a number, as a record has no holes",
            None => "must be a number",
        };
        Err(cell.refused(&column.name, rule))
    };
    let values = cells.iter().map(value).collect::<Result<Vec<f64>, Stop>>()?;
    Ok(Numbers { name: &column.name, values, cells: cells.iter().collect() })
}

/// Rows that go down in time are turned round; rows that go neither way, a date given twice and a date of another form are
/// refused; and where periods are missing between them it is asked whether that is right.
fn order(column: Option<&Column>, rows: std::ops::Range<usize>, said: &Choices) -> Result<Order, Stop> {
    let undated = Order { dates: None, is_turned: said.newest_first == Some(true), frequency: None };
    let Some(column) = column else { return Ok(undated) };
    let texts = column.texts();
    let given: Vec<&str> = texts.iter().copied().filter(|text| !text.is_empty()).collect();
    if !are_dates(&given, false) {
        let option = |label: &str, newest_first| {
            (label.to_owned(), Choices { newest_first: Some(newest_first), ..Choices::default() })
        };
        let question =
            format!("The dates are not understood, such as {}. Which row is the oldest?", given.first().unwrap_or(&""));
        let options = vec![option("The first row", false), option("The last row", true)];
        return if said.newest_first.is_some() {
            Ok(undated)
        } else {
            Err(Stop::asked("newest_first", question, options))
        };
    }
    let form = form(&given, said)?;
    let mut cells: Vec<&Cell> = column.cells[rows].iter().collect();
    let date = |cell: &&Cell| {
        form.date(&cell.text).ok_or_else(|| cell.refused(&column.name, "must be a date in the form of the others"))
    };
    let mut dates = cells.iter().map(date).collect::<Result<Vec<Date>, Stop>>()?;
    let falling = dates.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let is_turned = 2 * falling > dates.len() - 1;
    let broken = |pair: &[Date]| if is_turned { pair[1] >= pair[0] } else { pair[1] <= pair[0] };
    if let Some(at) = dates.windows(2).position(broken) {
        let (than, order) =
            if is_turned { ("earlier", "newest to the oldest") } else { ("later", "oldest to the newest") };
        let before = &cells[at].text;
        let rule = format!("must be {than} than {before}, the row before: rows go from the {order}, one a date");
        return Err(cells[at + 1].refused(&column.name, &rule));
    }
    if is_turned {
        dates.reverse();
        cells.reverse();
    }
    let written: Vec<&str> = cells.iter().map(|cell| cell.text.as_ref()).collect();
    let frequency = match Frequency::of(&dates, &written) {
        Ok(frequency) => Some(frequency),
        Err(_) if said.gaps == Some(true) => Frequency::typical(&dates),
        Err(found) => {
            let question = format!("{}: {}", cells[found.index].called(&column.name), found.rule);
            let choices = Choices { gaps: Some(true), ..Choices::default() };
            return Err(Stop::asked("gaps", question, vec![("Take the rows as they are".to_owned(), choices)]));
        }
    };
    Ok(Order { dates: Some(dates), is_turned, frequency })
}
