//! The floor gain of the step after, at everything that one robust step can reach.
//!
//! From one state, the next state depends on the action and the adversary's return z only. The law's features depend on
//! z alone. Wealth and the holding depend on both, wealth linearly in the action. The prediction is a smooth function
//! of z and wealth, so it is tabulated once. The table is exact at a few returns (local cubics between them), at a few
//! Chebyshev nodes in the action if wealth matters, and at the holdings at which the value is known. Where the nodes lie
//! within half a length scale in wealth, it is itself interpolated (`numerics/gp/along.rs`). Every action is then priced
//! without evaluating the surrogate again: one product for each node and return.
//!
//! If trading costs, wealth also depends on the share that the trade keeps, by a few percent at most. This dependence
//! is nearly linear, except when withdrawals leave little wealth.
//!
//! With contributions or withdrawals, everything is relative to total wealth: a trade moves the share of it that is in
//! hand, and the rest grows as the bank does.

use super::field::{Field, Payoffs, places};
use super::next_value::NextValue;
use super::problem::Problem;
use crate::control::problem::dynamics::{Dynamics, Trade};
use crate::control::problem::holdings::Holdings;
use crate::control::problem::state::State;
use crate::control::problem::utility::RelativeUtility;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::search::chebyshev::{Chebyshev, local_cubic};

/// Chebyshev nodes in the action. Over the action interval the log of the next wealth, which is the feature, is nearly
/// a parabola: a cubic through four nodes is good to 1e-6 of the gain.
const ACTION_NODES: usize = 4;

/// Predictions tabulated over returns and trades, for one state.
pub struct GainField<'a> {
    problem: &'a Problem,
    step: usize,
    /// The law before the period.
    law: &'a EmpiricalDistribution,
    next: &'a NextValue,
    utility: RelativeUtility,
    dynamics: Dynamics,
    /// The dynamics of the period after.
    after: Dynamics,
    /// Total wealth after one period in the bank once everything is sold, and the share of it that is in hand now.
    bank: f64,
    in_hand: f64,
    /// The highest action that is priced.
    highest: f64,
    returns: Vec<f64>,
    action_nodes: Chebyshev,
    /// The largest and the smallest share kept by a trade, at which trades are tabulated; `None` if one share serves
    /// all. Between them, and a little beyond for a side whose cost is paid both ways, predictions are linear.
    kept_nodes: Option<[f64; 2]>,
    holdings: Holdings,
    /// `table[(i * nodes + m) * holdings + j]`: the prediction at return i, trade m and holding j; empty if the gain is
    /// constant. Trades run over the action nodes for each of the kept nodes.
    table: Vec<f64>,
}

impl<'a> GainField<'a> {
    /// Tabulates the field. `returns` are ascending and distinct, `utility` is relative to the floor of `state`. Cost
    /// O(returns x nodes x design count) at most.
    pub fn tabulate(
        problem: &'a Problem,
        step: usize,
        next: &'a NextValue,
        utility: RelativeUtility,
        state: &'a State,
        returns: Vec<f64>,
    ) -> Self {
        let [dynamics, after] = [step, step + 1].map(|step| problem.dynamics(step));
        let wealth_matters = next.depends_on_wealth(&problem.selection);
        let action_nodes = Chebyshev::new(if wealth_matters { ACTION_NODES } else { 1 });
        let liquidation = dynamics.liquidation(state.holding);
        let kept_nodes = (wealth_matters && dynamics.trading_cost > 0.0)
            .then(|| [1.0, dynamics.liquidation(1.0)].map(|left| left / liquidation));
        let highest = problem.actions(step, state).highest.max(f64::MIN_POSITIVE);
        let trades = |kept: f64| action_nodes.nodes().iter().map(move |share| Trade { action: share * highest, kept });
        let trades: Vec<Trade> = match kept_nodes {
            Some(nodes) => nodes.into_iter().flat_map(trades).collect(),
            None => trades(1.0).collect(),
        };
        let table = next.tabulate(problem, step, state, &returns, &trades);
        let bank = dynamics.total(state.wealth, state.holding) * (1.0 + dynamics.rate_per_step);
        let in_hand = dynamics.in_hand(state.wealth, state.holding);
        let holdings = next.holdings(problem);
        GainField {
            problem,
            step,
            law: &state.law,
            next,
            utility,
            dynamics,
            after,
            bank,
            in_hand,
            highest,
            returns,
            action_nodes,
            kept_nodes,
            holdings,
            table,
        }
    }

    /// Returns total wealth from wealth in hand, each over its growth if everything is sold at once: `s w + 1 - s`, s
    /// the share in hand.
    fn with_what_is_to_come(&self, relative: f64) -> f64 {
        self.in_hand * relative + (1.0 - self.in_hand)
    }

    /// Returns the cost of selling the holding that the floor accounts for: none at the horizon.
    fn cost_of_selling(&self) -> f64 {
        if matches!(self.next, NextValue::Terminal) { 0.0 } else { self.dynamics.trading_cost }
    }

    /// Returns the share in hand of total wealth after the period.
    fn in_hand_after(&self, total: f64) -> f64 {
        (total - self.after.to_come) / total
    }

    /// Prepares evaluation at fixed returns, some of which may be among `known`, ascending.
    fn rows(&self, returns: &[f64], known: Option<&FieldRows<'_>>) -> FieldRows<'_> {
        let (nodes, holdings) = (self.trade_count(), self.holdings.count());
        let places = known.map(|known| places(&known.returns, returns));
        let kept = |index: usize| Some((known?, places.as_ref()?[index]?));
        let mut rows = vec![0.0; if self.table.is_empty() { 0 } else { nodes * returns.len() * holdings }];
        if !self.table.is_empty() {
            for (index, &log_return) in returns.iter().enumerate() {
                let kept = kept(index);
                let cubic = kept.is_none().then(|| local_cubic(&self.returns, log_return));
                for node in 0..nodes {
                    let start = (node * returns.len() + index) * holdings;
                    let row = &mut rows[start..start + holdings];
                    if let Some((known, place)) = kept {
                        row.copy_from_slice(&known.rows[(node * known.returns.len() + place) * holdings..][..holdings]);
                    }
                    let Some((first, weights)) = cubic else { continue };
                    for i in (0..weights.len()).filter(|i| weights[*i] != 0.0) {
                        let values = &self.table[((first + i) * nodes + node) * holdings..][..holdings];
                        row.iter_mut().zip(values).for_each(|(sum, value)| *sum += weights[i] * value);
                    }
                }
            }
        }
        let growth = |(index, log_return): (usize, &f64)| match kept(index) {
            Some((known, place)) => known.growths[place],
            None => log_return.exp() / (1.0 + self.dynamics.rate_per_step),
        };
        let growths: Vec<f64> = returns.iter().enumerate().map(growth).collect();
        let sold = 1.0 - self.cost_of_selling();
        let excesses = growths.iter().map(|growth| sold * growth - 1.0).collect();
        let largest = match self.next {
            NextValue::Surrogate(_) => self.problem.largest_gains_after(self.step, self.law, returns),
            NextValue::Terminal | NextValue::Constant(..) | NextValue::Exact(..) => vec![f64::INFINITY; returns.len()],
        };
        FieldRows { field: self, returns: returns.to_vec(), rows, growths, excesses, largest }
    }

    fn trade_count(&self) -> usize {
        self.action_nodes.nodes().len() * self.kept_nodes.map_or(1, |nodes| nodes.len())
    }

    /// Returns the weight of each tabulated trade in the prediction for `trade`.
    fn basis(&self, trade: Trade) -> Vec<f64> {
        let actions = self.action_nodes.basis(trade.action / self.highest);
        match self.kept_nodes {
            None => actions,
            Some([most, least]) => {
                let share = (most - trade.kept) / (most - least);
                [1.0 - share, share]
                    .into_iter()
                    .flat_map(|kept| actions.iter().map(move |weight| kept * weight))
                    .collect()
            }
        }
    }
}

impl Field for GainField<'_> {
    fn returns(&self) -> &[f64] {
        &self.returns
    }

    fn at<'f>(&'f self, returns: &[f64]) -> Box<dyn Payoffs<'f> + 'f> {
        Box::new(self.rows(returns, None))
    }

    /// Returns the relative utility of selling everything after `log_return`.
    fn least_payoff(&self, trade: Trade, log_return: f64) -> f64 {
        let Dynamics { rate_per_step, .. } = self.dynamics;
        let sold = self.cost_of_selling() * trade.action * log_return.exp();
        let growth = self.dynamics.growth(trade.action, log_return) - sold;
        self.utility.value(self.with_what_is_to_come(trade.kept * growth / (1.0 + rate_per_step)).ln())
    }
}

/// A field restricted to fixed returns.
struct FieldRows<'f> {
    field: &'f GainField<'f>,
    returns: Vec<f64>,
    /// `rows[(m * returns + k) * holdings + j]`: the prediction at trade m, return k and holding j; empty if the gain
    /// is constant.
    rows: Vec<f64>,
    /// `e^z / (1 + r)`.
    growths: Vec<f64>,
    /// `(1 - c) e^z / (1 + r) - 1`: the gain of a unit of allocation over the bank once it is sold.
    excesses: Vec<f64>,
    /// Upper bounds on the gain of the next state with nothing held.
    largest: Vec<f64>,
}

impl<'f> Payoffs<'f> for FieldRows<'f> {
    fn moved_to(&self, returns: &[f64]) -> Box<dyn Payoffs<'f> + 'f> {
        Box::new(self.field.rows(returns, Some(self)))
    }

    /// Returns `u(w(a, z))`. Cost O(returns x nodes).
    fn payoff(&self, trade: Trade) -> Vec<f64> {
        let GainField { next, utility, bank, .. } = self.field;
        // S(x, a, z) with everything sold, plus future contributions, over the growth of selling at once.
        let sold = self.excesses.iter().map(|excess| trade.kept * (1.0 + trade.action * excess));
        let relative: Vec<f64> = sold.map(|relative| self.field.with_what_is_to_come(relative)).collect();
        let gains = match next {
            NextValue::Terminal => vec![0.0; relative.len()],
            NextValue::Constant(holdings, gains) if holdings.matter() => {
                let gain = |(holding, relative)| {
                    let in_hand = self.field.in_hand_after(bank * relative);
                    holdings.gain(gains, self.field.after, holding, in_hand)
                };
                self.holdings(trade).zip(&relative).map(gain).collect()
            }
            NextValue::Constant(_, gains) => vec![gains[0].max(0.0); relative.len()],
            NextValue::Surrogate(_) | NextValue::Exact(..) if self.field.holdings.matter() => {
                let totals: Vec<f64> = relative.iter().map(|relative| bank * relative).collect();
                self.gains_by_holding(trade, &totals)
            }
            NextValue::Surrogate(_) | NextValue::Exact(..) => {
                let mut gains = self.interpolated(trade);
                let totals = relative.iter().map(|relative| bank * relative);
                next.gains(&mut gains, totals.zip(self.largest.iter().copied()));
                gains
            }
        };
        utility.values(relative, &gains)
    }
}

impl FieldRows<'_> {
    /// Returns the gains if the holding matters, which may have drifted beyond the highest action; `totals` are of
    /// total wealth.
    fn gains_by_holding(&self, trade: Trade, totals: &[f64]) -> Vec<f64> {
        let GainField { next, holdings, after, .. } = self.field;
        let held: Vec<f64> = self.holdings(trade).collect();
        let mut gains = self.interpolated_at(trade, &held);
        let within = totals.iter().zip(&held).zip(&self.largest).map(|((total, &holding), largest)| {
            let unsold = (total - after.to_come) / after.liquidation(holding);
            let within = after.total(unsold, holdings.within(holding));
            // A holding before trading also gains the cost of selling it.
            (within, largest + (after.total(unsold, 0.0) / within).ln())
        });
        next.gains(&mut gains, within);
        for ((gain, &holding), total) in gains.iter_mut().zip(&held).zip(totals) {
            *gain += holdings.beyond(*after, holding, self.field.in_hand_after(*total));
        }
        gains
    }

    /// Returns the share held after each return.
    fn holdings(&self, trade: Trade) -> impl Iterator<Item = f64> {
        let GainField { bank, in_hand, dynamics: Dynamics { contribution, .. }, .. } = self.field;
        let before = bank * in_hand * trade.kept;
        self.growths.iter().map(move |growth| {
            let relative = 1.0 - trade.action + trade.action * growth;
            let grown = before * relative;
            trade.action * growth / relative * (grown / (grown + contribution))
        })
    }

    /// Interpolates the tabulated predictions along trades.
    fn interpolated(&self, trade: Trade) -> Vec<f64> {
        let count = self.growths.len();
        let mut predictions = vec![0.0; count];
        for (weight, row) in self.field.basis(trade).iter().zip(self.rows.chunks_exact(count)) {
            predictions.iter_mut().zip(row).for_each(|(prediction, value)| *prediction += weight * value);
        }
        predictions
    }

    /// Interpolates the tabulated predictions along trades and at the share `held` after each return.
    fn interpolated_at(&self, trade: Trade, held: &[f64]) -> Vec<f64> {
        let (count, holdings) = (self.growths.len(), self.field.holdings);
        let basis = self.field.basis(trade);
        let mut predictions = vec![0.0; count];
        let cubics: Vec<(usize, [f64; 4])> = held.iter().map(|&holding| holdings.cubic(holding)).collect();
        for (weight, block) in basis.iter().zip(self.rows.chunks_exact(count * holdings.count())) {
            let read = cubics.iter().zip(block.chunks_exact(holdings.count()));
            for (prediction, ((first, cubic), values)) in predictions.iter_mut().zip(read) {
                let along = &values[*first..first + 4];
                let sum = cubic[0] * along[0] + cubic[1] * along[1] + cubic[2] * along[2] + cubic[3] * along[3];
                *prediction += weight * sum;
            }
        }
        predictions
    }
}
