//! One robust Bellman step: the best action against the worst law of the uncertainty set.
//!
//!   g = max_a  u^{-1}( min_{F in C} E_F[ u( w(a, Z) ) ] ),
//!   w(a, z) = ln( ((1-a)(1+r) + a e^z) / (1+r) ) + g_next( G(y, a, z) ),
//!
//! u the utility relative to the all-bank floor, so that g is the floor gain ln(CE / floor), and G(y, a, z) the state with
//! the wealth that the action earns and, where the framework learns, the law with z in it. Source: paper (3.2) to (3.4),
//! with V taken at the adversary's z.
//!
//! What differs between uncertainty sets is how an action is priced (`Pricing`); the search for the best one is the same.

pub mod gain_field;
pub mod next_value;
mod normal;
pub mod problem;
pub mod solution;
mod transport;

use self::gain_field::GainField;
use self::next_value::NextValue;
use self::normal::NormalPricing;
use self::problem::Problem;
use self::solution::{RobustSolution, WorstExpectation};
use self::transport::TransportPricing;
use crate::control::problem::actions::ActionInterval;
use crate::control::problem::state::State;
use crate::control::problem::utility::RelativeUtility;
use crate::control::surrogate::policy_target::policy_target;
use crate::control::uncertainty::{Reach, UncertaintySet};
use crate::numerics::minimise::maximise_concave_scalar;

/// Doublings of an uncertified window, at most: sixteen times the first reach takes a return to e^-9.6.
const WINDOW_GROWTHS: usize = 4;

/// The robust step at every state of one step.
#[derive(Clone, Copy)]
pub struct BellmanStep<'a> {
    /// What is solved.
    pub problem: &'a Problem,
    /// Periods observed before it.
    pub step: usize,
    /// The value of the step after.
    pub next: &'a NextValue,
}

/// Prices actions at one state: what each is worth under the law that is worst for it.
trait Pricing {
    /// Worst expected relative utility of an action.
    fn value(&self, action: f64) -> f64;

    /// The same, good enough to say between which actions the best one lies.
    fn rough_value(&self, action: f64) -> f64 {
        self.value(action)
    }

    /// How closely the best action is worth finding by the prices of now.
    fn tolerance(&self) -> f64;

    /// Prices more exactly around where the worst law for `action` puts its mass. False where nothing is left to refine.
    fn refine(&mut self, action: f64) -> bool;

    /// The worst expectation of an action with its law.
    fn worst(&self, action: f64) -> WorstExpectation;
}

impl BellmanStep<'_> {
    /// Solves the step at `state`. Cost: the gain field, and some thirty actions priced.
    pub fn solve(&self, state: &State) -> RobustSolution {
        let set = self.problem.uncertainty_set(state);
        at_least_the_bank(self.optimum(state, &set, self.problem.actions(), |_, _| ()).0)
    }

    /// The same were the uncertainty set of this step alone of another radius; the value of the step after stays.
    pub fn solve_within(&self, state: &State, radius: f64) -> RobustSolution {
        let set = self.problem.uncertainty_set_within(state, radius);
        at_least_the_bank(self.optimum(state, &set, self.problem.actions(), |_, _| ()).0)
    }

    /// [`Self::solve`] with the target of the policy surrogate at the state.
    pub fn solve_for_design(&self, state: &State) -> (RobustSolution, f64) {
        let (set, actions) = (self.problem.uncertainty_set(state), self.problem.actions());
        let utility = self.utility(state);
        let curvature = utility.relative_risk_aversion() * set.variance();
        let (solution, target) = self.optimum(state, &set, actions, |pricing, found| {
            let gain = |action: f64| utility.inverse(pricing.value(action));
            policy_target(found.action, actions.highest, found.floor_gain, curvature, gain)
        });
        (at_least_the_bank(solution), target)
    }

    /// What one action is worth, the best or not.
    pub fn price(&self, state: &State, action: f64) -> RobustSolution {
        let only = ActionInterval { lowest: action, highest: action };
        self.optimum(state, &self.problem.uncertainty_set(state), only, |_, _| ()).0
    }

    fn utility(&self, state: &State) -> RelativeUtility {
        RelativeUtility::new(self.problem.specification.problem.utility, self.problem.floor(self.step, state))
    }

    /// The best of `actions`, and what `then` makes of it and of the prices around it. Windows of returns grow until the
    /// worst law provably stays inside.
    fn optimum<T>(
        &self,
        state: &State,
        set: &UncertaintySet,
        actions: ActionInterval,
        then: impl Fn(&dyn Pricing, &RobustSolution) -> T,
    ) -> (RobustSolution, T) {
        let utility = self.utility(state);
        let largest = self.problem.largest_gain(self.step, state);
        let (mut reach, mut growths) = (Reach::FIRST, 0);
        loop {
            let field = GainField::tabulate(self.problem, self.next, utility, state, set.exact_returns(reach));
            let mut pricing: Box<dyn Pricing + '_> = match set {
                UncertaintySet::Point(centre) => Box::new(TransportPricing::new(centre, 0.0, &field)),
                UncertaintySet::Ball { centre, radius, .. } => Box::new(TransportPricing::new(centre, *radius, &field)),
                UncertaintySet::Region(region) => Box::new(NormalPricing::new(*region, &field)),
            };
            let action = best_action(pricing.as_mut(), actions);
            let solution = solution(action, pricing.worst(action), utility, largest);
            if solution.certified || !set.has_window() || growths == WINDOW_GROWTHS {
                let more = then(pricing.as_ref(), &solution);
                return (solution, more);
            }
            (reach, growths) = (reach.doubled(), growths + 1);
        }
    }
}

/// Brackets the best action, then polishes it as the prices are refined. Its value is concave in the action.
fn best_action(pricing: &mut dyn Pricing, actions: ActionInterval) -> f64 {
    let (low, high) = actions.bracket(|action| pricing.rough_value(action));
    loop {
        let (action, _) = maximise_concave_scalar(|action| pricing.value(action), low, high, pricing.tolerance());
        if !pricing.refine(action) {
            return action;
        }
    }
}

/// All-bank is feasible and no law can hurt it.
fn at_least_the_bank(solution: RobustSolution) -> RobustSolution {
    let gain = solution.floor_gain;
    // What is not a number stays so, and no zero is negative.
    RobustSolution { floor_gain: if gain <= 0.0 { 0.0 } else { gain }, ..solution }
}

/// The primal and the dual value as gains. Neither is above the `largest` gain, for no law of the set is better in every
/// period than its best return; where wealth is so large that its utility no longer grows, both may be that.
fn solution(action: f64, worst: WorstExpectation, utility: RelativeUtility, largest: f64) -> RobustSolution {
    let gain = |value: f64| match utility.inverse(value) {
        gain if gain > largest => largest,
        gain => gain,
    };
    let floor_gain = gain(worst.value);
    RobustSolution {
        action,
        floor_gain,
        duality_gap: floor_gain - gain(worst.dual),
        multiplier: worst.multiplier,
        adversary: worst.adversary,
        certified: worst.certified,
    }
}
