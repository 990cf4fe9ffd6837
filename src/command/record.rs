//! A record in a file, and the investor who asks about it for one period.

use std::error::Error;

use ballast::control::error::FieldError;
use ballast::control::request::specification::{ProblemSpecification, UtilitySpecification};
use clap::Args;
use serde::Serialize;

use super::returns::{Returns, ReturnsFile};

#[derive(Debug, Clone, Args)]
pub struct Record {
    #[command(flatten)]
    file: ReturnsFile,
    /// Use the last so many returns; all of them unless given
    #[arg(long)]
    window: Option<usize>,
    /// Relative risk aversion: 1 is log utility, more is more careful
    #[arg(long, default_value_t = 3.0)]
    risk_aversion: f64,
}

impl Record {
    /// # Errors
    /// An option breaks a rule, or the file cannot be read.
    pub fn read(&self) -> Result<Returns, Box<dyn Error>> {
        if !(1.0..=100.0).contains(&self.risk_aversion) {
            return Err(FieldError::new("--risk-aversion", self.risk_aversion, "must lie in [1, 100]").into());
        }
        let returns = self.file.read()?;
        Ok(match self.window {
            Some(window) => returns.last(window)?,
            None => returns,
        })
    }

    /// Of the returns read.
    pub fn problem(&self, returns: &Returns) -> ProblemSpecification {
        let history = returns.rows().iter().map(|row| row.period().log_return).collect();
        ProblemSpecification {
            horizon: 1,
            periods_per_year: Some(returns.periods_per_year as f64),
            utility: UtilitySpecification::relative(self.risk_aversion),
            ..ProblemSpecification::of(history, returns.rate())
        }
    }
}

/// Prints what was read and what is `told` of the answer; as JSON the answer alone, and what was read on the standard error.
///
/// # Errors
/// The answer cannot be written as JSON.
pub fn show(
    returns: &Returns,
    as_json: bool,
    answer: &impl Serialize,
    told: impl FnOnce() -> String,
) -> serde_json::Result<()> {
    if as_json {
        eprintln!("{}", returns.sentence());
        println!("{}", serde_json::to_string_pretty(answer)?);
    } else {
        println!("{}\n\n{}", returns.sentence(), told());
    }
    Ok(())
}
