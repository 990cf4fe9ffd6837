//! `ballast plan`: what to spend and what to hold for years, from a file of returns or prices. No server runs; the answer
//! is that of `POST /plan`.

use std::error::Error;
use std::fmt::Write;

use ballast::control::error::{FieldError, TrainError};
use ballast::control::evaluation::plan::report::{InBothWorlds, PlanReport, PlanRule, PlanStrategy};
use ballast::control::evaluation::plan::words::amount;
use ballast::control::request::assets::AssetsProblem;
use ballast::control::request::plan::{PlanAim, PlanQuestion};
use ballast::control::request::rules::{HORIZON, WEALTH, whole, within};
use ballast::control::request::specification::{ProblemSpecification, default_seed};
use ballast::control::request::spending::{BEQUEST, SECURED, SMALLEST_HIGHEST, Spending};
use ballast::numerics::machine::digits::percent;
use ballast::service::advice::plan::PlanAsked;
use clap::Args;

use super::caution::{self, CautionArgs};
use super::record::{RecordArguments, show};
use super::returns::AnyReturns;

#[derive(Debug, Clone, Args)]
pub struct PlanArgs {
    #[command(flatten)]
    record: RecordArguments,
    #[command(flatten)]
    caution: CautionArgs,
    /// Years of the plan
    #[arg(long, default_value_t = 30)]
    years: usize,
    /// Wealth now, in any currency
    #[arg(long, default_value_t = 100.0)]
    wealth: f64,
    /// Amount wanted in every year, in money of now; what the plan spends first unless given
    #[arg(long, value_name = "AMOUNT")]
    wanted: Option<f64>,
    /// Wealth wanted at the end, in money of now
    #[arg(long, value_name = "AMOUNT")]
    goal: Option<f64>,
    /// Amount put in every year, in money of now, if the plan aims at a goal
    #[arg(long, value_name = "AMOUNT", requires = "aim", conflicts_with = "wanted")]
    saved: Option<f64>,
    /// Aim at the goal: hold what makes the expected shortfall least, and spend what is wanted
    #[arg(long, requires = "goal", conflicts_with_all = ["lowest", "highest", "bequest", "secured", "secured_left"])]
    aim: bool,
    /// Limit on the drawdown of money that stays invested, as a fraction: 0.2 is 20 %
    #[arg(long, value_name = "SHARE")]
    drawdown_limit: Option<f64>,
    /// The drawdown today, as a fraction
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    drawdown: f64,
    /// Probability with which an amount is to last
    #[arg(long, default_value_t = 0.9)]
    certainty: f64,
    /// Rise of prices a year, as a fraction: 0.02 is 2 %
    #[arg(long, default_value_t = 0.0)]
    inflation: f64,
    /// Least share of wealth that is spent in a year
    #[arg(long, default_value_t = 0.0)]
    lowest: f64,
    /// Greatest share of wealth that is spent in a year; any unless given
    #[arg(long)]
    highest: Option<f64>,
    /// Weight of what is left at the end, in years of spending
    #[arg(long, default_value_t = 1.0)]
    bequest: f64,
    /// Amount spent in every year whatever returns do, in money of now
    #[arg(long, value_name = "AMOUNT", default_value_t = 0.0)]
    secured: f64,
    /// Wealth left at the end whatever returns do, in money of now
    #[arg(long, value_name = "AMOUNT", default_value_t = 0.0)]
    secured_left: f64,
    /// Number of simulated paths
    #[arg(long, default_value_t = 4000)]
    paths: usize,
    /// Seed of the simulations
    #[arg(long, default_value_t = default_seed())]
    seed: u64,
    /// Print the answer of POST /plan as JSON, and what was read on the standard error
    #[arg(long)]
    json: bool,
}

/// Allowed rises of prices a year. Percent typed as a fraction, 3 for 3 %, lie above.
const YEARLY_INFLATION: (f64, f64) = (-0.2, 0.5);

/// The command-line option for each field of the question that is not checked by the year.
const OPTIONS: [(&str, &str); 8] = [
    ("problem.spending.secured_left", "--secured-left"),
    ("problem.initial_wealth", "--wealth"),
    ("goal", "--goal"),
    ("aim", "--aim"),
    ("drawdown_limit", "--drawdown-limit"),
    ("drawdown", "--drawdown"),
    ("certainty", "--certainty"),
    ("paths", "--paths"),
];

pub fn run(arguments: &PlanArgs) -> Result<(), Box<dyn Error>> {
    let (question, read, noun) = match arguments.record.read_named()? {
        AnyReturns::One(returns) => {
            arguments.check(returns.periods_per_year)?;
            let problem = arguments.caution.applied(arguments.record.problem(&returns));
            let question = PlanAsked::Asset(arguments.question(problem, returns.periods_per_year));
            (question, returns.sentence(), returns.noun())
        }
        AnyReturns::Several(returns) => {
            arguments.check(returns.record.periods_per_year)?;
            let problem = arguments.record.assets_problem(&returns, |problem| arguments.caution.applied(problem));
            let (periods, noun) = (returns.record.periods_per_year, returns.record.frequency.noun());
            (PlanAsked::Assets(arguments.question_of_assets(problem, periods)), returns.sentence, noun)
        }
    };
    let report = question.answer().map_err(|error| match error {
        TrainError::Specification(error) => TrainError::Specification(arguments.by_option(error)),
        error => error,
    })?;
    Ok(show(&read, arguments.json, &report, || describe(&report, noun))?)
}

impl PlanArgs {
    /// Checks what is said by the year, in that unit.
    ///
    /// # Errors
    /// An option breaks its rule.
    fn check(&self, periods_per_year: usize) -> Result<(), FieldError> {
        let periods = periods_per_year as f64;
        whole("--years", self.years, &(1..=*HORIZON.end() / periods_per_year))?;
        within("--inflation", self.inflation, YEARLY_INFLATION.0, YEARLY_INFLATION.1)?;
        within("--lowest", self.lowest, 0.0, periods)?;
        let least = self.lowest.max(SMALLEST_HIGHEST * periods);
        self.highest.map_or(Ok(()), |highest| within("--highest", highest, least, periods))?;
        within("--bequest", self.bequest, BEQUEST.0 / periods, BEQUEST.1 / periods)?;
        within("--secured", self.secured, SECURED.0, SECURED.1)?;
        within("--secured-left", self.secured_left, SECURED.0, SECURED.1)?;
        let yearly = |option: &str, amount: Option<f64>| {
            amount.map_or(Ok(()), |amount| within(option, amount, WEALTH.0 * periods, WEALTH.1))
        };
        yearly("--wanted", self.wanted)?;
        yearly("--saved", self.saved)
    }

    fn question(&self, problem: ProblemSpecification, periods_per_year: usize) -> PlanQuestion {
        self.by_period(periods_per_year, |horizon, spending| ProblemSpecification {
            horizon,
            initial_wealth: self.wealth,
            spending,
            ..problem
        })
    }

    fn question_of_assets(&self, problem: AssetsProblem, periods_per_year: usize) -> PlanQuestion<AssetsProblem> {
        self.by_period(periods_per_year, |horizon, spending| AssetsProblem {
            horizon: Some(horizon),
            initial_wealth: self.wealth,
            spending,
            ..problem
        })
    }

    /// Converts what is said by the year to periods.
    fn by_period<P>(
        &self,
        periods_per_year: usize,
        problem: impl FnOnce(usize, Option<Box<Spending>>) -> P,
    ) -> PlanQuestion<P> {
        let periods = periods_per_year as f64;
        let spending = Spending {
            lowest: self.lowest / periods,
            highest: self.highest.map_or(1.0, |highest| highest / periods),
            inflation: (self.inflation.ln_1p() / periods).exp_m1(),
            // A plan that aims at a goal has no weights.
            bequest: if self.aim { 1.0 } else { self.bequest * periods },
            secured: self.secured / periods,
            secured_left: self.secured_left,
            ..Spending::default()
        };
        PlanQuestion {
            wanted: self.wanted.map(|wanted| wanted / periods),
            goal: self.goal,
            saved: self.saved.map(|saved| saved / periods),
            aim: if self.aim { PlanAim::Goal } else { PlanAim::Spending },
            drawdown_limit: self.drawdown_limit,
            drawdown: self.drawdown,
            certainty: self.certainty,
            paths: self.paths,
            ..PlanQuestion::of(problem(self.years * periods_per_year, Some(spending.into())), self.seed)
        }
    }

    /// Renames the field of an error to the option that the user knows.
    fn by_option(&self, error: FieldError) -> FieldError {
        match OPTIONS.iter().chain(&caution::OPTIONS).find(|(field, _)| *field == error.field) {
            Some((_, option)) => FieldError { field: (*option).into(), ..error },
            None if error.field == "problem.history" => FieldError { field: self.record.source().into(), ..error },
            None if error.field == "problem.spending.secured" => {
                let rule = "must be less: --wealth, left in the bank, does not pay for so much in every year";
                FieldError::new("--secured", self.secured, rule)
            }
            None => error,
        }
    }
}

fn describe(report: &PlanReport, noun: &str) -> String {
    let mut text = report.sentences.join("\n");
    let shares = |both: &InBothWorlds| format!("{} | {}", percent(both.record.value, 0), percent(both.worst.value, 0));
    let amounts = |both: &InBothWorlds| format!("{} | {}", amount(both.record.value), amount(both.worst.value));
    let cells = |strategy: &PlanStrategy| -> Vec<(&str, String)> {
        let PlanStrategy { ruin, mean_spending, lowest_spending, bequest, max_drawdown, .. } = strategy;
        let mut cells = vec![
            ("runs out", shares(ruin)),
            ("mean spending", amounts(mean_spending)),
            ("lowest spending", amounts(lowest_spending)),
            ("left at the end", amounts(bequest)),
            ("largest fall", shares(max_drawdown)),
        ];
        cells.extend(strategy.reaches_goal.as_ref().map(|share| ("ends with goal", shares(share))));
        cells.extend(strategy.shortfall.as_ref().map(|missing| ("missing on average", amounts(missing))));
        cells.extend(strategy.certainty_equivalent.as_ref().map(|sure| ("sure spending", amounts(sure))));
        cells
    };
    let mut line = |first: &str, cells: Vec<&str>| {
        let rest: String = cells.iter().map(|cell| format!("{cell:>20}")).collect();
        // Writing to a string cannot fail.
        let _ = write!(text, "\n  {first:<36}{rest}");
    };
    let heads = report.strategies.first().map(cells).unwrap_or_default();
    line("", Vec::new());
    line(&format!("record | worst law, by the {noun}"), heads.iter().map(|(head, _)| *head).collect());
    for strategy in &report.strategies {
        let cells = cells(strategy);
        line(name(strategy.rule), cells.iter().map(|(_, cell)| cell.as_str()).collect());
    }
    text.push('\n');
    for warning in &report.warnings {
        let _ = write!(text, "\n{}", warning.message);
    }
    text.lines().map(str::trim_end).collect::<Vec<_>>().join("\n").trim_end().to_owned()
}

fn name(rule: PlanRule) -> &'static str {
    match rule {
        PlanRule::Plan => "the plan",
        PlanRule::Trusting => "a plan that trusts the record",
        PlanRule::SixtyForty => "the plan's spending, 60 % held",
        PlanRule::FourPercent => "4 % of the first wealth, 60 % held",
        PlanRule::ShareOfWealth => "4 % of present wealth, 60 % held",
    }
}
