//! `ballast backtest`: the walk-forward report on real returns.
//!
//! Every so many periods, a year of them unless chosen otherwise, a policy is trained on the window before and lived by
//! until the next one; nothing later than a period is used for its allocation. What comes out is a page to read, and the
//! same as JSON and CSV.

use std::path::{Path, PathBuf};
use std::time::Instant;

use ballast::control::error::TrainError;
use ballast::control::evaluation::rolling::{Period, Strategy, WalkForward};
use ballast::control::pool::{PoolError, TrainingPool};
use ballast::control::progress::Watch;
use ballast::report::ChartError;
use clap::Args;
use thiserror::Error;

use super::returns::{Returns, ReturnsError, ReturnsFile, Row};
use analysis::{Analysis, Line, Scale};
use progress::Trainings;

mod analysis;
mod files;
mod page;
mod progress;
mod verdict;

/// Years of history that a policy is trained on.
const WINDOW_YEARS: usize = 20;

#[derive(Debug, Clone, Args)]
pub struct BacktestArgs {
    #[command(flatten)]
    returns: ReturnsFile,
    /// Folder for report.html, report.json, periods.csv and strategies.csv; made if absent
    #[arg(long)]
    out: PathBuf,
    /// Periods of history that each policy is trained on; 20 years of them unless given
    #[arg(long)]
    window: Option<usize>,
    /// Periods from one training to the next; a year of them unless given
    #[arg(long)]
    every: Option<usize>,
    /// Periods that a policy looks ahead; those to the next training unless given
    #[arg(long)]
    horizon: Option<usize>,
    /// Levels of the adaptive strategies; the static one takes the second, or the first of one
    #[arg(long, value_delimiter = ',', default_values_t = [0.05, 0.1, 0.5])]
    alpha: Vec<f64>,
    /// Relative risk aversion: 1 is log utility
    #[arg(long, default_value_t = 3.0)]
    risk_aversion: f64,
    /// Trading cost, in hundredths of a per cent of what is traded; policies are trained with it
    #[arg(long, default_value_t = 0.0)]
    cost_bp: f64,
    /// Train every policy as if trading were free
    #[arg(long)]
    cost_blind: bool,
    /// Design points per step: more is more accurate and slower
    #[arg(long, default_value_t = 100)]
    count: usize,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads that train; every core unless given
    #[arg(long)]
    threads: Option<usize>,
}

#[derive(Debug, Error)]
pub enum BacktestError {
    #[error("the returns cannot be used")]
    Returns(#[from] ReturnsError),
    #[error("the file holds {found} {noun}s: must hold at least {wanted}, the window (--window) and a year")]
    TooShort { found: usize, noun: &'static str, wanted: usize },
    #[error("{option} is {value}: {rule}")]
    Option { option: &'static str, value: String, rule: &'static str },
    #[error(transparent)]
    Pool(#[from] PoolError),
    #[error("training")]
    Train(#[from] TrainError),
    #[error("writing {}", path.display())]
    Write { path: PathBuf, source: std::io::Error },
    #[error("drawing the report")]
    Chart(#[from] ChartError),
    #[error("writing JSON")]
    Json(#[from] serde_json::Error),
}

/// Everything the report is made from.
pub struct Backtest {
    pub args: BacktestArgs,
    pub returns: Returns,
    pub walk: WalkForward,
    pub lines: Vec<Line>,
    pub analysis: Analysis,
    pub seconds: f64,
}

/// Trains, counts and writes.
pub fn run(args: &BacktestArgs) -> Result<(), BacktestError> {
    let returns = args.returns.read()?;
    println!("{}\n", returns.sentence());
    let backtest = walk(args, returns)?;
    files::write(&backtest, &args.out)?;
    let sentences = verdict::sentences(&backtest);
    sentences.iter().for_each(|sentence| println!("{sentence}"));
    println!("\nThe report is {}.", args.out.join(files::PAGE).display());
    Ok(())
}

impl BacktestArgs {
    /// How these returns are walked through.
    fn walk(&self, returns: &Returns) -> Result<WalkForward, BacktestError> {
        self.check()?;
        let year = returns.periods_per_year;
        let every = self.every.unwrap_or_else(|| self.horizon.map_or(year, |horizon| year.min(horizon)));
        let horizon = self.horizon.unwrap_or(every);
        if !(1..=horizon).contains(&every) {
            let rule = "must be at least 1, and at most --horizon: a policy is lived by until the next is trained";
            return Err(BacktestError::Option { option: "--every", value: every.to_string(), rule });
        }
        let window = self.window.unwrap_or(WINDOW_YEARS * year);
        let (found, wanted) = (returns.rows().len(), window.max(2).saturating_add(year));
        if found < wanted {
            return Err(BacktestError::TooShort { found, noun: returns.frequency.noun(), wanted });
        }
        let (risk_aversion, count, seed) = (self.risk_aversion, self.count, self.seed);
        let trading_cost = if self.cost_blind { 0.0 } else { self.cost() };
        Ok(WalkForward { window, every, horizon, risk_aversion, trading_cost, count, seed })
    }

    fn check(&self) -> Result<(), BacktestError> {
        if !(0.0..=1000.0).contains(&self.cost_bp) {
            let rule = "must lie in [0, 1000]";
            return Err(BacktestError::Option { option: "--cost-bp", value: self.cost_bp.to_string(), rule });
        }
        if !(1.0..=100.0).contains(&self.risk_aversion) {
            let rule = "must lie in [1, 100]";
            return Err(BacktestError::Option {
                option: "--risk-aversion",
                value: self.risk_aversion.to_string(),
                rule,
            });
        }
        // More would not be told apart on one chart.
        if !(1..=3).contains(&self.alpha.len()) {
            let (value, rule) = (format!("{} levels", self.alpha.len()), "must be 1 to 3");
            return Err(BacktestError::Option { option: "--alpha", value, rule });
        }
        Ok(())
    }

    /// As a share of what is traded.
    fn cost(&self) -> f64 {
        1e-4 * self.cost_bp
    }

    /// The line most is said about: the second adaptive strategy, or the only one.
    pub fn main_line(&self) -> usize {
        usize::from(self.alpha.len() > 1)
    }

    /// The name of the same, trained as if trading were free.
    pub fn blind_line(&self) -> String {
        format!("cost-blind, alpha {}", self.main_alpha())
    }

    /// Its level.
    pub fn main_alpha(&self) -> f64 {
        self.alpha[self.main_line()]
    }

    /// The adaptive ones first, in the order of their levels.
    fn strategies(&self) -> Vec<(String, Strategy)> {
        let adaptive =
            self.alpha.iter().map(|&alpha| (format!("adaptive, alpha {alpha}"), Strategy::Adaptive { alpha }));
        let alpha = self.main_alpha();
        let knows_cost = self.cost_bp > 0.0 && !self.cost_blind;
        let blind = knows_cost.then(|| (self.blind_line(), Strategy::CostBlind { alpha }));
        adaptive
            .chain(blind)
            .chain([
                (format!("static, alpha {alpha}"), Strategy::Static { alpha }),
                ("plug-in".into(), Strategy::PlugIn),
                ("60/40".into(), Strategy::Mix { share: 0.6 }),
                ("all-stock".into(), Strategy::Mix { share: 1.0 }),
                ("all-bank".into(), Strategy::Mix { share: 0.0 }),
            ])
            .collect()
    }
}

impl Backtest {
    /// The periods decided about, after the first window.
    pub fn rows(&self) -> &[Row] {
        &self.returns.rows()[self.walk.window..]
    }
}

/// Decides every period, keeps the books, and measures them.
fn walk(args: &BacktestArgs, returns: Returns) -> Result<Backtest, BacktestError> {
    let walk = args.walk(&returns)?;
    let started = Instant::now();
    let periods: Vec<Period> = returns.rows().iter().map(Row::period).collect();
    let (names, strategies): (Vec<String>, Vec<Strategy>) = args.strategies().into_iter().unzip();
    let threads = args.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let pool = TrainingPool::new(threads)?;
    let trainings = Trainings::new(walk.trainings(&strategies, &periods));
    let watch = Watch::unwatched();
    let decisions = pool.install(|| walk.decide(&strategies, &periods, &watch, &|| trainings.one_more()))?;
    trainings.finish();
    let lived = &periods[walk.window..];
    let mut lines: Vec<Line> = names
        .into_iter()
        .zip(decisions)
        .map(|(name, decisions)| Line::new(name, decisions, lived, args.cost()))
        .collect();
    let main = args.main_line();
    lines.push(lines[main].hindsight(lived, args.cost()));
    let scale = Scale { periods_per_year: returns.periods_per_year, utility: walk.utility(), seed: walk.seed };
    let analysis = Analysis::of(&lines, main, lived, &scale);
    let seconds = started.elapsed().as_secs_f64();
    Ok(Backtest { args: args.clone(), returns, walk, lines, analysis, seconds })
}

fn file(folder: &Path, name: &str, text: &str) -> Result<(), BacktestError> {
    let path = folder.join(name);
    std::fs::write(&path, text).map_err(|source| BacktestError::Write { path, source })
}

#[cfg(test)]
mod tests {
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
        Returns::parse(&format!("date,return\n{text}"), Some(0.002), None).unwrap()
    }

    fn quarters(count: usize) -> Returns {
        let quarter = |index| format!("{:04}-{:02},{}\n", 2000 + index / 4, 3 * (index % 4) + 3, risky_return(index));
        let text: String = (0..count).map(quarter).collect();
        Returns::parse(&format!("date,return\n{text}"), Some(0.006), None).unwrap()
    }

    #[test]
    fn the_same_arguments_give_the_same_report() {
        let made = || walk(&arguments(&["--alpha", "0.3,0.9,0.5", "--cost-bp", "10"]), months(36)).unwrap();
        let (one, other) = (made(), made());
        assert_eq!(files::periods(&one), files::periods(&other));
        assert_eq!(files::summary(&one), files::summary(&other));
        assert_eq!(files::periods(&one).lines().count(), 1 + 12 * one.lines.len());
        assert_eq!(one.analysis.years, 1);
        let page = page::page(&one).html().unwrap();
        assert!(page.contains("adaptive, alpha 0.9") && page.contains("Trading costs 10 bp"), "{page}");
        assert!(page.contains("The whole years are 1, fewer than 10"), "{page}");
    }

    /// Two trainings make the year after the window; figures of a year count its four quarters.
    #[test]
    fn quarters_are_walked_through_and_told_as_quarters() {
        let args = arguments(&["--every", "2", "--horizon", "3", "--alpha", "0.5"]);
        let backtest = walk(&args, quarters(24 + 4)).unwrap();
        let WalkForward { window, every, horizon, .. } = backtest.walk;
        assert_eq!((window, every, horizon, backtest.analysis.years), (24, 2, 3, 1));
        let stock = backtest.analysis.figures.iter().find(|figures| figures.strategy == "all-stock").unwrap();
        let mean = (24..28).map(risky_return).sum::<f64>() / 4.0;
        assert!((stock.annual_mean.value - 4.0 * mean).abs() < 1e-12, "{stock:?}");
        assert_eq!(files::periods(&backtest).lines().nth(1).unwrap().split(',').next(), Some("2006-03"));
        let page = page::page(&backtest).html().unwrap();
        assert!(page.contains("Every 2 quarters a policy is trained on the 24 quarters before"), "{page}");
        assert!(!page.contains("month"), "{page}");
    }

    #[test]
    fn what_is_not_said_follows_from_the_frequency_and_from_what_is() {
        let returns = quarters(24 + 4);
        let said = |more: &[&str]| {
            let line = ["backtest", "returns.csv", "--out", "report"];
            let walk = Line::try_parse_from(line.iter().chain(more)).unwrap().args.walk(&returns);
            walk.map(|WalkForward { window, every, horizon, .. }| (window, every, horizon)).map_err(|e| e.to_string())
        };
        let short = "the file holds 28 quarters: must hold at least 84, the window (--window) and a year";
        assert_eq!(said(&[]), Err(short.into()));
        assert_eq!(said(&["--window", "20"]), Ok((20, 4, 4)));
        assert_eq!(said(&["--window", "20", "--every", "6"]), Ok((20, 6, 6)));
        assert_eq!(said(&["--window", "20", "--horizon", "3"]), Ok((20, 3, 3)));
        assert_eq!(said(&["--window", "20", "--horizon", "9"]), Ok((20, 4, 9)));
    }

    #[test]
    fn options_that_break_a_rule_are_named() {
        let message = |more: &[&str]| walk(&arguments(more), months(48)).err().unwrap().to_string();
        assert_eq!(message(&["--cost-bp", "2000"]), "--cost-bp is 2000: must lie in [0, 1000]");
        assert_eq!(message(&["--risk-aversion", "0.5"]), "--risk-aversion is 0.5: must lie in [1, 100]");
        assert_eq!(message(&["--alpha", "0.1,0.2,0.3,0.4"]), "--alpha is 4 levels: must be 1 to 3");
        let every = "must be at least 1, and at most --horizon: a policy is lived by until the next is trained";
        assert_eq!(message(&["--every", "0"]), format!("--every is 0: {every}"));
        assert_eq!(message(&["--every", "7", "--horizon", "6"]), format!("--every is 7: {every}"));
        let long = BacktestArgs { window: Some(50), ..arguments(&[]) };
        let short = walk(&long, months(48)).err().unwrap().to_string();
        assert_eq!(short, "the file holds 48 months: must hold at least 62, the window (--window) and a year");
        let few = BacktestArgs { count: 3, ..arguments(&[]) };
        assert!(matches!(walk(&few, months(48)), Err(BacktestError::Train(TrainError::Specification(_)))));
    }
}
