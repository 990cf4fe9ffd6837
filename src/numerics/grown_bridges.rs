//! The bridge statistic of many laws that have learned a few values each beyond a base that they share.
//!
//!   H = sum_{k=1}^{n} z_(k) (|B(t_(k-1))| - |B(t_k)|),   |B(0)| = |B(1)| = 0,   t_k = k/n
//!
//! by summation by parts, all weights being equal. Where s of the values learned are smaller, value j of the base is value
//! j + s of the law. A stretch of the base between two values learned therefore adds the difference of two entries of a
//! table of sums along the base, of which there is one for each s: a law costs two reads a value learned, however many values
//! the base has.

use super::bridge::Statistic;
use super::bridge_paths::{AbsoluteBridges, Times};
use super::dispatch::dispatched;
use super::empirical::EmpiricalDistribution;

/// Paths whose tables stay in the second-level cache: with 12 tables of 240 values, 0.7 MB.
const PATHS: usize = 32;
/// Tables pay where there are this many laws for each of them.
const LAWS_A_TABLE: usize = 4;

/// A number for each path of a block.
type Block = [f64; PATHS];

/// A value learned, and how many values of the base are at or below it.
type Learned = (f64, usize);

impl AbsoluteBridges {
    /// The statistic over the direction of every path, law by law, to rounding; `base` ascending. `None` where some law does
    /// not have the values of the base, where weights decay, or where the laws are too few for tables to pay.
    /// Cost O((learned + 1) (base + laws) paths).
    ///
    /// Checked by: `laws_that_grew_from_a_base_are_measured_as_any`.
    pub(super) fn grown_statistics(
        &self,
        laws: &[&EmpiricalDistribution],
        base: &[f64],
        which: Statistic,
    ) -> Option<Vec<Vec<f64>>> {
        let Times::Sample(_) = self.times else { return None };
        let size = laws.first()?.sample_size();
        let learned = size.checked_sub(base.len())?;
        if base.is_empty() || laws.len() < LAWS_A_TABLE * (learned + 1) {
            return None;
        }
        let learned: Option<Vec<Vec<Learned>>> = laws.iter().map(|law| beyond(law, base)).collect();
        let learned = learned?;
        let mut statistics = vec![vec![0.0; self.paths]; laws.len()];
        for start in (0..self.paths).step_by(PATHS) {
            dispatched!(self.add_block(start, size, base, which, &learned, &mut statistics));
        }
        Some(statistics)
    }

    #[inline(always)]
    fn add_block(
        &self,
        start: usize,
        size: usize,
        base: &[f64],
        which: Statistic,
        learned: &[Vec<Learned>],
        statistics: &mut [Vec<f64>],
    ) {
        let falls = self.falls(start, size, which);
        let shifts = size - base.len();
        let tables: Vec<Vec<Block>> = (0..=shifts).map(|shift| sums(base, &falls[shift..])).collect();
        let count = PATHS.min(self.paths - start);
        for (learned, statistic) in learned.iter().zip(statistics) {
            let (mut sum, mut from) = ([0.0; PATHS], 0);
            for (shift, &(value, below)) in learned.iter().enumerate() {
                add(&mut sum, 1.0, &tables[shift][below]);
                add(&mut sum, -1.0, &tables[shift][from]);
                add(&mut sum, value, &falls[below + shift]);
                from = below;
            }
            add(&mut sum, 1.0, &tables[shifts][base.len()]);
            add(&mut sum, -1.0, &tables[shifts][from]);
            statistic[start..start + count].copy_from_slice(&sum[..count]);
        }
    }

    /// `|B(t_(k-1))| - |B(t_k)|` for k = 1 to `size`, over the paths from `start` on; of [`Statistic::OneLater`], `|B|` is the
    /// mean of what it is over the laws that learn one of the values again.
    #[inline(always)]
    fn falls(&self, start: usize, size: usize, which: Statistic) -> Vec<Block> {
        let count = PATHS.min(self.paths - start);
        let node = |time: usize| -> Block {
            let mut block = [0.0; PATHS];
            let read = time.checked_sub(1).and_then(|index| self.values.get(index * self.paths + start..));
            let read = read.and_then(|values| values.get(..count)).unwrap_or_default();
            block.iter_mut().zip(read).for_each(|(wide, value)| *wide = f64::from(*value));
            block
        };
        let at = |k: usize| match which {
            Statistic::Now => node(k),
            Statistic::OneLater => {
                let share = k as f64 / size as f64;
                let mut block = [0.0; PATHS];
                add(&mut block, 1.0 - share, &node(k));
                add(&mut block, share, &node(k + 1));
                block
            }
        };
        let mut before = [0.0; PATHS];
        let fall = |k: usize| {
            let here = at(k);
            let mut fall = before;
            add(&mut fall, -1.0, &here);
            before = here;
            fall
        };
        (1..=size).map(fall).collect()
    }
}

/// `sums[j]`: the sum of value times fall over the first j values.
#[inline(always)]
fn sums(values: &[f64], falls: &[Block]) -> Vec<Block> {
    let mut sum = [0.0; PATHS];
    let mut sums = vec![sum];
    for (value, fall) in values.iter().zip(falls) {
        add(&mut sum, *value, fall);
        sums.push(sum);
    }
    sums
}

#[inline(always)]
fn add(sum: &mut Block, weight: f64, block: &Block) {
    sum.iter_mut().zip(block).for_each(|(sum, value)| *sum += weight * value);
}

/// What a law has learned beyond `base`, ascending; `None` where it has not all of the base, or its weights decay.
fn beyond(law: &EmpiricalDistribution, base: &[f64]) -> Option<Vec<Learned>> {
    let (mut below, mut learned) = (0, Vec::new());
    for &atom in law.atoms() {
        if base.get(below).is_some_and(|value| *value == atom) {
            below += 1;
        } else {
            learned.push((atom, below));
        }
    }
    (below == base.len() && law.retention() >= 1.0).then_some(learned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laws_that_grew_from_a_base_are_measured_as_any() {
        let base = [-0.07, -0.01, 0.0, 0.0, 0.02, 0.03, 0.05];
        for (learned, paths) in [(0_usize, 70), (1, 32), (3, 40)] {
            let sample = |law: usize| -> Vec<f64> {
                let values = (0..learned).map(|k| ((law * 7 + k * 5) % 23) as f64 * 0.01 - 0.11);
                base.iter().copied().chain(values).collect()
            };
            let laws: Vec<EmpiricalDistribution> =
                (0..16).map(|law| EmpiricalDistribution::new(&sample(law))).collect();
            let laws: Vec<&EmpiricalDistribution> = laws.iter().collect();
            for (later, which) in [Statistic::Now, Statistic::OneLater].into_iter().enumerate() {
                let bridges = AbsoluteBridges::simulate(base.len() + learned + later, paths, 5);
                let found = bridges.grown_statistics(&laws, &base, which).unwrap();
                for (law, found) in laws.iter().zip(found) {
                    let alone = bridges.directional_statistic(law, which);
                    // Two dozen roundings of numbers below 0.1.
                    assert!(found.iter().zip(&alone).all(|(found, alone)| (found - alone).abs() < 1e-15));
                }
                assert_eq!(bridges.grown_statistics(&laws[..2], &base[1..], which), None, "too few");
                assert_eq!(bridges.grown_statistics(&laws, &[0.012], which), None, "another base");
            }
        }
    }
}
