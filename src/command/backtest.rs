//! `ballast backtest`: the walk-forward report on real returns.
//!
//! Every `--every` periods, by default a year of them, a policy is trained on the window before and followed until the
//! next training. Nothing later than the start of a period is used for its allocation. A file of several assets is
//! tested with a trained policy or the one-step problem, and with common rules (`assets`). The result is a page to read, and the same as
//! JSON and CSV.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use ballast::control::error::{FieldError, TrainError};
use ballast::control::evaluation::backtest::{Backtest, Walked};
use ballast::control::evaluation::backtest_report::BacktestReport;
use ballast::control::pool::{PoolError, TrainingPool};
use ballast::control::progress::Watch;
use ballast::control::request::backtest::{BacktestRequest, Rates, defaults};
use ballast::control::request::backtest_assets::StrategyFamily;
use ballast::control::request::caution::CautionLevel;
use ballast::control::request::centre::CentreSpecification;
use ballast::control::request::means::MeansRule;
use ballast::control::request::own_weights::OwnShares;
use ballast::control::request::support::Support;
use ballast::http::gate::decode;
use ballast::http::site::dashboard;
use ballast::report::{self, FileError};
use clap::Args;
use serde::Serialize;
use thiserror::Error;

use self::weights::{OwnRule, OwnStrategy, own_strategies};
use super::caution;
use super::limits::LimitsArgument;
use super::means::means;
use super::progress::Parts;
use super::returns::{AnyReturns, Returns, ReturnsError, ReturnsFile, Row};

mod assets;
mod files;
mod weights;

#[derive(Debug, Clone, Args)]
pub struct BacktestArgs {
    #[command(flatten)]
    returns: ReturnsFile,
    /// Folder for report.html, report.json, periods.csv and strategies.csv; made if absent
    #[arg(long)]
    out: PathBuf,
    /// Periods of history that each policy is trained on; 20 years of them unless given. For several assets: periods
    /// that strategies know, several numbers or `all`; 10 years, 20 years and all unless given
    #[arg(long, value_delimiter = ',')]
    window: Vec<Window>,
    /// For several assets: `policy`, the trained policy that a session follows, `one_step`, the one-step problem solved
    /// in every period, or both; `one_step` unless given
    #[arg(long, value_delimiter = ',', value_parser = family)]
    strategies: Vec<StrategyFamily>,
    /// Periods from one training to the next, or for several assets from one measurement of the radius; a year of them
    /// unless given
    #[arg(long)]
    every: Option<usize>,
    /// Periods that a policy looks ahead; those to the next training unless given
    #[arg(long)]
    horizon: Option<usize>,
    /// Levels of the adaptive strategies, 0.05, 0.1 and 0.5 unless given; the static one takes the second, or the first
    /// if there is only one. For several assets one level, 0.1 unless given
    #[arg(long, value_delimiter = ',')]
    alpha: Vec<f64>,
    /// Multiple of the radius of every ball; 1 unless given
    #[arg(long)]
    scale: Option<f64>,
    /// Share of every radius that is used: bold, balanced or cautious, computed anew for every training, or paper, all
    /// of it
    #[arg(long, value_parser = caution::level)]
    caution: Option<CautionLevel>,
    /// Returns that are considered possible: a multiple of the worst and the best observed, or none for any at all,
    /// which is the default
    #[arg(long, value_parser = caution::support)]
    support: Option<Support>,
    /// Centre of the balls, as `problem.centre` of a request: '{"kind": "smoothed", "bandwidth": 0.01}'; the observed
    /// returns unless given
    #[arg(long, value_parser = centre)]
    centre: Option<CentreSpecification>,
    /// Means of several assets: sample, bayes_stein, or the share of the way from each to their average, 0 to 1; sample
    /// unless given
    #[arg(long, value_parser = means)]
    means: Option<MeansRule>,
    /// Relative risk aversion: 1 is log utility
    #[arg(long, default_value_t = defaults::risk_aversion())]
    risk_aversion: f64,
    /// Trading cost, in hundredths of a per cent of the amount traded; policies are trained with it, other strategies of
    /// several assets do not take it into account
    #[arg(long, default_value_t = 0.0)]
    cost_bp: f64,
    /// Train every policy as if trading were free
    #[arg(long)]
    cost_blind: bool,
    /// A strategy of your own to compare, as NAME=FILE, up to ten of them: a CSV file of dates and the share of wealth held
    /// in each period, or for several assets a column with the name of each
    #[arg(long)]
    weights: Vec<OwnStrategy>,
    /// Compare a strategy of your own, from a formula over the returns before each period: `last`, `mean`, `deviation`, with
    /// several assets for each; `mean12` is the mean of the last 12 periods. `bank` is the rate of the bank
    #[arg(long, value_name = "NAME=FORMULA")]
    formula: Vec<OwnRule>,
    #[command(flatten)]
    limits: LimitsArgument,
    /// Design points per step: more is more accurate and slower; 100 unless given
    #[arg(long)]
    count: Option<usize>,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of training threads; every core unless given
    #[arg(long)]
    threads: Option<usize>,
}

#[derive(Debug, Error)]
pub enum BacktestError {
    #[error("the returns cannot be used")]
    Returns(#[from] ReturnsError),
    #[error("{option} is {value}: {rule}")]
    Option { option: String, value: String, rule: String },
    #[error(transparent)]
    Pool(#[from] PoolError),
    #[error("training")]
    Train(#[from] TrainError),
    #[error("writing {}", path.display())]
    Write { path: PathBuf, source: std::io::Error },
    #[error("writing the page")]
    Page(#[from] FileError),
    #[error("writing JSON")]
    Json(#[from] serde_json::Error),
}

/// How much of the past is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Window {
    /// The last `n` periods.
    Last(usize),
    All,
}

impl FromStr for Window {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "all" => Ok(Window::All),
            text => text.parse().map(Window::Last).map_err(|_| "must be a number of periods, or all"),
        }
    }
}

impl fmt::Display for Window {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Window::Last(periods) => write!(formatter, "{periods}"),
            Window::All => write!(formatter, "all"),
        }
    }
}

/// Everything the page is made from.
pub struct BacktestPage {
    pub walked: Walked,
    pub report: BacktestReport,
    /// The returns as they were read.
    pub returns: Returns,
}

/// A report, and a sentence on the returns that were read for it.
#[derive(Serialize)]
pub struct ReportOfRecord<'a, R> {
    #[serde(flatten)]
    pub report: &'a R,
    pub read: &'a str,
}

fn page(
    module: &str,
    name: &str,
    dates: &[String],
    read: &impl Serialize,
    sentences: &[String],
) -> Result<String, FileError> {
    let date = |date: Option<&String>| date.cloned().unwrap_or_default();
    let span = if dates.is_empty() { "" } else { &format!(", {} to {}", date(dates.first()), date(dates.last())) };
    let title = format!("{name}{span}");
    report::html(dashboard::embedded, module, &title, read, sentences)
}

/// Runs the walk-forward and writes the files.
pub fn run(args: &BacktestArgs) -> Result<(), BacktestError> {
    let sentences = match args.returns.read_any()? {
        AnyReturns::One(returns) => {
            println!("{}\n", returns.sentence());
            let shown = walk(args, returns)?;
            let (strategies, periods) = (files::strategies(&shown.report.strategies), files::periods(&shown));
            files::write(&args.out, &shown.page()?, &shown.report, &strategies, &periods)?;
            shown.report.sentences
        }
        AnyReturns::Several(returns) => {
            println!("{}\n", returns.sentence);
            let shown = assets::walk(args, returns)?;
            let (strategies, periods) = (assets::files::strategies(&shown.report), assets::files::periods(&shown));
            files::write(&args.out, &shown.page()?, &shown.report, &strategies, &periods)?;
            shown.report.sentences
        }
    };
    sentences.iter().for_each(|sentence| println!("{sentence}"));
    println!("\nThe report is {}.", args.out.join(files::PAGE).display());
    Ok(())
}

impl BacktestArgs {
    /// Builds the request from these arguments.
    fn request(&self, returns: &Returns) -> Result<BacktestRequest, BacktestError> {
        let window = match self.window[..] {
            [] => None,
            [Window::Last(periods)] => Some(periods),
            _ => {
                let given: Vec<String> = self.window.iter().map(Window::to_string).collect();
                let rule = "must be one number of periods, because the file has one asset";
                return Err(refused("--window", given.join(","), rule));
            }
        };
        if !self.strategies.is_empty() {
            let rule = "must be left out, because the file has one asset";
            return Err(refused("--strategies", format!("{} names", self.strategies.len()), rule));
        }
        self.limits.check_none()?;
        if let Some(means) = self.means {
            return Err(refused("--means", means.name(), "must be left out, because the file has one asset"));
        }
        let rows = returns.rows();
        Ok(BacktestRequest {
            log_returns: None,
            simple_returns: Some(rows.iter().map(|row| row.risky_return).collect()),
            rate: Rates::Listed(rows.iter().map(|row| row.risk_free_return).collect()),
            dates: returns.frequency.map(|_| rows.iter().map(|row| row.date.clone()).collect()),
            periods_per_year: Some(returns.periods_per_year),
            window,
            every: self.every,
            horizon: self.horizon,
            alpha: if self.alpha.is_empty() { defaults::alpha() } else { self.alpha.clone() },
            scale: self.scale.unwrap_or_else(defaults::scale),
            caution: self.caution.unwrap_or_else(defaults::caution),
            support: self.support.unwrap_or_else(defaults::support),
            centre: self.centre.clone().unwrap_or_default(),
            risk_aversion: self.risk_aversion,
            trading_cost: self.trading_cost()?,
            cost_blind: self.cost_blind,
            weights: Default::default(),
            count: self.count.unwrap_or_else(defaults::count),
            seed: self.seed,
        })
    }

    /// Returns the cost as a share of the amount traded.
    fn trading_cost(&self) -> Result<f64, BacktestError> {
        if (0.0..=1000.0).contains(&self.cost_bp) {
            return Ok(1e-4 * self.cost_bp);
        }
        Err(refused("--cost-bp", self.cost_bp, "must lie in [0, 1000]"))
    }

    fn pool(&self) -> Result<TrainingPool, PoolError> {
        let threads = self.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
        TrainingPool::new(threads)
    }

    fn backtest(&self, returns: &Returns) -> Result<Backtest, BacktestError> {
        let request = self.request(returns)?.completed()?;
        let window = request.window.unwrap_or_default();
        let dates: Vec<String> = returns.rows().iter().map(|row| row.date.clone()).collect();
        let shares = |own: &OwnStrategy| Ok(OwnShares::Given(own.rows(&[], &dates, window)?.concat()));
        let weights = own_strategies(&self.weights, &self.formula, shares)?;
        Ok(Backtest::new(BacktestRequest { weights, ..request })?)
    }
}

fn centre(text: &str) -> Result<CentreSpecification, String> {
    decode::json(text.as_bytes()).map_err(|problem| problem.detail.into())
}

fn family(text: &str) -> Result<StrategyFamily, &'static str> {
    match text {
        "policy" => Ok(StrategyFamily::Policy),
        "one_step" => Ok(StrategyFamily::OneStep),
        _ => Err("must be policy or one_step"),
    }
}

fn refused(option: &str, value: impl ToString, rule: &str) -> BacktestError {
    BacktestError::Option { option: option.into(), value: value.to_string(), rule: rule.into() }
}

/// Names the option, or the file, for a field of the request.
impl From<FieldError> for BacktestError {
    fn from(FieldError { field, value, rule }: FieldError) -> Self {
        // Fields of an object belong to its option.
        let field = if ["centre.", "limits.", "means.", "weights."].iter().any(|object| field.starts_with(object)) {
            field.replacen('.', " ", 1)
        } else {
            field
        };
        // An option of its own name already.
        if field.starts_with("--") {
            return BacktestError::Option { option: field, value, rule };
        }
        let option = match (field.strip_prefix("simple_returns"), field.strip_prefix("assets")) {
            (Some(at), _) => format!("the file{at}"),
            (None, Some(at)) => format!("--column{at}"),
            (None, None) => format!("--{}", field.replace('_', "-")),
        };
        BacktestError::Option { option, value, rule }
    }
}

impl BacktestPage {
    /// Renders the report as a page.
    fn page(&self) -> Result<String, FileError> {
        let (report, read) = (&self.report, self.returns.sentence());
        let dates = report.dates.as_deref().unwrap_or_default();
        page("backtest.js", "Backtest", dates, &ReportOfRecord { report, read: &read }, &report.sentences)
    }

    /// Returns the periods that are decided, after the first window.
    pub fn rows(&self) -> &[Row] {
        &self.returns.rows()[self.walked.backtest.walk.window..]
    }
}

/// Decides every period, and computes the accounts and the figures.
fn walk(args: &BacktestArgs, returns: Returns) -> Result<BacktestPage, BacktestError> {
    let backtest = args.backtest(&returns)?;
    let steps = Parts::new(backtest.steps(), "steps of trainings");
    let walked = args.pool()?.install(|| backtest.run(&Watch::unwatched(), &|| steps.one_more()))?;
    steps.finish();
    let report = BacktestReport::new(&walked);
    Ok(BacktestPage { walked, report, returns })
}

fn file(folder: &Path, name: &str, text: &str) -> Result<(), BacktestError> {
    let path = folder.join(name);
    std::fs::write(&path, text).map_err(|source| BacktestError::Write { path, source })
}

#[cfg(test)]
mod tests {
    use ballast::returns::Choices;
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: BacktestArgs,
    }

    fn arguments(more: &[&str]) -> BacktestArgs {
        let usual = ["backtest", "returns.csv", "--out", "report", "--window", "24", "--count", "10"];
        Line::try_parse_from(usual.iter().chain(more)).unwrap().args
    }

    fn risky_return(index: usize) -> f64 {
        0.02 + 0.03 * (1.7 * index as f64).sin()
    }

    fn months(count: usize) -> Returns {
        let month = |index| format!("{:04}-{:02},{}\n", 2000 + index / 12, index % 12 + 1, risky_return(index));
        let text: String = (0..count).map(month).collect();
        Returns::parse(&format!("date,return\n{text}"), &Choices::default(), Some(0.002), None).unwrap()
    }

    fn quarters(count: usize) -> Returns {
        let quarter = |index| format!("{:04}-{:02},{}\n", 2000 + index / 4, 3 * (index % 4) + 3, risky_return(index));
        let text: String = (0..count).map(quarter).collect();
        Returns::parse(&format!("date,return\n{text}"), &Choices::default(), Some(0.006), None).unwrap()
    }

    #[test]
    fn the_same_arguments_give_the_same_report() {
        let made = || walk(&arguments(&["--alpha", "0.3,0.9,0.5", "--cost-bp", "10"]), months(36)).unwrap();
        let (one, other) = (made(), made());
        assert_eq!(files::periods(&one), files::periods(&other));
        assert_eq!(one.report, other.report);
        assert_eq!(files::periods(&one).lines().count(), 1 + 12 * one.walked.lines.len());
        assert_eq!(one.report.whole_years, 1);
        let page = one.page().unwrap();
        assert!(page.contains("Cautious, learns, 10 %") && page.contains("Trading costs 10 bp"), "{page}");
        assert!(page.contains("Whole years: 1. Comparing the strategies takes at least 30."), "{page}");
    }

    /// Checks that two trainings cover the year after the window, and that yearly figures count its four quarters.
    #[test]
    fn quarters_are_walked_through_and_told_as_quarters() {
        let args = arguments(&["--every", "2", "--horizon", "3", "--alpha", "0.5"]);
        let shown = walk(&args, quarters(24 + 4)).unwrap();
        let BacktestReport { choices, strategies, whole_years, dates, .. } = &shown.report;
        assert_eq!((choices.window, choices.every, choices.horizon, *whole_years), (24, 2, 3, 1));
        assert_eq!(dates.as_ref().unwrap()[0], "2006-03");
        let stock = strategies.iter().find(|figures| figures.strategy == "All in stocks").unwrap();
        let mean = (24..28).map(risky_return).sum::<f64>() / 4.0;
        assert!((stock.performance.annual_mean.value - ((1.0 + mean).powi(4) - 1.0)).abs() < 1e-12, "{stock:?}");
        assert_eq!(files::periods(&shown).lines().nth(1).unwrap().split(',').next(), Some("2006-03"));
        assert!(shown.page().unwrap().contains("<title>Backtest, 2006-03 to 2006-12</title>"));
    }

    #[test]
    fn what_is_not_said_follows_from_the_frequency_and_from_what_is() {
        let returns = quarters(24 + 4);
        let choices_of = |more: &[&str]| {
            let line = ["backtest", "returns.csv", "--out", "report"];
            let backtest = Line::try_parse_from(line.iter().chain(more)).unwrap().args.backtest(&returns);
            let choices = |Backtest { walk, .. }: Backtest| (walk.window, walk.every, walk.horizon);
            backtest.map(choices).map_err(|error| error.to_string())
        };
        // The file has fewer than twenty-one years, so half of the record is used.
        assert_eq!(choices_of(&[]), Ok((14, 4, 4)));
        assert_eq!(choices_of(&["--window", "20"]), Ok((20, 4, 4)));
        assert_eq!(choices_of(&["--window", "20", "--every", "6"]), Ok((20, 6, 6)));
        assert_eq!(choices_of(&["--window", "20", "--horizon", "3"]), Ok((20, 3, 3)));
        assert_eq!(choices_of(&["--window", "20", "--horizon", "9"]), Ok((20, 4, 9)));
    }

    #[test]
    fn options_that_break_a_rule_are_named() {
        let message = |more: &[&str]| walk(&arguments(more), months(48)).err().unwrap().to_string();
        assert_eq!(message(&["--cost-bp", "2000"]), "--cost-bp is 2000: must lie in [0, 1000]");
        assert_eq!(message(&["--risk-aversion", "0.5"]), "--risk-aversion is 0.5: must be a number in [1, 100]");
        assert_eq!(message(&["--alpha", "0.1,0.2,0.3,0.4"]), "--alpha is 4 levels: must hold 1 to 3");
        let every = "must be at least 1 and at most horizon: each policy is used until the next is trained";
        assert_eq!(message(&["--every", "0"]), format!("--every is 0: {every}"));
        assert_eq!(message(&["--every", "7", "--horizon", "6"]), format!("--every is 7: {every}"));
        let long = BacktestArgs { window: vec![Window::Last(50)], ..arguments(&[]) };
        let short = walk(&long, months(48)).err().unwrap().to_string();
        assert_eq!(
            short,
            "--window is 50: must be at most 36: the record has 48 periods, and a year of 12 must follow the window"
        );
        let few = BacktestArgs { count: Some(3), ..arguments(&[]) };
        let few = walk(&few, months(48)).err().unwrap().to_string();
        assert_eq!(few, "--count is 3: must lie in [10, 10000]");
        let scaled = "--centre kind is volatility_scaled: must be another centre if the horizon exceeds 1";
        let centre = r#"{"kind": "volatility_scaled", "half_life": 12}"#;
        assert!(message(&["--centre", centre]).starts_with(scaled), "{}", message(&["--centre", centre]));
        let wide = message(&["--centre", r#"{"kind": "smoothed", "bandwidth": 2}"#]);
        assert_eq!(wide, "--centre bandwidth is 2: must be a number in [0, 1]");
        assert_eq!(message(&["--scale", "1000"]), "--scale is 1000: must be a number in [0, 100]");
        assert_eq!(message(&["--alpha", "0.1,2"]), "--alpha[1] is 2: must be a number in [0.001, 0.999]");
    }
}
