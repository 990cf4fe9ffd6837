//! Worst expectation over a Wasserstein-1 ball on a finite support, solved exactly.
//!
//! The paper maximises a dual over the multiplier gamma, (3.3). The dual is concave and piecewise linear. At any gamma
//! each atom's mass goes to the point where `v(z) + gamma |z - z_k|` is least, and the distance cost and loss of that
//! plan give the line that touches the dual there. This module finds the two lines between which the radius lies. The
//! multiplier is where they meet, and the worst law moves from one plan to the other until the radius is spent. Its
//! expectation bounds the infimum from above, and the dual at the multiplier bounds it from below. The difference is
//! reported as the duality gap.

use std::ops::Range;

use crate::numerics::machine::dispatch::dispatched;
use crate::numerics::transport::runs::{Levels, MassRun, passed};

/// A ball around a discrete law: `masses[k]` is at `support[k]` (ascending, distinct), and the masses sum to 1.
#[derive(Debug, Clone, Copy)]
pub struct WassersteinBall<'a> {
    /// Support points s_k, ascending and distinct.
    pub support: &'a [f64],
    /// Masses p_k, which sum to 1.
    pub masses: &'a [f64],
    /// Radius in the unit of the support, at least 0.
    pub radius: f64,
}

/// Mass moved from one support point to another, or kept if they are equal; indices into the support.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// Index of the mass's original point.
    pub from: usize,
    /// Index of the point to which the mass is moved.
    pub to: usize,
    /// The mass moved.
    pub mass: f64,
}

/// The solution of the inner problem.
#[derive(Debug, Clone, PartialEq)]
pub struct WorstLaw {
    /// Expectation of the payoff under the worst law: an upper bound of the infimum, because the law is feasible.
    pub expectation: f64,
    /// Dual value at the multiplier: a lower bound of the infimum.
    pub dual: f64,
    /// Lagrange multiplier of the radius, at least 0.
    pub multiplier: f64,
    /// The moves that turn the ball's centre into the worst law.
    pub moves: Vec<Move>,
}

/// The destination of all mass at one multiplier: its cost in distance, and the amount by which it lowers the mean.
#[derive(Debug, Clone, Copy)]
struct DualPlan {
    multiplier: f64,
    cost: f64,
    loss: f64,
}

/// The plan that moves nothing.
const STAYING: DualPlan = DualPlan { multiplier: f64::INFINITY, cost: 0.0, loss: 0.0 };
/// The most plans tried: each nearly halves the remaining interval.
const PLAN_LIMIT: usize = 200;
/// The factors of a guessed multiplier that are tried, to bound it from both sides.
const GUESSES: [f64; 3] = [0.99, 1.01, 0.8];
/// If a plan improves on a mixture of two others by less than this share of their loss, it counts as equal.
const ROUNDING: f64 = 1e-12;

/// The two plans between which the worst law spends the radius, and the multiplier at which both are optimal.
struct OptimalFace {
    near: DualPlan,
    far: DualPlan,
    multiplier: f64,
}

/// A search for the points at which `v + gamma distance` is least.
struct MinimumSearch<'a> {
    ball: &'a WassersteinBall<'a>,
    payoff: &'a [f64],
    /// Range of the mass that may still move: mass that stays at one multiplier stays at every greater one.
    from: Range<usize>,
    /// Range that contains this mass and every point it may move to.
    between: Range<usize>,
    /// The runs moved by the latest plan, ascending.
    runs: Vec<MassRun>,
    /// The runs that would move if all moved down, ascending, and if all moved up, descending.
    downs: Vec<MassRun>,
    ups: Vec<MassRun>,
}

impl<'a> MinimumSearch<'a> {
    fn new(ball: &'a WassersteinBall<'a>, payoff: &'a [f64]) -> Self {
        let has_mass = |mass: &f64| *mass > 0.0;
        let first = ball.masses.iter().position(has_mass).unwrap_or(0);
        let end = ball.masses.iter().rposition(has_mass).map_or(0, |last| last + 1);
        let (from, between) = (first..end, 0..ball.support.len());
        MinimumSearch { ball, payoff, from, between, runs: Vec::new(), downs: Vec::new(), ups: Vec::new() }
    }

    /// Finds the runs that move at a multiplier, each in the better of two directions. Cost O(points between).
    fn sweep(&mut self, multiplier: f64) {
        let (support, payoff) = (self.ball.support, self.payoff);
        let MinimumSearch { from, between, runs, downs, ups, .. } = self;
        let levels = |slope: f64| Levels { support, payoff, slope };
        dispatched!(levels(multiplier).downs(between, from, downs));
        dispatched!(levels(-multiplier).ups(between, from, ups));
        ups.reverse();
        runs.clear();
        let mut push = |points: Range<usize>, to: usize| {
            if !points.is_empty() {
                runs.push(MassRun { points, to });
            }
        };
        let (mut downs, mut ups, mut at) = (downs.as_slice(), ups.as_slice(), from.start);
        while at < from.end {
            let ((below, end_below), (above, end_above)) = (passed(&mut downs, at), passed(&mut ups, at));
            let end = from.end.min(end_below).min(end_above);
            match (below, above) {
                (None, None) => {}
                (Some(to), None) | (None, Some(to)) => push(at..end, to),
                (Some(below), Some(above)) => {
                    // Down if `v(s) - v(below) - gamma (s - below)` is no less than
                    // `v(s) - v(above) - gamma (above - s)`.
                    let bound = payoff[above] - payoff[below] + multiplier * (support[above] + support[below]);
                    let cut = at + support[at..end].partition_point(|point| 2.0 * multiplier * point <= bound);
                    push(at..cut, below);
                    push(cut..end, above);
                }
            }
            at = end;
        }
    }

    /// Returns the best plan at a multiplier. Cost O(points between).
    fn plan(&mut self, multiplier: f64) -> DualPlan {
        self.sweep(multiplier);
        let WassersteinBall { support, masses, .. } = *self.ball;
        let beyond = |values: &[f64]| {
            let of_run = |MassRun { points, to }: &MassRun| {
                sum_beyond(values[*to], &values[points.clone()], &masses[points.clone()])
            };
            dispatched!(self.runs.iter().map(of_run).map(f64::abs).sum())
        };
        // All points of a run move in one direction, to a point with a lower payoff.
        DualPlan { multiplier, cost: beyond(support), loss: beyond(self.payoff) }
    }

    /// Drops the mass that stays in the latest plan; its multiplier must be below the one sought.
    fn restrict(&mut self) {
        let support = self.ball.support;
        let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
        for MassRun { points, to } in &self.runs {
            let [first, last, to] = [points.start, points.end - 1, *to].map(|point| support[point]);
            // Mass that moved to one side may move less far to the other.
            (lowest, highest) = (lowest.min(to).min(2.0 * first - to), highest.max(to).max(2.0 * last - to));
        }
        let ends = self.runs.first().zip(self.runs.last());
        self.from = ends.map_or(0..0, |(first, last)| first.points.start..last.points.end);
        let first = support.partition_point(|&point| point < lowest);
        let last = support.partition_point(|&point| point <= highest);
        // Rounding may have excluded the farthest point.
        self.between = first.saturating_sub(1)..(last + 1).min(support.len());
    }

    /// Finds the edge of the frontier of cost and loss on which the radius lies. The slope of a chord of the frontier
    /// is the multiplier of the plan farthest beyond it. That plan replaces one end of the chord, until there is none.
    fn edge(&mut self, guess: f64) -> OptimalFace {
        let radius = self.ball.radius;
        let (mut near, mut far) = (STAYING, None);
        let guesses = GUESSES.map(|factor| factor * guess).into_iter().filter(|guess| *guess > 0.0);
        for multiplier in guesses.chain([0.0]) {
            if far.is_some_and(|far: DualPlan| multiplier <= far.multiplier) || multiplier >= near.multiplier {
                continue;
            }
            let plan = self.plan(multiplier);
            if plan.cost > radius {
                self.restrict();
                far = Some(plan);
            } else {
                near = plan;
            }
        }
        let Some(mut far) = far else {
            // The rest of the radius gains nothing.
            return OptimalFace { near, far: near, multiplier: 0.0 };
        };
        let chord = |near: DualPlan, far: DualPlan| (far.loss - near.loss) / (far.cost - near.cost);
        for _ in 0..PLAN_LIMIT {
            let multiplier = chord(near, far);
            let plan = self.plan(multiplier);
            let better = (plan.loss - near.loss) - multiplier * (plan.cost - near.cost);
            if !(plan.cost > near.cost && plan.cost < far.cost && better > ROUNDING * far.loss) {
                break;
            }
            if plan.cost > radius {
                self.restrict();
                far = plan;
            } else {
                near = plan;
            }
        }
        OptimalFace { near, far, multiplier: chord(near, far) }
    }

    /// Returns the point to which a plan sends the mass of each point.
    fn destinations(&mut self, plan: DualPlan) -> Vec<usize> {
        let mut places: Vec<usize> = (0..self.payoff.len()).collect();
        if plan.multiplier < f64::INFINITY {
            self.sweep(plan.multiplier);
            self.runs.iter().for_each(|MassRun { points, to }| places[points.clone()].fill(*to));
        }
        places
    }
}

/// The number of sums that run in parallel.
const LANES: usize = 8;

/// Returns `sum_k p_k (v_k - level)`, in a fixed order that does not depend on the processor.
#[inline(always)]
fn sum_beyond(level: f64, values: &[f64], masses: &[f64]) -> f64 {
    let ((values, last_values), (masses, last_masses)) = (values.as_chunks::<LANES>(), masses.as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    for (values, masses) in values.iter().zip(masses) {
        for lane in 0..LANES {
            sums[lane] += masses[lane] * (values[lane] - level);
        }
    }
    let rest: f64 = last_values.iter().zip(last_masses).map(|(value, mass)| mass * (value - level)).sum();
    sums.iter().sum::<f64>() + rest
}

impl WassersteinBall<'_> {
    /// Returns `min { E_F[payoff] : W1(F, law) <= radius, F on the support }` and its multiplier.
    ///
    /// `payoff[k]` is the payoff at `support[k]`, finite. Cost O(K) for each of a dozen plans.
    pub fn worst_expectation(&self, payoff: &[f64]) -> (f64, f64) {
        self.worst_expectation_near(payoff, 0.0)
    }

    /// Returns the same values, up to rounding, given a guess of the multiplier, or 0: half as many plans if the guess
    /// is good.
    pub fn worst_expectation_near(&self, payoff: &[f64], guess: f64) -> (f64, f64) {
        let edge = MinimumSearch::new(self, payoff).edge(guess);
        (self.expectation(payoff, &edge), edge.multiplier)
    }

    /// Returns the worst law with both bounds; at most one atom's mass is split. Cost as [`Self::worst_expectation`].
    pub fn worst_law(&self, payoff: &[f64]) -> WorstLaw {
        self.worst_law_near(payoff, 0.0)
    }

    /// Returns the worst law given a guess of the multiplier, as in [`Self::worst_expectation_near`].
    pub fn worst_law_near(&self, payoff: &[f64], guess: f64) -> WorstLaw {
        let mut search = MinimumSearch::new(self, payoff);
        let edge = search.edge(guess);
        let [near, far] = [edge.near, edge.far].map(|plan| search.destinations(plan));
        let (mut budget, mut moves) = (self.radius - edge.near.cost, Vec::new());
        for (from, &mass) in self.masses.iter().enumerate().filter(|(_, mass)| **mass > 0.0) {
            let [near, far] = [near[from], far[from]];
            let distance = |to: usize| (self.support[to] - self.support[from]).abs();
            let cost = mass * (distance(far) - distance(near));
            let share = if near == far || cost <= budget { 1.0 } else { budget / cost };
            budget = if share < 1.0 { 0.0 } else { budget - cost };
            push_move(&mut moves, from, far, mass * share);
            push_move(&mut moves, from, near, mass * (1.0 - share));
        }
        let (expectation, multiplier) = (self.expectation(payoff, &edge), edge.multiplier);
        WorstLaw { expectation, dual: self.dual(payoff, multiplier), multiplier, moves }
    }

    /// Returns the dual value of the worst expectation.
    ///
    ///   D(gamma) = sum_k p_k min_l { v(s_l) + gamma |s_l - s_k| } - gamma radius
    ///
    /// Concave in gamma >= 0, and a lower bound at each gamma. Radius 0 and a large gamma give the mean of v.
    /// Cost O(K): the inner minimum is a distance transform. Source: paper (3.3), (3.4), with V taken at z'.
    pub fn dual(&self, payoff: &[f64], multiplier: f64) -> f64 {
        let envelope = self.envelope(payoff, multiplier);
        let mean: f64 = envelope.iter().zip(self.masses).map(|(value, mass)| value * mass).sum();
        mean - multiplier * self.radius
    }

    /// Returns `E(k) = min_l { v(s_l) + gamma |s_l - s_k| }`, the largest gamma-Lipschitz function below the payoff.
    pub fn envelope(&self, payoff: &[f64], multiplier: f64) -> Vec<f64> {
        let mut envelope = payoff.to_vec();
        for k in 1..envelope.len() {
            let from_left = envelope[k - 1] + multiplier * (self.support[k] - self.support[k - 1]);
            envelope[k] = envelope[k].min(from_left);
        }
        for k in (1..envelope.len()).rev() {
            let from_right = envelope[k] + multiplier * (self.support[k] - self.support[k - 1]);
            envelope[k - 1] = envelope[k - 1].min(from_right);
        }
        envelope
    }

    /// Returns the expectation under the law at the centre of the ball.
    pub fn mean(&self, payoff: &[f64]) -> f64 {
        dispatched!(sum_beyond(0.0, payoff, self.masses))
    }

    /// Returns the expectation under the law that spends the radius between the two plans of `edge`.
    fn expectation(&self, payoff: &[f64], edge: &OptimalFace) -> f64 {
        self.mean(payoff) - edge.near.loss - edge.multiplier * (self.radius - edge.near.cost)
    }
}

fn push_move(moves: &mut Vec<Move>, from: usize, to: usize, mass: f64) {
    if mass > 0.0 {
        moves.push(Move { from, to, mass });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Checks that both bounds meet at a law in the ball, for any guess.
    fn meet(ball: WassersteinBall<'_>, payoff: &[f64]) -> Result<(), TestCaseError> {
        let WassersteinBall { support, radius, .. } = ball;
        let worst = ball.worst_law(payoff);
        // A dozen roundings of numbers below 2.
        prop_assert!((worst.expectation - worst.dual).abs() < 1e-12);
        let total: f64 = worst.moves.iter().map(|m| m.mass).sum();
        let spent: f64 = worst.moves.iter().map(|m| m.mass * (support[m.to] - support[m.from]).abs()).sum();
        let reached: f64 = worst.moves.iter().map(|m| m.mass * payoff[m.to]).sum();
        prop_assert!((total - 1.0).abs() < 1e-12);
        prop_assert!(spent <= radius + 1e-12);
        prop_assert!((reached - worst.expectation).abs() < 1e-12);
        prop_assert_eq!(ball.worst_expectation(payoff), (worst.expectation, worst.multiplier));
        for factor in [0.5, 0.97, 1.0, 1.005, 1.3, 9.0] {
            let near = ball.worst_law_near(payoff, factor * worst.multiplier);
            prop_assert!((near.expectation - worst.expectation).abs() < 1e-12);
            prop_assert!((near.dual - worst.expectation).abs() < 1e-12);
        }
        let sources: std::collections::BTreeSet<usize> = worst.moves.iter().map(|m| m.from).collect();
        prop_assert!(worst.moves.len() <= sources.len() + 1, "at most one atom's mass is split");
        Ok(())
    }

    proptest! {
        #[test]
        fn primal_and_dual_meet_on_any_payoff(
            payoff in proptest::collection::vec(-1.0_f64..1.0, 12),
            atoms in proptest::collection::vec(0_usize..12, 5),
            radius in 0.0_f64..2.0,
            monotone in any::<bool>(),
        ) {
            let support: Vec<f64> = (0..12).map(|k| k as f64 * 0.1 + (k * k) as f64 * 0.01).collect();
            let mut payoff = payoff;
            if monotone {
                payoff.sort_by(f64::total_cmp);
            }
            let mut masses = vec![0.0; 12];
            for atom in atoms {
                masses[atom] += 0.2;
            }
            // With radius 0 the multiplier is the steepest fall from an atom.
            let centre = WassersteinBall { support: &support, masses: &masses, radius: 0.0 };
            let fall = |from: usize, to: usize| (payoff[from] - payoff[to]) / (support[from] - support[to]).abs();
            let falls = (0..144).filter(|pair| masses[pair / 12] > 0.0 && pair / 12 != pair % 12);
            let steepest = falls.map(|pair| fall(pair / 12, pair % 12)).fold(0.0, f64::max);
            prop_assert!((centre.worst_expectation(&payoff).1 - steepest).abs() < 1e-9 * (1.0 + steepest));
            meet(WassersteinBall { radius, ..centre }, &payoff)?;
        }

        /// Waves that rise and fall over many points, with atoms at some of them.
        #[test]
        fn primal_and_dual_meet_over_many_points(
            waves in proptest::collection::vec(-0.3_f64..0.3, 6),
            has_mass in proptest::collection::vec(any::<bool>(), 2..400),
            radius in 0.0_f64..0.3,
        ) {
            let points = has_mass.len();
            let support: Vec<f64> = (0..points).map(|k| k as f64 / points as f64).collect();
            let wave = |at: &f64| waves.iter().zip(1..).map(|(size, turns)| size * (f64::from(turns) * 4.0 * at).cos()).sum();
            let payoff: Vec<f64> = support.iter().map(wave).collect();
            let count = has_mass.iter().filter(|has| **has).count().max(1) as f64;
            let mut masses: Vec<f64> = has_mass.iter().map(|&has| f64::from(u8::from(has)) / count).collect();
            if !has_mass.contains(&true) {
                masses[0] = 1.0;
            }
            meet(WassersteinBall { support: &support, masses: &masses, radius }, &payoff)?;
        }
    }
}
