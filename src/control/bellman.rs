//! One robust Bellman step: the best action against the worst law of the ball.
//!
//!   g = max_a  u^{-1}( min_{W1(F, F^) <= radius} E_F[ u( w(a, Z) ) ] ),
//!   w(a, z) = ln( ((1-a)(1+r) + a e^z) / (1+r) ) + g_next( x'(a,z), (n F^ + delta_z)/(n+1) ),
//!
//! u the utility relative to the all-bank floor, so that g is the floor gain ln(CE / floor). Source: paper
//! eqs. (max2), (max3), with V taken at the adversary's z.

use super::gain_field::{FieldContext, FieldRows, GainField};
use super::specification::Interval;
use super::state::{State, growth};
use super::utility::RelativeUtility;
use crate::numerics::confidence_region::NormalLaw;
use crate::numerics::minimise::maximise_concave_scalar;
use crate::numerics::wasserstein::{Move, WassersteinBall, WorstLaw};

/// Equal parts of the action interval that are tried before the search between the best one's neighbours.
const COARSE_ACTIONS: usize = 8;
const ACTION_TOLERANCE: f64 = 1e-7;
const PLACING_TOLERANCE: f64 = 1e-4;
/// Step of the one-sided derivatives at a bound.
const DERIVATIVE_STEP: f64 = 5e-2;
/// The curvature there is taken to lie within this factor of relative risk aversion times variance.
const CURVATURE_RANGE: f64 = 4.0;
/// How far past a bound the policy target may be extended.
const LARGEST_EXTENSION: f64 = 2.0;
/// Exact returns of the field across the atoms, and the ratio by which spacing grows outside them.
const CORE_RETURNS: usize = 20;
const TAIL_RATIO: f64 = 1.3;
/// First reach of the window below and above the atoms; doubled until certified, at most this often.
const REACH: (f64, f64) = (0.6, 0.3);
const WINDOW_GROWTHS: usize = 4;
/// Log-returns closer than this are one.
const COINCIDENT: f64 = 1e-12;
/// Relative utility that sums of a few hundred roundings may lose.
pub const LOSS_OF_ROUNDING: f64 = 1e-14;
/// Parts into which each interval between exact returns is cut for the support, and again around destinations.
const SUPPORT_PARTS: usize = 4;
const REFINED_PARTS: usize = 8;
const REFINEMENTS: usize = 2;

/// The problem of one state, complete.
pub struct RobustStep<'a> {
    pub field: FieldContext<'a>,
    pub utility: RelativeUtility,
    pub support: Option<Interval>,
    /// Centre of the ball: ascending distinct atoms and their masses.
    pub atoms: &'a [f64],
    pub masses: &'a [f64],
    pub radius: f64,
    /// Variance of the centre, for the reference curvature of the extended target.
    pub variance: f64,
}

/// The solution of one state.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustSolution {
    pub action: f64,
    /// The action, moved past a bound by the Newton step of the one-sided derivatives there.
    pub extended_action: f64,
    /// Log certainty equivalent over the all-bank floor.
    pub floor_gain: f64,
    /// Primal minus dual value, in log certainty equivalent; 0 over normal laws, which are searched without a dual.
    pub duality_gap: f64,
    /// Lost relative utility per unit of radius.
    pub multiplier: f64,
    pub adversary: Adversary,
    /// True where the multiplier proves that no mass wants to leave the window, and over normal laws, which have none.
    pub certified: bool,
}

impl RobustSolution {
    /// The same without the worst law: with a long history that takes more memory than all else of a design point.
    pub fn without_adversary(self) -> Self {
        RobustSolution { adversary: Adversary::Transport { support: Vec::new(), moves: Vec::new() }, ..self }
    }
}

/// The law that is worst for an action.
#[derive(Debug, Clone, PartialEq)]
pub enum Adversary {
    /// Of a ball: the centre's masses moved about a support.
    Transport { support: Vec<f64>, moves: Vec<Move> },
    /// Of a confidence region, around its estimate.
    Normal { worst: NormalLaw, estimate: NormalLaw },
}

/// The support with the centre's masses on it.
struct Grid {
    support: Vec<f64>,
    masses: Vec<f64>,
}

impl RobustStep<'_> {
    /// Solves the step at `state` over the actions in `[lowest, highest]`: a single action is priced where they are
    /// equal. Windows grow until certified; then the support is refined around the destinations of the worst law and
    /// the action polished.
    pub fn solve(&self, state: &State, actions: (f64, f64)) -> RobustSolution {
        let (mut reach, mut solved) = (REACH, None);
        for growth in 0..=WINDOW_GROWTHS {
            let found = self.solve_in_window(state, reach, actions);
            let done = found.certified || self.support.is_some() || self.radius <= 0.0 || growth == WINDOW_GROWTHS;
            solved = Some(found);
            if done {
                break;
            }
            reach = (2.0 * reach.0, 2.0 * reach.1);
        }
        solved.unwrap_or_else(|| self.solve_in_window(state, reach, actions))
    }

    fn solve_in_window(&self, state: &State, reach: (f64, f64), (lowest, highest): (f64, f64)) -> RobustSolution {
        let returns = self.exact_returns(reach);
        let field = GainField::tabulate(self.field, state, returns.clone());
        let mut grid = self.grid(subdivided(&returns, SUPPORT_PARTS, |_| true));
        let mut rows = field.at(&grid.support);
        let (low, high) = bracket(lowest, highest, |action| self.robust_value(&grid, &rows, action));
        let polished = |grid: &Grid, rows: &FieldRows, tolerance: f64| {
            maximise_concave_scalar(|action| self.robust_value(grid, rows, action), low, high, tolerance).0
        };
        // Until the last refinement the action only has to say where the worst law puts its mass.
        let mut action = polished(&grid, &rows, if self.radius > 0.0 { PLACING_TOLERANCE } else { ACTION_TOLERANCE });
        let rounds = if self.radius > 0.0 && action > 0.0 { REFINEMENTS } else { 0 };
        for round in 1..=rounds {
            let near: Vec<bool> = self.destinations(&grid, &rows, action);
            let refined = subdivided(&grid.support, REFINED_PARTS, |interval| near[interval] || near[interval + 1]);
            grid = self.grid(refined);
            rows = field.at(&grid.support);
            action = polished(&grid, &rows, if round == rounds { ACTION_TOLERANCE } else { PLACING_TOLERANCE });
        }
        self.solution(grid, &rows, action)
    }

    fn solution(&self, grid: Grid, rows: &FieldRows, action: f64) -> RobustSolution {
        let payoff = self.payoff(rows, action);
        let worst = self.worst_law(&grid, &payoff);
        let gain = self.utility.inverse(worst.expectation);
        RobustSolution {
            action,
            extended_action: self.extended(&grid, rows, action, gain),
            floor_gain: gain,
            duality_gap: gain - self.utility.inverse(worst.dual),
            multiplier: worst.multiplier,
            certified: self.certified(&grid, &payoff, &worst, action),
            adversary: Adversary::Transport { support: grid.support, moves: worst.moves },
        }
    }

    /// The worst law; the centre itself where no law takes more than rounding, so that nobody is told of moves that
    /// rounding made.
    fn worst_law(&self, grid: &Grid, payoff: &[f64]) -> WorstLaw {
        let worst = self.ball(grid).worst_law(payoff);
        let centre = WassersteinBall { radius: 0.0, ..self.ball(grid) }.worst_law(payoff);
        if centre.expectation - worst.expectation > LOSS_OF_ROUNDING { worst } else { centre }
    }

    fn ball<'g>(&self, grid: &'g Grid) -> WassersteinBall<'g> {
        WassersteinBall { support: &grid.support, masses: &grid.masses, radius: self.radius }
    }

    /// Relative utility of the next state's certainty equivalent at every support point.
    fn payoff(&self, rows: &FieldRows, action: f64) -> Vec<f64> {
        let (relative, gains) = rows.at_action(action);
        self.utility.values(relative, &gains)
    }

    /// Worst expected relative utility of an action.
    fn robust_value(&self, grid: &Grid, rows: &FieldRows, action: f64) -> f64 {
        self.ball(grid).worst_expectation(&self.payoff(rows, action)).0
    }

    /// Support points that receive mass from elsewhere.
    fn destinations(&self, grid: &Grid, rows: &FieldRows, action: f64) -> Vec<bool> {
        let mut near = vec![false; grid.support.len()];
        for moved in self.ball(grid).worst_law(&self.payoff(rows, action)).moves {
            near[moved.to] |= moved.to != moved.from;
        }
        near
    }

    fn extended(&self, grid: &Grid, rows: &FieldRows, action: f64, gain: f64) -> f64 {
        let gain_at = |tried: f64| self.utility.inverse(self.robust_value(grid, rows, tried));
        let reference = self.utility.relative_risk_aversion() * self.variance;
        extended_action(action, self.field.highest_action, gain, reference, gain_at)
    }

    /// Proves from the multiplier that no law with mass outside the window does worse.
    ///
    /// Outside, the payoff is at least u at zero gain. Mass of atom j stays if, for every z outside,
    /// `u0(z) + gamma |z - z_j| >= E_j`, E the envelope; checked interval by interval, u0 being increasing.
    fn certified(&self, grid: &Grid, payoff: &[f64], worst: &WorstLaw, action: f64) -> bool {
        let (Some(&first), Some(&last)) = (grid.support.first(), grid.support.last()) else { return true };
        let rate = self.field.rate_per_step;
        let lowest = |z: f64| self.utility.value(growth(action, z, rate).ln() - rate.ln_1p());
        let gamma = worst.multiplier;
        let envelope = self.ball(grid).envelope(payoff, gamma);
        let (mut below, mut above) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        for ((&point, &mass), &value) in grid.support.iter().zip(&grid.masses).zip(&envelope) {
            if mass > 0.0 {
                below = below.max(value - gamma * (point - first));
                above = above.max(value - gamma * (last - point));
            }
        }
        // Rounding of the envelope, in relative utility.
        const SLACK: f64 = 1e-12;
        let mut edge = 0.0;
        while edge < 40.0 {
            let far = edge + 0.02 + 0.1 * edge;
            if lowest(first - far) + gamma * edge < below - SLACK {
                return false;
            }
            edge = far;
        }
        lowest(last) >= above - SLACK
    }

    /// Returns at which the field is exact: evenly across the atoms, then with growing gaps to the window's edges.
    fn exact_returns(&self, reach: (f64, f64)) -> Vec<f64> {
        let (Some(&lowest), Some(&highest)) = (self.atoms.first(), self.atoms.last()) else { return vec![0.0] };
        let gap = ((highest - lowest) / CORE_RETURNS as f64).max(1e-4);
        let mut returns: Vec<f64> = (0..=CORE_RETURNS).map(|index| lowest + index as f64 * gap).collect();
        if self.radius > 0.0 {
            let (low, high) = match self.support {
                Some(Interval { min, max }) => (min, max),
                None => (lowest - reach.0, highest + reach.1),
            };
            for (start, limit, sign) in [(lowest, low, -1.0), (returns[CORE_RETURNS], high, 1.0)] {
                let (mut at, mut step) = (start, gap);
                while sign * (limit - at) > 1e-12 {
                    at = if sign * (limit - at) > 1.5 * step { at + sign * step } else { limit };
                    returns.push(at);
                    step *= TAIL_RATIO;
                }
            }
            returns.retain(|&z| z >= low && z <= high);
        }
        returns.sort_by(f64::total_cmp);
        returns.dedup();
        returns
    }

    /// Merges the atoms into `points`, which give way where they all but coincide with an atom: mass that moves by a
    /// rounding would count as moved. Without a radius the atoms alone are the support.
    fn grid(&self, points: Vec<f64>) -> Grid {
        if self.radius <= 0.0 {
            return Grid { support: self.atoms.to_vec(), masses: self.masses.to_vec() };
        }
        let mut all: Vec<(f64, f64)> = self.atoms.iter().copied().zip(self.masses.iter().copied()).collect();
        let apart = |point: &f64| {
            let above = self.atoms.partition_point(|atom| atom < point);
            let mut near = self.atoms.iter().take(above + 1).skip(above.saturating_sub(1));
            near.all(|atom| (atom - point).abs() > COINCIDENT)
        };
        all.extend(points.into_iter().filter(apart).map(|point| (point, 0.0)));
        all.sort_by(|left, right| left.0.total_cmp(&right.0));
        all.dedup_by(|next, kept| next.0 == kept.0);
        let (support, masses) = all.into_iter().unzip();
        Grid { support, masses }
    }
}

/// The neighbours of the best of the actions that cut `[lowest, highest]` into equal parts.
pub fn bracket(lowest: f64, highest: f64, value: impl Fn(f64) -> f64) -> (f64, f64) {
    let part = (highest - lowest) / COARSE_ACTIONS as f64;
    let mut best = (lowest, value(lowest));
    for index in 1..=COARSE_ACTIONS {
        let action = lowest + index as f64 * part;
        let tried = value(action);
        if tried > best.1 {
            best = (action, tried);
        }
    }
    ((best.0 - part).max(lowest), (best.0 + part).min(highest))
}

/// An action at a bound, or so near that the value of the step after may have put it there by its own error, moved past
/// the bound by the Newton step that the one-sided derivatives there suggest: the optimum of the parabola that touches the
/// robust gain at the bound, so that the target crosses the bound without a kink. `gain` is the robust gain of `action`,
/// `reference` is the curvature expected: relative risk aversion times variance.
pub fn extended_action(action: f64, highest: f64, gain: f64, reference: f64, gain_at: impl Fn(f64) -> f64) -> f64 {
    let (bound, inward) = if action < DERIVATIVE_STEP {
        (0.0, 1.0)
    } else if action > highest - DERIVATIVE_STEP {
        (highest, -1.0)
    } else {
        return action;
    };
    let gain = if action == bound { gain } else { gain_at(bound) };
    let [near, far] = [1.0, 2.0].map(|steps| gain_at(bound + inward * steps * DERIVATIVE_STEP));
    let slope = (4.0 * near - far - 3.0 * gain) / (2.0 * DERIVATIVE_STEP);
    if slope > 0.0 {
        return action;
    }
    let curvature = (2.0 * near - far - gain) / (DERIVATIVE_STEP * DERIVATIVE_STEP);
    let curvature = curvature.clamp(reference / CURVATURE_RANGE, reference * CURVATURE_RANGE);
    // Far beyond the bound the target levels off, smoothly, for what is never wanted needs no resolution.
    bound + inward * LARGEST_EXTENSION * (slope / curvature / LARGEST_EXTENSION).tanh()
}

/// `points` with the chosen intervals cut into equal parts.
fn subdivided(points: &[f64], parts: usize, chosen: impl Fn(usize) -> bool) -> Vec<f64> {
    let mut all = Vec::with_capacity(points.len() * parts);
    for (interval, pair) in points.windows(2).enumerate() {
        all.push(pair[0]);
        if chosen(interval) {
            all.extend((1..parts).map(|part| pair[0] + (pair[1] - pair[0]) * part as f64 / parts as f64));
        }
    }
    all.extend(points.last());
    all
}
