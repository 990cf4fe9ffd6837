//! One robust Bellman step: the best action against the worst law of the uncertainty set.
//!
//!   g = max_a  u^{-1}( min_{F in C} E_F[ u( w(a, Z) ) ] ),
//!   w(a, z) = ln( ((1-a)(1+r) + a e^z) / (1+r) ) + g_next( G(y, a, z) ),
//!
//! u is the utility relative to the all-bank floor, so that g is the floor gain ln(CE / floor). G(y, a, z) is the state
//! with the wealth that the action earns and, if the framework learns, the law with z in it. Source: paper (3.2) to
//! (3.4), with V taken at the adversary's z.
//!
//! If trading costs, w has the extra term `ln((1 - c |a - h|) / (1 - c h))`, the log of the share kept by the trade.
//! The wealth earned counts as if all of it were sold. The worth of an action then has a kink at the holding h. So each
//! side is searched by itself, as if its cost were paid both ways, which leaves no kink. The two optima bound the
//! no-trade region. The best action is its nearer end, or the holding if inside. Source: Davis and Norman (1990),
//! Portfolio selection with transaction costs.
//!
//! With contributions or withdrawals, wealth is total wealth, of which the share s is in hand and moves
//! (`control/problem/dynamics.rs`):
//!
//!   w(a, z) = ln( s ((1-a)(1+r) + a e^z) / (1+r) + 1 - s ) + g_next( G(y, a, z) ).
//!
//! With spending, g is the gain of what is left after it, and the floor gain of the state follows by one formula
//! (`control/problem/spending.rs`).
//!
//! Uncertainty sets differ in how an action is priced (`Pricing`); the search for the best one is shared.

mod action_search;
pub mod controlled;
pub mod controlled_value;
pub mod field;
pub mod gain_field;
pub mod next_value;
mod normal;
pub mod problem;
pub mod solution;
mod transport;

use std::borrow::Cow;

use self::field::Field;
use self::gain_field::GainField;
use self::next_value::NextValue;
use self::normal::NormalPricing;
use self::problem::Problem;
use self::solution::{RobustSolution, WorstExpectation};
use self::transport::TransportPricing;
use crate::control::problem::actions::{ActionInterval, Band};
use crate::control::problem::dynamics::{Dynamics, Side, Trade};
use crate::control::problem::holdings::Holdings;
use crate::control::problem::state::State;
use crate::control::problem::utility::RelativeUtility;
use crate::control::surrogate::policy_target::policy_target;
use crate::control::uncertainty::{Reach, UncertaintySet};
use crate::numerics::machine::interruption;
use crate::numerics::search::minimise::maximise_concave_scalar;

/// Largest number of doublings of an uncertified window: sixteen times the first reach takes a return to e^-9.6.
const WINDOW_GROWTHS: usize = 4;

/// Refined prices move the best action by less than the width of its bracket over this.
const MOVED_BY_REFINING: f64 = 8.0;

/// The robust step at every state of one step.
#[derive(Clone, Copy)]
pub struct BellmanStep<'a> {
    /// The problem to solve.
    pub problem: &'a Problem,
    /// Periods observed before this step.
    pub step: usize,
    /// The value of the step after.
    pub next: &'a NextValue,
}

/// Prices trades at one state, each under the law that is worst for it.
trait Pricing {
    /// Returns the worst expected relative utility of a trade.
    fn value(&self, trade: Trade) -> f64;

    /// Returns the value to an accuracy that suffices to bracket the best action.
    fn rough_value(&self, trade: Trade) -> f64 {
        self.value(trade)
    }

    /// Returns the tolerance for the best action that the current prices justify.
    fn tolerance(&self) -> f64;

    /// Prices more exactly around the destinations of mass in the worst laws for `trades`. Returns false if nothing is
    /// left to refine.
    fn refine(&mut self, trades: &[Trade]) -> bool;

    /// Returns the worst expectation of a trade with its law.
    fn worst(&self, trade: Trade) -> WorstExpectation;
}

/// The results at one state from which the surrogates learn.
pub struct DesignSolution {
    /// At the state's own holding.
    pub solution: RobustSolution,
    /// Floor gains at the holdings asked for, or the solution's own alone if the holding does not matter.
    pub floor_gains: Vec<f64>,
    /// Either end of the band, or the action if both are equal, continued past the bounds of the interval, as shares of
    /// total wealth.
    pub policy_targets: Vec<f64>,
}

impl BellmanStep<'_> {
    /// Solves the step at `state`. Cost: the gain field, and some thirty actions priced, twice as many if trading
    /// costs.
    pub fn solve(&self, state: &State) -> RobustSolution {
        let set = self.problem.laws.uncertainty_set(&state.law);
        self.optimum(state, &set, self.actions(state), |_, _| ()).0.at_least_the_bank()
    }

    /// Solves the step with another radius for the uncertainty set of this step alone; the value of the step after
    /// stays.
    pub fn solve_within(&self, state: &State, radius: f64) -> RobustSolution {
        let set = self.problem.laws.uncertainty_set_within(&state.law, radius);
        self.optimum(state, &set, self.actions(state), |_, _| ()).0.at_least_the_bank()
    }

    /// Solves the step as [`Self::solve`] does, and returns the targets of the surrogates: the floor gains of the state
    /// with any of `holdings`, and the band. The radius may be given if it is known.
    pub fn solve_for_design(&self, state: &State, radius: Option<f64>, holdings: Holdings) -> DesignSolution {
        let actions = self.actions(state);
        let set = match radius {
            Some(radius) => Cow::Owned(self.problem.laws.uncertainty_set_within(&state.law, radius)),
            None => self.problem.laws.uncertainty_set(&state.law),
        };
        let (utility, dynamics) = (self.utility(state), self.problem.dynamics(self.step));
        let unit = self.problem.unit_of_action(self.step, state);
        let curvature = utility.relative_risk_aversion() * set.variance();
        let largest = self.problem.largest_gain(self.step, state);
        let (solution, (floor_gains, policy_targets)) = self.optimum(state, &set, actions, |pricing, found| {
            let gain = |trade: Trade| dynamics.gain(utility.inverse(pricing.value(trade)));
            let target = |&side: &Side| {
                let end = match side {
                    Side::Buying => found.band.low,
                    Side::Selling => found.band.high,
                };
                let gain_at = |share: f64| gain(dynamics.trade(side, state.holding, share / unit));
                // If both sides are one, the gain is known.
                let own = if dynamics.trading_cost > 0.0 { gain_at(end * unit) } else { found.floor_gain };
                policy_target(end * unit, actions.highest * unit, own, curvature, gain_at)
            };
            // Another holding has another floor, and its trade keeps another share.
            let gain_of = |holding: f64| {
                let Trade { action, kept } = dynamics.trade_into(found.band, holding);
                let liquidated = dynamics.liquidation(holding) / dynamics.liquidation(state.holding);
                let [floor, own] = [holding, state.holding].map(|holding| dynamics.total(state.wealth, holding));
                not_above(largest, gain(Trade { action, kept: kept * liquidated })) - (floor / own).ln()
            };
            let gains = match holdings.matter() {
                true => holdings.nodes().map(|holding| not_below_zero(gain_of(holding))).collect(),
                false => vec![not_below_zero(found.floor_gain)],
            };
            (gains, dynamics.sides().iter().map(target).collect())
        });
        DesignSolution { solution: solution.at_least_the_bank(), floor_gains, policy_targets }
    }

    /// Returns the worth of one action, which need not be the best.
    pub fn price(&self, state: &State, action: f64) -> RobustSolution {
        let only = ActionInterval { lowest: action, highest: action };
        self.optimum(state, &self.problem.laws.uncertainty_set(&state.law), only, |_, _| ()).0
    }

    fn actions(&self, state: &State) -> ActionInterval {
        self.problem.actions(self.step, state)
    }

    fn utility(&self, state: &State) -> RelativeUtility {
        RelativeUtility::new(self.problem.specification.problem.utility, self.problem.floor(self.step, state))
    }

    /// Finds the best of `actions`, and applies `then` to it and to the prices around it.
    fn optimum<T>(
        &self,
        state: &State,
        set: &UncertaintySet,
        actions: ActionInterval,
        then: impl Fn(&dyn Pricing, &RobustSolution) -> T,
    ) -> (RobustSolution, T) {
        let (utility, dynamics) = (self.utility(state), self.problem.dynamics(self.step));
        let largest = self.problem.largest_gain(self.step, state);
        let field = |returns| GainField::tabulate(self.problem, self.step, self.next, utility, state, returns);
        best_response(set, actions, (dynamics, state.holding), field, |pricing, best| {
            let solution = solution(best, (utility, dynamics), largest);
            let more = then(pricing, &solution);
            (solution, more)
        })
    }
}

/// The trade that is best against the worst law for it.
struct BestResponse {
    band: Band,
    trade: Trade,
    worst: WorstExpectation,
}

/// Finds the best of `actions` from a holding against the worst law of a set, and applies `then` to it and to the
/// prices around it. Windows of returns grow until the worst law provably stays inside.
fn best_response<F: Field, T>(
    set: &UncertaintySet,
    actions: ActionInterval,
    (dynamics, holding): (Dynamics, f64),
    field_at: impl Fn(Vec<f64>) -> F,
    then: impl Fn(&dyn Pricing, BestResponse) -> T,
) -> T {
    let (mut reach, mut growths) = (Reach::FIRST, 0);
    loop {
        interruption::checkpoint();
        let field = field_at(set.exact_returns(reach));
        let is_concave = field.is_concave();
        let mut pricing = pricing(set, &field);
        let band = best_band(pricing.as_mut(), (actions, is_concave), dynamics, holding);
        let trade = dynamics.trade_into(band, holding);
        let mut worst = pricing.worst(trade);
        // Other holdings trade to the ends of the band, whose worth is also reported.
        let ends = [band.low, band.high].into_iter().filter(|end| *end != trade.action);
        let mut ends = ends.map(|end| dynamics.trade_to(holding, end));
        // If a support bounds the returns, the window covers all of them.
        worst.certified = !set.has_window() || worst.certified && ends.all(|end| pricing.worst(end).certified);
        if worst.certified || growths == WINDOW_GROWTHS {
            return then(pricing.as_ref(), BestResponse { band, trade, worst });
        }
        (reach, growths) = (reach.doubled(), growths + 1);
    }
}

/// Returns the prices of a field against a set of laws.
fn pricing<'f>(set: &'f UncertaintySet, field: &'f dyn Field) -> Box<dyn Pricing + 'f> {
    match set {
        UncertaintySet::Point(centre) => Box::new(TransportPricing::new(centre, 0.0, field)),
        UncertaintySet::Ball { centre, radius, .. } => Box::new(TransportPricing::new(centre, *radius, field)),
        UncertaintySet::Region(region) => Box::new(NormalPricing::new(*region, field)),
    }
}

/// Brackets the best action of each side, then polishes them as the prices are refined. The worth of an investor's side
/// is concave in the action.
fn best_band(
    pricing: &mut dyn Pricing,
    (actions, is_concave): (ActionInterval, bool),
    dynamics: Dynamics,
    holding: f64,
) -> Band {
    let bracket = |&side: &Side| {
        let bracket = actions.bracket(is_concave, |action| pricing.rough_value(dynamics.trade(side, holding, action)));
        (side, bracket)
    };
    let mut brackets: Vec<(Side, (f64, f64))> = dynamics.sides().iter().map(bracket).collect();
    loop {
        let best = |&(side, (low, high)): &(Side, (f64, f64))| {
            let trade = |action: f64| dynamics.trade(side, holding, action);
            let (action, _) =
                maximise_concave_scalar(|action| pricing.value(trade(action)), low, high, pricing.tolerance());
            trade(action)
        };
        let ends: Vec<Trade> = brackets.iter().map(best).collect();
        if !pricing.refine(&ends) {
            return Band::of(&ends.iter().map(|trade| trade.action).collect::<Vec<f64>>());
        }
        for ((_, (low, high)), Trade { action, .. }) in brackets.iter_mut().zip(&ends) {
            let reach = (*high - *low) / MOVED_BY_REFINING;
            (*low, *high) = (low.max(action - reach), high.min(action + reach));
        }
    }
}

impl RobustSolution {
    /// Raises the gain to at least 0, because all-bank is feasible and no law can hurt it.
    fn at_least_the_bank(self) -> Self {
        RobustSolution { floor_gain: not_below_zero(self.floor_gain), ..self }
    }
}

/// Clamps to 0 from below. NaN stays NaN, and no zero is negative.
fn not_below_zero(gain: f64) -> f64 {
    if gain <= 0.0 { 0.0 } else { gain }
}

/// Clamps to `largest` from above. NaN stays NaN.
fn not_above(largest: f64, gain: f64) -> f64 {
    if gain > largest { largest } else { gain }
}

/// Converts the primal and the dual value to gains. Neither is above the `largest` gain, because no law of the set is
/// better in every period than its best return. If wealth is so large that its utility no longer grows, both may be
/// that.
fn solution(best: BestResponse, (utility, dynamics): (RelativeUtility, Dynamics), largest: f64) -> RobustSolution {
    let BestResponse { band, trade, worst } = best;
    let gain = |value: f64| dynamics.gain(not_above(largest, utility.inverse(value)));
    let floor_gain = gain(worst.value);
    let slope = dynamics.slope_of_gain(utility.inverse(worst.value)) * utility.inverse_slope(worst.value);
    RobustSolution {
        action: trade.action,
        band,
        floor_gain,
        duality_gap: floor_gain - gain(worst.dual),
        multiplier: worst.multiplier,
        radius_cost: worst.multiplier * slope,
        adversary: worst.adversary,
        certified: worst.certified,
    }
}
