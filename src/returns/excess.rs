//! Returns in excess of the bank's, as research files have them. The bank's rate is added, because the advice is about
//! the whole return.

use super::bank::Bank;
use super::choices::{Choices, Kind};
use super::heading::ColumnHeading;
use super::kind::ColumnReturns;
use super::outcome::Stop;

/// Returns the whole returns of the column `name`. If its heading names returns in excess of the bank's, the caller is
/// asked.
///
/// # Errors
/// A question, no column of the bank to add, or a cell of that column that breaks a rule.
pub fn whole(
    name: &str,
    returns: ColumnReturns,
    bank: Option<&Bank>,
    choices: &Choices,
) -> Result<ColumnReturns, Stop> {
    let is_return = returns.kind == Kind::Simple || returns.kind == Kind::Log;
    match choices.excess {
        None if is_return && ColumnHeading::of(name).is_excess => Err(ask(name, bank)),
        Some(true) if is_return => added(name, returns, bank, choices),
        _ => Ok(returns),
    }
}

fn ask(name: &str, bank: Option<&Bank>) -> Stop {
    let excess = |excess| Choices { excess: Some(excess), ..Choices::default() };
    let add = bank.map(|bank| (format!("Yes: add column {}", bank.column.name), excess(true)));
    let options =
        add.into_iter().chain([("No: the returns already include the bank rate".to_owned(), excess(false))]).collect();
    let question = match bank {
        Some(bank) => format!(
            "Column {name} is headed as returns in excess of the bank rate, which is in column {}. Add the bank rate?",
            bank.column.name
        ),
        None => format!(
            "Column {name} is headed as returns in excess of the bank rate, but no column such as rf holds that rate. Must the \
             bank rate be added?"
        ),
    };
    Stop::question("excess", question, options)
}

fn added(name: &str, returns: ColumnReturns, bank: Option<&Bank>, choices: &Choices) -> Result<ColumnReturns, Stop> {
    let Some(bank) = bank else {
        return Err(Stop::refused(format!(
            "Column {name} holds returns in excess of the bank rate, but no column such as rf holds that rate. Add one."
        )));
    };
    let paid = bank.rates(returns.simple.len(), returns.unit, choices)?;
    let paid = paid.map_err(|reason| Stop::refused(format!("Column {} is not added: {reason}.", bank.column.name)))?;
    let simple: Vec<f64> = returns.simple.iter().zip(&paid.rates).map(|(beyond, rate)| beyond + rate).collect();
    if let Some(index) = simple.iter().position(|simple| *simple <= -1.0) {
        let cell = bank.cells[bank.cells.len() - simple.len() + index].called(&bank.column.name);
        return Err(Stop::refused(format!("{cell}: adding it would give {name} a loss of 100 % or more.")));
    }
    let logarithmic = simple.iter().map(|simple| simple.ln_1p()).collect();
    Ok(ColumnReturns { simple, logarithmic, ..returns })
}
