//! The account of each period: what the bank paid, what was added and traded, and what simple rules would have made of
//! the same start.

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::problem::dynamics::Dynamics;
use crate::service::entries::periods::{Periods, ReplayedPeriod};
use crate::service::entries::record::SessionRecord;
use crate::service::error::ServiceError;
use crate::service::sessions::session_state::SessionState;

/// Money of a period, after all corrections.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PeriodAccount {
    /// Rate that the bank paid.
    pub rate: f64,
    /// Money added at the end; negative if withdrawn.
    pub flow: f64,
    /// Share of wealth bought and sold at the start, in all assets together.
    pub turnover: f64,
    /// Money that these trades cost.
    pub cost: f64,
    pub benchmarks: Benchmarks,
}

/// Wealth at the end of a period, had a simple rule been followed from the start of the session: with the same wealth,
/// holdings, rates, flows and trading cost. Null once a rule cannot pay a withdrawal.
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

/// The account of somebody who restores the same shares of wealth at the start of each period.
#[derive(Debug, Clone)]
struct FixedShares {
    /// `None` once a withdrawal could not be paid.
    wealth: Option<f64>,
    /// Share of wealth in each asset before trading.
    holdings: Vec<f64>,
    /// Share of wealth in each asset that is restored.
    shares: Vec<f64>,
    /// Share of wealth in assets that left, to be sold before the coming period.
    sold: f64,
}

impl FixedShares {
    fn at(start: &SessionState, shares: Vec<f64>) -> Self {
        let holdings = match &start.assets {
            Some(assets) => assets.fund.holdings.clone(),
            None => vec![start.state.holding],
        };
        FixedShares { wealth: Some(start.state.wealth), holdings, shares, sold: 0.0 }
    }

    /// Follows a change of the assets from those with the names `before` to those with the names `after`.
    fn change(&mut self, before: &[String], after: &[String]) {
        let of =
            |values: &[f64], name: &String| before.iter().position(|own| own == name).map_or(0.0, |own| values[own]);
        let [holdings, shares] = [&self.holdings, &self.shares]
            .map(|values| after.iter().map(|name| of(values, name)).collect::<Vec<f64>>());
        let (all, kept): (f64, f64) = (self.shares.iter().sum(), shares.iter().sum());
        self.sold = self.holdings.iter().sum::<f64>() - holdings.iter().sum::<f64>();
        self.holdings = holdings;
        self.shares = match kept > 0.0 {
            true => shares.iter().map(|share| all * share / kept).collect(),
            // None of its assets stays.
            false => vec![all / after.len() as f64; after.len()],
        };
    }

    /// Returns the wealth after a period of these log-returns.
    fn pass(&mut self, dynamics: Dynamics, log_returns: &[f64]) -> Option<f64> {
        let wealth = self.wealth.take()?;
        let bought = self.shares.iter().zip(&self.holdings).map(|(share, held)| f64::abs(share - held));
        let traded = bought.sum::<f64>() + std::mem::take(&mut self.sold);
        let left = wealth * dynamics.left(traded);
        let grown: Vec<f64> = self.shares.iter().zip(log_returns).map(|(share, z)| left * share * z.exp()).collect();
        let bank = left * (1.0 - self.shares.iter().sum::<f64>()) * (1.0 + dynamics.rate_per_step);
        let next = bank + grown.iter().sum::<f64>() + dynamics.contribution;
        self.wealth = (next > 0.0).then_some(next);
        self.holdings = grown.iter().map(|grown| grown / next).collect();
        self.wealth
    }
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
    let start = &passage.standing;
    let assets = start.names().len().max(1);
    let composition = start.assets.as_ref().map_or_else(|| vec![1.0], |assets| assets.fund.composition.clone());
    let mut equal = FixedShares::at(start, vec![1.0 / assets as f64; assets]);
    let mut initial = FixedShares::at(start, composition);
    let mut bank = FixedShares::at(start, vec![0.0; assets]);
    let mut before_names = start.names().to_vec();
    let mut accounts = Vec::with_capacity(periods.all.len());
    for (step, period) in periods.all.iter().enumerate() {
        if before_names.as_slice() != passage.standing.names() {
            [&mut equal, &mut initial, &mut bank]
                .into_iter()
                .for_each(|rule| rule.change(&before_names, passage.standing.names()));
            let assets = passage.standing.names().len();
            equal.shares = vec![1.0 / assets as f64; assets];
        }
        before_names = passage.standing.names().to_vec();
        let planned = passage.stretch().dynamics(step);
        let Some(passed) = passage.next().map_err(ServiceError::of_recorded)? else { break };
        let ReplayedPeriod { before, seen, turnover, .. } = passed;
        let rate_per_step = period.report.rate.unwrap_or(planned.rate_per_step);
        let contribution = period.report.flow.unwrap_or(planned.contribution);
        let dynamics = Dynamics { rate_per_step, contribution, ..planned };
        let moves = seen.moves();
        accounts.push(PeriodAccount {
            rate: rate_per_step,
            flow: contribution,
            turnover,
            cost: before.state.wealth * dynamics.trading_cost * turnover,
            benchmarks: Benchmarks {
                equal_weights: equal.pass(dynamics, &moves),
                initial_composition: initial.pass(dynamics, &moves),
                bank: bank.pass(dynamics, &moves),
            },
        });
    }
    Ok(Accounts { accounts, record: passage.record })
}
