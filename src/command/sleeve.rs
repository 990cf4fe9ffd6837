//! `ballast sleeve`: the share of the capital that a strategy's record supports, from a file of returns, prices or trades.
//! No server runs; the answer is that of `POST /sleeve`.

use std::error::Error;

use ballast::control::error::FieldError;
use ballast::control::request::sleeve::{RecordUnit, SleeveQuestion, USUAL_CAUTION};
use ballast::control::request::specification::{ProblemSpecification, UtilitySpecification, default_seed};
use ballast::control::sleeve::report::SleeveReport;
use ballast::service::advice::sleeve::SleeveRequest;
use clap::Args;

use super::caution::{self, CautionArgs};
use super::record::{RecordArguments, show};
use super::returns::AnyReturns;

#[derive(Debug, Clone, Args)]
pub struct SleeveArgs {
    #[command(flatten)]
    record: RecordArguments,
    #[command(flatten)]
    caution: CautionArgs,
    /// The file has a line for each trade: its profit or loss as a share of the stake
    #[arg(long)]
    trades: bool,
    /// Seed of the simulations
    #[arg(long, default_value_t = default_seed())]
    seed: u64,
    /// Print the answer of POST /sleeve as JSON, and what was read on the standard error
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &SleeveArgs) -> Result<(), Box<dyn Error>> {
    arguments.record.check_no_risk_aversion("the Kelly share maximises growth. Use `ballast advise` for less risk")?;
    let (request, read) = if arguments.trades { arguments.of_trades()? } else { arguments.of_periods()? };
    let report = request.answer().map_err(|error| arguments.by_option(error))?;
    Ok(show(&read, arguments.json, &report, || describe(&report))?)
}

impl SleeveArgs {
    fn of_trades(&self) -> Result<(SleeveRequest, String), Box<dyn Error>> {
        let (problem, read) = self.record.trades()?;
        Ok((SleeveRequest::Strategy(self.question(self.applied(problem))), read))
    }

    fn of_periods(&self) -> Result<(SleeveRequest, String), Box<dyn Error>> {
        Ok(match self.record.read_named()? {
            AnyReturns::One(returns) => {
                let problem = self.applied(self.record.problem(&returns));
                (SleeveRequest::Strategy(self.question(problem)), returns.sentence())
            }
            AnyReturns::Several(returns) => {
                let problem = self.record.assets_problem(&returns, |problem| self.applied(problem));
                (SleeveRequest::Strategies(self.question(problem)), returns.sentence)
            }
        })
    }

    fn applied(&self, problem: ProblemSpecification) -> ProblemSpecification {
        let usual = ProblemSpecification { caution: Some(USUAL_CAUTION), ..problem };
        ProblemSpecification { utility: UtilitySpecification::Log {}, ..self.caution.applied(usual) }
    }

    fn question<P>(&self, problem: P) -> SleeveQuestion<P> {
        let record_of = if self.trades { RecordUnit::Trades } else { RecordUnit::Periods };
        SleeveQuestion { problem, record_of, seed: self.seed }
    }

    /// Renames the field of an error to the option that the user knows.
    fn by_option(&self, error: FieldError) -> FieldError {
        match caution::OPTIONS.iter().find(|(field, _)| *field == error.field) {
            Some((_, option)) => FieldError { field: (*option).into(), ..error },
            None if error.field == "problem.history" => FieldError { field: self.record.source().into(), ..error },
            None => error,
        }
    }
}

fn describe(report: &SleeveReport) -> String {
    let cautions = report.caution.iter().map(|caution| &caution.sentence);
    let warnings = report.warnings.iter().map(|warning| &warning.message);
    let lines: Vec<&str> = report.sentences.iter().chain(cautions).chain(warnings).map(String::as_str).collect();
    lines.join("\n")
}
