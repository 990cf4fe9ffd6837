//! The order of a record's rows in time.

use jiff::civil::Date;

use super::cells::Cell;
use super::choices::Choices;
use super::dates::{Form, are_understood, form, numbered};
use super::outcome::Stop;
use super::record::Order;
use super::sheet::Column;
use crate::control::request::frequency::Frequency;

/// Orders the rows from oldest to newest; `times` are the hours of the rows, if a column has them. Rows that fall in
/// time are reversed. If periods are missing between rows, the caller is asked whether that is right.
///
/// # Errors
/// A question, or a refusal of rows that are in no order, a date given twice, or a date in another form.
pub fn ordered(
    column: Option<&Column>,
    times: Option<&Column>,
    rows: &[usize],
    choices: &Choices,
) -> Result<Order, Stop> {
    let undated = Order { dates: None, is_turned: choices.newest_first == Some(true), frequency: None, remark: None };
    let Some(column) = column else { return Ok(undated) };
    let given = given(column);
    if !are_understood(&given) {
        return if choices.newest_first.is_some() { Ok(undated) } else { Err(ask_the_end(&given)) };
    }
    let form = form(&given, choices)?;
    let mut cells = column.at(rows);
    let date = |cell: &&Cell| {
        form.date(&cell.text).ok_or_else(|| cell.refused(&column.name, "must be a date in the same form as the others"))
    };
    let mut dates = cells.iter().map(date).collect::<Result<Vec<Date>, Stop>>()?;
    let is_turned = falls(&dates);
    let times = times.map_or_else(|| cells.clone(), |times| times.at(rows));
    check_days(column, &cells, &dates, &times)?;
    check_order(column, &cells, &dates, is_turned)?;
    if is_turned {
        dates.reverse();
        cells.reverse();
    }
    let written: Vec<&str> = cells.iter().map(|cell| cell.text.as_ref()).collect();
    let frequency = match Frequency::of(&dates, &written) {
        Ok(frequency) => Some(frequency),
        Err(_) if choices.gaps == Some(true) => Frequency::typical(&dates),
        Err(found) => {
            let question = format!("{}: {}", cells[found.index].called(&column.name), found.rule);
            let choices = Choices { gaps: Some(true), ..Choices::default() };
            return Err(Stop::question("gaps", question, vec![("Use the rows as they are".to_owned(), choices)]));
        }
    };
    Ok(Order { remark: numbered(form, &written), dates: Some(dates), is_turned, frequency })
}

/// Returns true if the newest row comes first, as far as the dates or the choices tell.
pub fn is_newest_first(column: Option<&Column>, choices: &Choices) -> bool {
    let Some(column) = column else { return choices.newest_first == Some(true) };
    let given = given(column);
    match form(&given, choices) {
        Ok(form) if are_understood(&given) => falls(&read_as(form, &given)),
        _ => choices.newest_first == Some(true),
    }
}

fn given<'a>(column: &'a Column) -> Vec<&'a str> {
    column.cells.iter().filter(|cell| !cell.is_missing()).map(|cell| cell.text.as_ref()).collect()
}

fn read_as(form: Form, texts: &[&str]) -> Vec<Date> {
    texts.iter().filter_map(|text| form.date(text)).collect()
}

fn falls(dates: &[Date]) -> bool {
    2 * dates.windows(2).filter(|pair| pair[1] < pair[0]).count() + 1 > dates.len()
}

fn ask_the_end(given: &[&str]) -> Stop {
    let option = |label: &str, newest_first| {
        (label.to_owned(), Choices { newest_first: Some(newest_first), ..Choices::default() })
    };
    let question =
        format!("The dates, such as {}, cannot be read. Which row is the oldest?", given.first().unwrap_or(&""));
    Stop::question("newest_first", question, vec![option("The first row", false), option("The last row", true)])
}

/// # Errors
/// Two rows are of one day and differ by the hour.
fn check_days(column: &Column, cells: &[&Cell], dates: &[Date], times: &[&Cell]) -> Result<(), Stop> {
    let is_time = |cell: &Cell| cell.text.contains(':') || cell.text.bytes().all(|byte| byte.is_ascii_digit());
    let is_finer = |index: &usize| {
        let (before, time) = (times[*index], times[index + 1]);
        dates[*index] == dates[index + 1] && before.text != time.text && is_time(time)
    };
    let Some(index) = (0..dates.len().saturating_sub(1)).find(is_finer) else { return Ok(()) };
    let (before, time) = (&times[index].text, &times[index + 1].text);
    let rule = format!(
        "{time} is on the same day as {before}, the row before; give one row a day, because times are not read"
    );
    Err(cells[index + 1].refused(&column.name, &rule))
}

/// # Errors
/// A row is not in the order of the others, or has the same date as the row before.
fn check_order(column: &Column, cells: &[&Cell], dates: &[Date], is_turned: bool) -> Result<(), Stop> {
    let broken = |pair: &[Date]| if is_turned { pair[1] >= pair[0] } else { pair[1] <= pair[0] };
    let Some(at) = dates.windows(2).position(broken) else { return Ok(()) };
    let (than, order) = if is_turned { ("earlier", "newest to the oldest") } else { ("later", "oldest to the newest") };
    let before = &cells[at].text;
    let rule = format!("must be {than} than {before}, the row before: rows go from the {order}, one a date");
    Err(cells[at + 1].refused(&column.name, &rule))
}
