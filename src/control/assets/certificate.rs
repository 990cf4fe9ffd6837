//! The bounds that the search computes at every point: they hold in any state of the search.

use super::PortfolioStep;
use super::cuts::dot;
use super::interior::Interior;
use super::trading::Tangent;
use crate::numerics::machine::dispatch::dispatched;

/// Other assets enter if they raise the bound by more than this share of the gap without them. With the one that raises
/// it most, those of at least this share of its slope enter.
const ENTERING: f64 = 1.0;
const ENTERING_TOO: f64 = 0.5;

impl Interior<'_> {
    /// Updates the lower bound by this point, whose dual is given.
    pub fn update_lower_bound(&mut self, dual: f64) {
        let (shares, price) = self.point.split_at(self.step.assets());
        let lower = dual - self.step.trading.utility_cost(shares);
        if lower > self.lower {
            (self.lower, self.best, self.best_price) = (lower, shares.to_vec(), price[0]);
        }
    }

    /// Updates the upper bound by the law of the multipliers, and the assets that would raise it.
    pub fn update_upper_bound(&mut self) {
        let assets = self.step.assets();
        let shares = &self.point[..assets];
        let masses = self.law();
        let (mut mean, mut gradient, mut others) = (0.0, vec![0.0; assets], vec![0.0; self.whole.assets()]);
        dispatched!({
            for atom in 0..self.step.atoms() {
                for cut in self.cuts.of(atom) {
                    let (found, mass) = (&self.cuts.all[cut], masses[cut]);
                    mean += mass * found.utility;
                    let weight = mass * found.slope;
                    for (sum, excess) in gradient.iter_mut().zip(self.cuts.excess(cut)) {
                        *sum += weight * excess;
                    }
                    if assets < others.len() {
                        for (asset, growth) in self.whole.growth(atom).iter().enumerate() {
                            others[asset] += weight * (self.whole.unheld_growth(asset, *growth, found.level) - 1.0);
                        }
                    }
                }
            }
        });
        let steepest = |gradient: &[f64]| gradient.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let along = dot(&gradient, shares);
        let rise = |slopes: &[f64], step: &PortfolioStep| step.greatest_rise(&step.trading, slopes);
        let mut slopes = others.clone();
        self.held.iter().zip(&gradient).for_each(|(&asset, slope)| slopes[asset] = *slope);
        let most = rise(&slopes, self.whole);
        let all = mean + most.bound - along;
        if assets < others.len() && self.whole.compositions.is_some() {
            self.entering = self.entering_within(&most, &gradient, mean - along);
        } else if assets < others.len() {
            let among = mean + rise(&gradient, self.step).bound - along;
            if all - among > ENTERING * (among - self.lower) {
                self.held.iter().for_each(|&asset| others[asset] = f64::NEG_INFINITY);
                let (among, outside) = (steepest(&gradient), steepest(&others));
                let counts = |asset: &usize| others[*asset] - among > ENTERING_TOO * (outside - among);
                self.entering = (0..others.len()).filter(counts).collect();
            }
        }
        if all < self.upper {
            (self.upper, self.tangent) = (all, Some(Tangent { shares: shares.to_vec(), mean, slopes }));
        }
    }

    /// Takes the tangent, with its shares extended from the assets searched among to all.
    pub fn tangent_of_all(&mut self) -> Option<Tangent> {
        let tangent = self.tangent.take()?;
        Some(Tangent { shares: self.of_all(&tangent.shares), ..tangent })
    }

    /// Extends a row of the assets searched among to all assets; the others get 0.
    pub fn of_all(&self, row: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.whole.assets()];
        self.held.iter().zip(row).for_each(|(&asset, entry)| all[asset] = *entry);
        all
    }

    /// Returns the average move of each log-return under the law of this point.
    pub fn mean_moves(&self) -> Vec<f64> {
        let masses = self.law();
        let mut moves = vec![0.0; self.whole.assets()];
        for atom in 0..self.step.atoms() {
            let growths = self.whole.growth(atom);
            for cut in self.cuts.of(atom).skip(1) {
                let level = self.cuts.all[cut].level;
                let unheld_growth = |(asset, growth): (usize, &f64)| self.whole.unheld_growth(asset, *growth, level);
                let mut moved: Vec<f64> = growths.iter().enumerate().map(unheld_growth).collect();
                let held = self.held.iter().zip(self.cuts.excess(cut));
                held.for_each(|(&asset, excess)| moved[asset] = excess + 1.0);
                for (sum, (moved, growth)) in moves.iter_mut().zip(moved.iter().zip(growths)) {
                    *sum += masses[cut] * (moved / growth).ln();
                }
            }
        }
        moves
    }

    /// Returns the masses of the moves that the multipliers make. A law outside the ball is mixed with the centre.
    fn law(&self) -> Vec<f64> {
        let mut masses = vec![0.0; self.cuts.all.len()];
        let mut distance = 0.0;
        for (atom, mass) in self.step.masses.iter().enumerate() {
            let of = self.cuts.of(atom);
            let whole: f64 = self.cuts.all[of.clone()].iter().map(|cut| cut.multiplier).sum();
            for cut in of {
                masses[cut] = mass * self.cuts.all[cut].multiplier / whole;
                distance += masses[cut] * self.cuts.all[cut].cost;
            }
        }
        // If the distance is NaN there is no law, and so no bound.
        let kept = if distance <= self.step.radius { 1.0 } else { self.step.radius / distance };
        masses.iter_mut().for_each(|mass| *mass *= kept);
        for (atom, mass) in self.step.masses.iter().enumerate() {
            masses[self.cuts.of(atom).start] += (1.0 - kept) * mass;
        }
        masses
    }
}
