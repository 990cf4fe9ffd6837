//! The bridge statistic H: its law is the limit of sqrt(n) times the Wasserstein distance between the empirical law of
//! n values and the true law.
//!
//!   H = sum_{i=1}^{n-1} |B(W_i)| (z_(i+1) - z_(i)),   B a standard Brownian bridge, z_(1) <= ... <= z_(n) the values
//!
//! with W_i the mass of the first i values, i/n if all weights are equal; sqrt(n) is then the root of the effective
//! size. If a W_i is not a time of the bridges, |B| is interpolated between the two times around it and scaled to its
//! exact mean.
//!
//! H is simulated over the directions of bridges, and the quantile integrates their lengths out. H is the length, which
//! has a chi law, times the statistic over the direction; the two are independent. Source: paper, section 2.1, (2.4).
//!
//! Its modules hold the law of the statistic, its paths, its quantiles for laws that grow, for several sizes in a row,
//! and for funds of several assets.

pub mod calibration;
pub mod funds;
pub mod grown;
pub mod limit;
pub mod partial_sums;
pub mod paths;
pub mod scale_mixture;
pub mod sized_gaps;

use std::ops::Range;
use std::sync::Arc;

use crate::numerics::bridge::paths::{AbsoluteBridges, PATHS, Share};
use crate::numerics::bridge::scale_mixture::LastQuantile;
use crate::numerics::bridge::sized_gaps::{SizedGaps, Statistic};
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::machine::dispatch::dispatched;

/// A simulated quantile and the standard error of its simulation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantile {
    /// The quantile, in the unit of the law's values.
    pub value: f64,
    /// Standard error of the simulation alone, in the same unit.
    pub standard_error: f64,
}

impl AbsoluteBridges {
    /// Returns the statistic over the direction of every path: H divided by the length of the path. Cost O(min(n, 540)
    /// paths).
    pub(super) fn directional_statistic(&self, law: &EmpiricalDistribution, which: Statistic) -> Vec<f64> {
        self.directional_statistics(&[law], which).swap_remove(0)
    }

    /// Returns the statistics of many laws with the same number of values, each bit for bit as for that law alone. The
    /// cost is that of one law after the other, but the bridges are read from memory once.
    ///
    /// Checked by: `many_laws_at_a_time_are_one_by_one_to_the_last_bit`.
    fn directional_statistics(&self, laws: &[&EmpiricalDistribution], which: Statistic) -> Vec<Vec<f64>> {
        let weights = self.waiting(laws, which);
        // Whole blocks of paths; the last block may be longer than the paths that remain.
        let mut statistics: Vec<_> = laws.iter().map(|_| vec![0.0; self.paths.next_multiple_of(PATHS)]).collect();
        for (index, block) in self.blocks().enumerate() {
            for (waiting, statistic) in weights.iter().zip(&mut statistics) {
                waiting.accumulate(block, &mut statistic.as_chunks_mut().0[index]);
            }
        }
        statistics.iter_mut().for_each(|statistic| statistic.truncate(self.paths));
        statistics
    }

    /// Returns the weight of |B| at each time in the statistic of a law.
    pub(super) fn nodes(&self, law: &EmpiricalDistribution) -> Vec<f64> {
        let mut weights = Weights::new(self);
        for (pair, shares) in law.atoms().windows(2).zip(&*self.shares_of(law, Statistic::Current)) {
            weights.place(shares, pair[1] - pair[0]);
        }
        weights.weights.iter().zip(&self.units).map(|(weight, unit)| weight / unit).collect()
    }

    /// Returns the weights of every gap of each law. With equal weights, the gaps of all laws with the same number of
    /// values count at the same times.
    fn waiting(&self, laws: &[&EmpiricalDistribution], which: Statistic) -> Vec<GapWeights> {
        let mut weights = Weights::new(self);
        let of_law = |law: &&EmpiricalDistribution| {
            for (pair, shares) in law.atoms().windows(2).zip(&*self.shares_of(law, which)) {
                weights.place(shares, pair[1] - pair[0]);
            }
            weights.take()
        };
        laws.iter().map(of_law).collect()
    }

    /// Returns the times and weights of each gap of a law.
    fn shares_of(&self, law: &EmpiricalDistribution, which: Statistic) -> Arc<[[Share; 4]]> {
        if law.is_even() {
            return self.equal_gaps(law.sample_size(), which);
        }
        let (mut places, mut below) = (SizedGaps::of_laws_like(self, law, which), 0.0);
        let gap = |weight: &f64| {
            below += weight;
            places.of(below)
        };
        law.weights().iter().take(law.sample_size() - 1).map(gap).collect()
    }

    /// Returns, for each of `laws`, the (1 - alpha)-quantile of a statistic at each of `alphas`, with a relative error
    /// of at most 5e-6. Alphas must be in [0.001, 0.999], and all laws must have the same number of values. `base`
    /// holds the values that they all share, ascending; it may be empty.
    pub fn bridge_quantiles(
        &self,
        laws: &[&EmpiricalDistribution],
        base: &[f64],
        which: Statistic,
        alphas: &[f64],
    ) -> Vec<Vec<f64>> {
        let mut last = vec![LastQuantile::default(); alphas.len()];
        let statistics =
            self.grown_statistics(laws, base, which).unwrap_or_else(|| self.directional_statistics(laws, which));
        let at_levels = |statistic: Vec<f64>| {
            let quantile = |(alpha, last): (&f64, _)| self.lengths.quantile_next(1.0 - alpha, &statistic, 0.0, last);
            alphas.iter().zip(&mut last).map(quantile).collect()
        };
        statistics.into_iter().map(at_levels).collect()
    }

    /// Returns the (1 - alpha)-quantile of a statistic of `law`; `alpha` must be in [0.001, 0.999].
    pub fn bridge_quantile(&self, law: &EmpiricalDistribution, which: Statistic, alpha: f64) -> f64 {
        self.lengths.quantile(1.0 - alpha, &self.directional_statistic(law, which))
    }

    /// Returns the (1 - alpha)-quantile for the law itself, with the standard error of its simulation; `alpha` must be
    /// in [0.001, 0.999].
    pub fn bridge_quantile_with_error(&self, law: &EmpiricalDistribution, alpha: f64) -> Quantile {
        let statistic = self.directional_statistic(law, Statistic::Current);
        let (value, standard_error) = self.lengths.quantile_with_error(1.0 - alpha, &statistic);
        Quantile { value, standard_error }
    }

    /// Returns the (1 - alpha)-quantiles of a statistic of `law` (of m values) with one more value, for every value in
    /// ascending `values`; `alpha` must be in [0.001, 0.999]. Cost O((min(m, 540) + values) paths): between two values
    /// only the gaps between them change.
    pub fn bridge_quantiles_with(
        &self,
        law: &EmpiricalDistribution,
        values: &[f64],
        which: Statistic,
        alpha: f64,
    ) -> Vec<f64> {
        let (atoms, count, retention) = (law.atoms(), law.sample_size(), law.retention());
        let total = law.total_weight() * retention + 1.0;
        let mut weights = Weights::new(self);
        // Known if all weights are equal; the others are computed gap by gap.
        let equal = law.is_even().then(|| self.equal_gaps(count + 1, which));
        let mut places = SizedGaps::new(self, count + 1, total, retention, which);
        let mut place = |weights: &mut Weights, below: f64, length: f64| match &equal {
            Some(shares) => weights.place(&shares[below as usize - 1], length),
            None => weights.place(&places.of(below), length),
        };
        // Gap j is between atoms j - 1 and j. If it is below the new value, the first j atoms lie below it; if it is
        // above, so does the value.
        let gap = |j: usize| atoms[j] - atoms[j - 1];
        let mut sum = 0.0;
        let sums = law.weights().iter().map(|weight| {
            sum += weight;
            retention * sum
        });
        let first: Vec<f64> = std::iter::once(0.0).chain(sums).collect();
        (1..count).for_each(|j| place(&mut weights, first[j] + 1.0, gap(j)));
        let mut below = 0;
        let enter = |&value: &f64| {
            while below < count && atoms[below] <= value {
                below += 1;
                // The gap under the atom just passed is now below the value; the gap above the atom will be cut in two.
                if below >= 2 {
                    place(&mut weights, first[below - 1], gap(below - 1));
                }
                if below < count {
                    place(&mut weights, first[below] + 1.0, -gap(below));
                }
            }
            let carried = weights.take();
            if below > 0 {
                place(&mut weights, first[below], value - atoms[below - 1]);
            }
            if below < count {
                place(&mut weights, first[below] + 1.0, atoms[below] - value);
            }
            [carried, weights.take()]
        };
        let entered: Vec<[GapWeights; 2]> = values.iter().map(enter).collect();
        let mut carried = vec![0.0; self.paths];
        let mut last = LastQuantile::default();
        let mut quantiles = Vec::with_capacity(values.len());
        let together = (BYTES_TOGETHER / (size_of::<f64>() * self.paths)).max(1);
        for (entered, values) in entered.chunks(together).zip(values.chunks(together)) {
            let statistics = self.carry_on(&mut carried, entered);
            for (statistic, &value) in statistics.chunks_exact(self.paths).zip(values) {
                quantiles.push(self.lengths.quantile_next(1.0 - alpha, statistic, value, &mut last));
            }
        }
        quantiles
    }

    /// Returns the sums of each entry: sums carried from entry to entry, plus the entry's own. Results are ordered by
    /// entry, but computed by block of paths, so that data that entries share is read from memory once.
    fn carry_on(&self, carried: &mut [f64], entered: &[[GapWeights; 2]]) -> Vec<f64> {
        let mut all = vec![0.0; entered.len() * self.paths];
        for (block, first) in self.blocks().zip((0..).step_by(PATHS)) {
            let mut on_the_way = [0.0; PATHS];
            let some = &carried[first..self.paths.min(first + PATHS)];
            on_the_way[..some.len()].copy_from_slice(some);
            for ([on, own], all) in entered.iter().zip(all.chunks_exact_mut(self.paths)) {
                on.accumulate(block, &mut on_the_way);
                let mut sums = on_the_way;
                own.accumulate(block, &mut sums);
                keep(&sums, first, all);
            }
            keep(&on_the_way, first, carried);
        }
        all
    }
}

/// Copies the sums of a block into a statistic of all paths, from `first` on.
fn keep(sums: &[f64; PATHS], first: usize, statistic: &mut [f64]) {
    statistic[first..].iter_mut().zip(sums).for_each(|(place, sum)| *place = *sum);
}

/// The most bytes of statistics that are computed together, unless one alone takes more.
const BYTES_TOGETHER: usize = 1 << 20;

/// Weights to be added to a law's statistic: one for each time of the bridges.
struct Weights {
    weights: Vec<f64>,
    /// Range of the times with nonzero weight.
    touched: Range<usize>,
}

impl Weights {
    fn new(bridges: &AbsoluteBridges) -> Self {
        Weights { weights: vec![0.0; bridges.units.len()], touched: 0..0 }
    }

    /// Adds a gap of width `length`.
    fn place(&mut self, shares: &[Share; 4], length: f64) {
        for &(time, part) in shares {
            if part > 0.0 {
                self.weights[time] += length * part;
                let Range { start, end } = self.touched;
                self.touched = if start == end { time..time + 1 } else { start.min(time)..end.max(time + 1) };
            }
        }
    }

    /// Returns the collected weights and resets them.
    fn take(&mut self) -> GapWeights {
        let touched = std::mem::take(&mut self.touched);
        let weights = &mut self.weights[touched.clone()];
        let collected =
            GapWeights { first: touched.start, weights: weights.iter().map(|weight| *weight as f32).collect() };
        weights.fill(0.0);
        collected
    }
}

/// Weights of some times, in the units of their values.
struct GapWeights {
    first: usize,
    weights: Vec<f32>,
}

impl GapWeights {
    /// Adds the weighted values to the statistics of a block of paths.
    fn accumulate(&self, block: &[[u16; PATHS]], sums: &mut [f64; PATHS]) {
        dispatched!(add_nodes(&self.weights, &block[self.first..], sums));
    }
}

/// The number of nodes added in one pass over the sums. Each pass sums in single precision, because twice as many
/// numbers fit a vector, and only its sum is widened. It is off by about 1e-7 of itself, differently in every path.
const NODES: usize = 16;

/// The number of paths whose sums stay in registers.
const LANES: usize = 64;

/// Adds `gaps[i]` times node i of a block of paths to `sums`, [`NODES`] at a time. Fused operations are written as such
/// and the order is that of the nodes, so the bits do not depend on the processor.
#[inline(always)]
fn add_nodes(gaps: &[f32], nodes: &[[u16; PATHS]], sums: &mut [f64; PATHS]) {
    for (gaps, nodes) in gaps.chunks(NODES).zip(nodes.chunks(NODES)) {
        for start in (0..PATHS).step_by(LANES) {
            let mut group = [0.0; LANES];
            for (gap, node) in gaps.iter().zip(nodes) {
                for lane in 0..LANES {
                    group[lane] = gap.mul_add(f32::from(node[start + lane]), group[lane]);
                }
            }
            for lane in 0..LANES {
                sums[start + lane] += f64::from(group[lane]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_laws_at_a_time_are_one_by_one_to_the_last_bit() {
        // Sizes for which blocks and nodes are full, and sizes for which they are not.
        for (size, paths) in [(2, 40), (5, 256), (9, 300), (12, 700), (17, 256), (40, 300)] {
            let bridges = AbsoluteBridges::simulate(size, paths, 4);
            let law = |shift: usize| {
                let sample: Vec<f64> = (0..size).map(|k| ((k + shift) as f64).powf(1.3)).collect();
                EmpiricalDistribution::new(&sample)
            };
            let laws = [law(0), law(1), law(5)];
            let laws: Vec<&EmpiricalDistribution> = laws.iter().collect();
            let together = bridges.directional_statistics(&laws, Statistic::Current);
            let alone: Vec<Vec<f64>> =
                laws.iter().map(|law| bridges.directional_statistic(law, Statistic::Current)).collect();
            assert_eq!(together, alone, "{size} {paths}");
            let quantiles = bridges.bridge_quantiles(&laws, &[], Statistic::Current, &[0.1, 0.5]);
            for (law, found) in laws.iter().zip(quantiles) {
                let alone = [0.1, 0.5].map(|alpha| bridges.bridge_quantile(law, Statistic::Current, alpha));
                // The tolerance of one of many quantiles.
                assert!(found.iter().zip(alone).all(|(found, alone)| (found / alone - 1.0).abs() < 1e-5));
            }
        }
    }

    #[test]
    fn carrying_sums_equals_building_each_law() {
        let small = [0.02, -0.05, 0.11, 0.04, 0.04];
        let large: Vec<f64> = (0..3000).map(|k| (f64::from(k) / 1500.0 - 1.0).powi(3)).collect();
        let values = [-2.0, -0.7, -0.05, 0.0, 0.001, 0.04, 0.4, 0.41, 3.0];
        for retention in [1.0, 0.6] {
            for (sample, bridges) in [
                (&small[..], [6, 7].map(|size| AbsoluteBridges::simulate(size, 300, 9))),
                (&large, [2, 3].map(|seed| AbsoluteBridges::graded(50, seed))),
            ] {
                let law = EmpiricalDistribution::decaying(sample, retention);
                for (which, bridges) in [Statistic::Current, Statistic::AfterOneMore].into_iter().zip(bridges) {
                    let carried = bridges.bridge_quantiles_with(&law, &values, which, 0.1);
                    for (value, quantile) in values.iter().zip(carried) {
                        let mut larger = law.clone();
                        larger.push(*value);
                        let expected = bridges.bridge_quantile(&larger, which, 0.1);
                        // Ten times the tolerance of one of many quantiles, because these values are far apart.
                        assert!((quantile / expected - 1.0).abs() < 5e-5, "{retention} {value}: {quantile} {expected}");
                    }
                }
            }
        }
    }

    #[test]
    fn weights_that_hardly_decay_are_equal_ones() {
        let sample = [0.02, -0.05, 0.11, 0.04, 0.07, -0.13, 0.005];
        let (equal, decaying) =
            (EmpiricalDistribution::new(&sample), EmpiricalDistribution::decaying(&sample, 1.0 - 1e-15));
        for (size, which) in [(7, Statistic::Current), (8, Statistic::AfterOneMore)] {
            let bridges = AbsoluteBridges::simulate(size, 500, 3);
            let [one, other] = [&equal, &decaying].map(|law| bridges.bridge_quantile(law, which, 0.1));
            // Times move by about 1e-15, and between two nodes |B| grows by about its size; the tolerance of a quantile
            // is 1e-7.
            assert!((one / other - 1.0).abs() < 1e-7, "{one} and {other}");
        }
    }

    #[test]
    fn the_statistic_is_the_plain_sum_to_single_precision() {
        for size in [2, 5, 8, 9, 10, 17, 20] {
            let bridges = AbsoluteBridges::whole(size, 37, 4);
            let atoms: Vec<f64> = (0..size).map(|k| (k as f64).powf(1.3)).collect();
            let mut plain = vec![0.0; 37];
            for (time, pair) in atoms.windows(2).enumerate() {
                plain.iter_mut().zip(bridges.at(time)).for_each(|(sum, value)| *sum += (pair[1] - pair[0]) * value);
            }
            let law = EmpiricalDistribution::new(&atoms);
            for (found, plain) in bridges.directional_statistic(&law, Statistic::Current).iter().zip(plain) {
                // 16 fused sums of positive numbers, each rounded by at most 2^-24 of itself, and 16 weights.
                assert!((found / plain - 1.0).abs() < 32.0 * 2.0_f64.powi(-24), "{size}: {found} against {plain}");
            }
        }
    }

    #[test]
    fn the_quantile_is_continuous_in_the_law() {
        let bridges = AbsoluteBridges::simulate(5, 2000, 1);
        let quantile = |sample: &[f64]| bridges.bridge_quantile_with_error(&EmpiricalDistribution::new(sample), 0.1);
        let before = quantile(&[0.02, -0.05, 0.11, 0.04, 0.07]);
        let after = quantile(&[0.02, -0.05, 0.11 + 1e-9, 0.04, 0.07]);
        // One gap grows by 1e-9, and |B| stays below 3 on 2000 paths.
        assert!((before.value - after.value).abs() < 3e-9);
        assert!(before.standard_error > 0.0);
    }

    /// Returns the plain estimate: the order statistic of H over whole paths, with the share `alpha` above it.
    fn order_statistic(whole: &AbsoluteBridges, law: &EmpiricalDistribution, alpha: f64) -> f64 {
        let mut statistic = whole.directional_statistic(law, Statistic::Current);
        statistic.sort_by(f64::total_cmp);
        statistic[((1.0 - alpha) * statistic.len() as f64) as usize]
    }

    /// Returns the mean and the deviation of an estimate over many simulations.
    fn mean_and_deviation(estimates: &[f64]) -> (f64, f64) {
        let count = estimates.len() as f64;
        let mean = estimates.iter().sum::<f64>() / count;
        (mean, (estimates.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt())
    }

    #[test]
    fn directions_need_fewer_paths_than_whole_paths_and_say_how_far_they_are_off() {
        let law = EmpiricalDistribution::new(&[0.02, -0.05, 0.11, 0.04, 0.07, -0.13, 0.005, 0.062, -0.02, 0.09]);
        let found = (0..200).map(|seed| AbsoluteBridges::simulate(10, 200, seed).bridge_quantile_with_error(&law, 0.1));
        let (values, errors): (Vec<f64>, Vec<f64>) = found.map(|found| (found.value, found.standard_error)).unzip();
        let plain = (0..200).map(|seed| order_statistic(&AbsoluteBridges::whole(10, 200, seed), &law, 0.1));
        let (plain_mean, plain_deviation) = mean_and_deviation(&plain.collect::<Vec<f64>>());
        let (mean, deviation) = mean_and_deviation(&values);
        assert!(deviation < 0.85 * plain_deviation, "{deviation} against {plain_deviation}");
        // An order statistic is off by about half of one in 200, which is less than one standard error of the mean of
        // 200.
        assert!((mean - plain_mean).abs() < 5.0 * plain_deviation / 200_f64.sqrt(), "{mean} against {plain_mean}");
        // A deviation over 200 simulations has a standard error of 5 %.
        assert!((errors.iter().sum::<f64>() / 200.0 / deviation - 1.0).abs() < 0.2, "{errors:?}");
    }

    #[test]
    fn one_later_is_the_mean_over_the_values_of_the_law() {
        for retention in [1.0, 0.7] {
            let law = EmpiricalDistribution::decaying(&[0.02, -0.05, 0.11, 0.04, 0.07], retention);
            let bridges = AbsoluteBridges::simulate(6, 20, 1);
            let mut mean = vec![0.0; 20];
            for (&atom, weight) in law.atoms().iter().zip(law.weights()) {
                let mut doubled = law.clone();
                doubled.push(atom);
                let (statistic, mass) =
                    (bridges.directional_statistic(&doubled, Statistic::Current), weight / law.total_weight());
                mean.iter_mut().zip(statistic).for_each(|(sum, value)| *sum += mass * value);
            }
            for (found, expected) in bridges.directional_statistic(&law, Statistic::AfterOneMore).iter().zip(mean) {
                // A dozen numbers, each rounded to single precision a few times.
                assert!((found / expected - 1.0).abs() < 24.0 * 2.0_f64.powi(-24));
            }
        }
    }

    #[test]
    fn graded_times_serve_large_samples() {
        // A Student-like sample: its widest gaps are where the grid is finest.
        let sample: Vec<f64> = (0..1500).map(|k| (f64::from(k) - 749.5) / (f64::from(k.min(1499 - k)) + 0.5)).collect();
        let law = EmpiricalDistribution::new(&sample);
        let expected = AbsoluteBridges::simulate(1500, 2000, 4).bridge_quantile_with_error(&law, 0.1);
        let found = AbsoluteBridges::graded(2000, 4).bridge_quantile_with_error(&law, 0.1);
        // Paths inside a cell are different draws: four standard deviations of the difference, as if all draws were
        // different.
        let allowed = 4.0 * expected.standard_error.hypot(found.standard_error);
        assert!((found.value - expected.value).abs() < allowed, "{found:?} against {expected:?}");
        let mean_of =
            |whole: AbsoluteBridges| whole.directional_statistic(&law, Statistic::Current).iter().sum::<f64>();
        let [exact, graded] =
            [AbsoluteBridges::whole(1500, 2000, 4), AbsoluteBridges::whole_graded(2000, 4)].map(mean_of);
        // The statistic's deviation is about half its mean, so four standard errors of the mean of 2000 are 5 %.
        assert!((graded / exact - 1.0).abs() < 0.05, "{graded} against {exact}");
    }
}
