//! The weights of a law's gaps in a statistic over bridges: the times at which they count, and how much.

use std::sync::Arc;

use crate::numerics::bridge::paths::{AbsoluteBridges, Share, Times, deviation};
use crate::numerics::law::empirical::EmpiricalDistribution;

/// A statistic of a law of n values; if weights decay, n stands for their sum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Statistic {
    /// The statistic of the law itself, over bridges of sample size n.
    Current,
    /// The mean over the laws that add one of its values again, each with the mass of that value, over bridges of
    /// sample size n + 1. This is the expected statistic if the next value is drawn from the law itself. With equal
    /// weights, a value doubled at rank j moves the gaps above it one node up. Gap i is therefore at node i in n - i of
    /// the laws, and at node i + 1 in the other i.
    AfterOneMore,
}

/// Mass below or above a gap that counts as zero: the bridge is within 1e-7 of 0.
const NO_MASS: f64 = 1e-14;

const NONE: Share = (0, 0.0);

/// The weights of gaps, for laws of one size and retention.
pub(super) struct SizedGaps<'a> {
    bridges: &'a AbsoluteBridges,
    /// Total weight of all values of a law.
    total: f64,
    retention: f64,
    which: Statistic,
    /// The graded time at or after the latest one requested; the next is often the same, or one further.
    near: usize,
}

impl<'a> SizedGaps<'a> {
    /// Prepares for laws of `size` values whose weights sum to `total`.
    pub fn new(bridges: &'a AbsoluteBridges, size: usize, total: f64, retention: f64, which: Statistic) -> Self {
        if let Times::Sample(own) = bridges.times {
            assert_eq!(
                own,
                size + usize::from(which == Statistic::AfterOneMore),
                "bridges of the sample size of the law"
            );
        }
        SizedGaps { bridges, total, retention, which, near: 0 }
    }

    pub fn of_laws_like(bridges: &'a AbsoluteBridges, law: &EmpiricalDistribution, which: Statistic) -> Self {
        SizedGaps::new(bridges, law.sample_size(), law.total_weight(), law.retention(), which)
    }

    /// Returns the times and weights of a gap with values of total weight `below` under it.
    pub fn of(&mut self, below: f64) -> [Share; 4] {
        match self.which {
            Statistic::Current => {
                let [first, second] = self.at(below, self.total);
                [first, second, NONE, NONE]
            }
            Statistic::AfterOneMore => {
                let share = below / self.total;
                let (kept, total) = (below * self.retention, self.total * self.retention + 1.0);
                let [first, second] = self.at(kept, total).map(|(time, part)| (time, (1.0 - share) * part));
                let [third, fourth] = self.at(kept + 1.0, total).map(|(time, part)| (time, share * part));
                [first, second, third, fourth]
            }
        }
    }

    /// Returns the times and weights for the time below/total.
    fn at(&mut self, below: f64, total: f64) -> [Share; 2] {
        let time = below / total;
        if time.min(1.0 - time) <= NO_MASS {
            return [NONE; 2];
        }
        match &self.bridges.times {
            Times::Sample(own) => {
                let size = *own as f64;
                // With equal weights the ratio is 1, so the position is a node, to the last bit.
                let position = below * (size / total);
                let node = position.ceil();
                if node == position {
                    return [self.share(node as usize, 1.0), NONE];
                }
                let ends = [(node - 1.0) / size, node / size];
                self.interpolated(node as usize, ends, ends.map(deviation), time)
            }
            Times::Graded { times, deviations } => {
                let is_after = |&after: &usize| times[after - 1] < time && time <= times[after];
                let near = (self.near.max(1)..times.len()).take(2).find(is_after);
                let after = near.unwrap_or_else(|| times.partition_point(|&known| known < time));
                self.near = after;
                let ends = [after - 1, after];
                self.interpolated(after, ends.map(|end| times[end]), ends.map(|end| deviations[end]), time)
            }
        }
    }

    /// Interpolates between time `after` - 1 and time `after`, which are `low` and `high`, with the deviations of a
    /// bridge there.
    fn interpolated(&self, after: usize, [low, high]: [f64; 2], [at_low, at_high]: [f64; 2], time: f64) -> [Share; 2] {
        let share = (time - low) / (high - low);
        let scale = deviation(time) / ((1.0 - share) * at_low + share * at_high);
        [self.share(after - 1, (1.0 - share) * scale), self.share(after, share * scale)]
    }

    /// Returns the weight at time `time` of the bridges, from 1; at 0, and at 1 after the last time, a bridge is 0.
    fn share(&self, time: usize, part: f64) -> Share {
        let units = &self.bridges.units;
        time.checked_sub(1).and_then(|time| Some((time, part * units.get(time)?))).unwrap_or(NONE)
    }
}

impl AbsoluteBridges {
    /// Returns the times and weights of each gap of a law of `size` values with equal weights. Cost O(size) at first.
    pub(super) fn equal_gaps(&self, size: usize, which: Statistic) -> Arc<[[Share; 4]]> {
        self.equal.of((size, which as usize), || {
            let mut places = SizedGaps::new(self, size, size as f64, 1.0, which);
            (1..size).map(|below| places.of(below as f64)).collect()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_weights_are_those_computed_anew() {
        let bridges = AbsoluteBridges::graded(10, 3);
        for size in [2000, 3, 2000, 5000, 9000, 2000] {
            for which in [Statistic::Current, Statistic::AfterOneMore] {
                let mut places = SizedGaps::new(&bridges, size, size as f64, 1.0, which);
                let anew: Vec<[Share; 4]> = (1..size).map(|below| places.of(below as f64)).collect();
                assert_eq!(*bridges.equal_gaps(size, which), *anew, "{size}");
            }
        }
    }
}
