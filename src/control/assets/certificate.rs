//! The bounds that the search tells of every point: they hold whatever its state.

use super::interior::{Interior, dot};

impl Interior<'_> {
    /// Both bounds of the step, at this point and from the multipliers' law.
    pub fn tell_bounds(&mut self) {
        let assets = self.step.assets();
        let (shares, price) = (&self.point[..assets], self.point[assets]);
        let (lower, _) = self.step.dual(&self.branches, price);
        if lower > self.lower {
            (self.lower, self.best, self.best_price) = (lower, shares.to_vec(), price);
        }
        let masses = self.law();
        let (mut mean, mut gradient) = (0.0, vec![0.0; assets]);
        for (found, (mass, branch)) in self.branches.all.iter().zip(masses.iter().zip(0..)) {
            mean += mass * (found.payoff - price * found.cost);
            let weight = mass * found.slope;
            let excess = self.branches.excess(branch);
            gradient.iter_mut().zip(excess).for_each(|(sum, excess)| *sum += weight * excess);
        }
        let steepest = gradient.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let total = self.step.total;
        let upper = mean + (total.highest * steepest).max(total.lowest * steepest) - dot(&gradient, shares);
        self.upper = self.upper.min(upper);
    }

    /// By how much the law of this point moves each log-return, on average.
    pub fn mean_moves(&self) -> Vec<f64> {
        let masses = self.law();
        let mut moves = vec![0.0; self.step.assets()];
        for atom in 0..self.step.atoms() {
            for branch in self.branches.of(atom).skip(1) {
                let grown = self.branches.excess(branch).iter().zip(self.step.growth(atom));
                for (sum, (excess, growth)) in moves.iter_mut().zip(grown) {
                    *sum += masses[branch] * ((excess + 1.0) / growth).ln();
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
