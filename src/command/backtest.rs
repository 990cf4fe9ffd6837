//! `ballast backtest`: the walk-forward report on real returns.
//!
//! Every year a policy is trained on the window of months before it and lived by for twelve months; nothing later than a
//! month is used for its allocation. What comes out is a page to read, and the same as JSON and CSV.

use std::path::{Path, PathBuf};
use std::time::Instant;

use ballast::control::error::TrainError;
use ballast::control::evaluation::rolling::{Period, Strategy, WalkForward};
use ballast::control::pool::{PoolError, TrainingPool};
use ballast::control::progress::Watch;
use ballast::report::ChartError;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use thiserror::Error;

use super::monthly_returns::{Month, MonthlyReturns, ReturnsError};
use analysis::{Analysis, Line};

mod analysis;
mod files;
mod page;
mod verdict;

pub const MONTHS_PER_YEAR: usize = 12;

#[derive(Debug, Clone, Args)]
pub struct BacktestArgs {
    /// Monthly returns: date,risky_return[,risk_free_return]; simple, as fractions, oldest first
    file: PathBuf,
    /// Folder for report.html, report.json, months.csv and strategies.csv; made if absent
    #[arg(long)]
    out: PathBuf,
    /// Months of history that each year's policy is trained on
    #[arg(long, default_value_t = 240)]
    window: usize,
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
    #[error("the file holds {found} months: must hold at least {wanted}, the window and a year")]
    TooShort { found: usize, wanted: usize },
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
    pub walk: WalkForward,
    /// The months decided about, after the first window.
    pub months: Vec<Month>,
    pub lines: Vec<Line>,
    pub analysis: Analysis,
    pub seconds: f64,
}

/// Trains, counts and writes.
pub fn run(args: &BacktestArgs) -> Result<(), BacktestError> {
    let returns = MonthlyReturns::read(&args.file)?;
    let backtest = walk(args, returns.months())?;
    files::write(&backtest, &args.out)?;
    let sentences = verdict::sentences(&backtest);
    sentences.iter().for_each(|sentence| println!("{sentence}"));
    println!("\nThe report is {}.", args.out.join(files::PAGE).display());
    Ok(())
}

impl BacktestArgs {
    fn check(&self, months: usize) -> Result<(), BacktestError> {
        let wanted = self.window.max(2) + MONTHS_PER_YEAR;
        if months < wanted {
            return Err(BacktestError::TooShort { found: months, wanted });
        }
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

/// Decides every month, keeps the books, and measures them.
fn walk(args: &BacktestArgs, months: &[Month]) -> Result<Backtest, BacktestError> {
    args.check(months.len())?;
    let started = Instant::now();
    let (window, risk_aversion, count, seed) = (args.window, args.risk_aversion, args.count, args.seed);
    let trading_cost = if args.cost_blind { 0.0 } else { args.cost() };
    let walk = WalkForward { window, year: MONTHS_PER_YEAR, risk_aversion, trading_cost, count, seed };
    let period = |month: &Month| Period { log_return: month.risky_return.ln_1p(), bank_return: month.risk_free_return };
    let periods: Vec<Period> = months.iter().map(period).collect();
    let (names, strategies): (Vec<String>, Vec<Strategy>) = args.strategies().into_iter().unzip();
    let threads = args.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let pool = TrainingPool::new(threads)?;
    let bar = progress_bar(walk.trainings(&strategies, &periods));
    let watch = Watch::unwatched();
    let decisions = pool.install(|| walk.decide(&strategies, &periods, &watch, &|| bar.inc(1)))?;
    bar.finish_and_clear();
    let lived = &periods[window..];
    let mut lines: Vec<Line> = names
        .into_iter()
        .zip(decisions)
        .map(|(name, decisions)| Line::new(name, decisions, lived, args.cost()))
        .collect();
    let main = args.main_line();
    lines.push(lines[main].hindsight(lived, args.cost()));
    let analysis = Analysis::of(&lines, main, lived, &walk);
    let (args, months, seconds) = (args.clone(), months[window..].to_vec(), started.elapsed().as_secs_f64());
    Ok(Backtest { args, walk, months, lines, analysis, seconds })
}

fn progress_bar(trainings: usize) -> ProgressBar {
    let bar = ProgressBar::new(trainings as u64);
    if let Ok(style) = ProgressStyle::with_template("  [{bar:32}] {pos} of {len} trainings, {eta} left") {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
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

    /// Two years after a window of 24 months.
    fn months() -> Vec<Month> {
        let risky_return = |index: usize| 0.02 + 0.03 * (1.7 * index as f64).sin();
        let month = |index: usize| Month {
            month: format!("{:04}-{:02}", 2000 + index / 12, index % 12 + 1),
            risky_return: risky_return(index),
            risk_free_return: 0.002,
        };
        (0..24 + 24).map(month).collect()
    }

    #[test]
    fn the_same_arguments_give_the_same_report() {
        let year = &months()[..36];
        let made = || walk(&arguments(&["--alpha", "0.3,0.9,0.5", "--cost-bp", "10"]), year).unwrap();
        let (one, other) = (made(), made());
        assert_eq!(files::months(&one), files::months(&other));
        assert_eq!(files::summary(&one), files::summary(&other));
        assert_eq!(files::months(&one).lines().count(), 1 + 12 * one.lines.len());
        assert_eq!(one.analysis.years, 1);
        let page = page::page(&one).html().unwrap();
        assert!(page.contains("adaptive, alpha 0.9") && page.contains("Trading costs 10 bp"), "{page}");
        assert!(page.contains("The whole years are 1, fewer than 10"), "{page}");
    }

    #[test]
    fn options_that_break_a_rule_are_named() {
        let message = |more: &[&str]| walk(&arguments(more), &months()).err().unwrap().to_string();
        assert_eq!(message(&["--cost-bp", "2000"]), "--cost-bp is 2000: must lie in [0, 1000]");
        assert_eq!(message(&["--risk-aversion", "0.5"]), "--risk-aversion is 0.5: must lie in [1, 100]");
        assert_eq!(message(&["--alpha", "0.1,0.2,0.3,0.4"]), "--alpha is 4 levels: must be 1 to 3");
        let long = BacktestArgs { window: 50, ..arguments(&[]) };
        let short = walk(&long, &months()).err().unwrap().to_string();
        assert_eq!(short, "the file holds 48 months: must hold at least 62, the window and a year");
        let few = BacktestArgs { count: 3, ..arguments(&[]) };
        assert!(matches!(walk(&few, &months()), Err(BacktestError::Train(TrainError::Specification(_)))));
    }
}
