//! Walk-forward of a file of several assets, by a trained policy or the one-step problem, and by common rules.

use ballast::control::evaluation::assets::report::{AssetsBacktestReport, AssetsChoices};
use ballast::control::evaluation::assets::{AssetsBacktest, AssetsRecord, AssetsWalked};
use ballast::control::progress::Watch;
use ballast::control::request::own_weights::OwnShares;
use ballast::report::FileError;

use super::weights::{OwnStrategy, own_strategies};
use super::{BacktestArgs, BacktestError, ReportOfRecord, Window, page, refused};
use crate::command::progress::Parts;
use crate::command::returns::SeveralReturns;

pub mod files;

/// Everything the page is made from.
pub struct AssetsBacktestPage {
    pub walked: AssetsWalked,
    pub report: AssetsBacktestReport,
    /// Sentence on the returns that were read.
    pub read: String,
}

impl AssetsBacktestPage {
    /// Renders the report as a page.
    pub fn page(&self) -> Result<String, FileError> {
        let (report, read) = (&self.report, &self.read);
        let name = format!("Backtest of {} assets", report.assets.len());
        page("backtest.js", &name, &report.dates, &ReportOfRecord { report, read }, &report.sentences)
    }
}

impl BacktestArgs {
    /// Builds the walk-forward that these arguments request.
    fn of_assets(&self, record: AssetsRecord) -> Result<AssetsBacktest, BacktestError> {
        let of_one = [
            ("--cost-blind", self.cost_blind.then(|| "given".to_owned())),
            ("--scale", self.scale.map(|scale| scale.to_string())),
            ("--centre", self.centre.as_ref().map(|centre| centre.name().to_owned())),
        ];
        if let Some((option, value)) = of_one.into_iter().find_map(|(option, value)| Some((option, value?))) {
            return Err(refused(option, value, "must be left out with several assets"));
        }
        if let Some(caution) = self.caution {
            return Err(refused(
                "--caution",
                caution.name(),
                "must be left out with several assets: the one-step problem is walked at every level, a policy at balanced",
            ));
        }
        let usual = AssetsChoices::usual(record.periods_per_year, record.rows.len());
        let window = |window: &Window| match window {
            Window::Last(periods) => Some(*periods),
            Window::All => None,
        };
        let windows: Vec<Option<usize>> = self.window.iter().map(window).collect();
        let alpha = match self.alpha[..] {
            [] => usual.alpha,
            [alpha] => alpha,
            _ => {
                return Err(refused(
                    "--alpha",
                    format!("{} levels", self.alpha.len()),
                    "must be one level if there are several assets",
                ));
            }
        };
        let choices = AssetsChoices {
            strategies: if self.strategies.is_empty() { usual.strategies } else { self.strategies.clone() },
            windows: if windows.is_empty() { usual.windows } else { windows },
            every: self.every.unwrap_or(usual.every.min(self.horizon.unwrap_or(usual.every))),
            horizon: self.horizon,
            count: self.count,
            alpha,
            support: self.support.unwrap_or(usual.support),
            means: self.means.unwrap_or_default(),
            risk_aversion: self.risk_aversion,
            trading_cost: self.trading_cost()?,
            limits: self.limits.given(),
            seed: self.seed,
        };
        let names_columns = self.returns.names_columns();
        let named = |error| match BacktestError::from(error) {
            BacktestError::Option { option, value, rule } if option == "--column" && !names_columns => {
                refused("the file", value, &format!("{rule}. Choose assets with --column, once for each"))
            }
            error => error,
        };
        let backtest = AssetsBacktest::new(record, choices).map_err(named)?;
        let AssetsRecord { assets, dates, .. } = &backtest.record;
        let rows = |own: &OwnStrategy| Ok(OwnShares::Given(own.rows(assets, dates, backtest.first)?));
        let weights = own_strategies(&self.weights, &self.formula, rows)?;
        Ok(backtest.with_own(weights)?)
    }
}

/// Decides every period, and computes the accounts and the figures.
pub fn walk(args: &BacktestArgs, returns: SeveralReturns) -> Result<AssetsBacktestPage, BacktestError> {
    let SeveralReturns { record, sentence } = returns;
    let backtest = args.of_assets(record)?;
    let parts = Parts::new(backtest.parts(), "stretches");
    let walked = args.pool()?.install(|| backtest.run(&Watch::unwatched(), &|| parts.one_more()))?;
    parts.finish();
    let report = AssetsBacktestReport::new(&walked);
    Ok(AssetsBacktestPage { walked, report, read: sentence })
}
