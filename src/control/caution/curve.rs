//! The allocation advised for one period as a function of the radius, for one law at all radii at once.
//!
//! Against the ball of radius e around a law, the worth of an allocation a is (Kantorovich duality,
//! [`crate::control::bellman`])
//!
//!   v(a, e)  =  max_(gamma >= 0)  sum_j p_j min_(b <= z <= z_j) [ f(z) + gamma (z_j - z) ]  -  gamma e,
//!
//! f(z) = U(1 - a + a e^z / (1 + r)) and b the lowest return allowed. f is convex below the return at which U'(w) a e^z
//! is steepest and concave above. So all mass that moves goes to one point m, and comes from an interval (m, t). At m
//! f' = gamma, or m = b; t is where the slope of the chord from m falls to gamma. Along the path on which m falls to b
//! and then gamma to 0 the distance e grows from 0. The derivative of the worth in a under the moved law,
//!
//!   g  =  E[ U'(w) (e^Z / (1 + r) - 1) ],
//!
//! falls. a is advised at the radius where g is 0, and if g stays above 0, at every radius. The sums over the atoms
//! below each atom are computed once for an allocation, so that a point of the path costs two binary searches.
//!
//! Checked by: `tests/solver/caution.rs` against the robust step, on problems drawn at random: of 1,500 all but 1 in
//! 100 lie within half of the distance of two allocations, and all within one.

use crate::control::problem::utility::RelativeUtility;
use crate::control::request::support::{LIMIT, Support};
use crate::control::uncertainty::centre::Centre;

/// Number of allocations at which the radius is computed.
const ALLOCATIONS: usize = 24;
/// The first of them, as a share of the highest.
const LEAST_ALLOCATION: f64 = 1e-4;
/// Halvings of the path: to a millionth of it.
const HALVINGS: usize = 20;

/// The advised allocation as a function of the radius, from the largest radius to 0: given at some radii, and linear
/// between these.
#[derive(Debug, Clone, PartialEq)]
pub struct AllocationCurve {
    /// Advised allocations, ascending.
    allocations: Vec<f64>,
    /// Radii at which they are advised, descending.
    radii: Vec<f64>,
}

/// An investor over one period with no holdings before.
#[derive(Debug, Clone, Copy)]
pub struct OnePeriodInvestor {
    /// 1 + r.
    pub bank: f64,
    /// Utility of wealth over the bank's.
    pub utility: RelativeUtility,
    /// The largest allocation allowed.
    pub highest: f64,
    /// The support that the adversary may use.
    pub support: Support,
}

/// A law with the sums that an allocation needs.
struct Sums<'a> {
    atoms: &'a [f64],
    /// Sums over the atoms before each: mass, mass times log-return, and g's terms.
    mass: Vec<f64>,
    moment: Vec<f64>,
    slopes: Vec<f64>,
    utilities: Vec<f64>,
    lowest: f64,
    allocation: f64,
    investor: OnePeriodInvestor,
}

impl AllocationCurve {
    /// Computes the curve of a law. Cost: 24 allocations times its atoms.
    pub fn of(centre: &Centre, investor: OnePeriodInvestor) -> Self {
        let growths: Vec<f64> = centre.atoms.iter().map(|z| z.exp() / investor.bank).collect();
        let lowest = investor.support.around(|| centre.extent()).map_or(-LIMIT, |support| support.min);
        let (mut allocations, mut radii): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut before = (0.0, 0.0);
        for index in 0..=ALLOCATIONS {
            let part = (index as f64 / ALLOCATIONS as f64).max(LEAST_ALLOCATION);
            let allocation = part * investor.highest;
            let sums = Sums::new(centre, &growths, lowest, allocation, investor);
            let slope = sums.slope_at_centre();
            if slope <= 0.0 {
                // The allocation without a ball lies between this and the one before.
                let (allocation_before, slope_before) = before;
                let crossing = match index {
                    0 => 0.0,
                    _ => allocation_before + (allocation - allocation_before) * slope_before / (slope_before - slope),
                };
                allocations.push(crossing);
                radii.push(0.0);
                break;
            }
            before = (allocation, slope);
            let radius = sums.radius();
            allocations.push(allocation);
            radii.push(radii.last().map_or(radius, |last| radius.min(*last)));
        }
        AllocationCurve { allocations, radii }
    }

    /// Returns the allocation advised in a ball of this radius.
    pub fn at(&self, radius: f64) -> f64 {
        let above = self.radii.partition_point(|other| *other >= radius);
        match above {
            // At a radius beyond all of them nothing is held.
            0 => 0.0,
            all if all == self.radii.len() => self.allocations[all - 1],
            _ => {
                let [upper, lower] = [self.radii[above - 1], self.radii[above]];
                let part = if upper.is_finite() { (upper - radius) / (upper - lower) } else { 0.0 };
                self.allocations[above - 1] + part * (self.allocations[above] - self.allocations[above - 1])
            }
        }
    }
}

impl<'a> Sums<'a> {
    fn new(centre: &'a Centre, growths: &[f64], lowest: f64, allocation: f64, investor: OnePeriodInvestor) -> Self {
        let count = centre.atoms.len();
        let [mut mass, mut moment, mut slopes, mut utilities] = [(); 4].map(|()| Vec::with_capacity(count + 1));
        let (mut total, mut first, mut slope) = (0.0, 0.0, 0.0);
        for ((atom, weight), growth) in centre.atoms.iter().zip(&centre.masses).zip(growths) {
            mass.push(total);
            moment.push(first);
            slopes.push(slope);
            let (utility, marginal) = investor.utility.at(1.0 + allocation * (growth - 1.0));
            utilities.push(utility);
            total += weight;
            first += weight * atom;
            slope += weight * marginal * (growth - 1.0);
        }
        mass.push(total);
        moment.push(first);
        slopes.push(slope);
        Sums { atoms: &centre.atoms, mass, moment, slopes, utilities, lowest, allocation, investor }
    }

    fn slope_at_centre(&self) -> f64 {
        self.slopes[self.atoms.len()]
    }

    /// Returns f, f' and U'(w) (e^z / (1 + r) - 1) at a return.
    fn at(&self, log_return: f64) -> [f64; 3] {
        let growth = log_return.exp() / self.investor.bank;
        let (utility, marginal) = self.investor.utility.at(1.0 + self.allocation * (growth - 1.0));
        [utility, marginal * self.allocation * growth, marginal * (growth - 1.0)]
    }

    /// Returns the radius at which g is 0, given that g is above 0 without a ball. It is infinite if even the lowest
    /// return allowed beats the bank.
    fn radius(&self) -> f64 {
        let highest = self.atoms[self.atoms.len() - 1];
        let steepest = self.investor.utility.steepest(1.0 - self.allocation) / self.allocation * self.investor.bank;
        let top = highest.min(steepest.ln()).max(self.lowest);
        let at_lowest = self.at(self.lowest);
        let moved = |part: f64| {
            let place = (top - part * (top - self.lowest)).max(self.lowest);
            let at = if part < 1.0 { self.at(place) } else { at_lowest };
            let price = if part < 1.0 { at[1] } else { at[1] * (2.0 - part) };
            self.moved(place, at, price)
        };
        let (mut within, mut beyond) = (0.0, 2.0);
        if moved(beyond)[1] > 0.0 {
            return f64::INFINITY;
        }
        for _ in 0..HALVINGS {
            let between = 0.5 * (within + beyond);
            if moved(between)[1] > 0.0 { within = between } else { beyond = between }
        }
        let [[distance, slope], [further, below]] = [moved(within), moved(beyond)];
        distance + (further - distance) * slope / (slope - below)
    }

    /// Returns the distance and g after moving to `place` all mass that pays to move at this price of distance.
    fn moved(&self, place: f64, [utility, _, slope]: [f64; 3], price: f64) -> [f64; 2] {
        let first = self.atoms.partition_point(|atom| *atom <= place);
        let is_moved = |index: usize| self.utilities[index] - utility > price * (self.atoms[index] - place);
        let (mut low, mut high) = (first, self.atoms.len());
        while low < high {
            let middle = low + (high - low) / 2;
            if is_moved(middle) { low = middle + 1 } else { high = middle }
        }
        let mass = self.mass[low] - self.mass[first];
        let distance = self.moment[low] - self.moment[first] - place * mass;
        [distance, self.slope_at_centre() - (self.slopes[low] - self.slopes[first]) + mass * slope]
    }
}
