//! The search for the best allocation and price of distance: what is known of the adversary is solved by an interior point method,
//!
//!   max sum_j p_j t_j - gamma radius   over a, gamma, t,   t_j <= f_jm(a, gamma) for every move m known of atom j (`cuts.rs`),
//!
//! within the bounds of the shares, of their sum and of gamma, and at what is found the adversary is asked anew. Every multiplier
//! m >= 0, sum_m m_jm = p_j, makes a law in the ball or, after a mixture with the centre, one that is.
//!
//! A barrier of mu p_j for each move makes it smooth, with t_j where it is best. Steps are Newton's on `slack x multiplier = mu p_j`;
//! they raise the barrier function, which the step's length is found by. Where the answer of the adversary lies far below what was
//! known, the search goes back on half of its way, and mu stays as large as a share of what was not known. Where trading costs,
//! u_i >= |a_i - h_i| join the point, and `p sum u_i` is taken off (`trading.rs`). Sources: Boyd and Vandenberghe (2004), Convex
//! Optimization, section 11.7; Reemtsen and Rueckmann (1998), Semi-Infinite Programming, chapter 7 (exchange methods).

mod newton;

use self::newton::Direction;
use super::AssetsStep;
use super::branches::Branches;
use super::cuts::{Cut, Cuts, dot};
use super::trading::Tangent;
use crate::numerics::interruption;

/// Questions to the adversary at most, and steps between two.
const ROUNDS: usize = 60;
const STEPS: usize = 60;
/// What the barrier is brought to, of what it was, and of what was not known of the adversary.
const REDUCTION: f64 = 0.1;
const OF_UNKNOWN: f64 = 0.1;
/// Rounding takes what steps at a lower barrier gain.
const LEAST_BARRIER: f64 = 1e-12;
/// A gain of a step below this share of the barrier ends a round.
const LEAST_GAIN: f64 = 0.2;
/// Barriers that the adversary's answer may lie below what was known, before the search goes back; and how often it does.
const BELOW_KNOWN: f64 = 30.0;
const HALVINGS: usize = 10;
/// Of the gain that a step foresees, what it must make; steps shorter than this are taken whatever they make.
const GAIN_MADE: f64 = 1e-4;
const LEAST_LENGTH: f64 = 1e-8;
/// Rounding of a mean of utilities.
const ROUNDING: f64 = 1e-15;
/// Newton steps for t_j at most, and their end as a share of the barrier.
const TOP_STEPS: usize = 30;
const TOP_TOLERANCE: f64 = 1e-10;
/// Radius that the search has at least.
const LEAST_RADIUS: f64 = 1e-9;
/// Multipliers are kept within this factor of the central path.
const OFF_CENTRE: f64 = 100.0;
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
    pub bounds: Vec<Bound>,
    /// Barrier of a bound, over that of all atoms.
    pub bound_weight: f64,
    pub barrier: f64,
    /// The adversary's answer at the point.
    branches: Branches,
    /// What is known of the adversary.
    pub cuts: Cuts,
    known_before: Cuts,
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

/// t with `sum 1 / (f_m - t) = 1 / barrier`, by Newton's method on its reciprocal, which is concave.
fn top(cuts: &[Cut], barrier: f64) -> f64 {
    let least = cuts.iter().map(|cut| cut.payoff).fold(f64::INFINITY, f64::min);
    let mut top = least - barrier;
    for _ in 0..TOP_STEPS {
        let (mut sum, mut squares) = (0.0, 0.0);
        for cut in cuts {
            let inverse = 1.0 / (cut.payoff - top);
            sum += inverse;
            squares += inverse * inverse;
        }
        let step = (1.0 / sum - barrier) * sum * sum / squares;
        top += step;
        if step.abs() < TOP_TOLERANCE * barrier {
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
            bounds,
            bound_weight: 1.0 / assets as f64,
            barrier,
            branches: Branches::default(),
            cuts: Cuts::default(),
            known_before: Cuts::default(),
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            tangent: None,
            evaluations: 0,
        };
        interior.open();
        interior.ask();
        interior.learn();
        interior
    }

    /// Asks the adversary at the point. The dual there, which is a lower bound.
    fn ask(&mut self) -> f64 {
        let (shares, price) = self.point.split_at(self.step.assets());
        self.branches.find(self.step, shares, price[0]);
        self.evaluations += 1;
        let dual = self.step.dual(&self.branches, price[0]).0;
        self.tell_lower(dual);
        dual
    }

    /// Joins the adversary's answer to what is known.
    fn learn(&mut self) {
        std::mem::swap(&mut self.cuts, &mut self.known_before);
        self.cuts.renew(self.step, &self.branches, &self.point, &self.known_before);
        self.merit();
        for (atom, mass) in self.step.masses.iter().enumerate() {
            let of = self.cuts.of(atom);
            self.cuts.all[of].iter_mut().for_each(|cut| cut.multiplier = mass * self.barrier / cut.slack);
        }
    }

    /// What is traded, and the multipliers of the bounds, at the start: on the central path.
    fn open(&mut self) {
        let barrier = self.barrier * self.bound_weight;
        let (assets, price) = (self.step.assets(), self.step.trading.price);
        for (asset, held) in self.step.trading.holdings.iter().enumerate() {
            // The multipliers of its two bounds sum to the price.
            let moved = price * (self.point[asset] - held);
            self.point[assets + 1 + asset] = (barrier + barrier.hypot(moved)) / price;
        }
        for bound in &mut self.bounds {
            bound.multiplier = barrier / bound.slack(&self.point);
        }
    }

    /// Runs until the bounds are within the tolerance, or other assets would enter.
    pub fn run(&mut self, tolerance: f64) {
        for _ in 0..ROUNDS {
            let goes_on = self.solve_known();
            let unknown = self.known() - self.ask();
            self.cuts.follow(self.step, &self.point);
            self.tell_upper();
            let found = self.upper - self.lower < tolerance || !self.entering.is_empty();
            if found || !goes_on || self.barrier < LEAST_BARRIER {
                return;
            }
            self.go_back(unknown);
            self.learn();
            self.barrier = (REDUCTION * self.barrier).max((OF_UNKNOWN * unknown.abs()).min(self.barrier));
        }
    }

    /// Brings the point to the best by what is known, but for the barrier. False where no step can be told.
    fn solve_known(&mut self) -> bool {
        let mut merit = self.merit();
        self.tame();
        for _ in 0..STEPS {
            interruption::checkpoint();
            let Some(direction) = self.direction() else { return false };
            let next = self.go(&direction, merit);
            // A step that rounding takes the gain of is the last too.
            let gains = next > merit + ROUNDING * (1.0 + merit.abs());
            merit = next;
            if !gains || direction.gain < LEAST_GAIN * self.barrier {
                break;
            }
        }
        merit.is_finite()
    }

    /// In a ball of no radius the price would rise without end.
    fn radius(&self) -> f64 {
        self.step.radius.max(LEAST_RADIUS)
    }

    /// Of the point, by what is known of the adversary.
    fn known(&self) -> f64 {
        let atoms = self.step.masses.iter().enumerate();
        let mean: f64 = atoms.map(|(atom, mass)| mass * self.cuts.least(atom)).sum();
        mean - self.point[self.step.assets()] * self.step.radius
    }

    /// Halves the way from where the adversary was asked before, as long as its answer lies `unknown` below what was known.
    fn go_back(&mut self, mut unknown: f64) {
        for _ in 0..HALVINGS {
            if unknown <= BELOW_KNOWN * self.barrier {
                return;
            }
            let from = self.cuts.origin();
            self.point.iter_mut().zip(from).for_each(|(at, from)| *at = 0.5 * (*at + from));
            self.cuts.evaluate(self.step, &self.point);
            unknown = self.known() - self.ask();
        }
    }

    /// Takes the step, or as many halves of it as raise the barrier function by a part of what was foreseen; its value then.
    fn go(&mut self, direction: &Direction, before: f64) -> f64 {
        let from = self.point.clone();
        let mut length = direction.length;
        let merit = loop {
            let along = from.iter().zip(&direction.point);
            self.point.iter_mut().zip(along).for_each(|(at, (from, step))| *at = from + length * step);
            self.cuts.evaluate(self.step, &self.point);
            let merit = self.merit();
            if merit >= before + GAIN_MADE * length * direction.gain - ROUNDING * (1.0 + before.abs())
                || length < LEAST_LENGTH
            {
                break merit;
            }
            length *= 0.5;
        };
        let steps = self.cuts.all.iter_mut().zip(&direction.multipliers);
        steps.for_each(|(cut, step)| cut.multiplier += direction.dual_length * step);
        let steps = self.bounds.iter_mut().zip(&direction.bounds);
        steps.for_each(|(bound, step)| bound.multiplier += direction.dual_length * step);
        self.tame();
        merit
    }

    /// The barrier function at the point, with t of every atom, and so the slacks, where it is best.
    fn merit(&mut self) -> f64 {
        let (assets, barrier) = (self.step.assets(), self.barrier);
        let traded: f64 = self.point[assets + 1..].iter().sum();
        let mut merit = -self.point[assets] * self.radius() - self.step.trading.price * traded;
        for bound in &self.bounds {
            merit += barrier * self.bound_weight * bound.slack(&self.point).ln();
        }
        for (atom, mass) in self.step.masses.iter().enumerate() {
            let of = self.cuts.of(atom);
            let cuts = &mut self.cuts.all[of];
            let top = top(cuts, barrier);
            let mut logarithms = 0.0;
            for cut in cuts {
                cut.slack = cut.payoff - top;
                logarithms += (cut.slack / barrier).ln();
            }
            merit += mass * (top + barrier * logarithms);
        }
        merit
    }

    /// Brings multipliers that are far off the central path nearer to it.
    fn tame(&mut self) {
        let near = |multiplier: f64, central: f64| multiplier.max(central / OFF_CENTRE).min(central * OFF_CENTRE);
        for (atom, mass) in self.step.masses.iter().enumerate() {
            let of = self.cuts.of(atom);
            for cut in &mut self.cuts.all[of] {
                cut.multiplier = near(cut.multiplier, self.barrier * mass / cut.slack);
            }
        }
        for bound in &mut self.bounds {
            let central = self.barrier * self.bound_weight / bound.slack(&self.point);
            bound.multiplier = near(bound.multiplier, central);
        }
    }
}
