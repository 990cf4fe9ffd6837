//! The search for the best allocation and price of distance: an interior point method on
//!
//!   max sum_j p_j t_j - gamma radius   over a, gamma, t,   t_j <= f_jm(a, gamma) for every branch m of atom j,
//!
//! and the bounds of the shares, of their sum and of gamma. Branches are found anew at every point: a branch whose level follows
//! is a smooth concave function of (a, gamma), with
//!
//!   grad f = (U' (e^z' / (1 + r) - 1), D),
//!   -hess f = U' [ sum_i p_i v_i v_i' + bend s s' ],  v_i = e_i / a_i - e_gamma / gamma over what moves, s = grad of what does not,
//!
//! of which every multiplier m >= 0, sum_m m_jm = p_j, makes a law in the ball or, after a mixture with the centre, one that is.
//! Multipliers and slacks follow Newton steps on `slack x multiplier = barrier x p_j`; where a branch has come or gone, or lies
//! lower than the step foresaw, t_j gives way. Where trading costs, u_i >= |a_i - h_i| join the point, and `p sum u_i` is taken off
//! (`trading.rs`). Source: Boyd and Vandenberghe (2004), Convex Optimization, section 11.7.

mod newton;
mod price;

use self::newton::Direction;
use super::AssetsStep;
use super::branches::Branches;
use super::trading::Tangent;

/// What a barrier is brought to, of what is reached: after a step of this length, or more; shorter ones do with less.
const REDUCTIONS: [(f64, f64); 3] = [(0.9, 0.2), (0.5, 0.4), (0.0, 0.9)];
/// Points at most.
const STEP_LIMIT: usize = 100;
/// Halvings of a step that falls far below what it foresaw, at most.
const HALVINGS: usize = 10;
/// How much of the barrier atoms may give way by, together, before a step is halved.
const GIVING_WAY: f64 = 10.0;
/// Of its slack before a branch keeps at least this, and one that is new this of the barrier.
const KEPT_SLACK: f64 = 0.1;
const NEW_SLACK: f64 = 0.3;
/// A branch that has all of its atom has the barrier for its slack; none has less than this of it.
const LEAST_SLACK: f64 = 0.01;
/// Slack times multiplier beyond this of the barrier tells that a multiplier is that of another branch.
const OFF_CENTRE: f64 = 100.0;
/// Branches of less of their atom's mass are let go with their place.
const LEAST_MASS: f64 = 1e-6;
/// Shares of the start by which one near a similar step is drawn inside.
const DRAWN_INSIDE: f64 = 0.002;
/// Shares of a start sum to this over the risk aversion at most, above the least they may sum to.
const SHARE_AT_START: f64 = 0.5;
/// Room that the sum of the shares has at least.
const LEAST_ROOM: f64 = 1e-6;

/// `offset + direction . (a, gamma) >= 0`, with its multiplier.
#[derive(Debug, Clone)]
pub(super) struct Bound {
    pub direction: Vec<f64>,
    offset: f64,
    pub multiplier: f64,
}

impl Bound {
    pub fn slack(&self, point: &[f64]) -> f64 {
        self.offset + dot(&self.direction, point)
    }
}

/// Slack and multiplier of a branch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    pub slack: f64,
    pub multiplier: f64,
}

/// The search.
pub(super) struct Interior<'a> {
    /// The step with the assets searched among, which are `held` of the `whole`.
    pub step: &'a AssetsStep,
    pub whole: &'a AssetsStep,
    pub held: &'a [usize],
    /// Others that would raise the value by more than what is left to find among these.
    pub entering: Vec<usize>,
    /// The shares, then the price gamma, then where trading costs what is traded of each asset.
    pub point: Vec<f64>,
    /// t_j.
    pub tops: Vec<f64>,
    pub bounds: Vec<Bound>,
    /// Barrier of a bound, over that of all atoms.
    pub bound_weight: f64,
    pub barrier: f64,
    pub branches: Branches,
    pub pairs: Vec<Pair>,
    before: Branches,
    pairs_before: Vec<Pair>,
    /// The allocation of the best lower bound, and its price.
    pub best: Vec<f64>,
    pub best_price: f64,
    /// What the best is worth at least, and every allocation at most, in relative utility.
    pub lower: f64,
    pub upper: f64,
    /// Of the law that told the lowest upper bound; none where no law told one.
    pub tangent: Option<Tangent>,
    pub evaluations: usize,
}

pub(super) fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}

/// t with `sum 1 / (f_m - t) = 1 / barrier`, by Newton's method on its reciprocal, which is concave.
fn top(branches: &Branches, atom: usize, barrier: f64) -> f64 {
    let least = branches.all[branches.worst(atom)].payoff;
    let mut top = least - barrier;
    for _ in 0..20 {
        let (mut sum, mut squares) = (0.0, 0.0);
        for branch in branches.of(atom) {
            let inverse = 1.0 / (branches.all[branch].payoff - top);
            sum += inverse;
            squares += inverse * inverse;
        }
        let step = (1.0 / sum - barrier) * sum * sum / squares;
        top += step;
        if step.abs() < 1e-6 * barrier {
            break;
        }
    }
    top
}

impl<'a> Interior<'a> {
    /// `near`, where the search starts, are shares of the assets searched among, and a price.
    pub fn start(
        step: &'a AssetsStep,
        whole: &'a AssetsStep,
        held: &'a [usize],
        near: Option<(Vec<f64>, f64)>,
        barrier: f64,
    ) -> Self {
        let assets = step.assets();
        let highest = step.total.highest;
        let lowest = step.total.lowest.min(highest - LEAST_ROOM);
        // Halfway between the bounds of the sum, or where a loss of all that is held still weighs little: deeper in, utilities of
        // a risk aversion of 20 and more are so large that rounding takes what a step could gain.
        let weighs_little = SHARE_AT_START / step.utility.relative_risk_aversion();
        let middle = (0.5 * (lowest + highest)).min(lowest + weighs_little);
        let even = middle / assets as f64;
        let mut point = vec![even; assets];
        if let Some((shares, _)) = &near {
            let inside = |(share, near): (&mut f64, &f64)| *share = DRAWN_INSIDE * *share + (1.0 - DRAWN_INSIDE) * near;
            point.iter_mut().zip(shares).for_each(inside);
        }
        point.push(near.as_ref().map_or(middle, |(_, price)| price.max(LEAST_ROOM)));
        point.extend(&step.trading.holdings);
        let size = point.len();
        let unit = |index: usize| (0..size).map(|other| if other == index { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
        let sum = |sign: f64| (0..size).map(|other| if other < assets { sign } else { 0.0 }).collect::<Vec<f64>>();
        let mut lines: Vec<(Vec<f64>, f64)> = (0..=assets).map(|index| (unit(index), 0.0)).collect();
        lines.push((sum(-1.0), highest));
        if lowest > 0.0 {
            lines.push((sum(1.0), -lowest));
        }
        for (asset, held) in step.trading.holdings.iter().enumerate() {
            for sign in [1.0, -1.0] {
                let mut line = unit(assets + 1 + asset);
                line[asset] = sign;
                lines.push((line, -sign * held));
            }
        }
        let bounds =
            lines.into_iter().map(|(direction, offset)| Bound { direction, offset, multiplier: 0.0 }).collect();
        let mut interior = Interior {
            step,
            whole,
            held,
            entering: Vec::new(),
            best: point[..assets].to_vec(),
            best_price: point[assets],
            point,
            tops: vec![0.0; step.atoms()],
            bounds,
            bound_weight: 1.0 / assets as f64,
            barrier,
            branches: Branches::default(),
            pairs: Vec::new(),
            before: Branches::default(),
            pairs_before: Vec::new(),
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            tangent: None,
            evaluations: 0,
        };
        interior.price_the_start(near.is_some());
        interior.open();
        interior
    }

    fn find(&mut self) {
        let (shares, price) = self.point.split_at(self.step.assets());
        self.branches.find(self.step, shares, price[0]);
        self.evaluations += 1;
    }

    /// The first point: everything on the central path but the shares.
    fn open(&mut self) {
        self.pairs.clear();
        for atom in 0..self.step.atoms() {
            self.centre(atom);
        }
        let barrier = self.barrier * self.bound_weight;
        let (assets, price) = (self.step.assets(), self.step.trading.price);
        for (asset, held) in self.step.trading.holdings.iter().enumerate() {
            // On the central path the multipliers of its two bounds sum to the price.
            let moved = price * (self.point[asset] - held);
            self.point[assets + 1 + asset] = (barrier + barrier.hypot(moved)) / price;
        }
        for bound in &mut self.bounds {
            bound.multiplier = barrier / bound.slack(&self.point);
        }
    }

    /// Puts an atom, the next to have its pairs, on the central path.
    fn centre(&mut self, atom: usize) {
        let (mass, barrier) = (self.step.masses[atom], self.barrier);
        let top = top(&self.branches, atom, barrier);
        self.tops[atom] = top;
        self.pairs.extend(self.branches.all[self.branches.of(atom)].iter().map(|branch| {
            let slack = branch.payoff - top;
            Pair { slack, multiplier: mass * barrier / slack }
        }));
    }

    /// Runs until the bounds are within the tolerance, or other assets would enter.
    pub fn run(&mut self, tolerance: f64) {
        let mut length = 1.0;
        for _ in 0..STEP_LIMIT {
            self.tell_bounds();
            if self.upper - self.lower < tolerance || !self.entering.is_empty() {
                return;
            }
            self.lower_barrier(length);
            let Some(direction) = self.direction() else { return };
            length = self.go(&direction);
        }
    }

    fn lower_barrier(&mut self, length: f64) {
        let (mut products, mut weight) = (0.0, 0.0);
        for (atom, mass) in self.step.masses.iter().enumerate() {
            for pair in &self.pairs[self.branches.of(atom)] {
                products += pair.slack * pair.multiplier;
                weight += mass;
            }
        }
        for bound in &self.bounds {
            products += bound.multiplier * bound.slack(&self.point);
            weight += self.bound_weight;
        }
        let reduction = REDUCTIONS.iter().find(|(least, _)| length > *least).map_or(1.0, |(_, reduction)| *reduction);
        self.barrier = reduction * products / weight;
    }

    /// Takes the step, or as many halves of it as keep the atoms from giving way by far more than the barrier. Answers the shorter
    /// length of the point's and the multipliers'.
    fn go(&mut self, direction: &Direction) -> f64 {
        std::mem::swap(&mut self.branches, &mut self.before);
        std::mem::swap(&mut self.pairs, &mut self.pairs_before);
        let (point, tops) = (self.point.clone(), self.tops.clone());
        let along = |from: &[f64], by: &[f64], length: f64| -> Vec<f64> {
            from.iter().zip(by).map(|(from, by)| from + length * by).collect()
        };
        let mut length = direction.length;
        for halving in 0..=HALVINGS {
            self.point = along(&point, &direction.point, length);
            self.tops = along(&tops, &direction.tops, length);
            let assets = self.step.assets();
            let (before, known) = (&self.before, &self.pairs_before);
            let counts = |atom: usize, branch: usize| known[branch].multiplier > LEAST_MASS * self.step.masses[atom];
            self.branches.find_after(self.step, &self.point[..assets], self.point[assets], before, counts);
            self.evaluations += 1;
            let given: f64 = (0..self.tops.len()).map(|atom| self.step.masses[atom] * self.give_way(atom)).sum();
            if given <= GIVING_WAY * self.barrier || halving == HALVINGS {
                break;
            }
            length *= 0.5;
        }
        self.pairs.clear();
        for atom in 0..self.tops.len() {
            self.pair_up(atom, direction);
        }
        for (bound, step) in self.bounds.iter_mut().zip(&direction.bounds) {
            bound.multiplier += direction.dual_length * step;
        }
        length.min(direction.dual_length)
    }

    /// Lowers t_j until every branch has a share of the slack it had, and answers by how much.
    fn give_way(&mut self, atom: usize) -> f64 {
        let mut way: f64 = 0.0;
        for branch in self.branches.of(atom) {
            let least = match self.branches.all[branch].continues {
                Some(before) => (KEPT_SLACK * self.pairs_before[before].slack).max(LEAST_SLACK * self.barrier),
                None => NEW_SLACK * self.barrier,
            };
            way = way.max(least - (self.branches.all[branch].payoff - self.tops[atom]));
        }
        self.tops[atom] -= way;
        way
    }

    /// The pairs of an atom after a step: multipliers go on with their branches, new ones start on the central path.
    fn pair_up(&mut self, atom: usize, direction: &Direction) {
        let (from, central) = (self.pairs.len(), self.barrier * self.step.masses[atom]);
        let mut off_centre = false;
        for branch in self.branches.of(atom) {
            let slack = self.branches.all[branch].payoff - self.tops[atom];
            let multiplier = match self.branches.all[branch].continues {
                Some(before) => {
                    off_centre |= self.pairs_before[before].multiplier * slack > OFF_CENTRE * central;
                    self.pairs_before[before].multiplier + direction.dual_length * direction.multipliers[before]
                }
                None => central / slack,
            };
            self.pairs.push(Pair { slack, multiplier });
        }
        if off_centre {
            self.pairs.truncate(from);
            self.centre(atom);
        }
    }
}
