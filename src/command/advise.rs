//! `ballast advise`: what to hold through the coming period, from a file of returns or prices. No server runs; the answer is
//! that of `POST /advise`.

use std::error::Error;

use ballast::control::error::FieldError;
use ballast::control::request::learning::Learning;
use ballast::control::request::rules::BRIDGE_NUMBERS;
use ballast::control::request::specification::{ProblemSpecification, default_seed};
use ballast::service::advise::Advise;
use ballast::service::advise_assets::AdviseAssets;
use clap::Args;

use super::caution::{self, CautionArgs};
use super::record::{Record, show};
use super::returns::{AnyReturns, Returns, SeveralReturns};

mod words;

#[derive(Debug, Clone, Args)]
pub struct AdviseArgs {
    #[command(flatten)]
    record: Record,
    #[command(flatten)]
    caution: CautionArgs,
    /// Of the simulations
    #[arg(long, default_value_t = default_seed())]
    seed: u64,
    /// Periods in which the weight of a return halves; all weigh the same unless given
    #[arg(long)]
    half_life: Option<f64>,
    /// Wealth now, in any currency
    #[arg(long, default_value_t = 100.0)]
    wealth: f64,
    /// Share of wealth in the risky asset now
    #[arg(long, default_value_t = 0.0)]
    holding: f64,
    /// Lost of what is bought or sold, as a fraction: 0.001 is 0.1 %
    #[arg(long, default_value_t = 0.0)]
    trading_cost: f64,
    /// Say as well how near the advice is to changing
    #[arg(long)]
    sensitivity: bool,
    /// Print what POST /advise answers, and what was read on the standard error
    #[arg(long)]
    json: bool,
}

/// The option that says what a field of the question is.
const OPTIONS: [(&str, &str); 6] = [
    ("problem.learning.half_life", "--half-life"),
    ("problem.trading_cost", "--trading-cost"),
    ("problem.periods_per_year", "--periods-per-year"),
    ("wealth", "--wealth"),
    ("holding", "--holding"),
    ("sensitivity", "--sensitivity"),
];

pub fn run(arguments: &AdviseArgs) -> Result<(), Box<dyn Error>> {
    match arguments.record.read_named()? {
        AnyReturns::One(returns) => one(arguments, &returns),
        AnyReturns::Several(returns) => several(arguments, &returns),
    }
}

fn one(arguments: &AdviseArgs, returns: &Returns) -> Result<(), Box<dyn Error>> {
    let count = returns.rows().len();
    let advised = arguments.question(returns).answer().map_err(|error| by_option(error, count, &arguments.record))?;
    let told = || {
        let coarser = returns.coarser().into_iter().filter_map(|returns| {
            let advised = arguments.question(&returns).answer().ok()?;
            Some((returns.noun(), advised.advice.allocation))
        });
        let text = words::told(&advised, arguments.wealth, returns.noun(), returns.periods_per_year as f64);
        words::told_of_coarser(text, &coarser.collect::<Vec<_>>())
    };
    Ok(show(&returns.sentence(), arguments.json, &advised, told)?)
}

fn several(arguments: &AdviseArgs, returns: &SeveralReturns) -> Result<(), Box<dyn Error>> {
    let given = [
        ("--holding", arguments.holding != 0.0),
        ("--trading-cost", arguments.trading_cost != 0.0),
        ("--half-life", arguments.half_life.is_some()),
        ("--sensitivity", arguments.sensitivity),
    ];
    if let Some((option, _)) = given.into_iter().find(|(_, is_given)| *is_given) {
        let rule = "must be left out of several assets, of which what is held now and what trading costs are not known";
        return Err(FieldError::new(option, format!("given of {}", returns.record.assets.len()), rule).into());
    }
    let question = AdviseAssets {
        problem: arguments.record.assets_problem(returns, |problem| arguments.caution.applied(problem)),
        wealth: Some(arguments.wealth),
        seed: arguments.seed,
    };
    let count = returns.record.rows.len();
    let advised = question.answer().map_err(|error| by_option(error, count, &arguments.record))?;
    let (noun, periods) = (returns.record.frequency.noun(), returns.record.periods_per_year as f64);
    let told = || words::told_of_several(&advised, arguments.wealth, noun, periods);
    Ok(show(&returns.sentence, arguments.json, &advised, told)?)
}

impl AdviseArgs {
    fn question(&self, returns: &Returns) -> Advise {
        let problem = ProblemSpecification {
            trading_cost: self.trading_cost,
            learning: self.half_life.map_or_else(Learning::default, |half_life| Learning::Decay { half_life }),
            ..self.caution.applied(self.record.problem(returns))
        };
        Advise {
            problem,
            wealth: Some(self.wealth),
            holding: Some(self.holding),
            seed: self.seed,
            sensitivity: self.sensitivity,
        }
    }
}

/// The error of a question about `count` returns, under the name by which the user knows the field.
fn by_option(error: FieldError, count: usize, record: &Record) -> FieldError {
    if error.field == "problem.radius.paths" {
        // Of one step: the returns and one more.
        let most = error.value.parse().map_or(0, |paths: usize| BRIDGE_NUMBERS / paths.max(1) - 1);
        let rule = format!(
            "must be at most {most}, as the radius is not simulated for more: --window {most} uses the last ones"
        );
        return FieldError::new(record.source(), format!("{count} returns"), rule);
    }
    match OPTIONS.iter().chain(&caution::OPTIONS).find(|(field, _)| *field == error.field) {
        Some((_, option)) => FieldError { field: (*option).into(), ..error },
        None => error,
    }
}
