//! One robust step of any controlled problem:
//!
//!   V_t(x, F^) = max_a  min_{F in C(F^)}  E_F[ V_(t+1)( S(x, a, Z), R(F^, Z) ) ].
//!
//! Gains of the next state are predicted at every return of the support. If the state's description depends on the
//! action, they are also predicted at even actions, with local cubics between. The dynamics themselves are followed for
//! every action. The investor's own step (`super::BellmanStep`) knows that wealth is affine in the action, and predicts
//! at fewer returns.

use super::field::{Field, Payoffs, places};
use super::{BestResponse, best_response};
use crate::control::problem::controlled::Controlled;
use crate::control::problem::dynamics::{Dynamics, Trade};
use crate::control::surrogate::features::{FeatureSelection, Features};
use crate::control::surrogate::value_surrogate::ValueSurrogate;
use crate::control::uncertainty::laws::Laws;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::search::chebyshev::local_cubic;

/// Even actions at which gains are predicted if the description of the next state depends on the action. If changing
/// the description costs, a value has kinks. Cubics are then good to a twentieth of the jump of its second derivative
/// times the distance's square.
const EVEN_ACTIONS: usize = 33;

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
#[derive(Debug, Clone, Copy, PartialEq)]
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
}

impl<P: Controlled> ControlledStep<'_, P> {
    /// Returns the features of a state and its law: the description, then the features of the law.
    pub fn features(&self, state: &P::State, law: &EmpiricalDistribution) -> Features {
        self.selection.of_law(&self.laws.summary(law)).after(self.problem.describe(self.step, state))
    }

    /// Solves the step. Cost: a prediction at each of some hundreds of returns, and some thirty actions priced.
    pub fn solve(&self, state: &P::State, law: &EmpiricalDistribution) -> ControlledSolution {
        let set = self.laws.uncertainty_set(law);
        let (problem, actions) = (self.problem, self.problem.actions(self.step, state));
        let baseline = problem.baseline(self.step, state);
        let field = |returns: Vec<f64>| {
            let part = (actions.highest - actions.lowest) / (EVEN_ACTIONS - 1) as f64;
            let mut even: Vec<f64> = (0..EVEN_ACTIONS).map(|index| actions.lowest + index as f64 * part).collect();
            let described = |action: f64, log_return: f64| {
                problem.describe(self.step + 1, &problem.next(self.step, state, action, log_return))
            };
            // One action is enough if none of them changes the description.
            let ends = [returns.first(), returns.last()].map(|end| end.copied().unwrap_or_default());
            let moves = |z: f64| even.iter().any(|&action| described(action, z) != described(actions.lowest, z));
            if part <= 0.0 || !ends.into_iter().any(moves) {
                even.truncate(1);
            }
            ControlledField { step: self, state, law, actions: even, baseline, returns }
        };
        // The cost of trading is part of the problem itself.
        let free = (Dynamics::plain(0.0, 0.0), 0.0);
        best_response(&set, actions, free, field, |_, BestResponse { trade, worst, .. }| {
            let certain = |value: f64| problem.certainty_equivalent(value, baseline);
            let certainty_equivalent = certain(worst.value);
            ControlledSolution {
                action: trade.action,
                certainty_equivalent,
                gain: problem.gain(certainty_equivalent, baseline),
                duality_gap: certainty_equivalent - certain(worst.dual),
                certified: worst.certified,
            }
        })
    }
}

/// The next state's value, from one state.
struct ControlledField<'a, P: Controlled> {
    step: &'a ControlledStep<'a, P>,
    state: &'a P::State,
    law: &'a EmpiricalDistribution,
    /// Actions at which gains are predicted, ascending.
    actions: Vec<f64>,
    /// The baseline of this state.
    baseline: f64,
    returns: Vec<f64>,
}

impl<P: Controlled> ControlledField<'_, P> {
    fn next(&self, action: f64, log_return: f64) -> P::State {
        self.step.problem.next(self.step.step, self.state, action, log_return)
    }

    fn utility(&self, gain: f64, next: &P::State) -> f64 {
        let problem = self.step.problem;
        let worth = problem.worth(gain, problem.baseline(self.step.step + 1, next));
        problem.utility(worth, self.baseline)
    }

    /// Returns the gains of the next state, return by return, action by action; none at the horizon.
    fn gains(&self, returns: &[f64]) -> Vec<f64> {
        let ControlledStep { problem, laws, selection, step, next } = *self.step;
        let mut gains = Vec::new();
        if let Some(value) = next {
            for (law, &log_return) in laws.summaries_with(self.law, returns).iter().zip(returns) {
                let law = selection.of_law(law);
                for &action in &self.actions {
                    let next = self.next(action, log_return);
                    let gain = value.gain(&law.clone().after(problem.describe(step + 1, &next)));
                    gains.push(if problem.has_floor() { gain.max(0.0) } else { gain });
                }
            }
        }
        gains
    }
}

impl<P: Controlled> Field for ControlledField<'_, P> {
    fn returns(&self) -> &[f64] {
        &self.returns
    }

    fn at<'f>(&'f self, returns: &[f64]) -> Box<dyn Payoffs<'f> + 'f> {
        Box::new(ControlledRows { field: self, returns: returns.to_vec(), gains: self.gains(returns) })
    }

    fn least_payoff(&self, trade: Trade, log_return: f64) -> f64 {
        self.utility(0.0, &self.next(trade.action, log_return))
    }
}

struct ControlledRows<'f, P: Controlled> {
    field: &'f ControlledField<'f, P>,
    returns: Vec<f64>,
    /// Return by return, action by action; empty at the horizon.
    gains: Vec<f64>,
}

impl<'f, P: Controlled> Payoffs<'f> for ControlledRows<'f, P> {
    fn moved_to(&self, returns: &[f64]) -> Box<dyn Payoffs<'f> + 'f> {
        let (places, actions) = (places(&self.returns, returns), self.field.actions.len());
        let unknown = returns.iter().zip(&places).filter(|(_, place)| place.is_none());
        let unknown: Vec<f64> = unknown.map(|(log_return, _)| *log_return).collect();
        let computed = self.field.gains(&unknown);
        let mut computed = computed.chunks_exact(actions);
        let gains = places.iter().flat_map(|place| match place {
            Some(place) => self.gains.get(place * actions..(place + 1) * actions),
            None => computed.next(),
        });
        let gains = gains.flatten().copied().collect();
        Box::new(ControlledRows { field: self.field, returns: returns.to_vec(), gains })
    }

    fn payoff(&self, trade: Trade) -> Vec<f64> {
        let (first, weights) = local_cubic(&self.field.actions, trade.action);
        let gain = |index: usize| {
            let along = self.gains.get(index * self.field.actions.len() + first..).unwrap_or_default();
            along.iter().zip(weights).map(|(gain, weight)| gain * weight).sum()
        };
        let payoff = |(index, &log_return)| self.field.utility(gain(index), &self.field.next(trade.action, log_return));
        self.returns.iter().enumerate().map(payoff).collect()
    }
}
