//! A record in a file, and the options of an investor with one period.

use std::error::Error;

use ballast::control::error::FieldError;
use ballast::control::evaluation::assets::AssetsRecord;
use ballast::control::request::assets::AssetsProblem;
use ballast::control::request::frontier::asked_of;
use ballast::control::request::rules::within;
use ballast::control::request::specification::{ProblemSpecification, UtilitySpecification};
use clap::Args;
use serde::Serialize;

use super::returns::{AnyReturns, Returns, ReturnsError, ReturnsFile, SeveralReturns, Trades};

/// Relative risk aversion unless given.
const USUAL_RISK_AVERSION: f64 = 3.0;

#[derive(Debug, Clone, Args)]
pub struct RecordArguments {
    #[command(flatten)]
    file: ReturnsFile,
    /// Number of the latest returns to use; all of them unless given
    #[arg(long)]
    window: Option<usize>,
    /// Relative risk aversion: 1 is log utility, more is more careful; 3 unless given
    #[arg(long)]
    risk_aversion: Option<f64>,
}

impl RecordArguments {
    /// Reads the returns of one asset.
    ///
    /// # Errors
    /// An option breaks a rule, or the file cannot be read.
    pub fn read(&self) -> Result<Returns, Box<dyn Error>> {
        self.check()?;
        Ok(self.last(self.file.read()?)?)
    }

    /// Reads each named column as an asset. Without names, an ambiguous file is an error that asks for the column.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_named(&self) -> Result<AnyReturns, Box<dyn Error>> {
        if self.file.names_columns() { self.read_any() } else { self.read().map(AnyReturns::One) }
    }

    /// Reads each column as an asset if the file does not show which one is meant.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_any(&self) -> Result<AnyReturns, Box<dyn Error>> {
        self.check()?;
        Ok(match (self.file.read_any()?, self.window) {
            (AnyReturns::One(returns), _) => AnyReturns::One(self.last(returns)?),
            (AnyReturns::Several(returns), Some(window)) => AnyReturns::Several(last_of_several(returns, window)?),
            (several, None) => several,
        })
    }

    /// Reads the outcomes of trades, and builds the problem from them.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn trades(&self) -> Result<(ProblemSpecification, String), Box<dyn Error>> {
        self.check()?;
        let Trades { log_returns, rate, trades_per_year, sentence } = self.file.trades()?;
        let kept = self.window.unwrap_or(log_returns.len());
        let Some(first) = log_returns.len().checked_sub(kept) else {
            return Err(fewer(kept, log_returns.len()).into());
        };
        let problem = self.specification(log_returns[first..].to_vec(), rate, 1);
        Ok((ProblemSpecification { periods_per_year: trades_per_year, ..problem }, sentence))
    }

    fn check(&self) -> Result<(), FieldError> {
        self.risk_aversion.map_or(Ok(()), |given| within("--risk-aversion", given, 1.0, 100.0))
    }

    /// Checks that no risk aversion is given, because `why`.
    ///
    /// # Errors
    /// One is given.
    pub fn check_no_risk_aversion(&self, why: &str) -> Result<(), FieldError> {
        let rule = || format!("must be left out: {why}");
        self.risk_aversion.map_or(Ok(()), |given| Err(FieldError::new("--risk-aversion", given, rule())))
    }

    /// Returns the source of the number of returns: the option if it is given, or else the file.
    pub fn source(&self) -> &'static str {
        if self.window.is_some() { "--window" } else { "the file" }
    }

    fn last(&self, returns: Returns) -> Result<Returns, ReturnsError> {
        self.window.map_or(Ok(returns.clone()), |window| returns.last(window))
    }

    /// Builds the problem from the returns that were read.
    pub fn problem(&self, returns: &Returns) -> ProblemSpecification {
        let history = returns.rows().iter().map(|row| row.period().log_return).collect();
        self.specification(history, returns.rate(), returns.periods_per_year)
    }

    /// Builds the problem of several assets; `completed` adds the other choices.
    pub fn assets_problem(
        &self,
        returns: &SeveralReturns,
        completed: impl Fn(ProblemSpecification) -> ProblemSpecification,
    ) -> AssetsProblem {
        let AssetsRecord { assets, rows, bank, periods_per_year, .. } = &returns.record;
        let rate = bank.last().copied().unwrap_or(0.0);
        asked_of(assets.clone(), rows.clone(), &completed(self.specification(Vec::new(), rate, *periods_per_year)))
    }

    fn specification(&self, history: Vec<f64>, rate: f64, periods_per_year: usize) -> ProblemSpecification {
        ProblemSpecification {
            horizon: 1,
            periods_per_year: Some(periods_per_year as f64),
            utility: UtilitySpecification::relative(self.risk_aversion.unwrap_or(USUAL_RISK_AVERSION)),
            ..ProblemSpecification::of(history, rate)
        }
    }
}

/// Keeps the last `count` periods.
fn last_of_several(mut returns: SeveralReturns, count: usize) -> Result<SeveralReturns, ReturnsError> {
    let SeveralReturns { record, sentence } = &mut returns;
    let found = record.rows.len();
    if !(2..=found).contains(&count) {
        return Err(fewer(count, found));
    }
    record.rows = record.rows.of(found - count..found);
    record.bank.drain(..found - count);
    record.dates.drain(..found - count);
    sentence.push_str(&format!(" The last {count} periods are used, from {}.", record.dates[0]));
    Ok(returns)
}

/// Returns the error of a window that the file does not fill.
fn fewer(count: usize, found: usize) -> ReturnsError {
    let rule = "must be from 2 to the number of returns in the file";
    ReturnsError::Option { option: "--window", value: format!("{count} of {found}"), rule }
}

/// Prints what was read, followed by `text`. As JSON, prints the answer alone, and what was read on the standard error.
///
/// # Errors
/// The answer cannot be written as JSON.
pub fn show(
    read: &str,
    as_json: bool,
    answer: &impl Serialize,
    text: impl FnOnce() -> String,
) -> serde_json::Result<()> {
    if as_json {
        eprintln!("{read}");
        println!("{}", serde_json::to_string_pretty(answer)?);
    } else {
        println!("{read}\n\n{}", text());
    }
    Ok(())
}
