//! One robust step with several assets, with the utility of wealth at its end:
//!
//!   max_a  min_F { E_F[ U(w(a, Z)) ] : W1(F, F^) <= radius },   w = (1 - sum a_i)(1 + r) + sum a_i e^(z_i),
//!
//! a_i >= 0 are the shares of wealth, with a sum in an interval. The ground cost of W1 is the largest |dz_i|
//! (`GroundMetric::Sup`) or `sum k_i |dz_i|` (`GroundMetric::Weighted`). No move up helps the adversary, so an atom that is moved
//! by D moves along its water-filling path (`numerics/transport/water_filling.rs`). With the price gamma of distance
//!
//!   the step  =  max_(a, gamma >= 0)  sum_j p_j min_D [ U(w_j(D; a)) + gamma D ]  -  gamma radius,
//!
//! concave in a and gamma together, because the bracket is concave for every fixed move. At any a and gamma it is a
//! lower bound on the worth of a. Any law F in the ball bounds the step from above, by `E_F U` and its largest rise
//! over the allocations:
//!
//!   the step  <=  E_F[ U(w(a, Z)) ] + max_v (v - a) . E_F[ U'(w(a, Z)) (e^Z / (1 + r) - 1) ].
//!
//! `value` reports the first and `bound` the second, both in log certainty equivalent over the bank. They hold however
//! the search found them. Under `GroundMetric::Sup` without a floor the step is that of one asset whose log-return is
//! `ln(sum theta_i e^(z_i))`, theta = a / sum a. Source of the ball: paper (2.5); of the reduction, the water filling.

pub mod advice;
pub mod advising;
mod branches;
mod centred;
mod certificate;
pub mod composition;
mod cuts;
pub mod fund;
mod interior;
mod limited;
mod outcome;
mod renewal;
mod trading;
pub mod worst;

use self::branches::Branches;
use self::centred::CentredUtility;
use self::interior::Interior;
use self::trading::{Tangent, Trading};
use self::worst::RobustValue;
use crate::control::policy::caution::Caution;
use crate::control::problem::actions::ActionInterval;
use crate::control::problem::compositions::CompositionSet;
use crate::control::problem::utility::RelativeUtility;
use crate::control::request::assets::MOST_ASSETS;
use crate::numerics::transport::water_filling::GroundMetric;

/// Gap between the bounds at which a search ends, in relative utility.
const TOLERANCE: f64 = 1e-8;
/// Gap between the bounds that ends all searches, in log certainty equivalent: a thousandth of a hundredth of a
/// percent.
const CONTENT: f64 = 1e-7;
/// Relative rounding of a mean of utilities. If a utility hardly grows any more, inverting a value rounded up would
/// give infinity.
const ROUNDING: f64 = 1e-14;
/// First barriers of successive searches, in relative utility; of a warm start; and of one from half the risk aversion.
const BARRIERS: [f64; 4] = [1e-3, 1e-4, 1e-2, 1e-1];
const BARRIER_NEAR: f64 = 1e-6;
const BARRIER_CONTINUED: f64 = 1e-2;
/// How far above the least of its atom a move of the adversary may pay to be learned by a first search, in barriers.
/// Further up it would get a thousandth of the mass at most. If it is missed as the search goes on, it is found again,
/// and searches after a failed one learn all moves.
const REACH: f64 = 1000.0;
/// Smaller shares are rounding of a search that stays inside its bounds.
const LEAST_SHARE: f64 = 1e-6;

/// A robust step with several assets.
#[derive(Debug, Clone, PartialEq)]
pub struct PortfolioStep {
    assets: usize,
    /// `e^(z_i) / (1 + r)`, atom after atom.
    growths: Vec<f64>,
    masses: Vec<f64>,
    /// The growth over the bank of each asset below which no move goes; 0 without a floor.
    least_growths: Vec<f64>,
    ground: GroundMetric,
    radius: f64,
    utility: CentredUtility,
    total: ActionInterval,
    trading: Trading,
    /// The compositions allowed; all if there are no limits.
    compositions: Option<CompositionSet>,
}

/// The law of the coming returns and the set around it.
#[derive(Debug, Clone)]
pub struct ReturnScenarios<'a> {
    /// Log-returns of all assets, at most thirty, date by date; at least one date.
    pub returns: &'a [Vec<f64>],
    /// In log-return, at least 0.
    pub radius: f64,
    /// The log-return of each asset below which no move goes; minus infinity without a floor.
    pub floors: Vec<f64>,
}

/// An allocation with its bounds and the law behind them.
#[derive(Debug, Clone, PartialEq)]
pub struct AssetsSolution {
    /// Shares of wealth.
    pub allocation: Vec<f64>,
    /// Lower bound on the log certainty equivalent of the allocation over the bank, against the worst law.
    pub value: f64,
    /// Upper bound on that of every allocation.
    pub bound: f64,
    /// Lost relative utility per unit of radius.
    pub multiplier: f64,
    /// The average move of each log-return under the law behind the bound; at most 0.
    pub mean_moves: Vec<f64>,
    /// Number of points at which the adversary's answer was computed.
    pub evaluations: usize,
}

impl AssetsSolution {
    /// True if nothing is gained by searching on.
    fn is_certified(&self) -> bool {
        self.bound - self.value < CONTENT
    }

    /// Returns the better of two solutions, with the lower bound and the evaluations of both.
    fn or(self, other: AssetsSolution) -> Self {
        let (bound, evaluations) = (self.bound.min(other.bound), self.evaluations + other.evaluations);
        let better = if other.value > self.value || self.value.is_nan() { other } else { self };
        AssetsSolution { bound, evaluations, ..better }
    }

    /// Warns if the search ended before its bounds met.
    pub fn caution(&self) -> Option<Caution> {
        Caution::not_certified(self.bound - self.value)
    }
}

impl PortfolioStep {
    /// Builds the step at the empirical law of `law.returns`, each date with the same mass; the shares sum to within
    /// `total`. `utility` is relative to the wealth that the bank makes.
    pub fn new(
        law: ReturnScenarios<'_>,
        ground: GroundMetric,
        utility: RelativeUtility,
        rate_per_step: f64,
        total: ActionInterval,
    ) -> Self {
        let bank = 1.0 + rate_per_step;
        let count = law.returns.len().max(1);
        PortfolioStep {
            assets: law.returns.first().map_or(0, Vec::len),
            growths: law.returns.iter().flatten().map(|log_return| log_return.exp() / bank).collect(),
            masses: vec![1.0 / count as f64; law.returns.len()],
            least_growths: law.floors.iter().map(|floor| floor.exp() / bank).collect(),
            ground,
            radius: law.radius,
            utility: utility.into(),
            total,
            trading: Trading::default(),
            compositions: None,
        }
    }

    /// Solves for the best allocation. `near` is a warm start: the solution of a similar step.
    ///
    /// If a search leaves its bounds apart, others follow with all moves of the adversary from starts further inside or
    /// out, and then from the solutions at lower risk aversions; bounds of all of them hold. Cost: 1 search, and up to 13
    /// if they fail, each with some 10 to 40 evaluations of O(n d ln d), and 30 to 200 steps of O(n d^2), d the number
    /// of assets in the search.
    pub fn solve(&self, near: Option<&AssetsSolution>) -> AssetsSolution {
        let barrier = if near.is_some() { BARRIER_NEAR } else { BARRIERS[0] };
        let (mut best, _) = self.search(self.first_held(near), near, barrier, REACH);
        for barrier in BARRIERS {
            if best.is_certified() {
                break;
            }
            best = best.or(self.search((0..self.assets).collect(), None, barrier, f64::INFINITY).0);
        }
        if !best.is_certified() {
            best = self.continue_from_milder(best);
        }
        self.at_least_the_bank(best)
    }

    /// Solves at a low risk aversion, and follows the solution while it is doubled up to this one, each time around the
    /// wealth that the last solution is worth.
    fn continue_from_milder(&self, failed: AssetsSolution) -> AssetsSolution {
        let mut utilities: Vec<CentredUtility> =
            std::iter::successors(Some(self.utility), |utility| utility.milder()).skip(1).collect();
        let Some(mildest) = utilities.pop() else { return failed };
        let with = |utility: CentredUtility| PortfolioStep { utility, ..self.clone() };
        let (mut near, _) = with(mildest).search(self.first_held(None), None, BARRIERS[0], f64::INFINITY);
        for utility in utilities.into_iter().rev().chain([self.utility]) {
            let log_wealth = with(utility.around(near.value)).worth(&near.allocation).value;
            let step = with(utility.around(log_wealth));
            let RobustValue { value, multiplier, .. } = step.worth(&near.allocation);
            let start = AssetsSolution { value, bound: f64::INFINITY, multiplier, ..near };
            let held = step.first_held(Some(&start));
            let (found, _) = step.search(held, Some(&start), BARRIER_CONTINUED, f64::INFINITY);
            near = start.or(found);
        }
        failed.or(near)
    }

    /// Returns the assets that a search begins with: those held or in the warm start; if there are none, the one of
    /// highest mean under `GroundMetric::Sup`, and otherwise all. Those that limits need are among them.
    fn first_held(&self, near: Option<&AssetsSolution>) -> Vec<usize> {
        let counts =
            |asset: usize| self.trading.holding(asset) > 0.0 || near.is_some_and(|near| near.allocation[asset] > 0.0);
        let held: Vec<usize> = (0..self.assets).filter(|&asset| counts(asset)).collect();
        if held.is_empty() && !self.ground.is_sup() {
            return (0..self.assets).collect();
        }
        if let Some(compositions) = &self.compositions {
            return compositions.supporting(held, &self.means());
        }
        if !held.is_empty() {
            return held;
        }
        let means = self.means();
        (0..self.assets).max_by(|&left, &right| means[left].total_cmp(&means[right])).into_iter().collect()
    }

    /// Returns the mean growth of each asset over the bank.
    fn means(&self) -> Vec<f64> {
        let mut means = vec![0.0; self.assets];
        for (atom, mass) in self.masses.iter().enumerate() {
            means.iter_mut().zip(self.growth(atom)).for_each(|(mean, growth)| *mean += mass * growth);
        }
        means
    }

    /// Searches among the assets `held`, and adds others once they would raise the value. Moves of the adversary within
    /// `reach` barriers of the least of their atom are learned. The bound is that of all assets, and so is the tangent
    /// returned with it.
    fn search(
        &self,
        mut held: Vec<usize>,
        near: Option<&AssetsSolution>,
        mut barrier: f64,
        reach: f64,
    ) -> (AssetsSolution, Option<Tangent>) {
        let mut start = near.map(|near| (held.iter().map(|&asset| near.allocation[asset]).collect(), near.multiplier));
        let (mut upper, mut evaluations) = (f64::INFINITY, 0);
        loop {
            let among = self.among(&held);
            let mut interior = Interior::start(&among, self, &held, start, barrier, reach);
            interior.run(TOLERANCE);
            upper = interior.upper.min(upper);
            evaluations += interior.evaluations;
            if interior.entering.is_empty() {
                return (among.solution_from(&interior, upper, evaluations), interior.tangent_of_all());
            }
            let entering = std::mem::take(&mut interior.entering);
            let (shares, price) = interior.point.split_at(held.len());
            let mut shares = shares.to_vec();
            shares.resize(held.len() + entering.len(), 0.0);
            (start, barrier) = (Some((shares, price[0])), interior.barrier.max(BARRIER_NEAR));
            held.extend(entering);
        }
    }

    /// Returns the step with some of the assets alone.
    fn among(&self, held: &[usize]) -> PortfolioStep {
        let of = |row: &[f64]| held.iter().map(|&asset| row[asset]).collect::<Vec<f64>>();
        PortfolioStep {
            assets: held.len(),
            growths: (0..self.atoms()).flat_map(|atom| of(self.growth(atom))).collect(),
            least_growths: of(&self.least_growths),
            masses: self.masses.clone(),
            trading: self.trading.among(held),
            compositions: self.compositions.as_ref().map(|compositions| compositions.among(held)),
            ground: match &self.ground {
                GroundMetric::Sup => GroundMetric::Sup,
                GroundMetric::Weighted(weights) => GroundMetric::Weighted(of(weights)),
            },
            ..*self
        }
    }

    /// Returns the growth of an asset not held once positions are lowered to a level. It moves at no cost if all move
    /// together, and does not move if each move is paid for.
    #[inline(always)]
    fn unheld_growth(&self, asset: usize, growth: f64, level: f64) -> f64 {
        let moved = if self.ground.is_sup() { growth * level } else { growth };
        let least = self.least_growths[asset];
        let held_up = if moved > least { moved } else { least };
        if held_up < growth { held_up } else { growth }
    }

    /// Returns a lower bound on the worth of an allocation, in relative utility less the cost of trading: the dual at a
    /// price of distance.
    fn value_at(&self, allocation: &[f64], price: f64) -> f64 {
        let mut branches = Branches::default();
        branches.find(self, allocation, price);
        self.dual(&branches, price).0 - self.trading.utility_cost(allocation)
    }

    /// Returns the dual at a price of distance, and the distance that its law uses.
    fn dual(&self, branches: &Branches, price: f64) -> (f64, f64) {
        if !branches.bounded {
            return (f64::NEG_INFINITY, f64::INFINITY);
        }
        let (mut mean, mut distance) = (0.0, 0.0);
        for (atom, mass) in self.masses.iter().enumerate() {
            let worst = &branches.all[branches.worst(atom)];
            mean += mass * worst.payoff;
            distance += mass * worst.cost;
        }
        (mean - price * self.radius, distance)
    }

    /// Returns the log of the larger of the best growth over the bank seen and that of the bank: no allocation is worth
    /// more.
    fn most_growth(&self) -> f64 {
        self.growths.iter().copied().fold(1.0, f64::max).ln()
    }

    fn atoms(&self) -> usize {
        self.masses.len()
    }

    fn assets(&self) -> usize {
        self.assets
    }

    fn growth(&self, atom: usize) -> &[f64] {
        &self.growths[atom * self.assets..][..self.assets]
    }
}
