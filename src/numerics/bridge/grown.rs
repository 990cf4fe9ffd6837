//! The bridge statistic of many laws that each add a few values to a common base.
//!
//!   H = sum_{k=1}^{n} z_(k) (|B(t_(k-1))| - |B(t_k)|),   |B(0)| = |B(1)| = 0,   t_k = k/n
//!
//! by summation by parts, with equal weights. If s of the added values are smaller, value j of the base is value j + s
//! of the law. A part of the base between two added values therefore contributes the difference of two entries in a
//! table of sums along the base. There is one such table for each s. A law costs two reads for each added value,
//! however many values the base has.

use crate::numerics::bridge::paths::{self, AbsoluteBridges, Times};
use crate::numerics::bridge::sized_gaps::Statistic;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::machine::dispatch::dispatched;

/// The number of paths for which the tables stay in the second-level cache: 12 tables of 240 values take 0.7 MB.
const PATHS: usize = 64;
/// The most bytes of tables; larger ones do not stay in that cache.
const MOST_BYTES: usize = 4 << 20;
/// The least number of laws for each table; with fewer, tables do not pay.
const LAWS_A_TABLE: usize = 4;

/// A number for each path of a block. In single precision a sum along the base is off by about 1e-6 of itself,
/// differently in every path.
type PathBlock = [f32; PATHS];

/// An added value, and the number of values of the base at or below it.
type Learned = (f64, usize);

/// Tables from which the statistics of laws are assembled, for a block of paths.
struct Tables {
    /// `|B(t_(k-1))| - |B(t_k)|` for k from 1.
    falls: Vec<PathBlock>,
    /// For each number of smaller added values, the sums of value times fall over the first values of the base.
    sums: Vec<PathBlock>,
    /// Length of the sums for one number: one more than the base has values.
    stride: usize,
}

/// Returns the bytes of the tables for laws that add `learned` values to a base, or 0 if the tables are not made.
pub fn table_bytes(base: usize, learned: usize) -> usize {
    let bytes = (learned + 1).saturating_mul(base + 1).saturating_mul(size_of::<PathBlock>());
    if bytes <= MOST_BYTES { bytes } else { 0 }
}

impl AbsoluteBridges {
    /// Returns the statistic over the direction of every path, law by law, to single precision; `base` is ascending.
    /// `None` if some law does not contain the base, if weights decay, or if there are too few laws for tables to pay.
    ///
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
        let are_made = table_bytes(base.len(), learned) > 0 && laws.len() >= LAWS_A_TABLE * (learned + 1);
        if base.is_empty() || !are_made {
            return None;
        }
        let stride = base.len() + 1;
        let beyond: Option<Vec<Vec<Learned>>> = laws.iter().map(|law| beyond(law, base)).collect();
        let beyond = beyond?;
        let mut tables =
            Tables { falls: vec![[0.0; PATHS]; size], sums: vec![[0.0; PATHS]; (learned + 1) * stride], stride };
        let mut statistics = vec![vec![0.0; self.paths]; laws.len()];
        for first in (0..self.paths).step_by(PATHS) {
            dispatched!({
                tables.fill(self, first, which, base);
                for (learned, statistic) in beyond.iter().zip(&mut statistics) {
                    let block = &mut statistic[first..self.paths.min(first + PATHS)];
                    block.iter_mut().zip(tables.law(learned)).for_each(|(wide, value)| *wide = f64::from(value));
                }
            });
        }
        Some(statistics)
    }

    /// Returns `|B|` at a time, from 1, over the paths from `first` on; at 0 and at 1, after the last time, a bridge is
    /// 0.
    #[inline(always)]
    fn some(&self, time: usize, first: usize) -> PathBlock {
        let mut block = [0.0; PATHS];
        if let Some(&unit) = time.checked_sub(1).and_then(|time| self.units.get(time)) {
            let values = &self.values[first / paths::PATHS * self.units.len() + time - 1];
            let values = &values[first % paths::PATHS..][..PATHS];
            for path in 0..PATHS {
                block[path] = unit as f32 * f32::from(values[path]);
            }
        }
        block
    }
}

impl Tables {
    /// Fills the tables for the paths from `first` on. For [`Statistic::AfterOneMore`], `|B|` is its mean over the laws
    /// that add one of the values again.
    #[inline(always)]
    fn fill(&mut self, bridges: &AbsoluteBridges, first: usize, which: Statistic, base: &[f64]) {
        let size = self.falls.len() as f32;
        let (mut before, mut node) = ([0.0; PATHS], bridges.some(1, first));
        for (index, fall) in self.falls.iter_mut().enumerate() {
            let next = bridges.some(index + 2, first);
            let share = match which {
                Statistic::Current => 0.0,
                Statistic::AfterOneMore => (index + 1) as f32 / size,
            };
            for path in 0..PATHS {
                let here = (1.0 - share) * node[path] + share * next[path];
                fall[path] = before[path] - here;
                before[path] = here;
            }
            node = next;
        }
        for (smaller, sums) in self.sums.chunks_exact_mut(self.stride).enumerate() {
            let mut sum = [0.0; PATHS];
            for (to, (value, fall)) in sums[1..].iter_mut().zip(base.iter().zip(&self.falls[smaller..])) {
                let value = *value as f32;
                for path in 0..PATHS {
                    sum[path] = value.mul_add(fall[path], sum[path]);
                }
                *to = sum;
            }
        }
    }

    /// Returns the statistic of a law with these added values.
    #[inline(always)]
    fn law(&self, learned: &[Learned]) -> PathBlock {
        let (mut sum, mut from) = ([0.0; PATHS], 0);
        for (smaller, &(value, below)) in learned.iter().enumerate() {
            let sums = &self.sums[smaller * self.stride..][..self.stride];
            let (low, high, fall) = (&sums[from], &sums[below], &self.falls[below + smaller]);
            let value = value as f32;
            for path in 0..PATHS {
                sum[path] += value.mul_add(fall[path], high[path] - low[path]);
            }
            from = below;
        }
        let sums = &self.sums[learned.len() * self.stride..][..self.stride];
        let (low, high) = (&sums[from], &sums[self.stride - 1]);
        for path in 0..PATHS {
            sum[path] += high[path] - low[path];
        }
        sum
    }
}

/// Returns the values of a law beyond `base`, ascending; `None` if it lacks a value of the base or its weights decay.
fn beyond(law: &EmpiricalDistribution, base: &[f64]) -> Option<Vec<Learned>> {
    let (mut below, mut learned) = (0, Vec::new());
    for &atom in law.atoms() {
        if base.get(below).is_some_and(|value| *value == atom) {
            below += 1;
        } else {
            learned.push((atom, below));
        }
    }
    (below == base.len() && law.is_even()).then_some(learned)
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
            for (later, which) in [Statistic::Current, Statistic::AfterOneMore].into_iter().enumerate() {
                let bridges = AbsoluteBridges::simulate(base.len() + learned + later, paths, 5);
                let found = bridges.grown_statistics(&laws, &base, which).unwrap();
                for (law, found) in laws.iter().zip(found) {
                    let alone = bridges.directional_statistic(law, which);
                    // One by one, the laws are summed in single precision.
                    let near = |(found, alone): (&f64, &f64)| (found / alone - 1.0).abs() < 24.0 * 2.0_f64.powi(-24);
                    assert!(found.iter().zip(&alone).all(near));
                }
                assert_eq!(bridges.grown_statistics(&laws[..2], &base[1..], which), None, "too few");
                assert_eq!(bridges.grown_statistics(&laws, &[0.012], which), None, "another base");
            }
        }
    }
}
