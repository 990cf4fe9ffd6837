//! The value of the step after of a controlled problem, and its table over the numbers that describe a state.

use std::rc::Rc;

use crate::control::surrogate::features::Features;
use crate::control::surrogate::value_surrogate::ValueSurrogate;
use crate::numerics::search::chebyshev::{even, local_cubic};

/// Least and largest number of nodes of a description of one number. They are doubled until cubics predict the gain
/// halfway between to this share of its range. The value of a stock has kinks, and needs all of them.
const TABLE_NODES: [usize; 2] = [9, 513];
const NODE_ERROR: f64 = 1e-5;
/// Descriptions that differ by no more than this share are one.
const ROUNDING: f64 = 1e-12;
/// The gain of a step over its baseline.
pub enum ControlledValue {
    /// One gain for all states, if the state has no features.
    Constant(f64),
    /// Gains predicted from the features of a state.
    Surrogate(Box<ValueSurrogate>),
}

impl ControlledValue {
    /// Returns the gain of a state.
    pub fn gain(&self, features: &Features) -> f64 {
        match self {
            ControlledValue::Constant(gain) => *gain,
            ControlledValue::Surrogate(surrogate) => surrogate.prediction(features)[0],
        }
    }

    /// Returns gains that differ from `features` in the first feature alone.
    fn gains_along(&self, features: &Features, firsts: &[f64]) -> Vec<f64> {
        match self {
            ControlledValue::Surrogate(surrogate) if surrogate.uses_first() => {
                surrogate.predictions(features, firsts.iter().copied())
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
        let mut nodes = even(low, high, least);
        let mut gains = self.gains_along(features, &nodes);
        while nodes.len() < most {
            let coarse = GainNodes { at: Rc::new(nodes), gains };
            nodes = even(low, high, 2 * coarse.at.len() - 1);
            gains = self.gains_along(features, &nodes);
            let [lowest, highest] = range(gains.iter().copied());
            let halfway = nodes.iter().zip(&gains).skip(1).step_by(2);
            let worst = halfway.map(|(at, gain)| (coarse.gain(*at) - gain).abs()).fold(0.0, f64::max);
            if worst <= NODE_ERROR * (highest - lowest) {
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
        let (first, weights) = local_cubic(&self.at, at);
        self.gains[first..].iter().zip(weights).map(|(gain, weight)| gain * weight).sum()
    }
}

impl GainTable {
    /// Tabulates the gains of `value` at `nodes` of the description, under the law that follows each return, where they
    /// are above a floor.
    pub fn new(value: &ControlledValue, (returns, laws): (Vec<f64>, &[Features]), nodes: Vec<f64>, floor: f64) -> Self {
        let of_law = |law: &Features| value.gains_along(&law.clone().after(vec![nodes[0]]), &nodes);
        let gains = laws.iter().flat_map(of_law).map(|gain| gain.max(floor)).collect();
        GainTable { returns, nodes: Rc::new(nodes), gains }
    }

    /// Returns true if the table was made for these returns, or does not depend on them.
    pub fn covers(&self, returns: &[f64]) -> bool {
        self.returns.len() == 1 || self.returns == returns
    }

    /// Returns the gains after each return.
    pub fn rows(&self, returns: &[f64]) -> Vec<Rc<GainNodes>> {
        match self.returns.len() {
            1 => vec![self.row(self.returns[0]); returns.len()],
            _ => returns.iter().map(|log_return| self.row(*log_return)).collect(),
        }
    }

    /// Returns the gains after one return: local cubics of those tabulated.
    fn row(&self, log_return: f64) -> Rc<GainNodes> {
        let (first, weights) = local_cubic(&self.returns, log_return);
        let mut gains = vec![0.0; self.nodes.len()];
        for (row, weight) in self.gains.chunks_exact(self.nodes.len()).skip(first).zip(weights) {
            gains.iter_mut().zip(row).for_each(|(sum, gain)| *sum += weight * gain);
        }
        Rc::new(GainNodes { at: Rc::clone(&self.nodes), gains })
    }
}

/// Returns the least and the largest.
pub fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}
