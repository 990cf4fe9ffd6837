//! Reaching a goal: an amount is spent in every period, or put in if it is negative, and what is missing of it, or of the
//! wealth wanted at the horizon, counts with its size.
//!
//! With wealth x before spending and the amount wanted c, both in money of now, and the goal G:
//!
//!   minimise over a, against the worst law,  E[ sum over t of (c - x_t)^+  +  (G - x_T)^+ ],
//!   x_(t+1) = (x_t - c)^+ ((1-a)(1+r) + a e^Z) / (1 + i).
//!
//! The reserve R_t pays from the bank for all that is left to pay, and for nothing if more is put in than that. A state is
//! described by x / R, and nothing is missing from 1 on. Worth is what is missing, as a share of all that is wanted, negative.
//! The baseline is what is missing if all stays in the bank: with n periods left, g the growth of money there beyond prices
//! and P_k what k payments cost now,
//!
//!   (R_t - x)^+ g^n                        if x pays for every amount,
//!   G + (n - k) c - (x - P_k) g^k          otherwise, k the payments that x pays for in full;   P_k = sum of c g^-j, j < k.
//!
//! Shortfall below a target is the measure of Forsyth and Vetzal (2019) and, as the lower partial moment of order 1,
//! of Fishburn (1977).
//!
//! Checked by: `tests/solver/aims.rs`.

use super::actions::{ActionInterval, ActionSet};
use super::controlled::{Controlled, Gridded};
use crate::control::request::specification::ProblemSpecification;
use crate::numerics::search::chebyshev::even;

/// Numbers of funded states that are solved in each period.
pub const NODES: usize = 33;

/// The problem of reaching a goal.
pub struct Goal {
    /// c, spent in every period; negative if put in.
    amount: f64,
    /// G, wanted at the horizon.
    goal: f64,
    /// Wealth at the start.
    start: f64,
    /// Growth of money in the bank in a period, and of prices.
    bank: f64,
    prices: f64,
    actions: ActionInterval,
    /// R_t, in money of now, period by period, and the goal.
    reserves: Vec<f64>,
    /// P_k and g^k for each number of periods.
    paid: Vec<f64>,
    growths: Vec<f64>,
    /// All that is wanted.
    wanted: f64,
}

/// Wealth before spending, and what was missing so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Funds {
    /// x, in money of now.
    pub wealth: f64,
    /// The sum of what could not be spent.
    pub missing: f64,
}

impl Goal {
    /// Builds the problem: spend `amount` in every period, end with `goal`. `reserves` are R_t, period by period, in money of
    /// now.
    pub fn new(problem: &ProblemSpecification, amount: f64, goal: f64, reserves: impl Iterator<Item = f64>) -> Self {
        let (bank, prices) = (1.0 + problem.rate_per_step, 1.0 + problem.inflation());
        let periods = problem.horizon;
        let (mut paid, mut growths) = (vec![0.0], vec![1.0]);
        for period in 0..periods {
            paid.push(paid[period] + amount / growths[period]);
            growths.push(growths[period] * bank / prices);
        }
        let [lowest, highest] = problem.action_interval;
        Goal {
            amount,
            goal,
            start: problem.initial_wealth,
            bank,
            prices,
            actions: ActionInterval { lowest, highest },
            reserves: reserves.chain([goal]).collect(),
            paid,
            growths,
            wanted: amount.max(0.0) * periods as f64 + goal,
        }
    }

    /// Returns true if something is left to hold in a state, after what is spent.
    pub fn decides(&self, step: usize, number: f64) -> bool {
        number * self.reserves[step].max(0.0) > self.amount
    }

    /// Returns the expected shortfall of a worth, an amount in money of now.
    pub fn shortfall(&self, worth: f64) -> f64 {
        -worth * self.wanted
    }

    /// Returns the shortfall of wealth that stays in the bank from a step on, which no law can change. Cost O(ln horizon).
    pub fn shortfall_in_bank(&self, step: usize, wealth: f64) -> f64 {
        let left = self.reserves.len() - 1 - step;
        let paid = &self.paid[..=left];
        if self.amount <= 0.0 || wealth >= paid[left] {
            return (self.reserves[step] - wealth).max(0.0) * self.growths[left];
        }
        let full = paid.partition_point(|paid| *paid <= wealth) - 1;
        self.goal + (left - full) as f64 * self.amount - (wealth - paid[full]) * self.growths[full]
    }
}

/// Returns wealth over the reserve, at most 1, and 1 if the reserve is nothing.
pub fn funded(wealth: f64, reserve: f64) -> f64 {
    if reserve > 0.0 { (wealth / reserve).min(1.0) } else { 1.0 }
}

impl Controlled for Goal {
    type State = Funds;

    fn actions(&self, _step: usize, _state: &Funds) -> Vec<ActionSet> {
        vec![ActionSet::Interval(self.actions)]
    }

    fn next(&self, _step: usize, state: &Funds, actions: &[f64], noise: f64) -> Funds {
        let spent = state.wealth.min(self.amount);
        let growth = ((1.0 - actions[0]) * self.bank + actions[0] * noise.exp()) / self.prices;
        Funds { wealth: (state.wealth - spent) * growth, missing: state.missing + self.amount - spent }
    }

    fn describe(&self, step: usize, state: &Funds) -> Vec<f64> {
        vec![funded(state.wealth, self.reserves[step])]
    }

    fn baseline(&self, step: usize, state: &Funds) -> f64 {
        -(state.missing + self.shortfall_in_bank(step, state.wealth)) / self.wanted
    }

    fn utility(&self, worth: f64, from: f64) -> f64 {
        worth - from
    }

    fn certainty_equivalent(&self, utility: f64, from: f64) -> f64 {
        from + utility
    }
}

impl Gridded for Goal {
    fn nodes(&self, step: usize) -> Vec<f64> {
        if step == 0 {
            return vec![funded(self.start, self.reserves[0])];
        }
        // The worth bends most where the bank nearly pays for everything.
        even(0.0, 1.0, NODES).into_iter().map(|part| part * (2.0 - part)).collect()
    }

    fn at(&self, step: usize, number: f64) -> Funds {
        Funds { wealth: number * self.reserves[step].max(0.0), missing: 0.0 }
    }
}
