//! The value of the step after of a controlled problem, and its table over the numbers that describe a state.

use std::rc::Rc;

use crate::control::request::specification::Specification;
use crate::control::solved_step::StepSolution;
use crate::control::surrogate::features::Features;
use crate::control::surrogate::stored::Solution;
use crate::control::surrogate::value_surrogate::ValueSurrogate;
use crate::numerics::search::chebyshev::{even, local_cubic};
use crate::numerics::statistics::summary::range;

/// Least and largest number of nodes of a description of one number. They are doubled until cubics predict the gain
/// halfway between to this share of its range, or to this gain. After the doubling they err by an eighth of that or less.
/// The value of a stock has kinks, and needs all of them.
const TABLE_NODES: [usize; 2] = [9, 513];
const NODE_ERROR: f64 = 3e-4;
const LEAST_ERROR: f64 = 3e-7;
/// Largest number of returns of a table. Between them others are put until cubics predict the gain halfway as well, which
/// is judged at a few nodes.
const TABLE_RETURNS: usize = 400;
const JUDGED_NODES: usize = 3;
/// Descriptions that differ by no more than this share are one.
const ROUNDING: f64 = 1e-12;
/// The gain of a step over its baseline.
pub enum ControlledValue {
    /// One gain for all states, if the state has no features.
    Constant(f64),
    /// Gains predicted from the features of a state.
    Surrogate(Box<ValueSurrogate>),
    /// Gains at ascending values of the only feature, with local cubics between.
    Tabulated {
        /// Two at least.
        at: Vec<f64>,
        /// One for each.
        gains: Vec<f64>,
    },
}

impl ControlledValue {
    /// Returns the value of a trained step.
    pub fn of(specification: &Specification, trained: &StepSolution) -> Self {
        match &trained.solution {
            Solution::Single(single) => ControlledValue::Constant(single.floor_gains[0]),
            Solution::Surrogates(stored) => {
                ControlledValue::Surrogate(Box::new(ValueSurrogate::new(specification, trained.step, stored)))
            }
        }
    }

    /// Returns the gain of a state.
    pub fn gain(&self, features: &Features) -> f64 {
        match self {
            ControlledValue::Constant(gain) => *gain,
            ControlledValue::Surrogate(surrogate) => surrogate.prediction(features)[0],
            ControlledValue::Tabulated { at, gains } => interpolated(at, gains, features.first()),
        }
    }

    /// Returns gains that differ from `features` in the first feature alone.
    fn gains_along(&self, features: &Features, firsts: &[f64]) -> Vec<f64> {
        match self {
            ControlledValue::Surrogate(surrogate) if surrogate.uses_first() => {
                surrogate.predictions(features, firsts.iter().copied())
            }
            ControlledValue::Tabulated { at, gains } => {
                firsts.iter().map(|first| interpolated(at, gains, *first)).collect()
            }
            _ => vec![self.gain(features); firsts.len()],
        }
    }

    /// Returns the values of the first feature, over a range, at which gains are predicted.
    pub fn nodes(&self, features: &Features, [low, high]: [f64; 2]) -> Vec<f64> {
        let [least, most] = TABLE_NODES;
        if high - low <= ROUNDING * low.abs().max(high.abs()) {
            return vec![low];
        }
        if let ControlledValue::Tabulated { .. } = self {
            return even(low, high, most);
        }
        let mut nodes = even(low, high, least);
        let mut gains = self.gains_along(features, &nodes);
        while nodes.len() < most {
            let coarse = GainNodes { at: Rc::new(nodes), gains };
            nodes = even(low, high, 2 * coarse.at.len() - 1);
            gains = self.gains_along(features, &nodes);
            let halfway = nodes.iter().zip(&gains).skip(1).step_by(2);
            let worst = halfway.map(|(at, gain)| (coarse.gain(*at) - gain).abs()).fold(0.0, f64::max);
            if suffices(worst, &gains) {
                break;
            }
        }
        nodes
    }
}

/// Gains of the next state after one return: at even nodes, with local cubics between.
pub struct GainNodes {
    /// Shares of a line of actions, or values of the description if it is one number.
    pub at: Rc<Vec<f64>>,
    /// One for each.
    pub gains: Vec<f64>,
}

/// Gains of next states that one number describes.
pub struct GainTable {
    /// One, if the law does not change with the return.
    returns: Vec<f64>,
    nodes: Rc<Vec<f64>>,
    /// Return by return, node by node.
    gains: Vec<f64>,
}

impl GainNodes {
    /// Returns the gain at a place.
    pub fn gain(&self, at: f64) -> f64 {
        cubic(&self.at, &self.gains, at)
    }
}

/// Returns the gain at a place, or at the nearest end of the table.
fn interpolated(nodes: &[f64], gains: &[f64], at: f64) -> f64 {
    cubic(nodes, gains, at.clamp(nodes[0], nodes[nodes.len() - 1]))
}

fn cubic(nodes: &[f64], gains: &[f64], at: f64) -> f64 {
    let (first, weights) = local_cubic(nodes, at);
    gains[first..].iter().zip(weights).map(|(gain, weight)| gain * weight).sum()
}

impl GainTable {
    /// Tabulates the gains of `value` over a range of the description, after returns and more between them, whose laws
    /// have the features `of_laws`. No gain is below the floor.
    pub fn new(
        value: &ControlledValue,
        mut returns: Vec<f64>,
        of_laws: impl Fn(&[f64]) -> Vec<Features>,
        reached: [f64; 2],
        floor: f64,
    ) -> Self {
        let mut laws = of_laws(&returns);
        let nodes = value.nodes(&laws[laws.len() / 2].clone().after(vec![0.0]), reached);
        let row = |law: &Features, nodes: &[f64]| value.gains_along(&law.clone().after(vec![nodes[0]]), nodes);
        if laws.iter().all(|law| *law == laws[0]) {
            returns.truncate(1);
            laws.truncate(1);
        }
        let judged: Vec<f64> =
            (0..JUDGED_NODES).map(|part| nodes[part * (nodes.len() - 1) / (JUDGED_NODES - 1)]).collect();
        let judged_rows = |laws: &[Features]| laws.iter().flat_map(|law| row(law, &judged)).collect::<Vec<f64>>();
        let mut known = judged_rows(&laws);
        while returns.len() > 1 && returns.len() < TABLE_RETURNS {
            let halfway: Vec<f64> = returns.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
            let between = of_laws(&halfway);
            let found = judged_rows(&between);
            let predicted = halfway.iter().flat_map(|at| row_at(&returns, &known, JUDGED_NODES, *at));
            let worst = predicted.zip(&found).map(|(predicted, found)| (predicted - found).abs()).fold(0.0, f64::max);
            (returns, laws) = (alternated(returns, halfway, 1), alternated(laws, between, 1));
            known = alternated(known, found, JUDGED_NODES);
            if suffices(worst, &known) {
                break;
            }
        }
        let gains = laws.iter().flat_map(|law| row(law, &nodes)).map(|gain| gain.max(floor)).collect();
        GainTable { returns, nodes: Rc::new(nodes), gains }
    }

    /// Returns true if the table ends where these returns do, or does not depend on them.
    pub fn covers(&self, returns: &[f64]) -> bool {
        self.returns.len() == 1 || [self.returns.first(), self.returns.last()] == [returns.first(), returns.last()]
    }

    /// Returns the gains after each return.
    pub fn rows(&self, returns: &[f64]) -> Vec<Rc<GainNodes>> {
        match self.returns.len() {
            1 => vec![self.row(self.returns[0]); returns.len()],
            _ => returns.iter().map(|log_return| self.row(*log_return)).collect(),
        }
    }

    fn row(&self, log_return: f64) -> Rc<GainNodes> {
        let gains = row_at(&self.returns, &self.gains, self.nodes.len(), log_return);
        Rc::new(GainNodes { at: Rc::clone(&self.nodes), gains })
    }
}

/// Returns true if cubics that were off by `worst` before a doubling need no other. `gains` are all that are known.
fn suffices(worst: f64, gains: &[f64]) -> bool {
    let [lowest, highest] = range(gains.iter().copied());
    worst <= (NODE_ERROR * (highest - lowest)).max(LEAST_ERROR)
}

/// Returns the row of a table at one return: local cubics of the rows of `width` gains that it has.
fn row_at(returns: &[f64], gains: &[f64], width: usize, log_return: f64) -> Vec<f64> {
    let (first, weights) = local_cubic(returns, log_return);
    let mut row = vec![0.0; width];
    for (known, weight) in gains.chunks_exact(width).skip(first).zip(weights) {
        row.iter_mut().zip(known).for_each(|(sum, gain)| *sum += weight * gain);
    }
    row
}

/// Puts each `width` of `between` after as many of `known`, of which there are one set more.
fn alternated<T>(known: Vec<T>, between: Vec<T>, width: usize) -> Vec<T> {
    let (mut known, mut between) = (known.into_iter(), between.into_iter());
    let mut all = Vec::with_capacity(known.len() + between.len());
    while known.len() > 0 {
        all.extend(known.by_ref().take(width));
        all.extend(between.by_ref().take(width));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_with_rows_between_is_exact_for_cubics() {
        let cubic = |at: f64, node: f64| at.powi(3) - node * at;
        let rows =
            |returns: &[f64]| returns.iter().flat_map(|at| [cubic(*at, 1.0), cubic(*at, 2.0)]).collect::<Vec<f64>>();
        let (returns, halfway) = (vec![-1.0, 0.0, 0.5, 2.0], vec![-0.5, 0.25, 1.25]);
        let all = alternated(returns.clone(), halfway.clone(), 1);
        assert_eq!(all, [-1.0, -0.5, 0.0, 0.25, 0.5, 1.25, 2.0]);
        assert_eq!(alternated(rows(&returns), rows(&halfway), 2), rows(&all));
        for at in [-1.0, -0.7, 0.1, 1.9] {
            let row = row_at(&all, &rows(&all), 2, at);
            assert!(
                (row[0] - cubic(at, 1.0)).abs() < 1e-12 && (row[1] - cubic(at, 2.0)).abs() < 1e-12,
                "{at}: {row:?}"
            );
        }
    }
}
