//! Spending from wealth whose drawdown has a limit: no return of the support takes a unit that stays invested below a share of
//! its highest value so far.
//!
//! With y the value of the unit over its highest so far, d the limit and L the lowest return of the support, a share a may
//! be held if
//!
//!   y ((1-a)(1+r) + a e^L) >= 1 - d.
//!
//! Spending takes nothing from the unit, so that a drawdown is that of a time-weighted return. Utility, spending and the
//! worth of wealth are those of `spending.rs`, with m_t a function of y. Source: Grossman and Zhou (1993), Optimal
//! investment strategies for controlling drawdowns, who know the law.
//!
//! Checked by: `tests/solver/aims.rs`.

use super::actions::{ActionInterval, ActionSet};
use super::controlled::{Controlled, Gridded};
use super::spending::PeriodSpending;
use super::utility::{relative_utility, worth_of_utility};
use crate::control::request::specification::{ProblemSpecification, UtilitySpecification};
use crate::numerics::search::chebyshev::even;

/// Numbers of drawdowns that are solved in each period.
const NODES: usize = 17;

/// Spending under a limit on the drawdown.
pub struct DrawdownLimit {
    utility: UtilitySpecification,
    periods: Vec<PeriodSpending>,
    bank: f64,
    prices: f64,
    actions: ActionInterval,
    /// 1 - d.
    lowest: f64,
    /// y at the start.
    start: f64,
    /// e^L.
    worst_growth: f64,
}

/// A unit that stays invested.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnitValue {
    /// Its value now.
    pub now: f64,
    /// Its highest value so far.
    pub peak: f64,
    /// True once the period's spending is taken from the wealth that it stands for.
    pub is_left: bool,
}

impl DrawdownLimit {
    /// Builds the problem: `limit` is d, `drawdown` that of the start, `worst_return` L, or minus infinity.
    pub fn new(problem: &ProblemSpecification, limit: f64, drawdown: f64, worst_return: f64) -> Self {
        let [lowest, highest] = problem.action_interval;
        DrawdownLimit {
            utility: problem.utility,
            periods: PeriodSpending::of(problem),
            bank: 1.0 + problem.rate_per_step,
            prices: 1.0 + problem.inflation(),
            actions: ActionInterval { lowest, highest },
            lowest: 1.0 - limit,
            start: 1.0 - drawdown,
            worst_growth: worst_return.exp(),
        }
    }

    /// Returns the share of wealth to spend in a state whose robust step has this gain.
    pub fn share(&self, step: usize, gain: f64) -> f64 {
        self.periods[step].share(self.gain_before(step, gain))
    }

    /// Returns the sure level of spending of a unit of wealth at the start, given the gain of its robust step.
    pub fn sure_level(&self, gain: f64) -> f64 {
        self.periods[0].safe_worth() * self.gain_before(0, gain).exp()
    }

    /// Returns the greatest share that may be held.
    pub fn highest_action(&self, state: &UnitValue) -> f64 {
        let lost = self.bank - self.worst_growth;
        let kept = self.bank - self.lowest * state.peak / state.now;
        let ActionInterval { lowest, highest } = self.actions;
        if lost > 0.0 { (kept / lost).clamp(lowest, highest) } else { highest }
    }
}

impl Controlled for DrawdownLimit {
    type State = UnitValue;

    fn actions(&self, _step: usize, state: &UnitValue) -> Vec<ActionSet> {
        let highest = self.highest_action(state);
        vec![ActionSet::Interval(ActionInterval { lowest: self.actions.lowest, highest })]
    }

    fn next(&self, _step: usize, state: &UnitValue, actions: &[f64], noise: f64) -> UnitValue {
        let now = state.now * ((1.0 - actions[0]) * self.bank + actions[0] * noise.exp());
        UnitValue { now, peak: state.peak.max(now), is_left: false }
    }

    fn describe(&self, _step: usize, state: &UnitValue) -> Vec<f64> {
        vec![state.now / state.peak]
    }

    /// Returns the worth while all that is not spent stays in the bank, in money of the start.
    fn baseline(&self, step: usize, state: &UnitValue) -> f64 {
        let of_unit = |own: &PeriodSpending| if state.is_left { own.left_worth() } else { own.safe_worth() };
        self.prices.powi(-(step as i32)) * state.now * self.periods.get(step).map_or(1.0, of_unit)
    }

    fn utility(&self, worth: f64, from: f64) -> f64 {
        relative_utility(self.utility, worth, from)
    }

    fn certainty_equivalent(&self, utility: f64, from: f64) -> f64 {
        worth_of_utility(self.utility, utility, from)
    }

    fn gain(&self, worth: f64, baseline: f64) -> f64 {
        (worth / baseline).ln()
    }

    fn worth(&self, gain: f64, baseline: f64) -> f64 {
        baseline * gain.exp()
    }
}

impl Gridded for DrawdownLimit {
    fn nodes(&self, step: usize) -> Vec<f64> {
        if step == 0 {
            return vec![self.start];
        }
        // The share that may be held, and with it the worth, changes most near the limit.
        even(0.0, 1.0, NODES).into_iter().map(|part| self.lowest + (1.0 - self.lowest) * part * part).collect()
    }

    fn at(&self, _step: usize, number: f64) -> UnitValue {
        UnitValue { now: number, peak: 1.0, is_left: true }
    }

    fn gain_before(&self, step: usize, gain: f64) -> f64 {
        self.periods[step].gain(gain)
    }
}
