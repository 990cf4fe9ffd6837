//! `ballast advise`: the allocation for the coming period, from a file of returns or prices. No server runs; the answer
//! is that of `POST /advise`.

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt;

use ballast::control::error::FieldError;
use ballast::control::request::assets::AssetsProblem;
use ballast::control::request::learning::Learning;
use ballast::control::request::means::MeansRule;
use ballast::control::request::rules::HISTORY_LENGTH;
use ballast::control::request::specification::{ProblemSpecification, default_seed};
use ballast::service::advice::advise::Advise;
use ballast::service::advice::advise_assets::AdviseAssets;
use clap::Args;

use super::caution::{self, CautionArgs};
use super::limits::LimitsArgument;
use super::means::means;
use super::record::{RecordArguments, show};
use super::returns::{AnyReturns, Returns, SeveralReturns};

mod words;

#[derive(Debug, Clone, Args)]
pub struct AdviseArgs {
    #[command(flatten)]
    record: RecordArguments,
    #[command(flatten)]
    caution: CautionArgs,
    #[command(flatten)]
    limits: LimitsArgument,
    /// Seed of the simulations
    #[arg(long, default_value_t = default_seed())]
    seed: u64,
    /// Periods in which the weight of a return halves; all returns weigh the same unless given
    #[arg(long)]
    half_life: Option<f64>,
    /// Means of several assets: sample, bayes_stein, or the share of the way from each to their average, 0 to 1; sample
    /// unless given
    #[arg(long, value_parser = means)]
    means: Option<MeansRule>,
    /// Wealth now, in any currency
    #[arg(long, default_value_t = 100.0)]
    wealth: f64,
    /// Share of wealth in the risky asset now; for several columns COLUMN=SHARE, repeated for each
    #[arg(long = "holding", value_name = "SHARE", value_parser = Holding::read)]
    holdings: Vec<Holding>,
    /// Cost of each trade as a fraction of the amount traded: 0.001 is 0.1 %
    #[arg(long, default_value_t = 0.0)]
    trading_cost: f64,
    /// Report also how close the advice is to changing
    #[arg(long)]
    sensitivity: bool,
    /// Print the answer of POST /advise as JSON, and what was read on the standard error
    #[arg(long)]
    json: bool,
}

/// Current holding, in one of several columns if it is named.
#[derive(Debug, Clone, PartialEq)]
struct Holding {
    column: Option<String>,
    share: f64,
}

impl Holding {
    fn read(text: &str) -> Result<Self, String> {
        let (column, share) = match text.rsplit_once('=') {
            Some((column, share)) => (Some(column.to_owned()), share),
            None => (None, text),
        };
        let share = share.parse().map_err(|_| "must be a share of wealth, or COLUMN=SHARE".to_owned())?;
        Ok(Holding { column, share })
    }
}

impl fmt::Display for Holding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.column {
            Some(column) => write!(formatter, "{column}={}", self.share),
            None => write!(formatter, "{}", self.share),
        }
    }
}

/// The command-line option for each field of the question.
const OPTIONS: [(&str, &str); 8] = [
    ("problem.learning.half_life", "--half-life"),
    ("problem.trading_cost", "--trading-cost"),
    ("problem.means.intensity", "--means"),
    ("problem.periods_per_year", "--periods-per-year"),
    ("wealth", "--wealth"),
    ("holding", "--holding"),
    ("holdings", "--holding"),
    ("sensitivity", "--sensitivity"),
];

pub fn run(arguments: &AdviseArgs) -> Result<(), Box<dyn Error>> {
    match arguments.record.read_named()? {
        AnyReturns::One(returns) => one(arguments, &returns),
        AnyReturns::Several(returns) => several(arguments, &returns),
    }
}

fn one(arguments: &AdviseArgs, returns: &Returns) -> Result<(), Box<dyn Error>> {
    let holding = arguments.one_holding()?;
    arguments.limits.check_none()?;
    if let Some(means) = arguments.means {
        return Err(FieldError::new("--means", means.name(), "must be left out: there is one asset").into());
    }
    let answer = |returns: &Returns| arguments.question(returns, holding).answer();
    let named = |error| by_option(error, returns.rows().len(), arguments.record.source());
    let advised = answer(returns).map_err(named)?;
    let text = || {
        let coarser: Vec<(&str, Result<f64, FieldError>)> = (returns.coarser().iter())
            .map(|returns| (returns.noun(), answer(returns).map(|advised| advised.advice.allocation)))
            .collect();
        let text = words::describe(&advised, arguments.wealth, returns.noun(), returns.periods_per_year as f64);
        words::append_coarser(text, &coarser)
    };
    Ok(show(&returns.sentence(), arguments.json, &advised, text)?)
}

fn several(arguments: &AdviseArgs, returns: &SeveralReturns) -> Result<(), Box<dyn Error>> {
    let given = [
        ("--half-life", arguments.half_life.is_some(), "all their returns weigh the same"),
        ("--sensitivity", arguments.sensitivity, "how close their advice is to changing is not computed"),
    ];
    if let Some((option, _, why)) = given.into_iter().find(|(_, is_given, _)| *is_given) {
        let rule = format!("must be left out with several assets: {why}");
        return Err(FieldError::new(option, format!("given with {} assets", returns.record.assets.len()), rule).into());
    }
    let problem = arguments.record.assets_problem(returns, |problem| arguments.caution.applied(problem));
    let question = AdviseAssets {
        problem: AssetsProblem {
            trading_cost: arguments.trading_cost,
            limits: arguments.limits.given(),
            means: arguments.means.unwrap_or_default(),
            ..problem
        },
        wealth: Some(arguments.wealth),
        holdings: Some(arguments.holdings_of(&returns.record.assets)?),
        seed: arguments.seed,
    };
    let named = |error| by_option(error, returns.record.rows.len(), arguments.record.source());
    let advised = question.answer().map_err(named)?;
    let (noun, periods) = (returns.record.frequency.noun(), returns.record.periods_per_year as f64);
    let text = || words::describe_several(&advised, arguments.wealth, noun, periods);
    Ok(show(&returns.sentence, arguments.json, &advised, text)?)
}

impl AdviseArgs {
    /// Returns the holding of the only asset.
    fn one_holding(&self) -> Result<f64, FieldError> {
        match &self.holdings[..] {
            [] => Ok(0.0),
            [Holding { column: None, share }] => Ok(*share),
            all => {
                let given: Vec<String> = all.iter().map(Holding::to_string).collect();
                Err(FieldError::new(
                    "--holding",
                    given.join(" "),
                    "must be one share of wealth, because there is one asset",
                ))
            }
        }
    }

    /// Returns the holding of each of these columns: 0 for those that are not named.
    fn holdings_of(&self, columns: &[String]) -> Result<BTreeMap<String, f64>, FieldError> {
        let mut by_name = BTreeMap::new();
        for holding in &self.holdings {
            let rule = "must be COLUMN=SHARE if there are several assets, each column once";
            let wrong = || FieldError::new("--holding", holding, rule);
            let column = holding.column.clone().ok_or_else(wrong)?;
            if by_name.insert(column, holding.share).is_some() {
                return Err(wrong());
            }
        }
        columns.iter().for_each(|column| {
            by_name.entry(column.clone()).or_insert(0.0);
        });
        Ok(by_name)
    }

    fn question(&self, returns: &Returns, holding: f64) -> Advise {
        let problem = ProblemSpecification {
            trading_cost: self.trading_cost,
            learning: self.half_life.map_or_else(Learning::default, |half_life| Learning::Decay { half_life }),
            ..self.caution.applied(self.record.problem(returns))
        };
        Advise {
            problem,
            wealth: Some(self.wealth),
            holding: Some(holding),
            seed: self.seed,
            sensitivity: self.sensitivity,
        }
    }
}

/// Renames the field of an error about `count` returns to the option that the user knows; `source` determines how many
/// are used.
fn by_option(mut error: FieldError, count: usize, source: &'static str) -> FieldError {
    if error.field == "problem.history" {
        if count > *HISTORY_LENGTH.end() {
            error.rule.push_str("; --window keeps the last ones");
        }
        return FieldError { field: source.into(), ..error };
    }
    if let Some(column) = error.field.strip_prefix("holdings.") {
        return FieldError { value: format!("{column}={}", error.value), field: "--holding".into(), ..error };
    }
    if let Some(at) = error.field.strip_prefix("problem.limits") {
        return FieldError { field: format!("--limits{}", at.replacen('.', " ", 1)), ..error };
    }
    match OPTIONS.iter().chain(&caution::OPTIONS).find(|(field, _)| *field == error.field) {
        Some((_, option)) => FieldError { field: (*option).into(), ..error },
        None => error,
    }
}
