//! What to hold of several assets, by rule.

use super::AssetsBacktest;
use crate::control::assets::advising::floors;
use crate::control::assets::{AssetsLaw, AssetsSolution, AssetsStep};
use crate::control::error::TrainError;
use crate::control::evaluation::names::{StrategyKind, caution_in_words};
use crate::control::problem::actions::ActionInterval;
use crate::control::problem::utility::RelativeUtility;
use crate::control::progress::Watch;
use crate::control::request::fund::GroundNorm;
use crate::control::request::support::Support;
use crate::numerics::least_variance::least_variance;
use crate::numerics::levelling::inverse_volatility;

/// How shares of wealth are found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rule {
    /// The one-step problem, solved in every period. At scale 0 it is plug-in: the empirical law is taken as true.
    Robust {
        /// What moving a law costs the adversary.
        norm: GroundNorm,
        /// Times the radius.
        scale: f64,
    },
    /// The same, solved at the start of every stretch and kept.
    Static {
        /// What moving a law costs the adversary.
        norm: GroundNorm,
        /// Times the radius.
        scale: f64,
    },
    /// All wealth at the least variance.
    MinimumVariance,
    /// All wealth, in inverse proportion to the deviations of the returns.
    InverseVolatility,
    /// The same share in every asset.
    Equal {
        /// In all of them together.
        share: f64,
    },
}

/// A rule, and how many of the last periods it knows; all since the first where that is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AssetsStrategy {
    /// How it finds its shares.
    pub rule: Rule,
    /// Periods.
    pub window: Option<usize>,
}

/// Multiples of the radius that are walked.
const SCALES: [f64; 2] = [0.5, 1.0];

/// Those that are walked for each window, and the two that know nothing.
pub fn strategies(windows: &[Option<usize>]) -> Vec<AssetsStrategy> {
    let norms = [GroundNorm::ScaledOne, GroundNorm::Sup];
    let robust = norms.into_iter().flat_map(|norm| SCALES.map(|scale| Rule::Robust { norm, scale }));
    let others = [
        Rule::Static { norm: GroundNorm::ScaledOne, scale: SCALES[0] },
        Rule::Robust { norm: GroundNorm::Sup, scale: 0.0 },
        Rule::MinimumVariance,
        Rule::InverseVolatility,
    ];
    let rules: Vec<Rule> = robust.chain(others).collect();
    let of_windows = windows.iter().flat_map(|&window| rules.iter().map(move |&rule| AssetsStrategy { rule, window }));
    let equal = [1.0, 0.6].map(|share| AssetsStrategy { rule: Rule::Equal { share }, window: None });
    of_windows.chain(equal).collect()
}

impl Rule {
    /// Its kind, whatever its scale.
    pub fn kind(self) -> StrategyKind {
        match self {
            Rule::Robust { scale: 0.0, .. } => StrategyKind::PlugIn,
            Rule::Robust { norm: GroundNorm::ScaledOne, .. } => StrategyKind::Robust,
            Rule::Robust { norm: GroundNorm::Sup, .. } => StrategyKind::RobustSup,
            Rule::Static { .. } => StrategyKind::RobustStatic,
            Rule::MinimumVariance => StrategyKind::MinimumVariance,
            Rule::InverseVolatility => StrategyKind::InverseVolatility,
            Rule::Equal { share: 1.0 } => StrategyKind::EqualShares,
            Rule::Equal { .. } => StrategyKind::SixtyEqual,
        }
    }

    /// Times the radius, where there is one.
    pub fn scale(self) -> Option<f64> {
        match self {
            Rule::Robust { scale, .. } | Rule::Static { scale, .. } => Some(scale).filter(|scale| *scale > 0.0),
            _ => None,
        }
    }
}

/// Shares that are the same in every asset.
pub fn equal(assets: usize, share: f64) -> Vec<f64> {
    vec![share / assets as f64; assets]
}

impl AssetsStrategy {
    /// In words; `known` says of the window what it is.
    pub fn name(&self, known: impl Fn(Option<usize>) -> String) -> String {
        let caution = self.rule.scale().map_or(String::new(), |scale| format!(", {}", caution_in_words(scale)));
        let window = match self.rule {
            Rule::Equal { .. } => String::new(),
            _ => format!(", knows {}", known(self.window)),
        };
        format!("{}{caution}{window}", self.rule.kind().name())
    }

    /// Shares of wealth in every period decided about; `radii` are those of the stretches. `done` hears of every stretch.
    ///
    /// # Errors
    /// [`TrainError::Stopped`].
    pub fn decide(
        &self,
        backtest: &AssetsBacktest,
        radii: &[f64],
        watch: &Watch,
        done: &(dyn Fn() + Sync),
    ) -> Result<Vec<Vec<f64>>, TrainError> {
        let (every, first, periods) = (backtest.choices.every, backtest.first, backtest.record.rows.len());
        let (mut last, mut held): (Option<AssetsSolution>, Vec<Vec<f64>>) = (None, Vec::new());
        for period in first..periods {
            watch.go_on()?;
            let (stretch, is_start) = ((period - first) / every, (period - first).is_multiple_of(every));
            if is_start && period > first {
                done();
            }
            let rows = backtest.record.known(period, self.window);
            let kept = held.last().filter(|_| matches!(self.rule, Rule::Static { .. }) && !is_start);
            let shares = match (kept, self.rule) {
                (Some(kept), _) => kept.clone(),
                (None, Rule::MinimumVariance) => least_variance(&covariance(rows)),
                (None, Rule::InverseVolatility) => inverse_volatility(rows),
                (None, Rule::Equal { share }) => equal(rows[0].len(), share),
                (None, Rule::Robust { norm, scale } | Rule::Static { norm, scale }) => {
                    let step = step(backtest, period, rows, norm, scale * radii[stretch]);
                    last.insert(step.solve(last.as_ref())).allocation.clone()
                }
            };
            held.push(shares);
        }
        done();
        Ok(held)
    }
}

/// The one-step problem before a period. The bank is taken to go on paying what it paid last.
fn step(backtest: &AssetsBacktest, period: usize, rows: &[Vec<f64>], norm: GroundNorm, radius: f64) -> AssetsStep {
    let rate = backtest.record.bank[period - 1];
    // Under power and log utility wealth changes nothing.
    let utility = RelativeUtility::new(backtest.utility(), 1.0 + rate);
    let law = AssetsLaw { returns: rows, radius, floors: floors(Support::None {}, rows) };
    AssetsStep::new(law, norm.at(rows), utility, rate, ActionInterval { lowest: 0.0, highest: 1.0 })
}

/// Of log-returns, date by date.
fn covariance(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let (count, width) = (rows.len() as f64, rows[0].len());
    let mean = |asset: usize| rows.iter().map(|row| row[asset]).sum::<f64>() / count;
    let means: Vec<f64> = (0..width).map(mean).collect();
    let between =
        |i: usize, j: usize| rows.iter().map(|row| (row[i] - means[i]) * (row[j] - means[j])).sum::<f64>() / count;
    (0..width).map(|i| (0..width).map(|j| between(i, j)).collect()).collect()
}
