//! The search for the best allocation and price of distance. The problem with the known moves of the adversary is
//! solved by an interior point method,
//!
//!   max sum_j p_j t_j - gamma radius   over a, gamma, t,   t_j <= f_jm(a, gamma) for every known move m of atom j,
//!
//! (`cuts.rs`) within the bounds of the shares, of their sum and of gamma. At its solution the adversary's answer adds
//! new moves. Every set of multipliers m >= 0 with sum_m m_jm = p_j makes a law in the ball, or one that is after a
//! mixture with the centre.
//!
//! A barrier of mu p_j for each move makes it smooth, with the best t_j. Steps are Newton's on
//! `slack x multiplier = mu p_j`; they raise the barrier function, which also sets the step's length. If the
//! adversary's answer lies far below the known value, the search halves its step back, and mu stays as large as a share
//! of that gap. If trading costs, u_i >= |a_i - h_i| join the point, and `p sum u_i` is subtracted (`trading.rs`). If
//! turnover is limited, w_i join it (`problem/compositions.rs`).
//! Sources: Boyd and Vandenberghe (2004), Convex Optimization, section 11.7; Reemtsen and Rueckmann (1998),
//! Semi-Infinite Programming, chapter 7 (exchange methods).

mod newton;
mod start;

use self::newton::Direction;
use super::PortfolioStep;
use super::branches::Branches;
use super::cuts::{Cut, Cuts, dot};
use super::trading::Tangent;
use crate::numerics::machine::interruption;

/// Largest number of calls of the adversary, of steps between two, and of all steps: most searches need 30 to 120.
const ROUNDS: usize = 60;
const STEPS: usize = 60;
const ALL_STEPS: usize = 400;
/// The next barrier, as a share of the last one and of the gap to the adversary's answer.
const REDUCTION: f64 = 0.1;
const OF_UNKNOWN: f64 = 0.1;
/// At a lower barrier rounding exceeds the gain of a step.
const LEAST_BARRIER: f64 = 1e-12;
/// A gain of a step below this share of the barrier ends a round.
const LEAST_GAIN: f64 = 0.2;
/// How far the adversary's answer may lie below the known value, in barriers, before the search goes back; and how
/// often it does.
const BELOW_KNOWN: f64 = 30.0;
const HALVINGS: usize = 10;
/// The share of its predicted gain that a step must make; shorter steps than this are accepted with any gain.
const GAIN_MADE: f64 = 1e-4;
const LEAST_LENGTH: f64 = 1e-8;
/// Rounding of a mean of utilities.
const ROUNDING: f64 = 1e-15;
/// Largest number of Newton steps for t_j, and their tolerance as a share of the barrier.
const TOP_STEPS: usize = 30;
const TOP_TOLERANCE: f64 = 1e-10;
/// A product of slacks, in barriers, up to this and down to its inverse may have another factor.
const MOST_PRODUCT: f64 = 1e100;
/// Smallest radius used in the search.
const LEAST_RADIUS: f64 = 1e-9;

/// `offset + direction . (a, gamma) >= 0`, with its multiplier.
#[derive(Debug, Clone)]
pub(super) struct BarrierConstraint {
    pub direction: Vec<f64>,
    offset: f64,
    pub multiplier: f64,
}

impl BarrierConstraint {
    pub fn slack(&self, point: &[f64]) -> f64 {
        self.offset + dot(&self.direction, point)
    }
}

/// The state of the interior point search.
pub(super) struct Interior<'a> {
    /// The step that is searched: the step `whole`, with the assets `held` alone.
    pub step: &'a PortfolioStep,
    pub whole: &'a PortfolioStep,
    pub held: &'a [usize],
    /// Other assets, which would raise the value by more than the remaining gap among these.
    pub entering: Vec<usize>,
    /// The shares, then the price gamma, then the trade in each asset if trading costs, then its move if turnover is
    /// limited.
    pub point: Vec<f64>,
    pub bounds: Vec<BarrierConstraint>,
    /// Barrier of a bound, over that of all atoms.
    pub bound_weight: f64,
    pub barrier: f64,
    /// How far above the least of its atom a move may pay to be learned, in barriers.
    reach: f64,
    /// The adversary's answer at the point.
    branches: Branches,
    /// The known moves of the adversary.
    pub cuts: Cuts,
    known_before: Cuts,
    /// The allocation of the best lower bound, and its price.
    pub best: Vec<f64>,
    pub best_price: f64,
    /// Lower bound on the worth of the best allocation, and upper bound for every allocation, in relative utility.
    pub lower: f64,
    pub upper: f64,
    /// The tangent of the law with the lowest upper bound; none if no law gave a bound.
    pub tangent: Option<Tangent>,
    pub evaluations: usize,
    /// Newton steps so far.
    steps: usize,
}

/// Returns t with `sum 1 / (f_m - t) = 1 / barrier`, by Newton's method on its reciprocal, which is concave.
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
    /// Computes the adversary's answer at the point. Returns the dual there, which is a lower bound.
    fn ask(&mut self) -> f64 {
        let (shares, price) = self.point.split_at(self.step.assets());
        self.branches.find(self.step, shares, price[0]);
        self.evaluations += 1;
        let dual = self.step.dual(&self.branches, price[0]).0;
        self.update_lower_bound(dual);
        dual
    }

    /// Adds the adversary's answer to the known moves.
    fn learn(&mut self) {
        std::mem::swap(&mut self.cuts, &mut self.known_before);
        self.cuts.renew(self.step, &self.branches, self.reach * self.barrier, &self.point, &self.known_before);
        self.merit();
        for (atom, mass) in self.step.masses.iter().enumerate() {
            let of = self.cuts.of(atom);
            self.cuts.all[of].iter_mut().for_each(|cut| cut.multiplier = mass * self.barrier / cut.slack);
        }
    }

    /// Sets the trades and the multipliers of the bounds at the start, on the central path.
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
            self.update_upper_bound();
            let found = self.upper - self.lower < tolerance;
            if found || !goes_on || self.barrier < LEAST_BARRIER {
                return;
            }
            self.go_back(unknown);
            if !self.entering.is_empty() {
                return;
            }
            self.learn();
            self.barrier = (REDUCTION * self.barrier).max((OF_UNKNOWN * unknown.abs()).min(self.barrier));
        }
    }

    /// Brings the point to the optimum of the known problem, up to the barrier. Returns false if no step can be
    /// computed, or no more are allowed.
    fn solve_known(&mut self) -> bool {
        let mut merit = self.merit();
        self.tame();
        for _ in 0..STEPS {
            self.steps += 1;
            if self.steps > ALL_STEPS {
                return false;
            }
            interruption::checkpoint();
            let Some(direction) = self.direction() else { return false };
            let next = self.go(&direction, merit);
            // A step whose gain is within rounding is also the last.
            let gains = next > merit + ROUNDING * (1.0 + merit.abs());
            merit = next;
            if !gains || direction.gain < LEAST_GAIN * self.barrier {
                break;
            }
        }
        merit.is_finite()
    }

    /// Returns the radius, at least the smallest used: in a ball of radius 0 the price would rise without bound.
    fn radius(&self) -> f64 {
        self.step.radius.max(LEAST_RADIUS)
    }

    /// Returns the value of the point in the known problem.
    fn known(&self) -> f64 {
        let atoms = self.step.masses.iter().enumerate();
        let mean: f64 = atoms.map(|(atom, mass)| mass * self.cuts.least(atom)).sum();
        mean - self.point[self.step.assets()] * self.step.radius
    }

    /// Halves the step back to the last point where moves were learned, while the adversary's answer lies too far, by
    /// `unknown`, below the known value.
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

    /// Takes the step, halved until the barrier function rises by a part of the predicted gain. Returns its value then.
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

    /// Returns the barrier function at the point. Sets t of every atom to its optimum, and so the slacks.
    fn merit(&mut self) -> f64 {
        let (assets, barrier) = (self.step.assets(), self.barrier);
        let trades = self.step.trading.holdings.len();
        let traded: f64 = self.point[assets + 1..][..trades].iter().sum();
        let mut merit = -self.point[assets] * self.radius() - self.step.trading.price * traded;
        for bound in &self.bounds {
            merit += barrier * self.bound_weight * bound.slack(&self.point).ln();
        }
        for (atom, mass) in self.step.masses.iter().enumerate() {
            let of = self.cuts.of(atom);
            let cuts = &mut self.cuts.all[of];
            let top = top(cuts, barrier);
            let (mut product, mut logarithms) = (1.0_f64, 0.0);
            for cut in cuts {
                cut.slack = cut.payoff - top;
                product *= cut.slack / barrier;
                if !(MOST_PRODUCT.recip()..MOST_PRODUCT).contains(&product) {
                    logarithms += product.ln();
                    product = 1.0;
                }
            }
            merit += mass * (top + barrier * (logarithms + product.ln()));
        }
        merit
    }
}
