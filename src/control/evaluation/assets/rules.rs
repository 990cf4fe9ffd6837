//! Rules that choose the shares of several assets.

use super::{AssetsBacktest, AssetsDecisions, AssetsRecord};
use crate::control::assets::advising::{FundsBall, floors};
use crate::control::assets::{AssetsSolution, PortfolioStep, ReturnScenarios};
use crate::control::cache::Cache;
use crate::control::error::TrainError;
use crate::control::evaluation::names::{StrategyKind, caution_in_words};
use crate::control::problem::actions::ActionInterval;
use crate::control::problem::compositions::CompositionSet;
use crate::control::problem::utility::RelativeUtility;
use crate::control::progress::Watch;
use crate::control::request::asset_history::AssetHistory;
use crate::control::request::backtest_assets::StrategyFamily;
use crate::control::request::caution::CautionLevel;
use crate::control::request::fund::GroundNorm;
use crate::numerics::transport::least_variance::least_variance;
use crate::numerics::transport::water_filling::inverse_volatility;

/// A rule that chooses shares of wealth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rule {
    /// The policy of the assets' fund, trained anew at the start of every block of periods.
    Policy {
        /// Share of the radius that is used.
        caution: CautionLevel,
    },
    /// The one-step problem, solved in every period. With no caution it is plug-in: the empirical law is taken as true.
    Robust {
        /// The adversary's cost of moving a law.
        norm: GroundNorm,
        /// Share of the radius that is used.
        caution: CautionLevel,
    },
    /// The one-step problem under the norm `scaled_one`, solved at the start of every block of periods and kept.
    Static {
        /// Share of the radius that is used.
        caution: CautionLevel,
    },
    /// All wealth at minimum variance.
    MinimumVariance,
    /// All wealth, in inverse proportion to the deviations of the returns.
    InverseVolatility,
    /// The shares of a strategy of the user's own, by its place among those.
    Own {
        /// Its place in the order of their names.
        place: usize,
    },
    /// An equal share in every asset.
    Equal {
        /// Share in all assets together.
        share: f64,
    },
}

/// A rule, and how many of the last periods it knows; none means all since the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AssetsStrategy {
    /// How it chooses its shares.
    pub rule: Rule,
    /// Number of periods it knows.
    pub window: Option<usize>,
}

/// Levels of caution that are compared, the default first: under the norm `scaled_one`, and under `sup`.
const LEVELS: [CautionLevel; 4] =
    [CautionLevel::Balanced, CautionLevel::Bold, CautionLevel::Cautious, CautionLevel::Paper];
const SUP_LEVELS: [CautionLevel; 2] = [CautionLevel::Balanced, CautionLevel::Paper];
/// The caution that uses none of the radius and so trusts the record.
pub const NONE: CautionLevel = CautionLevel::Scale(0.0);

/// Returns the rules of a family.
fn rules_of(family: StrategyFamily) -> Vec<Rule> {
    let robust = LEVELS.into_iter().map(|caution| Rule::Robust { norm: GroundNorm::ScaledOne, caution });
    let sup = SUP_LEVELS.into_iter().map(|caution| Rule::Robust { norm: GroundNorm::Sup, caution });
    let others =
        [Rule::Static { caution: CautionLevel::Balanced }, Rule::Robust { norm: GroundNorm::Sup, caution: NONE }];
    match family {
        StrategyFamily::Policy => vec![Rule::Policy { caution: CautionLevel::Balanced }],
        StrategyFamily::OneStep => robust.chain(sup).chain(others).collect(),
    }
}

/// Returns the strategies compared for each window, and the two that use no returns.
pub fn strategies(windows: &[Option<usize>], families: &[StrategyFamily]) -> Vec<AssetsStrategy> {
    let of_families = families.iter().flat_map(|family| rules_of(*family));
    let rules: Vec<Rule> = of_families.chain([Rule::MinimumVariance, Rule::InverseVolatility]).collect();
    let of_windows = windows.iter().flat_map(|&window| rules.iter().map(move |&rule| AssetsStrategy { rule, window }));
    let equal = [1.0, 0.6].map(|share| AssetsStrategy { rule: Rule::Equal { share }, window: None });
    of_windows.chain(equal).collect()
}

impl Rule {
    /// Returns the kind of the rule.
    pub fn kind(self) -> StrategyKind {
        match self {
            Rule::Policy { .. } => StrategyKind::Policy,
            Rule::Robust { caution: NONE, .. } => StrategyKind::PlugIn,
            Rule::Robust { norm: GroundNorm::ScaledOne, .. } => StrategyKind::Robust,
            Rule::Robust { norm: GroundNorm::Sup, .. } => StrategyKind::RobustSup,
            Rule::Static { .. } => StrategyKind::RobustStatic,
            Rule::MinimumVariance => StrategyKind::MinimumVariance,
            Rule::InverseVolatility => StrategyKind::InverseVolatility,
            Rule::Equal { share: 1.0 } => StrategyKind::EqualShares,
            Rule::Equal { .. } => StrategyKind::SixtyEqual,
            Rule::Own { .. } => StrategyKind::Own,
        }
    }

    /// Returns true if the rule trains policies.
    pub fn is_policy(self) -> bool {
        matches!(self, Rule::Policy { .. })
    }

    /// Returns the level of caution, if the rule uses a radius.
    pub fn caution(self) -> Option<CautionLevel> {
        match self {
            Rule::Policy { caution } | Rule::Robust { caution, .. } | Rule::Static { caution, .. } => {
                Some(caution).filter(|level| *level != NONE)
            }
            _ => None,
        }
    }
}

/// Returns shares that are the same in every asset.
pub fn equal(assets: usize, share: f64) -> Vec<f64> {
    vec![share / assets as f64; assets]
}

impl AssetsStrategy {
    /// Returns the name in words; `known` describes the window.
    pub fn name(&self, known: impl Fn(Option<usize>) -> String) -> String {
        let caution = self.rule.caution().map_or(String::new(), |level| format!(", {}", caution_in_words(level)));
        let window = match self.rule {
            Rule::Equal { .. } | Rule::Own { .. } => String::new(),
            _ => format!(", knows {}", known(self.window)),
        };
        format!("{}{caution}{window}", self.rule.kind().name())
    }

    /// Returns the decisions of all periods; `balls` are those of the blocks of periods. `done` is called after every
    /// block.
    ///
    /// # Errors
    /// As [`FundWalk::tenure`](super::policy::FundWalk::tenure).
    pub fn decide(
        &self,
        backtest: &AssetsBacktest,
        balls: &[FundsBall],
        watch: &Watch,
        done: &(dyn Fn() + Sync),
    ) -> Result<AssetsDecisions, TrainError> {
        if let Some(walk) = backtest.fund_walk(*self) {
            let lived = walk.run(watch, &Cache::default(), |_, tenure| tenure().inspect(|_| done()));
            return lived.map(AssetsDecisions::Lived);
        }
        let (every, first, periods) = (backtest.choices.every, backtest.first, backtest.record.rows.len());
        let (mut last, mut held): (Option<AssetsSolution>, Vec<Vec<f64>>) = (None, Vec::new());
        for period in first..periods {
            watch.go_on()?;
            let (stretch, is_start) = ((period - first) / every, (period - first).is_multiple_of(every));
            if is_start && period > first {
                done();
            }
            let rows = &backtest.record.known(period, self.window);
            let compositions = backtest.compositions(held.last().map(|shares: &Vec<f64>| (period, shares)));
            let mut solved = |norm: GroundNorm, caution: CautionLevel| {
                let step = step(backtest, period, rows, norm, balls[stretch].radius_at(caution));
                let step = step.within(compositions.clone());
                last.insert(step.solve(last.as_ref())).allocation.clone()
            };
            let kept = held.last().filter(|_| matches!(self.rule, Rule::Static { .. }) && !is_start);
            let shares = match (kept, self.rule) {
                (Some(kept), _) => kept.clone(),
                (None, Rule::MinimumVariance) => match &compositions {
                    Some(compositions) => compositions.least_variance(&covariance(rows)),
                    None => least_variance(&covariance(rows)),
                },
                (None, Rule::InverseVolatility) => inverse_volatility(rows),
                (None, Rule::Equal { share }) => equal(rows[0].len(), share),
                (None, Rule::Own { place }) => backtest.own[place].1[period].clone(),
                (None, Rule::Robust { norm, caution }) => solved(norm, caution),
                (None, Rule::Static { caution } | Rule::Policy { caution }) => solved(GroundNorm::ScaledOne, caution),
            };
            held.push(match self.rule {
                Rule::Own { .. } => shares,
                _ => nearest(compositions.as_ref(), shares),
            });
        }
        done();
        Ok(AssetsDecisions::Shares(held))
    }
}

impl AssetsBacktest {
    /// Returns the compositions that the limits allow; `None` without limits. `held` is a period and the shares of wealth
    /// held through the one before, from which a turnover counts.
    fn compositions(&self, held: Option<(usize, &Vec<f64>)>) -> Option<CompositionSet> {
        let AssetsRecord { assets, rows, .. } = &self.record;
        let grown = match held {
            Some((period, shares)) => shares.iter().zip(&rows[period - 1]).map(|(share, z)| share * z.exp()).collect(),
            None => vec![0.0; assets.len()],
        };
        self.choices.limits.as_ref().map(|limits| limits.compositions(assets, &grown))
    }

    /// Returns shares of wealth of the nearest composition within the limits, without holdings before.
    pub(super) fn allowed(&self, shares: Vec<f64>) -> Vec<f64> {
        nearest(self.compositions(None).as_ref(), shares)
    }
}

/// Returns shares of the same sum, of the nearest composition allowed.
fn nearest(compositions: Option<&CompositionSet>, shares: Vec<f64>) -> Vec<f64> {
    let total: f64 = shares.iter().sum();
    match compositions {
        Some(compositions) if total > 0.0 => {
            let composition = compositions.nearest(shares.iter().map(|share| share / total).collect());
            composition.iter().map(|share| total * share).collect()
        }
        _ => shares,
    }
}

/// Returns the one-step problem before a period. The bank is assumed to keep paying its last rate.
fn step(
    backtest: &AssetsBacktest,
    period: usize,
    known: &AssetHistory,
    norm: GroundNorm,
    radius: f64,
) -> PortfolioStep {
    let rate = backtest.record.bank[period - 1];
    // Under power and log utility the solution does not depend on wealth.
    let utility = RelativeUtility::new(backtest.utility(), 1.0 + rate);
    let rows = &backtest.choices.means.applied(known);
    let law = ReturnScenarios { returns: rows, radius, floors: floors(backtest.choices.support, rows) };
    PortfolioStep::new(law, norm.at(rows, known), utility, rate, ActionInterval { lowest: 0.0, highest: 1.0 })
}

/// Returns the covariance of log-returns, given date by date.
fn covariance(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let (count, width) = (rows.len() as f64, rows[0].len());
    let mean = |asset: usize| rows.iter().map(|row| row[asset]).sum::<f64>() / count;
    let means: Vec<f64> = (0..width).map(mean).collect();
    let between =
        |i: usize, j: usize| rows.iter().map(|row| (row[i] - means[i]) * (row[j] - means[j])).sum::<f64>() / count;
    (0..width).map(|i| (0..width).map(|j| between(i, j)).collect()).collect()
}
