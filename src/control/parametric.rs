//! One robust Bellman step where returns are taken as normal: the best action against the worst mean and variance.
//!
//!   g = max_a  u^{-1}( min_{(mu, s2) in C} E_{N(mu, s2)}[ u( w(a, Z) ) ] ),
//!   w(a, z) = ln( ((1-a)(1+r) + a e^z) / (1+r) ) + g_next( x'(a,z), m'(z), v'(z) ),
//!
//! C the joint confidence region of the estimates (m, v) of n returns, u the utility relative to the all-bank floor, and
//!
//!   m' = m + (z - m)/(n+1),  v' = n v/(n+1) + n (z - m)^2/(n+1)^2
//!
//! where returns are learned. Source: Bielecki, Chen, Cialenco, Cousin and Jeanblanc (2019), Adaptive robust control under
//! model uncertainty, SIAM J. Control Optim. 57.

use super::bellman::{Adversary, LOSS_OF_ROUNDING, RobustSolution, bracket, extended_action};
use super::gain_field::{FieldContext, FieldRows, GainField};
use super::state::State;
use super::utility::RelativeUtility;
use crate::numerics::confidence_region::{ConfidenceRegion, NormalLaw, Quadrature, WorstNormal};
use crate::numerics::minimise::maximise_concave_scalar;

const ACTION_TOLERANCE: f64 = 1e-6;
/// Spacing of the field's exact returns around the estimated mean, in estimated standard deviations; how far that
/// goes; and the ratio by which spacing grows beyond.
const CORE_SPACING: f64 = 0.25;
const CORE_REACH: f64 = 5.0;
const TAIL_RATIO: f64 = 1.3;

/// The problem of one state, complete.
pub struct ParametricStep<'a> {
    pub field: FieldContext<'a>,
    pub utility: RelativeUtility,
    pub region: ConfidenceRegion,
}

/// What pricing an action takes: the gain field of the state, and the field at the nodes of the laws that every action is
/// tried against.
struct Pricing<'p, 'a> {
    step: &'p ParametricStep<'a>,
    field: &'p GainField<'a>,
    rows: FieldRows<'p, 'a>,
    quadrature: Quadrature,
}

impl ParametricStep<'_> {
    /// Solves the step at `state` over the actions in `[lowest, highest]`: a single action is priced where they are equal.
    /// Cost: the field, and some thirty actions of sixty expectations each.
    pub fn solve(&self, state: &State, (lowest, highest): (f64, f64)) -> RobustSolution {
        let field = GainField::tabulate(self.field, state, self.exact_returns());
        let nodes: Vec<f64> = self.region.angles().flat_map(|angle| self.region.at(angle).nodes()).collect();
        let pricing = Pricing { step: self, field: &field, rows: field.at(&nodes), quadrature: Quadrature::default() };
        let (low, high) =
            bracket(lowest, highest, |action| pricing.tried(action).into_iter().fold(f64::INFINITY, f64::min));
        let (action, _) = maximise_concave_scalar(|action| pricing.robust_value(action), low, high, ACTION_TOLERANCE);
        pricing.solution(action)
    }

    /// Returns at which the field is exact: evenly around the estimated mean, then with growing gaps as far as any law of
    /// the region has nodes.
    fn exact_returns(&self) -> Vec<f64> {
        let NormalLaw { mean, variance } = self.region.estimate;
        let gap = CORE_SPACING * variance.sqrt();
        let core = (CORE_REACH / CORE_SPACING) as i32;
        let mut returns: Vec<f64> = (-core..=core).map(|index| mean + f64::from(index) * gap).collect();
        let (low, high) = self.region.window();
        for (start, limit, sign) in [(returns[0], low, -1.0), (returns[returns.len() - 1], high, 1.0)] {
            let (mut at, mut step) = (start, gap);
            while sign * (limit - at) > 0.0 {
                step *= TAIL_RATIO;
                at += sign * step;
                returns.push(at);
            }
        }
        returns.sort_by(f64::total_cmp);
        returns
    }
}

impl Pricing<'_, '_> {
    /// Relative utility of the next state's certainty equivalent at prepared returns.
    fn payoff(&self, rows: &FieldRows, action: f64) -> Vec<f64> {
        let (relative, gains) = rows.at_action(action);
        self.step.utility.values(relative, &gains)
    }

    fn expectation(&self, law: NormalLaw, action: f64) -> f64 {
        let nodes: Vec<f64> = law.nodes().collect();
        self.quadrature.expectation(&self.payoff(&self.field.at(&nodes), action))
    }

    /// Expected relative utility under the laws that every action is tried against.
    fn tried(&self, action: f64) -> Vec<f64> {
        let payoff = self.payoff(&self.rows, action);
        payoff.chunks_exact(self.quadrature.count()).map(|payoff| self.quadrature.expectation(payoff)).collect()
    }

    fn worst(&self, action: f64) -> WorstNormal {
        self.step.region.worst(&self.tried(action), |law| self.expectation(law, action))
    }

    /// Worst expected relative utility of an action.
    fn robust_value(&self, action: f64) -> f64 {
        self.worst(action).expectation
    }

    fn solution(&self, action: f64) -> RobustSolution {
        let ParametricStep { field, utility, region } = self.step;
        let worst = self.worst(action);
        let gain = utility.inverse(worst.expectation);
        let reference = utility.relative_risk_aversion() * region.estimate.variance;
        let gain_at = |tried: f64| utility.inverse(self.robust_value(tried));
        // Nobody is told of a law that is worse by rounding alone.
        let loss = self.expectation(region.estimate, action) - worst.expectation;
        let told = if loss > LOSS_OF_ROUNDING { worst.law } else { region.estimate };
        RobustSolution {
            action,
            extended_action: extended_action(action, field.highest_action, gain, reference, gain_at),
            floor_gain: gain,
            duality_gap: 0.0,
            multiplier: region.multiplier(&worst, |law| self.expectation(law, action)),
            adversary: Adversary::Normal { worst: told, estimate: region.estimate },
            certified: true,
        }
    }
}
