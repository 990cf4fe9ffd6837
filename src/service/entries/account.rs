//! The account of each period: what the bank paid, what was added and traded, and what simple rules would have made of
//! the same start.

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::assets::fund::Fund;
use crate::control::problem::dynamics::Dynamics;
use crate::control::request::asset_history::AssetHistory;
use crate::control::request::means::MeansRule;
use crate::service::entries::periods::{Periods, ReplayedPeriod};
use crate::service::entries::record::SessionRecord;
use crate::service::error::ServiceError;
use crate::service::sessions::account_state::{AccountPeriod, AccountState};

/// Money of a period, after all corrections.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PeriodAccount {
    /// Rate that the bank paid.
    pub rate: f64,
    /// Money added at the end; negative if withdrawn.
    pub flow: f64,
    /// Money spent at the start; left out if it is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spent: Option<f64>,
    /// Share of wealth bought and sold at the start, in all assets together.
    pub turnover: f64,
    /// Money that these trades cost.
    pub cost: f64,
    pub benchmarks: Benchmarks,
}

/// Wealth at the end of a period, had a simple rule been followed from the start of the session: with the same wealth,
/// holdings, rates, flows, spending and trading cost. Null once a rule cannot pay them.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Benchmarks {
    /// Equal shares of all wealth in every asset, restored at the start of each period.
    pub equal_weights: Option<f64>,
    /// All wealth in the fund's first composition, restored at the start of each period. The share of an asset that
    /// leaves is spread over those that stay, in proportion.
    pub initial_composition: Option<f64>,
    /// All wealth in the bank.
    pub bank: Option<f64>,
}

/// The account of somebody who restores the same composition and share of wealth at the start of each period.
#[derive(Debug, Clone)]
struct FixedShares {
    /// `None` once a withdrawal could not be paid.
    wealth: Option<f64>,
    /// The composition that is restored, and what is held before trading.
    fund: Fund,
    /// Share of wealth in all assets that is restored.
    total: f64,
    /// Share of wealth in assets that left, to be sold before the coming period.
    sold: f64,
}

impl FixedShares {
    fn at(start: &AccountState, composition: Vec<f64>, total: f64) -> Self {
        let holdings = match &start.assets {
            Some(assets) => assets.fund.holdings.clone(),
            None => vec![start.state.holding],
        };
        let fund = Fund {
            rows: AssetHistory::default(),
            means: MeansRule::default(),
            before: composition.clone(),
            composition,
            holdings,
        };
        FixedShares { wealth: Some(start.state.wealth), fund, total, sold: 0.0 }
    }

    /// Follows a change of the assets from those with the names `before` to those with the names `after`.
    fn change(&mut self, before: &[String], after: &[String]) {
        let of = |values: &[f64], name| before.iter().position(|own| own == name).map_or(0.0, |own| values[own]);
        let kept = |values: &[f64]| after.iter().map(|name| of(values, name)).collect::<Vec<f64>>();
        let (holdings, composition) = (kept(&self.fund.holdings), kept(&self.fund.composition));
        let whole: f64 = composition.iter().sum();
        self.sold = self.fund.holdings.iter().sum::<f64>() - holdings.iter().sum::<f64>();
        self.fund.holdings = holdings;
        self.fund.composition = match whole > 0.0 {
            true => composition.iter().map(|share| share / whole).collect(),
            // None of its assets stays.
            false => equal(after.len()),
        };
    }

    /// Returns the wealth after a period of these log-returns, at the start of which `spent` was spent.
    fn pass(&mut self, (dynamics, spent): (Dynamics, f64), log_returns: &[f64]) -> Option<f64> {
        let shares = self.fund.shares(self.total);
        let (traded, log_return) = (self.fund.traded(&shares), self.fund.log_return(&shares, log_returns));
        let traded = traded + std::mem::take(&mut self.sold);
        let left = Some(self.wealth.take()? - spent).filter(|left| *left > 0.0)?;
        let (next, holding) = dynamics.next_after(left, traded, self.total, log_return);
        self.fund.passed(&shares, log_returns, None, holding);
        self.wealth = (next > 0.0).then_some(next);
        self.wealth
    }
}

/// Returns equal shares of so many assets.
fn equal(assets: usize) -> Vec<f64> {
    vec![1.0 / assets as f64; assets]
}

/// The account of every period.
pub(super) struct Accounts {
    pub accounts: Vec<PeriodAccount>,
    /// The returns behind the law after the last period.
    pub record: SessionRecord,
}

/// Returns the account of every period.
///
/// # Errors
/// A recorded report no longer keeps the rules.
pub(super) fn of(periods: &Periods) -> Result<Accounts, ServiceError> {
    let mut passage = periods.passage()?;
    let start = passage.standing.account()?;
    let assets = start.names().len().max(1);
    let composition = start.assets.as_ref().map_or_else(|| vec![1.0], |assets| assets.fund.composition.clone());
    let mut equal_weights = FixedShares::at(start, equal(assets), 1.0);
    let mut initial = FixedShares::at(start, composition.clone(), 1.0);
    let mut bank = FixedShares::at(start, composition, 0.0);
    let mut names = start.names().to_vec();
    let mut accounts = Vec::with_capacity(periods.all.len());
    loop {
        if names != passage.standing.names() {
            let next = passage.standing.names().to_vec();
            [&mut equal_weights, &mut initial, &mut bank].into_iter().for_each(|rule| rule.change(&names, &next));
            equal_weights.fund.composition = equal(next.len());
            names = next;
        }
        let Some(passed) = passage.next().map_err(ServiceError::of_recorded)? else { break };
        let ReplayedPeriod { before, seen, moved } = passed;
        let period = moved.account()?;
        let AccountPeriod { turnover, spent, dynamics, .. } = *period;
        let moves = seen.moves();
        accounts.push(PeriodAccount {
            rate: dynamics.rate_per_step,
            flow: dynamics.contribution,
            spent: period.reported_spending(),
            turnover,
            cost: before.account()?.state.wealth * dynamics.trading_cost * turnover,
            benchmarks: Benchmarks {
                equal_weights: equal_weights.pass((dynamics, spent), &moves),
                initial_composition: initial.pass((dynamics, spent), &moves),
                bank: bank.pass((dynamics, spent), &moves),
            },
        });
    }
    Ok(Accounts { accounts, record: passage.record })
}
