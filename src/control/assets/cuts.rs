//! The moves of the adversary that the search has found so far, atom by atom. A move bounds the payoff of its atom from
//! above, at every allocation a and price of distance gamma, by a concave function:
//!
//!   a fixed move       U(w(a)) + gamma D;
//!   a following move   min over moving positions of `U(w) + U' (w(a) - w) + gamma D`, less `U' bend (s . dx)^2 / 2`,
//!
//! the tangent and its bend at the origin, the point where the move was found. s is the derivative of the part that
//! does not move by itself. The second agrees with its branch to second order, and is a bound near the origin alone: if
//! it is kept longer, it becomes a fixed move.

use super::PortfolioStep;
use super::branches::Branches;
use crate::control::request::assets::MOST_ASSETS;
use crate::numerics::machine::dispatch::dispatched;

/// A move found before is kept while it has this share of its atom's mass.
const LEAST_MASS: f64 = 0.01;
/// Moves whose costs and growths differ by no more than this share are the same.
const SAME: f64 = 0.003;

/// One move of an atom, and the pair of slack and multiplier of `t_j <= payoff`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cut {
    /// Distance by which it moves the atom.
    pub cost: f64,
    /// The level to which positions are lowered; infinite if the atom stays.
    pub level: f64,
    /// U and U' at the point.
    pub utility: f64,
    pub slope: f64,
    /// Upper bound on the atom's payoff at the point.
    pub payoff: f64,
    /// The curvature of the payoff along `still`.
    pub curvature: f64,
    pub follows: Option<Following>,
    pub slack: f64,
    pub multiplier: f64,
}

/// The tangent of utility at the origin, `at_bank + slope (w - 1)`, of a following move.
#[derive(Debug, Clone, Copy)]
pub(super) struct Following {
    at_bank: f64,
    pub slope: f64,
}

/// All known moves of all atoms. Moves of one atom are contiguous, and its first move leaves it in place.
#[derive(Debug, Clone, Default)]
pub(super) struct Cuts {
    assets: usize,
    /// The start of each atom's moves, and the end.
    first: Vec<usize>,
    pub all: Vec<Cut>,
    /// Growth over the bank, less 1, asset by asset.
    excesses: Vec<f64>,
    /// The derivative, by the allocation and by gamma, of the part that does not move by itself.
    stills: Vec<f64>,
    /// The derivative of the payoff.
    gradients: Vec<f64>,
    /// The growth over the bank of each asset that moves by itself at the point; 0 for an asset that does not.
    moving: Vec<f64>,
    /// The point at which the following moves were found.
    origin: Vec<f64>,
}

/// Returns the scalar product over the entries that both have.
pub(super) fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}

impl Cuts {
    pub fn of(&self, atom: usize) -> std::ops::Range<usize> {
        self.first[atom]..self.first[atom + 1]
    }

    pub fn excess(&self, cut: usize) -> &[f64] {
        &self.excesses[cut * self.assets..][..self.assets]
    }

    pub fn still(&self, cut: usize) -> &[f64] {
        &self.stills[cut * (self.assets + 1)..][..self.assets + 1]
    }

    pub fn gradient(&self, cut: usize) -> &[f64] {
        &self.gradients[cut * (self.assets + 1)..][..self.assets + 1]
    }

    pub fn moving(&self, cut: usize) -> &[f64] {
        &self.moving[cut * self.assets..][..self.assets]
    }

    /// Returns the point at which the following moves were found.
    pub fn origin(&self) -> &[f64] {
        &self.origin
    }

    /// Returns the upper bound that the moves give on the payoff of an atom.
    pub fn least(&self, atom: usize) -> f64 {
        self.all[self.of(atom)].iter().map(|cut| cut.payoff).fold(f64::INFINITY, f64::min)
    }

    /// Takes over the branches found at a point that pay within `reach` of the least, and those earlier moves that still
    /// carry mass and differ from all of the new ones.
    pub fn renew(&mut self, step: &PortfolioStep, branches: &Branches, reach: f64, point: &[f64], before: &Cuts) {
        self.assets = step.assets();
        self.origin.clear();
        self.origin.extend_from_slice(point);
        self.first.clear();
        self.first.push(0);
        self.all.clear();
        self.excesses.clear();
        self.stills.clear();
        for (atom, mass) in step.masses.iter().enumerate() {
            let least = branches.all[branches.worst(atom)].payoff;
            let is_near = |branch: &usize| branches.all[*branch].payoff <= least + reach;
            let stays = branches.of(atom).start;
            for branch in branches.of(atom).filter(|branch| *branch == stays || is_near(branch)) {
                let (found, excess) = (&branches.all[branch], branches.excess(branch));
                let at_bank = found.payoff - point[self.assets] * found.cost - found.slope * dot(excess, point);
                let follows = found.follows.then_some(Following { at_bank, slope: found.slope });
                self.push(found.cost, found.level, found.slope * found.bend, follows);
                self.excesses.extend_from_slice(excess);
                self.stills.extend_from_slice(branches.still(branch));
            }
            let new = self.first[atom]..self.all.len();
            // Before the first call there were none.
            let known = if before.first.is_empty() { 0..0 } else { before.of(atom) };
            for old in known.filter(|old| before.all[*old].multiplier > LEAST_MASS * mass) {
                let (cut, excess) = (&before.all[old], before.excess(old));
                if new.clone().all(|new| !self.is_same(new, cut.cost, excess)) {
                    self.push(cut.cost, cut.level, 0.0, None);
                    self.excesses.extend_from_slice(excess);
                    self.stills.extend_from_slice(excess);
                    self.stills.push(0.0);
                }
            }
            self.first.push(self.all.len());
        }
        self.gradients.resize(self.stills.len(), 0.0);
        self.moving.resize(self.excesses.len(), 0.0);
        self.evaluate(step, point);
    }

    fn push(&mut self, cost: f64, level: f64, curvature: f64, follows: Option<Following>) {
        let (utility, slope, payoff, slack, multiplier) = (0.0, 0.0, 0.0, 0.0, 0.0);
        self.all.push(Cut { cost, level, utility, slope, payoff, curvature, follows, slack, multiplier });
    }

    fn is_same(&self, cut: usize, cost: f64, excess: &[f64]) -> bool {
        let known = self.all[cut].cost;
        let mut growths = self.excess(cut).iter().zip(excess);
        (known - cost).abs() <= SAME * known.max(cost)
            && growths.all(|(left, right)| (left - right).abs() <= SAME * (1.0 + left.max(*right)))
    }

    /// Sets payoffs and their derivatives at a point. Cost O(n d) for n moves of d assets.
    pub fn evaluate(&mut self, step: &PortfolioStep, point: &[f64]) {
        dispatched!({
            for atom in 0..step.atoms() {
                for cut in self.of(atom) {
                    match self.all[cut].follows {
                        Some(following) => self.evaluate_following(step, atom, cut, point, following),
                        None => self.evaluate_still(step, cut, point),
                    }
                }
            }
        });
    }

    #[inline(always)]
    fn evaluate_still(&mut self, step: &PortfolioStep, cut: usize, point: &[f64]) {
        let (assets, found) = (self.assets, &mut self.all[cut]);
        let excess = &self.excesses[cut * assets..][..assets];
        let wealth = 1.0 + dot(excess, point);
        (found.utility, found.slope) = step.utility.at(wealth);
        found.payoff = found.utility + point[assets] * found.cost;
        found.curvature = found.slope * step.utility.relative_aversion(wealth) / wealth;
        let gradient = &mut self.gradients[cut * (assets + 1)..][..=assets];
        gradient.iter_mut().zip(excess).for_each(|(entry, excess)| *entry = found.slope * excess);
        gradient[assets] = found.cost;
    }

    #[inline(always)]
    fn evaluate_following(
        &mut self,
        step: &PortfolioStep,
        atom: usize,
        cut: usize,
        point: &[f64],
        following: Following,
    ) {
        let along = self.along(cut, point);
        let level = self.level(step, atom, cut, point, following.slope);
        let (assets, found) = (self.assets, &mut self.all[cut]);
        let (shares, price, growths) = (&point[..assets], point[assets], step.growth(atom));
        let still = &self.stills[cut * (assets + 1)..][..=assets];
        let gradient = &mut self.gradients[cut * (assets + 1)..][..=assets];
        let moving = &mut self.moving[cut * assets..][..assets];
        let (bent, mut wealth) = (found.curvature * along, 1.0);
        let mut moved = [0.0; MOST_ASSETS];
        for index in 0..assets {
            let moves;
            (moved[index], moves) = lowered(step, index, shares[index], growths[index], level);
            wealth += shares[index] * (moved[index] - 1.0);
            gradient[index] = following.slope * (moved[index] - 1.0) - bent * still[index];
            moving[index] = if moves { moved[index] } else { 0.0 };
        }
        let cost = step.ground.cost(assets, level, |index| growths[index] / moved[index]);
        gradient[assets] = cost - bent * still[assets];
        found.payoff = following.at_bank + following.slope * (wealth - 1.0) + price * cost - 0.5 * bent * along;
    }

    /// Returns `s . dx` of a following move.
    #[inline(always)]
    fn along(&self, cut: usize, point: &[f64]) -> f64 {
        let since = point.iter().zip(&self.origin).map(|(at, from)| at - from);
        self.still(cut).iter().zip(since).map(|(still, since)| still * since).sum()
    }

    /// Returns the level at which a following move is optimal if U' is `slope`.
    #[inline(always)]
    fn level(&self, step: &PortfolioStep, atom: usize, cut: usize, point: &[f64], slope: f64) -> f64 {
        let price = point[self.assets];
        if !step.ground.is_sup() {
            return price / slope;
        }
        // If all move together, the level is a share of the sum that moved at the origin.
        let positions = point.iter().zip(step.growth(atom)).zip(self.still(cut));
        let moved = positions.filter(|(_, still)| **still == -1.0).map(|((share, growth), _)| share * growth);
        price / (slope * moved.sum::<f64>())
    }

    /// Sets the following moves to their optimum at a point, for the law: U' has also changed since the origin.
    pub fn follow(&mut self, step: &PortfolioStep, point: &[f64]) {
        let assets = self.assets;
        for atom in 0..step.atoms() {
            for cut in self.of(atom) {
                let Some(following) = self.all[cut].follows else { continue };
                let slope = following.slope - self.all[cut].curvature * self.along(cut, point);
                let level = self.level(step, atom, cut, point, if slope > 0.0 { slope } else { following.slope });
                let (found, growths) = (&mut self.all[cut], step.growth(atom));
                let excess = &mut self.excesses[cut * assets..][..assets];
                for (index, (excess, growth)) in excess.iter_mut().zip(growths).enumerate() {
                    *excess = lowered(step, index, point[index], *growth, level).0 - 1.0;
                }
                found.level = level;
                found.cost = step.ground.cost(assets, level, |index| growths[index] / (1.0 + excess[index]));
                (found.utility, found.slope) = step.utility.at(1.0 + dot(excess, point));
            }
        }
    }
}

/// Returns the growth of an asset with a positive share once positions are lowered to a level, and whether it moves by
/// itself there.
#[inline(always)]
fn lowered(step: &PortfolioStep, index: usize, share: f64, growth: f64, level: f64) -> (f64, bool) {
    let (position, floor) = (share * growth, share * step.least_growths[index].min(growth));
    let lowered = step.ground.lowered(index, position, floor, level);
    (if lowered < position { lowered / share } else { growth }, lowered < position && lowered > floor)
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::control::assets::ReturnScenarios;
    use crate::control::problem::actions::ActionInterval;
    use crate::control::problem::utility::RelativeUtility;
    use crate::numerics::machine::streams::stream;
    use crate::numerics::transport::water_filling::{GroundMetric, inverse_volatility};

    /// Compares with branches found anew at each point, and with differences of the move's own payoffs.
    #[test]
    fn a_move_is_its_branch_to_second_order_and_bounds_it() {
        const ASSETS: usize = 4;
        let mut random = stream(8, "cuts", 0, 0);
        let (mut followed, mut stayed) = (0, 0);
        for case in 0..60 {
            let returns: Vec<Vec<f64>> =
                (0..20).map(|_| (0..ASSETS).map(|_| 0.3 * random.random::<f64>() - 0.14).collect()).collect();
            let ground =
                if case % 2 == 0 { GroundMetric::Sup } else { GroundMetric::Weighted(inverse_volatility(&returns)) };
            let utility =
                [RelativeUtility::Power { eta: 3.0 }, RelativeUtility::Log, RelativeUtility::Exponential { k: 2.0 }]
                    [case % 3];
            let floor = [f64::NEG_INFINITY, -0.3, -0.13][case % 4 % 3];
            let law = ReturnScenarios { returns: &returns, radius: 0.01, floors: vec![floor; ASSETS] };
            let step = PortfolioStep::new(law, ground, utility, 0.002, ActionInterval { lowest: 0.0, highest: 1.0 });
            let mut draw = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
            let mut point: Vec<f64> = (0..ASSETS).map(|_| draw(0.02, 0.24)).collect();
            point.push(draw(0.1, 2.0));
            let way: Vec<f64> = point.iter().map(|entry| entry * draw(-1.0, 1.0)).collect();
            let at = |length: f64| -> Vec<f64> { point.iter().zip(&way).map(|(at, way)| at + length * way).collect() };
            let found_at = |length: f64| {
                let (mut branches, mut cuts, at) = (Branches::default(), Cuts::default(), at(length));
                branches.find(&step, &at[..ASSETS], at[ASSETS]);
                cuts.renew(&step, &branches, f64::INFINITY, &at, &Cuts::default());
                cuts
            };
            let here = found_at(0.0);
            let payoffs = |length: f64| -> Vec<f64> {
                let mut cuts = here.clone();
                cuts.evaluate(&step, &at(length));
                cuts.all.iter().map(|cut| cut.payoff).collect()
            };
            let (up, down) = (payoffs(1e-5), payoffs(-1e-5));
            // The error of a following move, if it is found again with the same moving assets.
            let error = |atom: usize, cut: usize, length: f64| -> Option<f64> {
                let there = found_at(length);
                let pattern = |cuts: &Cuts, cut: usize| {
                    cuts.still(cut)[..ASSETS].iter().map(|still| *still == -1.0).collect::<Vec<bool>>()
                };
                let same = there.of(atom).find(|other| pattern(&there, *other) == pattern(&here, cut))?;
                Some((payoffs(length)[cut] - there.all[same].payoff).abs())
            };
            for atom in 0..step.atoms() {
                for cut in here.of(atom) {
                    let along = dot(here.gradient(cut), &way);
                    // Central differences: their error is 1e-10 of the third derivative.
                    assert!(((up[cut] - down[cut]) / 2e-5 - along).abs() < 1e-5 * (1.0 + along.abs()), "{case} {atom}");
                    if here.all[cut].follows.is_none() {
                        stayed += 1;
                        continue;
                    }
                    let (Some(far), Some(near)) = (error(atom, cut, 2e-2), error(atom, cut, 1e-2)) else { continue };
                    // With half the distance an error of third order falls to an eighth, one of second order to a
                    // quarter.
                    assert!(near < far / 6.0 + 1e-12 || far < 1e-9, "{case} {atom}: {far:e} {near:e}");
                    followed += 1;
                }
                // The known fixed moves of an atom bound its payoff elsewhere too; following moves need not.
                let elsewhere = found_at(0.5).least(atom);
                let kept = here.of(atom).filter(|cut| here.all[*cut].follows.is_none()).map(|cut| payoffs(0.5)[cut]);
                assert!(kept.fold(f64::INFINITY, f64::min) > elsewhere - 1e-12, "{case} {atom}");
            }
        }
        assert!(followed > 200 && stayed > 1000, "{followed} {stayed}");
    }
}
