//! Worst expectation over a Wasserstein-1 ball on a finite support, solved exactly.
//!
//! The paper maximises a dual over the multiplier gamma, (3.3). Here the primal is solved instead, and gamma falls out of
//! it; the dual at that gamma bounds the value from below, and the difference of the two is reported as the duality gap.
//!
//! Transporting the mass of one atom over a distance d buys, at best, the lower convex envelope of the payoff as a
//! function of distance. Spending the radius on the steepest envelope segments of all atoms first is therefore
//! optimal, the slope at which the radius runs out is the Lagrange multiplier, and the moves are the worst law.
//! Where no atom gains by moving up (every monotone payoff), the envelopes of all atoms share one forest:
//! the parent of a point is the previous vertex of the lower hull of the points up to it, and mass flows down the
//! forest in order of slope. Otherwise each atom's two-sided envelope is built by itself.

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

/// One segment of an envelope: moving `from`'s mass on from vertex `near` to vertex `far`.
#[derive(Debug, Clone, Copy)]
struct Segment {
    slope: f64,
    from: usize,
    near: usize,
    far: usize,
}

/// Parents in the forest of lower hulls: the vertex before k on the lower hull of the points 0 to k, with the
/// slope towards it. Cost O(K), Graham's scan.
fn hull_forest(support: &[f64], payoff: &[f64]) -> Vec<(usize, f64)> {
    let slope = |low: usize, high: usize| (payoff[high] - payoff[low]) / (support[high] - support[low]);
    let mut stack: Vec<usize> = Vec::with_capacity(support.len());
    let mut forest = Vec::with_capacity(support.len());
    for point in 0..support.len() {
        while let [.., second, top] = stack[..] {
            if slope(second, top) < slope(top, point) {
                break;
            }
            stack.pop();
        }
        match stack.last() {
            Some(&top) => forest.push((top, slope(top, point))),
            None => forest.push((point, 0.0)),
        }
        stack.push(point);
    }
    forest
}

impl WassersteinBall<'_> {
    /// `min { E_F[payoff] : W1(F, law) <= radius, F on the support }` and its multiplier.
    ///
    /// `payoff[k]` is the payoff at `support[k]`, finite. Cost O(K ln K) for K support points where no atom gains by
    /// moving up, O(n K) otherwise.
    pub fn worst_expectation(&self, payoff: &[f64]) -> (f64, f64) {
        if self.one_sided(payoff) { self.flow(payoff, |_, _, _| {}) } else { self.spend(payoff, |_, _| {}) }
    }

    /// The worst law itself with both bounds. Cost as [`Self::worst_expectation`], plus O(K n) for the moves.
    pub fn worst_law(&self, payoff: &[f64]) -> WorstLaw {
        let mut moves = Vec::new();
        let (expectation, multiplier) = if self.one_sided(payoff) {
            let mut next: Vec<(usize, f64)> = (0..self.support.len()).map(|point| (point, 0.0)).collect();
            let solved = self.flow(payoff, |from, to, share| next[from] = (to, share));
            for from in (0..self.support.len()).filter(|&from| self.masses[from] > 0.0) {
                let mut at = from;
                while next[at].1 >= 1.0 {
                    at = next[at].0;
                }
                let (to, share) = next[at];
                push_move(&mut moves, from, to, self.masses[from] * share);
                push_move(&mut moves, from, at, self.masses[from] * (1.0 - share));
            }
            solved
        } else {
            let mut steps: Vec<(Segment, f64)> = Vec::new();
            let solved = self.spend(payoff, |segment, share| steps.push((segment, share)));
            for from in (0..self.support.len()).filter(|&from| self.masses[from] > 0.0) {
                let (mut at, mut split) = (from, None);
                for (segment, share) in steps.iter().filter(|(segment, _)| segment.from == from) {
                    if *share >= 1.0 {
                        at = segment.far;
                    } else {
                        split = Some((segment.far, *share));
                    }
                }
                let (to, share) = split.unwrap_or((at, 0.0));
                push_move(&mut moves, from, to, self.masses[from] * share);
                push_move(&mut moves, from, at, self.masses[from] * (1.0 - share));
            }
            solved
        };
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

    /// True where no atom has a smaller payoff anywhere above it.
    fn one_sided(&self, payoff: &[f64]) -> bool {
        let mut smallest_above = f64::INFINITY;
        for (&mass, &value) in self.masses.iter().zip(payoff).rev() {
            if mass > 0.0 && smallest_above < value {
                return false;
            }
            smallest_above = smallest_above.min(value);
        }
        true
    }

    fn mean(&self, payoff: &[f64]) -> f64 {
        payoff.iter().zip(self.masses).map(|(value, mass)| value * mass).sum()
    }

    /// Lets mass flow down the forest, steepest slope first, until the radius is spent.
    /// `record(from, to, share)` hears of each vertex emptied (share 1) or split.
    fn flow(&self, payoff: &[f64], mut record: impl FnMut(usize, usize, f64)) -> (f64, f64) {
        let mut expectation = self.mean(payoff);
        if self.radius <= 0.0 {
            return (expectation, self.steepest(payoff));
        }
        let forest = hull_forest(self.support, payoff);
        let mut reached: Vec<bool> = self.masses.iter().map(|&mass| mass > 0.0).collect();
        let mut order: Vec<usize> = Vec::with_capacity(self.support.len());
        for point in (0..self.support.len()).rev() {
            let (parent, slope) = forest[point];
            if reached[point] && slope > 0.0 {
                reached[parent] = true;
                order.push(point);
            }
        }
        order.sort_unstable_by(|&left, &right| forest[right].1.total_cmp(&forest[left].1).then(right.cmp(&left)));
        let mut masses = self.masses.to_vec();
        let mut budget = self.radius;
        for point in order {
            let (parent, slope) = forest[point];
            let cost = masses[point] * (self.support[point] - self.support[parent]);
            if cost > budget {
                record(point, parent, budget / cost);
                return (expectation - slope * budget, slope);
            }
            record(point, parent, 1.0);
            expectation -= slope * cost;
            budget -= cost;
            masses[parent] += masses[point];
        }
        (expectation, 0.0)
    }

    /// Spends the radius on the two-sided envelopes of all atoms, steepest segment first.
    fn spend(&self, payoff: &[f64], mut record: impl FnMut(Segment, f64)) -> (f64, f64) {
        let mut expectation = self.mean(payoff);
        if self.radius <= 0.0 {
            return (expectation, self.steepest(payoff));
        }
        let mut segments = self.segments(payoff);
        segments.sort_by(|left, right| right.slope.total_cmp(&left.slope));
        let mut budget = self.radius;
        for segment in segments {
            let distance = |point: usize| (self.support[point] - self.support[segment.from]).abs();
            let cost = self.masses[segment.from] * (distance(segment.far) - distance(segment.near));
            if cost > budget {
                record(segment, budget / cost);
                return (expectation - segment.slope * budget, segment.slope);
            }
            record(segment, 1.0);
            expectation -= segment.slope * cost;
            budget -= cost;
        }
        (expectation, 0.0)
    }

    /// The falling segments of every atom's envelope of payoff against distance, both directions together.
    fn segments(&self, payoff: &[f64]) -> Vec<Segment> {
        let left = hull_forest(self.support, payoff);
        let right = mirrored_forest(self.support, payoff);
        let mut segments = Vec::new();
        for from in (0..self.support.len()).filter(|&from| self.masses[from] > 0.0) {
            let distance = |point: usize| (self.support[point] - self.support[from]).abs();
            let mut vertices = chain(&left, from);
            vertices.extend(chain(&right, from).into_iter().skip(1));
            vertices.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(payoff[a].total_cmp(&payoff[b])));
            let mut hull: Vec<Segment> = Vec::new();
            let mut last = from;
            for vertex in vertices.into_iter().skip(1) {
                if distance(vertex) <= distance(last) || payoff[vertex] >= payoff[last] {
                    continue;
                }
                let mut near = last;
                let fall = |near: usize| (payoff[near] - payoff[vertex]) / (distance(vertex) - distance(near));
                while let Some(top) = hull.last() {
                    if top.slope > fall(top.far) {
                        break;
                    }
                    near = top.near;
                    hull.pop();
                }
                hull.push(Segment { slope: fall(near), from, near, far: vertex });
                last = vertex;
            }
            segments.append(&mut hull);
        }
        segments
    }

    /// Steepest fall of the payoff away from any atom: the smallest multiplier at which no mass wants to move.
    fn steepest(&self, payoff: &[f64]) -> f64 {
        let left = hull_forest(self.support, payoff);
        let right = mirrored_forest(self.support, payoff);
        let atoms = (0..self.support.len()).filter(|&point| self.masses[point] > 0.0);
        atoms.map(|point| left[point].1.max(right[point].1)).fold(0.0, f64::max)
    }
}

/// The forest towards the right: parents above, slopes positive where the payoff falls upwards.
fn mirrored_forest(support: &[f64], payoff: &[f64]) -> Vec<(usize, f64)> {
    let count = support.len();
    let mirrored: Vec<f64> = support.iter().rev().map(|point| -point).collect();
    let reversed: Vec<f64> = payoff.iter().rev().copied().collect();
    let forest = hull_forest(&mirrored, &reversed);
    forest.into_iter().rev().map(|(parent, slope)| (count - 1 - parent, slope)).collect()
}

/// The vertices from `start` along falling slopes of a forest, `start` first.
fn chain(forest: &[(usize, f64)], start: usize) -> Vec<usize> {
    let mut vertices = vec![start];
    let mut at = start;
    while forest[at].1 > 0.0 && forest[at].0 != at {
        at = forest[at].0;
        vertices.push(at);
    }
    vertices
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
            let ball = WassersteinBall { support: &support, masses: &masses, radius };
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
        }
    }
}
