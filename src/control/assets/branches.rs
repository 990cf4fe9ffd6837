//! The adversary's possible best moves of each atom at one allocation and one price of distance: it leaves the atom, or
//! moves it until moving further no longer pays.
//!
//! An atom that is moved along its water-filling path for the cost D pays `f(D) = u(w(D)) + gamma D`. Along a phase y
//! falls and b stays, so `w = b + y`, and f falls by `U'(w) y / rate - gamma` per unit of D. In ln y that slope rises
//! to one peak and falls. So f has at most one local minimum inside a phase, on the side of small y, where U' y still
//! grows. At the end of a phase, when a position reaches its floor, f may have another local minimum. A worst law needs
//! only these points and the atom in place.

use super::PortfolioStep;
use super::centred::CentredUtility;
use crate::numerics::machine::interruption;
use crate::numerics::transport::water_filling::{FillingPhase, Levelling};

/// Largest number of Newton steps for a local minimum, and the last step as a share of it: they approach it from one
/// side, and double the digits from about the third on.
const NEWTON_STEPS: usize = 40;
const NEWTON_TOLERANCE: f64 = 1e-9;
/// At 1 a local minimum and a maximum meet.
const MOST_FOLLOWED: f64 = 1.0 - 1e-4;

/// One candidate move of an atom by the adversary.
#[derive(Debug, Clone, Copy)]
pub(super) struct Branch {
    /// Distance by which it moves the atom.
    pub cost: f64,
    /// `u(w) + gamma D`.
    pub payoff: f64,
    /// `U'(w)`, by relative wealth.
    pub slope: f64,
    /// The curvature of the payoff with respect to the part that does not move, over the slope.
    pub bend: f64,
    /// The level to which positions are lowered; infinite if the atom stays.
    pub level: f64,
    /// True if the level follows allocation and price: at a local minimum inside a phase.
    pub follows: bool,
}

/// All branches of all atoms. Branches of one atom are contiguous, and its first branch leaves it in place.
#[derive(Debug, Clone, Default)]
pub(super) struct Branches {
    assets: usize,
    /// The start of each atom's branches, and the end.
    pub first: Vec<usize>,
    pub all: Vec<Branch>,
    /// Growth over the bank, less 1, asset by asset of each branch.
    excesses: Vec<f64>,
    /// The derivative, by the allocation and by gamma, of the part that does not move.
    still: Vec<f64>,
    levelling: Levelling,
    /// The last local minimum inside a phase: most atoms share their last phase.
    last: Inside,
    /// True unless the payoff of some atom falls without bound as it is moved further.
    pub bounded: bool,
}

impl Branches {
    pub fn excess(&self, branch: usize) -> &[f64] {
        &self.excesses[branch * self.assets..][..self.assets]
    }

    pub fn still(&self, branch: usize) -> &[f64] {
        &self.still[branch * (self.assets + 1)..][..self.assets + 1]
    }

    /// Returns the branches of an atom.
    pub fn of(&self, atom: usize) -> std::ops::Range<usize> {
        self.first[atom]..self.first[atom + 1]
    }

    /// Returns the branch of an atom that pays least.
    pub fn worst(&self, atom: usize) -> usize {
        self.of(atom)
            .min_by(|&left, &right| self.all[left].payoff.total_cmp(&self.all[right].payoff))
            .unwrap_or_default()
    }

    /// Finds the branches at a point. Cost O(n d ln d).
    pub fn find(&mut self, step: &PortfolioStep, allocation: &[f64], price: f64) {
        self.start(step);
        for atom in 0..step.atoms() {
            self.find_of(step, atom, allocation, price);
            self.first.push(self.all.len());
        }
    }

    fn start(&mut self, step: &PortfolioStep) {
        interruption::checkpoint();
        self.assets = step.assets();
        self.first.clear();
        self.first.push(0);
        self.all.clear();
        self.excesses.clear();
        self.still.clear();
        self.bounded = true;
        self.last = Inside::default();
    }

    /// Adds the branch that leaves the atom in place.
    fn leave(&mut self, utility: CentredUtility, allocation: &[f64], growths: &[f64]) {
        let start = self.excesses.len();
        self.excesses.extend(growths.iter().map(|growth| growth - 1.0));
        let row = &self.excesses[start..];
        let wealth = 1.0 + row.iter().zip(allocation).map(|(excess, share)| excess * share).sum::<f64>();
        self.still.extend(row);
        self.still.push(0.0);
        let (payoff, slope) = utility.at(wealth);
        let bend = utility.relative_aversion(wealth) / wealth;
        self.all.push(Branch { cost: 0.0, payoff, slope, bend, level: f64::INFINITY, follows: false });
    }

    fn find_of(&mut self, step: &PortfolioStep, atom: usize, allocation: &[f64], price: f64) {
        let growths = step.growth(atom);
        self.leave(step.utility, allocation, growths);
        if step.radius <= 0.0 {
            return;
        }
        let slope = self.all[self.first[atom]].slope;
        let mut levelling = std::mem::take(&mut self.levelling);
        let rest = (1.0 - allocation.iter().sum::<f64>()).max(0.0);
        let (mut positions, mut floors) = ([0.0; super::MOST_ASSETS], [0.0; super::MOST_ASSETS]);
        for (index, (&share, &growth)) in allocation.iter().zip(growths).enumerate() {
            (positions[index], floors[index]) = (share * growth, share * step.least_growths[index].min(growth));
        }
        let count = allocation.len();
        let phases = levelling.phases(rest, &positions[..count], &floors[..count], &step.ground);
        let mut last = self.last;
        let bounded = local_minima(phases, step.utility, price, slope, &mut last, |level, follows, known| {
            let start = self.still.len();
            let (mut wealth, mut moving) = (rest, 0.0);
            for (index, &share) in allocation.iter().enumerate() {
                let position = step.ground.lowered(index, positions[index], floors[index], level);
                wealth += position;
                let growth = match share > 0.0 {
                    true => position / share,
                    false => step.unheld_growth(index, growths[index], level),
                };
                let moves = follows && position < positions[index] && position > floors[index];
                moving += if moves { position } else { 0.0 };
                self.excesses.push(growth - 1.0);
                self.still.push(if moves { -1.0 } else { growth - 1.0 });
            }
            let cost = step.ground.cost(count, level, |index| {
                positions[index] / step.ground.lowered(index, positions[index], floors[index], level)
            });
            let (value, slope) = known.unwrap_or_else(|| step.utility.at(wealth));
            let aversion = step.utility.relative_aversion(wealth) / wealth;
            // Near the limit the level would follow without bound: such a move counts as fixed.
            let (room, follows) = (1.0 - aversion * moving, moving > 0.0 && aversion * moving < MOST_FOLLOWED);
            if follows {
                self.still.push(moving / price);
            } else {
                self.still.truncate(start);
                self.still.extend_from_slice(&self.excesses[self.excesses.len() - count..]);
                self.still.push(0.0);
            }
            let bend = if follows { aversion / room } else { aversion };
            self.all.push(Branch { cost, payoff: value + price * cost, slope, bend, level, follows });
        });
        (self.levelling, self.last) = (levelling, last);
        self.bounded &= bounded;
    }
}

/// A local minimum inside a phase, at one price: it depends on the fixed part and on the rate alone.
#[derive(Debug, Clone, Copy, Default)]
struct Inside {
    fixed: f64,
    rate: f64,
    /// The largest loss per unit of distance.
    at_peak: f64,
    /// The moving part of wealth; NaN until it is needed.
    moving: f64,
    /// The utility and its slope there.
    utility: (f64, f64),
}

/// Reports every local minimum of u(w) + price D along the phases, except D = 0: its level, whether it follows price
/// and allocation, and U and U' there if they are known. `slope` is U' if nothing is moved. Returns false if there is
/// no minimum because the payoff falls without bound.
fn local_minima(
    phases: &[FillingPhase],
    utility: CentredUtility,
    price: f64,
    mut slope: f64,
    last: &mut Inside,
    mut found: impl FnMut(f64, bool, Option<(f64, f64)>),
) -> bool {
    // The loss per unit of distance just before a phase starts; the first one starts at the atom itself.
    let mut before = None;
    for phase in phases.iter().rev() {
        let &FillingPhase { fixed, speed, rate, high, low } = phase;
        let start = slope * speed * high / rate;
        if before.is_some_and(|before| before > price && start <= price) {
            found(high, false, None);
        }
        let end = if low > 0.0 {
            slope = utility.at(fixed + speed * low).1;
            slope * speed * low / rate
        } else {
            utility.steepness_of_ruin(fixed) / rate
        };
        before = Some(end);
        if end < price {
            let peak = utility.steepest(fixed);
            if last.fixed != fixed || last.rate != rate {
                let at_peak = if peak < f64::INFINITY { utility.at(fixed + peak).1 * peak / rate } else { 0.0 };
                *last = Inside { fixed, rate, at_peak, moving: f64::NAN, utility: (0.0, 0.0) };
            }
            let crosses = speed * low < peak && peak < speed * high && last.at_peak > price;
            if start > price || crosses {
                if last.moving.is_nan() {
                    last.moving = inside(phase, utility, price, peak.min(speed * high));
                    last.utility = utility.at(fixed + last.moving);
                }
                found(last.moving / speed, true, Some(last.utility));
            }
        }
    }
    match (before, phases.first()) {
        (Some(before), Some(last)) if before > price && last.low > 0.0 => found(last.low, false, None),
        (Some(before), Some(_)) => return before <= price,
        _ => {}
    }
    true
}

/// Returns the y below `peak` at which `U'(b + y) y / rate` is the price. Newton's method runs from the left: up to its
/// peak `U'(b + y) y` is concave for every utility.
fn inside(phase: &FillingPhase, utility: CentredUtility, price: f64, peak: f64) -> f64 {
    let &FillingPhase { fixed, speed, rate, low, .. } = phase;
    let target = price * rate;
    let mut moving = if utility.is_log() {
        // y / (b + y) = target.
        return (target * fixed / (1.0 - target)).min(peak);
    } else {
        (speed * low).max(target / utility.at(fixed).1).min(peak)
    };
    for _ in 0..NEWTON_STEPS {
        let wealth = fixed + moving;
        let slope = utility.at(wealth).1;
        let rise = slope * (1.0 - utility.relative_aversion(wealth) * moving / wealth);
        let next = (moving + (target - slope * moving) / rise).min(peak);
        let step = (next - moving).abs();
        moving = next;
        if step < NEWTON_TOLERANCE * moving {
            break;
        }
    }
    moving
}
