//! One robust step of any controlled problem:
//!
//!   V_t(x, F^) = max_a  min_{F in C(F^)}  E_F[ V_(t+1)( S(x, a, Z), R(F^, Z) ) ].
//!
//! Actions are searched along lines (`action_search.rs`). If one number describes the next state, its gains are predicted
//! at even values of that number and at a few returns, for all lines (`controlled_value.rs::GainTable`). Otherwise
//! they are predicted at every return of the support, and at even actions of a line if the description depends on the
//! action. The dynamics themselves are followed for every action. The investor's own step (`super::BellmanStep`) knows
//! that wealth is affine in the action, and predicts at fewer actions.

use std::borrow::Cow;
use std::cell::RefCell;
use std::rc::Rc;

use super::action_search::{ActionChoices, ActionLine, LineSearch, SearchedActions, best_of_all};
use super::controlled_value::{ControlledValue, GainNodes, GainTable};
use super::field::{Field, Payoffs, places};
use super::solution::Adversary;
use super::{BestResponse, best_response, pricing};
use crate::control::error::TrainError;
use crate::control::problem::actions::{ActionInterval, FINE_ACTIONS};
use crate::control::problem::controlled::Controlled;
use crate::control::problem::dynamics::{Dynamics, Trade};
use crate::control::surrogate::features::{FeatureSelection, Features};
use crate::control::uncertainty::laws::{LawSummary, Laws};
use crate::control::uncertainty::{Reach, UncertaintySet};
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::search::chebyshev::even;
use crate::numerics::statistics::summary::range;

/// Nodes at which gains are predicted if the description of the next state depends on the action. If changing the
/// description costs, a value has kinks. Cubics are then good to a twentieth of the jump of its second derivative times
/// the distance's square.
const EVEN_NODES: usize = 33;

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
    /// Factor on the radius of this step's ball; 1 but for questions.
    pub radius_scale: f64,
}

/// The solution of a controlled problem's robust step at one state.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlledSolution {
    /// The best actions, one for each set of them.
    pub actions: Vec<f64>,
    /// Their certainty equivalent against the worst law, an amount at the horizon.
    pub certainty_equivalent: f64,
    /// The gain of the certainty equivalent over the state's baseline.
    pub gain: f64,
    /// Primal minus dual value, in certainty equivalent.
    pub duality_gap: f64,
    /// True if no mass wants to leave the window of returns.
    pub certified: bool,
    /// The worst law for the actions.
    pub adversary: Adversary,
}

impl<P: Controlled> ControlledStep<'_, P> {
    /// Returns the features of a state and its law: the description, then the features of the law.
    pub fn features(&self, state: &P::State, law: &EmpiricalDistribution) -> Features {
        self.selection.of_law(&self.laws.summary(law)).after(self.problem.describe(self.step, state))
    }

    /// Returns the features of the next states, noise by noise (ascending), with the laws that have learned them.
    pub fn features_after(
        &self,
        state: &P::State,
        law: &EmpiricalDistribution,
        actions: &[f64],
        noises: &[f64],
    ) -> Vec<Features> {
        let after = |(summary, noise): (LawSummary, &f64)| {
            let next = self.problem.next(self.step, state, actions, *noise);
            self.selection.of_law(&summary).after(self.problem.describe(self.step + 1, &next))
        };
        self.laws.summaries_with(law, noises).into_iter().zip(noises).map(after).collect()
    }

    /// Solves the step. Cost with one action: a prediction at each of some hundreds of returns, and some thirty actions
    /// priced; a hundred if the problem is not concave. Several actions take some ten searches of one, or twenty.
    pub fn solve(&self, state: &P::State, law: &EmpiricalDistribution) -> ControlledSolution {
        let at = self.at(state, law);
        best_of_all(&at.choices, &at)
    }

    /// Solves the step, and returns for each action the certainty equivalents of the even actions that a search begins
    /// with, from the lowest to the highest one of its interval, the others as they are best. They are good enough to show
    /// where the peaks are. `None` if the set of the action is no interval.
    pub fn solve_with_worths(
        &self,
        state: &P::State,
        law: &EmpiricalDistribution,
    ) -> (ControlledSolution, Vec<Option<Vec<f64>>>) {
        let at = self.at(state, law);
        let found = best_of_all(&at.choices, &at);
        let along = |place: usize| {
            let line = at.choices.axis(&found.actions, place)?;
            Some(at.rough_worths(&line, even(1.0, 2.0, FINE_ACTIONS + 1)))
        };
        let worths = (0..found.actions.len()).map(along).collect();
        (found, worths)
    }

    fn at<'a>(&'a self, state: &'a P::State, law: &'a EmpiricalDistribution) -> ControlledState<'a, P> {
        let baseline = self.problem.baseline(self.step, state);
        let choices = ActionChoices::of(self.problem.actions(self.step, state));
        let set = match self.radius_scale {
            1.0 => self.laws.uncertainty_set(law),
            scale => Cow::Owned(self.laws.uncertainty_set_within(law, scale * self.laws.radius(law))),
        };
        let described = match self.next {
            Some(_) => self.problem.describe(self.step, state).len(),
            None => 0,
        };
        let spread = if described == 1 { choices.spread() } else { Vec::new() };
        ControlledState { step: self, state, law, set, baseline, choices, spread, table: RefCell::default() }
    }
}

/// The robust step at one state.
struct ControlledState<'a, P: Controlled> {
    step: &'a ControlledStep<'a, P>,
    state: &'a P::State,
    law: &'a EmpiricalDistribution,
    set: Cow<'a, UncertaintySet>,
    /// The baseline of this state.
    baseline: f64,
    choices: ActionChoices,
    /// Actions over all that may be chosen, if the next state is described by one number; otherwise none.
    spread: Vec<Vec<f64>>,
    /// Gains for all lines, if the description is one number.
    table: RefCell<Option<Rc<GainTable>>>,
}

impl ControlledSolution {
    /// Returns the solution if its actions and its gain are numbers.
    ///
    /// # Errors
    /// [`TrainError::NotFinite`] with the step and the design point.
    pub fn finite(self, step: usize, point: usize) -> Result<Self, TrainError> {
        let gain = self.gain;
        match self.actions.iter().find(|action| !action.is_finite() || !gain.is_finite()) {
            Some(&action) => Err(TrainError::NotFinite { step, point, gain, action }),
            None => Ok(self),
        }
    }
}

impl SearchedActions for ControlledSolution {
    fn actions(&self) -> &[f64] {
        &self.actions
    }

    fn gain(&self) -> f64 {
        self.gain
    }
}

impl<P: Controlled> LineSearch for ControlledState<'_, P> {
    type Found = ControlledSolution;

    fn is_concave(&self) -> bool {
        self.step.problem.is_concave()
    }

    fn on_line(&self, line: &ActionLine) -> ControlledSolution {
        // Shares from 1 to 2 fit the tolerances of the search in any unit.
        let shares = ActionInterval { lowest: 1.0, highest: if line.is_point() { 1.0 } else { 2.0 } };
        // The cost of trading is part of the problem itself.
        let free = (Dynamics::plain(0.0, 0.0), 0.0);
        let field = |returns: Vec<f64>| ControlledField::new(self, line, returns);
        let certain = |value: f64| self.step.problem.certainty_equivalent(value, self.baseline);
        best_response(&self.set, shares, free, field, |_, BestResponse { trade, worst, .. }| {
            let certainty_equivalent = certain(worst.value);
            ControlledSolution {
                actions: line.at(trade.action),
                certainty_equivalent,
                gain: self.step.problem.gain(certainty_equivalent, self.baseline),
                duality_gap: certainty_equivalent - certain(worst.dual),
                certified: worst.certified,
                adversary: worst.adversary,
            }
        })
    }

    /// Returns a certainty equivalent.
    fn roughly(&self, actions: &[f64]) -> f64 {
        self.rough_worths(&ActionLine::point(actions), vec![1.0])[0]
    }
}

impl<P: Controlled> ControlledState<'_, P> {
    /// Returns the certainty equivalents at shares of a line, without finding exactly where the worst law puts its mass.
    fn rough_worths(&self, line: &ActionLine, shares: Vec<f64>) -> Vec<f64> {
        let field = ControlledField::new(self, line, self.set.exact_returns(Reach::FIRST));
        let pricing = pricing(&self.set, &field);
        let certain = |value: f64| self.step.problem.certainty_equivalent(value, self.baseline);
        shares.into_iter().map(|share| certain(pricing.rough_value(Trade { action: share, kept: 1.0 }))).collect()
    }
}

/// The next state's value, from one state and along a line of actions.
struct ControlledField<'a, P: Controlled> {
    state: &'a ControlledState<'a, P>,
    line: &'a ActionLine,
    returns: Vec<f64>,
    table: Option<Rc<GainTable>>,
}

impl<'a, P: Controlled> ControlledField<'a, P> {
    fn new(state: &'a ControlledState<'a, P>, line: &'a ActionLine, returns: Vec<f64>) -> Self {
        let mut field = ControlledField { state, line, returns, table: None };
        field.table = field.tabulated();
        field
    }

    fn next(&self, actions: &[f64], log_return: f64) -> P::State {
        self.state.step.problem.next(self.state.step.step, self.state.state, actions, log_return)
    }

    fn described(&self, next: &P::State) -> Vec<f64> {
        self.state.step.problem.describe(self.state.step.step + 1, next)
    }

    fn utility(&self, gain: f64, next: &P::State) -> f64 {
        let ControlledStep { problem, step, .. } = *self.state.step;
        let worth = problem.worth(gain, problem.baseline(step + 1, next));
        problem.utility(worth, self.state.baseline)
    }

    /// Returns the least gain: a floor cannot be lost.
    fn least_gain(&self) -> f64 {
        if self.state.step.problem.has_floor() { 0.0 } else { f64::NEG_INFINITY }
    }

    /// Returns the gains for all lines, if one number describes the next state.
    fn tabulated(&self) -> Option<Rc<GainTable>> {
        let value = self.state.step.next.filter(|_| !self.state.spread.is_empty())?;
        let mut table = self.state.table.borrow_mut();
        // A window of returns that grows needs another table.
        if table.as_ref().is_none_or(|table| !table.covers(&self.returns)) {
            let ControlledStep { laws, selection, .. } = *self.state.step;
            let of_laws = |returns: &[f64]| -> Vec<Features> {
                laws.summaries_with(self.state.law, returns).iter().map(|law| selection.of_law(law)).collect()
            };
            let number = |(actions, log_return): (&Vec<f64>, &f64)| self.described(&self.next(actions, *log_return))[0];
            let reached = self.state.spread.iter().flat_map(|actions| self.returns.iter().map(move |z| (actions, z)));
            let (returns, reached) = (self.returns.clone(), range(reached.map(number)));
            *table = Some(Rc::new(GainTable::new(value, returns, of_laws, reached, self.least_gain())));
        }
        table.clone()
    }

    /// Returns the gains of the next state after each return; none at the horizon.
    fn gains(&self, returns: &[f64]) -> Vec<Rc<GainNodes>> {
        let ControlledStep { laws, selection, next, .. } = *self.state.step;
        let Some(value) = next else { return Vec::new() };
        if let Some(table) = &self.table {
            return table.rows(returns);
        }
        let summaries = laws.summaries_with(self.state.law, returns);
        let nodes = |(law, log_return)| Rc::new(self.nodes(value, &selection.of_law(law), log_return));
        summaries.iter().zip(returns.iter().copied()).map(nodes).collect()
    }

    /// Returns the gains after one return along the line.
    fn nodes(&self, value: &ControlledValue, law: &Features, log_return: f64) -> GainNodes {
        let mut at = if self.line.is_point() { vec![1.0] } else { even(1.0, 2.0, EVEN_NODES) };
        let described = |share: &f64| self.described(&self.next(&self.line.at(*share), log_return));
        let descriptions: Vec<Vec<f64>> = at.iter().map(described).collect();
        if descriptions.iter().all(|described| *described == descriptions[0]) {
            at.truncate(1);
        }
        let gain = |described: Vec<f64>| value.gain(&law.clone().after(described)).max(self.least_gain());
        GainNodes { gains: descriptions.into_iter().take(at.len()).map(gain).collect(), at: Rc::new(at) }
    }
}

impl<P: Controlled> Field for ControlledField<'_, P> {
    fn returns(&self) -> &[f64] {
        &self.returns
    }

    fn is_concave(&self) -> bool {
        self.state.is_concave()
    }

    fn at<'f>(&'f self, returns: &[f64]) -> Box<dyn Payoffs<'f> + 'f> {
        Box::new(ControlledRows { field: self, returns: returns.to_vec(), gains: self.gains(returns) })
    }

    fn least_payoff(&self, trade: Trade, log_return: f64) -> f64 {
        // Without a floor nothing is certain, and nothing is beyond the support.
        let has_floor = self.state.step.problem.has_floor();
        let least = || self.utility(0.0, &self.next(&self.line.at(trade.action), log_return));
        if has_floor { least() } else { f64::NEG_INFINITY }
    }
}

struct ControlledRows<'f, P: Controlled> {
    field: &'f ControlledField<'f, P>,
    returns: Vec<f64>,
    /// Return by return; empty at the horizon.
    gains: Vec<Rc<GainNodes>>,
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
        let actions = self.field.line.at(trade.action);
        let along_line = self.field.table.is_none();
        let payoff = |(index, &log_return): (usize, &f64)| {
            let next = self.field.next(&actions, log_return);
            let gain = self.gains.get(index).map_or(0.0, |nodes| {
                nodes.gain(if along_line { trade.action } else { self.field.described(&next)[0] })
            });
            self.field.utility(gain, &next)
        };
        self.returns.iter().enumerate().map(payoff).collect()
    }
}
