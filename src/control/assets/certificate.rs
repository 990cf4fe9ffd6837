//! The bounds that the search tells of every point: they hold whatever its state.

use super::AssetsStep;
use super::interior::{Interior, dot};
use super::trading::Tangent;
use crate::numerics::dispatch::dispatched;

/// Others enter where they raise the bound by more than this share of the gap without them, and with the one that raises it
/// most those of at least this share of its slope.
const ENTERING: f64 = 1.0;
const ENTERING_TOO: f64 = 0.5;

impl Interior<'_> {
    /// Both bounds of the step, at this point and from the multipliers' law.
    pub fn tell_bounds(&mut self) {
        let assets = self.step.assets();
        let (shares, price) = (&self.point[..assets], self.point[assets]);
        let lower = self.step.dual(&self.branches, price).0 - self.step.trading.taken(shares);
        if lower > self.lower {
            (self.lower, self.best, self.best_price) = (lower, shares.to_vec(), price);
        }
        let masses = self.law();
        let (mut mean, mut gradient, mut others) = (0.0, vec![0.0; assets], vec![0.0; self.whole.assets()]);
        dispatched!({
            for atom in 0..self.step.atoms() {
                for branch in self.branches.of(atom) {
                    let (found, mass) = (&self.branches.all[branch], masses[branch]);
                    mean += mass * (found.payoff - price * found.cost);
                    let weight = mass * found.slope;
                    for (sum, excess) in gradient.iter_mut().zip(self.branches.excess(branch)) {
                        *sum += weight * excess;
                    }
                    if assets < others.len() {
                        for (asset, growth) in self.whole.growth(atom).iter().enumerate() {
                            others[asset] += weight * (self.whole.unheld(asset, *growth, found.level) - 1.0);
                        }
                    }
                }
            }
        });
        let steepest = |gradient: &[f64]| gradient.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let along = dot(&gradient, shares);
        let upper = |slopes: &[f64], step: &AssetsStep| mean + step.trading.most(slopes, step.total) - along;
        let among = upper(&gradient, self.step);
        let mut slopes = others.clone();
        self.held.iter().zip(&gradient).for_each(|(&asset, slope)| slopes[asset] = *slope);
        let all = upper(&slopes, self.whole);
        if all - among > ENTERING * (among - self.lower) {
            self.held.iter().for_each(|&asset| others[asset] = f64::NEG_INFINITY);
            let (among, outside) = (steepest(&gradient), steepest(&others));
            let counts = |asset: &usize| others[*asset] - among > ENTERING_TOO * (outside - among);
            self.entering = (0..others.len()).filter(counts).collect();
        }
        if all < self.upper {
            (self.upper, self.tangent) = (all, Some(Tangent { shares: shares.to_vec(), mean, slopes }));
        }
    }

    /// The tangent at shares of the assets searched among as one at shares of all.
    pub fn tangent_of_all(&mut self) -> Option<Tangent> {
        let tangent = self.tangent.take()?;
        Some(Tangent { shares: self.of_all(&tangent.shares), ..tangent })
    }

    /// A row of the assets searched among as one of all.
    pub fn of_all(&self, row: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.whole.assets()];
        self.held.iter().zip(row).for_each(|(&asset, entry)| all[asset] = *entry);
        all
    }

    /// By how much the law of this point moves each log-return, on average.
    pub fn mean_moves(&self) -> Vec<f64> {
        let masses = self.law();
        let mut moves = vec![0.0; self.whole.assets()];
        for atom in 0..self.step.atoms() {
            let growths = self.whole.growth(atom);
            for branch in self.branches.of(atom).skip(1) {
                let level = self.branches.all[branch].level;
                let unheld = |(asset, growth): (usize, &f64)| self.whole.unheld(asset, *growth, level);
                let mut moved: Vec<f64> = growths.iter().enumerate().map(unheld).collect();
                let held = self.held.iter().zip(self.branches.excess(branch));
                held.for_each(|(&asset, excess)| moved[asset] = excess + 1.0);
                for (sum, (moved, growth)) in moves.iter_mut().zip(moved.iter().zip(growths)) {
                    *sum += masses[branch] * (moved / growth).ln();
                }
            }
        }
        moves
    }

    /// The masses of the branches that the multipliers make, in the ball: a law that is too far is mixed with the centre.
    fn law(&self) -> Vec<f64> {
        let mut masses = vec![0.0; self.pairs.len()];
        let mut distance = 0.0;
        for (atom, mass) in self.step.masses.iter().enumerate() {
            let of = self.branches.of(atom);
            let whole: f64 = self.pairs[of.clone()].iter().map(|pair| pair.multiplier).sum();
            for branch in of {
                masses[branch] = mass * self.pairs[branch].multiplier / whole;
                distance += masses[branch] * self.branches.all[branch].cost;
            }
        }
        let kept = if distance > self.step.radius { self.step.radius / distance } else { 1.0 };
        masses.iter_mut().for_each(|mass| *mass *= kept);
        for (atom, mass) in self.step.masses.iter().enumerate() {
            masses[self.branches.first[atom]] += (1.0 - kept) * mass;
        }
        masses
    }
}
