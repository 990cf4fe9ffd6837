//! One robust step of any controlled problem:
//!
//!   V_t(x, F^) = max_a  min_{F in C(F^)}  E_F[ V_(t+1)( S(x, a, Z), R(F^, Z) ) ].
//!
//! Gains of the next state are predicted at every return of the support. If the state's description depends on the
//! action, they are also predicted at even actions, or at even values of a description of one number, with local cubics
//! between. The dynamics themselves are followed for every action. The investor's own step (`super::BellmanStep`) knows that wealth is affine in the action, and predicts
//! at fewer returns.

use super::field::{Field, Payoffs, places};
use super::solution::Adversary;
use super::{BestResponse, best_response};
use crate::control::problem::actions::ActionInterval;
use crate::control::problem::controlled::Controlled;
use crate::control::problem::dynamics::{Dynamics, Trade};
use crate::control::surrogate::features::{FeatureSelection, Features};
use crate::control::surrogate::value_surrogate::ValueSurrogate;
use crate::control::uncertainty::laws::{LawSummary, Laws};
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::search::chebyshev::{even, local_cubic};

/// Nodes at which gains are predicted if the description of the next state depends on the action. If changing the
/// description costs, a value has kinks. Cubics are then good to a twentieth of the jump of its second derivative times
/// the distance's square.
const EVEN_NODES: usize = 33;
/// Nodes of a description of one number. The value of a stock has kinks, between which 33 were too few.
const FINE_NODES: usize = 129;
/// Descriptions that differ by no more than this share are one.
const ROUNDING: f64 = 1e-12;

/// The robust step of a controlled problem at every state of one step.
pub struct ControlledStep<'a, P> {
    /// The controlled problem.
    pub problem: &'a P,
    /// The uncertainty sets and the summaries of laws.
    pub laws: &'a Laws,
    /// The features of a law.
    pub selection: &'a FeatureSelection,
    /// Periods observed before this step.
    pub step: usize,
    /// The value of the step after; `None` at the horizon.
    pub next: Option<&'a ControlledValue>,
}

/// The gain of a step over its baseline.
pub enum ControlledValue {
    /// One gain for all states, if the state has no features.
    Constant(f64),
    /// Gains predicted from the features of a state.
    Surrogate(Box<ValueSurrogate>),
}

impl ControlledValue {
    fn gain(&self, features: &Features) -> f64 {
        match self {
            ControlledValue::Constant(gain) => *gain,
            ControlledValue::Surrogate(surrogate) => surrogate.prediction(features)[0],
        }
    }
}

/// The solution of a controlled problem's robust step at one state.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlledSolution {
    /// The best action.
    pub action: f64,
    /// Its certainty equivalent against the worst law, an amount at the horizon.
    pub certainty_equivalent: f64,
    /// The gain of the certainty equivalent over the state's baseline.
    pub gain: f64,
    /// Primal minus dual value, in certainty equivalent.
    pub duality_gap: f64,
    /// True if no mass wants to leave the window of returns.
    pub certified: bool,
    /// The worst law for the action.
    pub adversary: Adversary,
}

impl<P: Controlled> ControlledStep<'_, P> {
    /// Returns the features of a state and its law: the description, then the features of the law.
    pub fn features(&self, state: &P::State, law: &EmpiricalDistribution) -> Features {
        self.selection.of_law(&self.laws.summary(law)).after(self.problem.describe(self.step, state))
    }

    /// Solves the step. The search runs over the shares of the interval of actions, from 1 to 2, so that its tolerances
    /// fit any unit. Cost: a prediction at each of some hundreds of returns, and some thirty actions priced; a hundred if
    /// the problem is not concave.
    pub fn solve(&self, state: &P::State, law: &EmpiricalDistribution) -> ControlledSolution {
        let set = self.laws.uncertainty_set(law);
        let (problem, actions) = (self.problem, self.problem.actions(self.step, state));
        let baseline = problem.baseline(self.step, state);
        let shares = ActionInterval { lowest: 1.0, highest: if actions.highest > actions.lowest { 2.0 } else { 1.0 } };
        let field = |returns: Vec<f64>| ControlledField { step: self, state, law, actions, baseline, returns };
        // The cost of trading is part of the problem itself.
        let free = (Dynamics::plain(0.0, 0.0), 0.0);
        best_response(&set, shares, free, field, |_, BestResponse { trade, worst, .. }| {
            let certain = |value: f64| problem.certainty_equivalent(value, baseline);
            let certainty_equivalent = certain(worst.value);
            ControlledSolution {
                action: action_at(actions, trade.action),
                certainty_equivalent,
                gain: problem.gain(certainty_equivalent, baseline),
                duality_gap: certainty_equivalent - certain(worst.dual),
                certified: worst.certified,
                adversary: worst.adversary,
            }
        })
    }
}

/// Returns the action at a share of the interval, from 1 to 2.
fn action_at(actions: ActionInterval, share: f64) -> f64 {
    actions.lowest + (share - 1.0) * (actions.highest - actions.lowest)
}

/// The next state's value, from one state.
struct ControlledField<'a, P: Controlled> {
    step: &'a ControlledStep<'a, P>,
    state: &'a P::State,
    law: &'a EmpiricalDistribution,
    actions: ActionInterval,
    /// The baseline of this state.
    baseline: f64,
    returns: Vec<f64>,
}

/// Gains of the next state after one return: at even nodes, with local cubics between.
#[derive(Clone)]
struct GainNodes {
    /// Shares of the interval of actions, or values of the description if it is one number.
    at: Vec<f64>,
    gains: Vec<f64>,
}

impl GainNodes {
    fn gain(&self, at: f64) -> f64 {
        let (first, weights) = local_cubic(&self.at, at);
        self.gains[first..].iter().zip(weights).map(|(gain, weight)| gain * weight).sum()
    }
}

impl<P: Controlled> ControlledField<'_, P> {
    fn next(&self, share: f64, log_return: f64) -> P::State {
        self.step.problem.next(self.step.step, self.state, action_at(self.actions, share), log_return)
    }

    fn described(&self, next: &P::State) -> Vec<f64> {
        self.step.problem.describe(self.step.step + 1, next)
    }

    fn utility(&self, gain: f64, next: &P::State) -> f64 {
        let problem = self.step.problem;
        let worth = problem.worth(gain, problem.baseline(self.step.step + 1, next));
        problem.utility(worth, self.baseline)
    }

    /// Returns the gains of the next state after each return; none at the horizon. A description of one number has its
    /// nodes in its own range: where it is a kinked function of the action, the gain of it is not kinked.
    fn gains(&self, returns: &[f64]) -> Vec<GainNodes> {
        let ControlledStep { problem, laws, selection, next, .. } = *self.step;
        let Some(value) = next else { return Vec::new() };
        let nodes = |(law, &log_return): (&LawSummary, &f64)| {
            let law = selection.of_law(law);
            let mut at = even(1.0, 2.0, EVEN_NODES);
            let described = |&share: &f64| self.described(&self.next(share, log_return));
            let mut descriptions: Vec<Vec<f64>> = at.iter().map(described).collect();
            if descriptions[0].len() == 1 {
                let [low, high] = range(&descriptions.concat());
                at = even(low, high, FINE_NODES);
                if high - low <= ROUNDING * low.abs().max(high.abs()) {
                    at.truncate(1);
                }
                descriptions = at.iter().map(|&described| vec![described]).collect();
            } else if descriptions.iter().all(|described| *described == descriptions[0]) {
                at.truncate(1);
            }
            let gain = |described: &Vec<f64>| {
                let gain = value.gain(&law.clone().after(described.clone()));
                if problem.has_floor() { gain.max(0.0) } else { gain }
            };
            GainNodes { gains: descriptions.iter().take(at.len()).map(gain).collect(), at }
        };
        laws.summaries_with(self.law, returns).iter().zip(returns).map(nodes).collect()
    }
}

/// Returns the least and the largest.
fn range(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| [low.min(value), high.max(value)])
}

impl<P: Controlled> Field for ControlledField<'_, P> {
    fn returns(&self) -> &[f64] {
        &self.returns
    }

    fn is_concave(&self) -> bool {
        self.step.problem.is_concave()
    }

    fn at<'f>(&'f self, returns: &[f64]) -> Box<dyn Payoffs<'f> + 'f> {
        Box::new(ControlledRows { field: self, returns: returns.to_vec(), gains: self.gains(returns) })
    }

    fn least_payoff(&self, trade: Trade, log_return: f64) -> f64 {
        // Without a floor nothing is certain, and nothing is beyond the support.
        let has_floor = self.step.problem.has_floor();
        if has_floor { self.utility(0.0, &self.next(trade.action, log_return)) } else { f64::NEG_INFINITY }
    }
}

struct ControlledRows<'f, P: Controlled> {
    field: &'f ControlledField<'f, P>,
    returns: Vec<f64>,
    /// Return by return; empty at the horizon.
    gains: Vec<GainNodes>,
}

impl<'f, P: Controlled> Payoffs<'f> for ControlledRows<'f, P> {
    fn moved_to(&self, returns: &[f64]) -> Box<dyn Payoffs<'f> + 'f> {
        let places = places(&self.returns, returns);
        let unknown = returns.iter().zip(&places).filter(|(_, place)| place.is_none());
        let unknown: Vec<f64> = unknown.map(|(log_return, _)| *log_return).collect();
        let mut computed = self.field.gains(&unknown).into_iter();
        let known = |place: usize| self.gains.get(place).cloned();
        let gains = places.iter().filter_map(|place| place.map_or_else(|| computed.next(), known)).collect();
        Box::new(ControlledRows { field: self.field, returns: returns.to_vec(), gains })
    }

    fn payoff(&self, trade: Trade) -> Vec<f64> {
        let payoff = |(index, &log_return): (usize, &f64)| {
            let next = self.field.next(trade.action, log_return);
            let gain = self.gains.get(index).map_or(0.0, |nodes| {
                let described = self.field.described(&next);
                nodes.gain(if described.len() == 1 { described[0] } else { trade.action })
            });
            self.field.utility(gain, &next)
        };
        self.returns.iter().enumerate().map(payoff).collect()
    }
}
