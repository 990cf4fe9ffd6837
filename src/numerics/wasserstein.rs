//! Worst expectation over a Wasserstein-1 ball on a finite support, solved exactly.
//!
//! The paper maximises a dual over the multiplier gamma, (3.3). It is concave and made of finitely many lines: at any gamma
//! every atom's mass goes where `v(z) + gamma |z - z_k|` is least, and what that plan costs in distance and pays is the line
//! that touches the dual there. Here the two lines are found between which the radius lies, and they are enough: the multiplier
//! is where they meet, and the worst law moves from the plan of the one to that of the other until the radius is spent.
//! The value is that of this law, and so bounds the infimum from above; the dual at the multiplier bounds it from below, and
//! the difference of the two is reported as the duality gap.

use std::ops::Range;

/// A ball around a discrete law: `masses[k]` sits at `support[k]` (ascending, distinct), the masses sum to 1.
#[derive(Debug, Clone, Copy)]
pub struct WassersteinBall<'a> {
    /// s_k, ascending and distinct.
    pub support: &'a [f64],
    /// p_k, which sum to 1.
    pub masses: &'a [f64],
    /// In the unit of the support, at least 0.
    pub radius: f64,
}

/// Mass moved from one support point to another (or kept, where they are equal); indices into the support.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// Where the mass was.
    pub from: usize,
    /// Where it is put.
    pub to: usize,
    /// How much.
    pub mass: f64,
}

/// The solution of the inner problem.
#[derive(Debug, Clone, PartialEq)]
pub struct WorstLaw {
    /// Expectation of the payoff under the worst law: an upper bound of the infimum, being feasible.
    pub expectation: f64,
    /// Dual value at the multiplier: a lower bound of the infimum.
    pub dual: f64,
    /// Lagrange multiplier of the radius, at least 0.
    pub multiplier: f64,
    /// That make the law out of the ball's own.
    pub moves: Vec<Move>,
}

/// Where the mass of all atoms goes at one multiplier: what that takes, in distance, and by how much it lowers the mean.
#[derive(Debug, Clone, Copy)]
struct Plan {
    multiplier: f64,
    cost: f64,
    loss: f64,
}

/// Where nothing moves.
const STAYING: Plan = Plan { multiplier: f64::INFINITY, cost: 0.0, loss: 0.0 };
/// Plans tried at most: each halves what is left, nearly.
const PLAN_LIMIT: usize = 200;
/// Factors of a guess at the multiplier that are tried, to bound it from both sides.
const GUESSES: [f64; 3] = [0.99, 1.01, 0.8];
/// A plan that is better than a mixture of two others by less than this share of what they lose is as good.
const ROUNDING: f64 = 1e-12;

/// The plans between which a law spends the radius, and the multiplier at which both are best.
struct Edge {
    near: Plan,
    far: Plan,
    multiplier: f64,
}

/// A search for places at which `v + gamma distance` is least.
struct Search<'a> {
    ball: &'a WassersteinBall<'a>,
    payoff: &'a [f64],
    /// The atoms that may still move, for mass that stays at one multiplier stays at every greater one, and where the plan
    /// found last sends them.
    moving: Vec<(usize, usize)>,
    /// Where they and all that they may move to lie.
    between: Range<usize>,
    /// For every point the best at or below it, and the best at or above it.
    below: Vec<usize>,
    above: Vec<usize>,
}

impl<'a> Search<'a> {
    fn new(ball: &'a WassersteinBall<'a>, payoff: &'a [f64]) -> Self {
        let points = ball.support.len();
        let atoms = (0..points).filter(|&point| ball.masses[point] > 0.0);
        let moving = atoms.map(|atom| (atom, atom)).collect();
        Search { ball, payoff, moving, between: 0..points, below: vec![0; points], above: vec![0; points] }
    }

    /// Cost O(points between): two scans.
    fn look(&mut self, multiplier: f64) {
        let Range { start, end } = self.between;
        let (support, payoff) = (&self.ball.support[start..end], &self.payoff[start..end]);
        let (below, above) = (&mut self.below[start..end], &mut self.above[start..end]);
        let (mut low, mut low_at, mut high, mut high_at) = (f64::INFINITY, 0, f64::INFINITY, 0);
        for up in 0..support.len() {
            let down = support.len() - 1 - up;
            let from_below = payoff[up] - multiplier * support[up];
            let from_above = payoff[down] + multiplier * support[down];
            low_at = if from_below <= low { up } else { low_at };
            low = if from_below < low { from_below } else { low };
            high_at = if from_above <= high { down } else { high_at };
            high = if from_above < high { from_above } else { high };
            (below[up], above[down]) = (start + low_at, start + high_at);
        }
    }

    /// Where the mass at `from` goes, how far, and what that takes off its payoff; it stays where nothing is better.
    #[inline(always)]
    fn best(&self, from: usize, multiplier: f64) -> (usize, f64, f64) {
        let support = self.ball.support;
        let (below, above) = (self.below[from], self.above[from]);
        let [down, up] = [support[from] - support[below], support[above] - support[from]];
        let [lost_below, lost_above] = [below, above].map(|to| self.payoff[from] - self.payoff[to]);
        let [gain_below, gain_above] = [lost_below - multiplier * down, lost_above - multiplier * up];
        let is_above = gain_above > gain_below || (gain_above == gain_below && up < down);
        let pick = |above: f64, below: f64| if is_above { above } else { below };
        let moves = pick(gain_above, gain_below) > 0.0;
        let some = |value: f64| if moves { value } else { 0.0 };
        let to = if is_above { above } else { below };
        (if moves { to } else { from }, some(pick(up, down)), some(pick(lost_above, lost_below)))
    }

    /// The best plan at a multiplier. Cost O(points between).
    fn plan(&mut self, multiplier: f64) -> Plan {
        self.look(multiplier);
        let (mut cost, mut loss) = (0.0, 0.0);
        let mut moving = std::mem::take(&mut self.moving);
        for (from, to) in &mut moving {
            let (best, distance, lost) = self.best(*from, multiplier);
            *to = best;
            cost += self.ball.masses[*from] * distance;
            loss += self.ball.masses[*from] * lost;
        }
        self.moving = moving;
        Plan { multiplier, cost, loss }
    }

    /// Leaves out the atoms that stay in the plan found last, whose multiplier is below the one sought.
    fn narrow(&mut self) {
        let support = self.ball.support;
        let (mut lowest, mut highest, mut kept) = (f64::INFINITY, f64::NEG_INFINITY, 0);
        for index in 0..self.moving.len() {
            let (from, to) = self.moving[index];
            let distance = (support[to] - support[from]).abs();
            self.moving[kept] = (from, to);
            kept += usize::from(from != to);
            // What moved to one side may move less far to the other.
            let [down, up] = [support[from] - distance, support[from] + distance];
            lowest = if from != to && down < lowest { down } else { lowest };
            highest = if from != to && up > highest { up } else { highest };
        }
        self.moving.truncate(kept);
        let first = support.partition_point(|&point| point < lowest);
        let last = support.partition_point(|&point| point <= highest);
        // A rounding may have left the farthest place out.
        self.between = first.saturating_sub(1)..(last + 1).min(support.len());
    }

    /// The edge of the frontier of cost and loss on which the radius lies. A chord of the frontier names the multiplier of the
    /// plan farthest beyond it, which takes the place of one of its ends, until there is none.
    fn edge(&mut self, guess: f64) -> Edge {
        let radius = self.ball.radius;
        let (mut near, mut far) = (STAYING, None);
        let guesses = GUESSES.map(|factor| factor * guess).into_iter().filter(|guess| *guess > 0.0);
        for multiplier in guesses.chain([0.0]) {
            if far.is_some_and(|far: Plan| multiplier <= far.multiplier) || multiplier >= near.multiplier {
                continue;
            }
            let plan = self.plan(multiplier);
            if plan.cost > radius {
                self.narrow();
                far = Some(plan);
            } else {
                near = plan;
            }
        }
        let Some(mut far) = far else {
            // The rest of the radius buys nothing.
            return Edge { near, far: near, multiplier: 0.0 };
        };
        let chord = |near: Plan, far: Plan| (far.loss - near.loss) / (far.cost - near.cost);
        for _ in 0..PLAN_LIMIT {
            let multiplier = chord(near, far);
            let plan = self.plan(multiplier);
            let better = (plan.loss - near.loss) - multiplier * (plan.cost - near.cost);
            if !(plan.cost > near.cost && plan.cost < far.cost && better > ROUNDING * far.loss) {
                break;
            }
            if plan.cost > radius {
                self.narrow();
                far = plan;
            } else {
                near = plan;
            }
        }
        Edge { near, far, multiplier: chord(near, far) }
    }

    /// Where a plan sends the mass of the atoms that may move, and how far.
    fn destinations(&mut self, plan: Plan) -> Vec<(usize, f64)> {
        if plan.multiplier == f64::INFINITY {
            return self.moving.iter().map(|&(from, _)| (from, 0.0)).collect();
        }
        self.look(plan.multiplier);
        let place = |&(from, _): &(usize, usize)| {
            let (to, distance, _) = self.best(from, plan.multiplier);
            (to, distance)
        };
        self.moving.iter().map(place).collect()
    }
}

impl WassersteinBall<'_> {
    /// `min { E_F[payoff] : W1(F, law) <= radius, F on the support }` and its multiplier.
    ///
    /// `payoff[k]` is the payoff at `support[k]`, finite. Cost O(K) for each of a dozen plans.
    pub fn worst_expectation(&self, payoff: &[f64]) -> (f64, f64) {
        self.worst_expectation_near(payoff, 0.0)
    }

    /// The same, to rounding, with a guess at the multiplier, or 0: half as many plans where it is good.
    pub fn worst_expectation_near(&self, payoff: &[f64], guess: f64) -> (f64, f64) {
        let edge = Search::new(self, payoff).edge(guess);
        (self.expectation(payoff, &edge), edge.multiplier)
    }

    /// The worst law itself with both bounds; at most one atom's mass is split. Cost as [`Self::worst_expectation`].
    pub fn worst_law(&self, payoff: &[f64]) -> WorstLaw {
        self.worst_law_near(payoff, 0.0)
    }

    /// The same with a guess at the multiplier, as [`Self::worst_expectation_near`].
    pub fn worst_law_near(&self, payoff: &[f64], guess: f64) -> WorstLaw {
        let mut search = Search::new(self, payoff);
        let edge = search.edge(guess);
        let [near, far] = [edge.near, edge.far].map(|plan| search.destinations(plan));
        let (mut budget, mut moves) = (self.radius - edge.near.cost, Vec::new());
        let mut places = search.moving.iter().zip(near.iter().zip(&far)).peekable();
        for (from, &mass) in self.masses.iter().enumerate().filter(|(_, mass)| **mass > 0.0) {
            let Some((_, (near, far))) = places.next_if(|((moving, _), _)| *moving == from) else {
                push_move(&mut moves, from, from, mass);
                continue;
            };
            let cost = mass * (far.1 - near.1);
            let share = if near.0 == far.0 || cost <= budget { 1.0 } else { budget / cost };
            budget = if share < 1.0 { 0.0 } else { budget - cost };
            push_move(&mut moves, from, far.0, mass * share);
            push_move(&mut moves, from, near.0, mass * (1.0 - share));
        }
        let (expectation, multiplier) = (self.expectation(payoff, &edge), edge.multiplier);
        WorstLaw { expectation, dual: self.dual(payoff, multiplier), multiplier, moves }
    }

    /// Dual value of the worst expectation.
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

    /// `E(k) = min_l { v(s_l) + gamma |s_l - s_k| }`, the largest gamma-Lipschitz function below the payoff.
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

    /// The expectation under the law in the middle of the ball.
    pub fn mean(&self, payoff: &[f64]) -> f64 {
        payoff.iter().zip(self.masses).map(|(value, mass)| value * mass).sum()
    }

    /// That of the law that spends the radius between two plans.
    fn expectation(&self, payoff: &[f64], edge: &Edge) -> f64 {
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
            // Without a radius the multiplier is the steepest fall from an atom.
            let centre = WassersteinBall { support: &support, masses: &masses, radius: 0.0 };
            let fall = |from: usize, to: usize| (payoff[from] - payoff[to]) / (support[from] - support[to]).abs();
            let falls = (0..144).filter(|pair| masses[pair / 12] > 0.0 && pair / 12 != pair % 12);
            let steepest = falls.map(|pair| fall(pair / 12, pair % 12)).fold(0.0, f64::max);
            prop_assert!((centre.worst_expectation(&payoff).1 - steepest).abs() < 1e-9 * (1.0 + steepest));
            let ball = WassersteinBall { radius, ..centre };
            let worst = ball.worst_law(&payoff);
            // A dozen roundings of numbers below 2.
            prop_assert!((worst.expectation - worst.dual).abs() < 1e-12);
            let total: f64 = worst.moves.iter().map(|m| m.mass).sum();
            let spent: f64 = worst.moves.iter().map(|m| m.mass * (support[m.to] - support[m.from]).abs()).sum();
            let reached: f64 = worst.moves.iter().map(|m| m.mass * payoff[m.to]).sum();
            prop_assert!((total - 1.0).abs() < 1e-12);
            prop_assert!(spent <= radius + 1e-12);
            prop_assert!((reached - worst.expectation).abs() < 1e-12);
            prop_assert_eq!(ball.worst_expectation(&payoff), (worst.expectation, worst.multiplier));
            // Whatever is guessed; and at most one atom's mass is split.
            for factor in [0.5, 0.97, 1.0, 1.005, 1.3, 9.0] {
                let near = ball.worst_law_near(&payoff, factor * worst.multiplier);
                prop_assert!((near.expectation - worst.expectation).abs() < 1e-12);
                prop_assert!((near.dual - worst.expectation).abs() < 1e-12);
            }
            let sources: std::collections::BTreeSet<usize> = worst.moves.iter().map(|m| m.from).collect();
            prop_assert!(worst.moves.len() <= sources.len() + 1);
        }
    }
}
