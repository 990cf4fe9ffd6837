//! Paths of Brownian bridges, in absolute value, at the times that laws of one size, or of all large sizes, need.
//!
//! A bridge at m times is a direction times a length: `sum (dB)^2 / dt` over the m + 1 intervals is chi-square with m
//! degrees of freedom and independent of the direction. A statistic that scales with the path as |B| does can therefore
//! be simulated over directions alone, and its length integrated out.

use std::sync::{Arc, PoisonError, RwLock};

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use crate::numerics::bridge::scale_mixture::ScaleMixture;
use crate::numerics::machine::streams::stream;

/// Simulated `|B(t)|` divided by the length of the path, at ascending times: common random numbers for laws.
///
/// Values are 16-bit integers, which a statistic reads at the speed of memory. It is off by about 1e-6 of itself,
/// differently in every path, which is far below the error of 2000 paths.
#[derive(Debug, Clone)]
pub struct AbsoluteBridges {
    pub(in crate::numerics) times: Times,
    pub(super) paths: usize,
    /// Values in the unit of their time: block after block of paths, each stored time by time, because a statistic adds
    /// time after time. Unused paths of the last block are 0.
    pub(in crate::numerics) values: Vec<[u16; PATHS]>,
    /// The unit of each time.
    pub(in crate::numerics) units: Vec<f64>,
    /// The law of the lengths by which the paths are divided.
    pub(in crate::numerics) lengths: ScaleMixture,
    /// The weights of gaps of laws with equal weights.
    pub(in crate::numerics) equal: EqualGaps,
}

/// The times at which paths are kept.
#[derive(Debug, Clone)]
pub(in crate::numerics) enum Times {
    /// i/n, i = 1 to n - 1: for laws of one sample size n.
    Sample(usize),
    /// Fixed times for laws of any size; `|B|` is interpolated between them.
    Graded {
        /// The times, with 0 before the first and 1 after the last.
        times: Vec<f64>,
        /// The standard deviation of a bridge at each time.
        deviations: Vec<f64>,
    },
}

/// A time of the bridges, and the weight of a gap's length there, in the unit of the values at that time.
pub(in crate::numerics) type Share = (usize, f64);

/// Largest number of gaps of all kept sizes and statistics together, unless one alone has more: a step of a training
/// needs two sizes and both statistics. They take two megabytes.
const MOST_GAPS: usize = 1 << 15;

/// The weights of all gaps of laws with equal weights, which do not depend on the values: those computed last, by size
/// and number of the statistic.
#[derive(Debug, Clone, Default)]
pub(in crate::numerics) struct EqualGaps(Arc<RwLock<Vec<EqualSize>>>);

type EqualSize = ((usize, usize), Arc<[[Share; 4]]>);

impl EqualGaps {
    /// Returns the weights of a size and a statistic, from the lowest gap; they are computed if they are not kept.
    pub(super) fn of(&self, key: (usize, usize), compute: impl FnOnce() -> Arc<[[Share; 4]]>) -> Arc<[[Share; 4]]> {
        let found = |known: &[EqualSize]| known.iter().find(|one| one.0 == key).map(|one| one.1.clone());
        if let Some(shares) = found(&self.0.read().unwrap_or_else(PoisonError::into_inner)) {
            return shares;
        }
        let shares = compute();
        let mut known = self.0.write().unwrap_or_else(PoisonError::into_inner);
        // Another thread may have been faster.
        if let Some(shares) = found(&known) {
            return shares;
        }
        known.push((key, shares.clone()));
        while known.len() > 1 && known.iter().map(|((size, _), _)| size).sum::<usize>() > MOST_GAPS {
            known.remove(0);
        }
        shares
    }
}

/// Returns the standard deviation of a bridge at a time.
pub(in crate::numerics) fn deviation(time: f64) -> f64 {
    (time * (1.0 - time)).sqrt()
}

/// The sample size from which laws share the graded times: from here their nodes would be closer than the graded times.
pub const GRADED_FROM: usize = 1025;
/// Number of equal cells of the graded times.
const GRADED_CELLS: usize = 512;
/// Halvings of the first and the last cell, where the tails of a large sample lie.
const HALVINGS: u32 = 14;

/// The number of paths that are summed together, so that their sums stay in the first-level cache.
pub(super) const PATHS: usize = 256;

/// The largest `|B|` that 16 bits represent, in deviations; one value in 500 million is larger, and is clamped.
const LARGEST: f64 = 6.0;

/// The least number of cells of the dyadic grid of the paths.
const LEAST_CELLS: usize = 1024;

/// Fills `bridge`, of 2^m + 1 values, by midpoint displacement (Levy's construction). Coarse levels come first, so a
/// finer grid refines the same path.
fn refine(bridge: &mut [f64], generator: &mut impl Rng) {
    let cells = bridge.len() - 1;
    (bridge[0], bridge[cells]) = (0.0, 0.0);
    let mut width = cells;
    while width > 1 {
        let deviation = 0.5 * (width as f64 / cells as f64).sqrt();
        for left in (0..cells).step_by(width) {
            let normal: f64 = generator.sample(StandardNormal);
            bridge[left + width / 2] = 0.5 * (bridge[left] + bridge[left + width]) + deviation * normal;
        }
        width /= 2;
    }
}

/// Position of a node in the dyadic grid: between `left` and the next grid point, with these weights. The remaining
/// variance is that of a normal with this deviation, which is 0 at a grid point.
struct GridPosition {
    left: usize,
    weights: [f64; 2],
    deviation: f64,
}

impl GridPosition {
    /// Returns the place of node i/n among `cells`. Given the grid's path, B is normal about the line between the
    /// adjacent grid points.
    fn of(node: usize, sample_size: usize, cells: usize) -> Self {
        let position = node as f64 / sample_size as f64 * cells as f64;
        let left = (position as usize).min(cells - 1);
        let share = position - left as f64;
        let deviation = (share * (1.0 - share) / cells as f64).sqrt();
        GridPosition { left, weights: [1.0 - share, share], deviation }
    }

    fn value(&self, bridge: &[f64], generator: &mut impl Rng) -> f64 {
        let line = self.weights[0] * bridge[self.left] + self.weights[1] * bridge[self.left + 1];
        if self.deviation == 0.0 { line } else { line + self.deviation * generator.sample::<f64, _>(StandardNormal) }
    }
}

impl AbsoluteBridges {
    /// Simulates the directions of `paths` standard Brownian bridges at the times i/n.
    ///
    /// Path p is the same path at every sample size, so that the quantile changes between sample sizes mainly because
    /// the law does, not because two simulations differ. The stream (seed, "bridge", 0, p) refines it by midpoints on
    /// 2^m cells, where m is the least with at least 1024 and 4n of them. B(i/n) is drawn given the ends of its cell
    /// from the stream (seed, "bridge in cells", n, p). The length is that of these values, so similar sizes share most
    /// of it but not all. Cost O(n paths) and a few thousand normals a path.
    pub fn simulate(sample_size: usize, paths: usize, seed: u64) -> Self {
        AbsoluteBridges::simulated(sample_size, paths, seed, Divisor::Length)
    }

    /// Does the work of [`Self::simulate`], with every path divided by its divisor.
    fn simulated(sample_size: usize, paths: usize, seed: u64, divisor: Divisor) -> Self {
        let nodes = sample_size.saturating_sub(1);
        let cells = LEAST_CELLS.max(4 * sample_size).next_power_of_two();
        let places: Vec<GridPosition> = (1..=nodes).map(|node| GridPosition::of(node, sample_size, cells)).collect();
        let times: Vec<f64> = (1..=nodes).map(|node| node as f64 / sample_size as f64).collect();
        let mut bridge = vec![0.0; cells + 1];
        let path = |index: usize, path: &mut [f64]| {
            refine(&mut bridge, &mut stream(seed, "bridge", 0, index));
            let mut between = stream(seed, "bridge in cells", sample_size, index);
            path.iter_mut().zip(&places).for_each(|(value, place)| *value = place.value(&bridge, &mut between));
        };
        AbsoluteBridges::gather(&times, Times::Sample(sample_size), paths, divisor, path)
    }

    /// Simulates the same paths at times that serve every sample size from about [`GRADED_FROM`] on: 512 equal cells,
    /// of which the first and the last are halved 14 times towards the ends. Between two times `|B|` is interpolated
    /// and scaled to its exact mean. The product of two values within a cell is off by less than the cell.
    pub fn graded(paths: usize, seed: u64) -> Self {
        AbsoluteBridges::simulated_graded(paths, seed, Divisor::Length)
    }

    /// Does the work of [`Self::graded`], with every path divided by its divisor.
    fn simulated_graded(paths: usize, seed: u64, divisor: Divisor) -> Self {
        let cell = 1.0 / GRADED_CELLS as f64;
        let halved = |power: u32| cell * 0.5_f64.powi(power as i32);
        let ends = (1..=HALVINGS).rev().map(halved);
        let inside = (1..GRADED_CELLS).map(|node| node as f64 * cell);
        let times: Vec<f64> = ends.clone().chain(inside).chain(ends.rev().map(|time| 1.0 - time)).collect();
        let mut bridge = vec![0.0; GRADED_CELLS + 1];
        let halvings = HALVINGS as usize;
        let path = |index: usize, path: &mut [f64]| {
            let mut generator = stream(seed, "bridge", 0, index);
            refine(&mut bridge, &mut generator);
            let last = path.len() - 1;
            path[halvings..=last - halvings].copy_from_slice(&bridge[1..GRADED_CELLS]);
            let (mut low, mut high) = (bridge[1], bridge[GRADED_CELLS - 1]);
            for halving in 0..HALVINGS {
                let deviation = 0.5 * halved(halving).sqrt();
                low = 0.5 * low + deviation * generator.sample::<f64, _>(StandardNormal);
                high = 0.5 * high + deviation * generator.sample::<f64, _>(StandardNormal);
                let distance = halvings - 1 - halving as usize;
                (path[distance], path[last - distance]) = (low, high);
            }
        };
        let with_ends: Vec<f64> = [0.0].into_iter().chain(times.iter().copied()).chain([1.0]).collect();
        let deviations = with_ends.iter().copied().map(deviation).collect();
        AbsoluteBridges::gather(&times, Times::Graded { times: with_ends, deviations }, paths, divisor, path)
    }

    /// Returns the bytes of the bridges for laws of `sample_size` values.
    pub fn bytes_of(sample_size: usize, paths: usize) -> usize {
        let (times, gaps) = match sample_size {
            ..GRADED_FROM => (sample_size, 2 * sample_size),
            _ => (GRADED_CELLS + 2 * HALVINGS as usize, MOST_GAPS),
        };
        let of_a_time = size_of::<u16>().saturating_mul(paths.saturating_add(PATHS - 1) / PATHS * PATHS);
        of_a_time.saturating_mul(times).saturating_add(gaps * size_of::<[Share; 4]>())
    }

    /// Returns the values of each block of paths, time by time.
    pub(in crate::numerics) fn blocks(&self) -> impl Iterator<Item = &[[u16; PATHS]]> {
        self.values.chunks(self.units.len().max(1))
    }

    /// Collects all paths divided by their divisors; `draw` writes each path, given its index.
    fn gather(
        at: &[f64],
        times: Times,
        paths: usize,
        divisor: Divisor,
        mut draw: impl FnMut(usize, &mut [f64]),
    ) -> Self {
        let largest = match divisor {
            Divisor::One => LARGEST,
            // A value is at most its deviation times the length.
            Divisor::Length => (LARGEST / (at.len() as f64).sqrt()).min(1.0),
        };
        let unit = |time: &f64| largest * deviation(*time) / f64::from(u16::MAX);
        let units: Vec<f64> = at.iter().map(unit).collect();
        let mut values = vec![[0; PATHS]; at.len() * paths.div_ceil(PATHS)];
        let mut path = vec![0.0; at.len()];
        for index in 0..paths {
            draw(index, &mut path);
            let divisor = match divisor {
                Divisor::One => 1.0,
                Divisor::Length => length(at, &path),
            };
            let block = &mut values[index / PATHS * at.len()..][..at.len()];
            for (paths, (value, unit)) in block.iter_mut().zip(path.iter().zip(&units)) {
                paths[index % PATHS] = (value.abs() / (divisor * unit)).round() as u16;
            }
        }
        let (lengths, equal) = (ScaleMixture::chi(at.len().max(1)), EqualGaps::default());
        AbsoluteBridges { times, paths, values, units, lengths, equal }
    }
}

/// The divisor of a path.
#[derive(Clone, Copy)]
enum Divisor {
    /// The length of the path, which leaves the direction.
    Length,
    /// 1, so the statistic of whole paths is H itself: the plain form against which directions are checked.
    #[cfg_attr(not(test), expect(dead_code))]
    One,
}

/// Returns `sqrt(sum (dB)^2 / dt)` over the intervals between 0, `times` and 1, for a path that is 0 at both ends.
fn length(times: &[f64], path: &[f64]) -> f64 {
    let (mut time, mut value, mut sum) = (0.0, 0.0, 0.0);
    for (&next_time, &next_value) in times.iter().chain(&[1.0]).zip(path.iter().chain(&[0.0])) {
        sum += (next_value - value).powi(2) / (next_time - time);
        (time, value) = (next_time, next_value);
    }
    sum.sqrt()
}

#[cfg(test)]
impl AbsoluteBridges {
    pub(in crate::numerics) fn whole(sample_size: usize, paths: usize, seed: u64) -> Self {
        AbsoluteBridges::simulated(sample_size, paths, seed, Divisor::One)
    }

    pub(super) fn whole_graded(paths: usize, seed: u64) -> Self {
        AbsoluteBridges::simulated_graded(paths, seed, Divisor::One)
    }

    /// Returns `|B|` at a time, path by path.
    pub(in crate::numerics) fn at(&self, time: usize) -> impl Iterator<Item = f64> {
        let of_block = move |block: &[[u16; PATHS]]| block[time].map(|value| f64::from(value) * self.units[time]);
        self.blocks().flat_map(of_block).take(self.paths)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_weights_of_gaps_are_bounded_and_computed_once() {
        let known = EqualGaps::default();
        let of = |size: usize, part: f64| known.of((size, 0), || vec![[(1, part); 4]; size - 1].into())[0][0].1;
        assert_eq!([of(2000, 1.0), of(2000, 2.0)], [1.0, 1.0]);
        for size in [5000, 6000, 7000, 8000, 9000, MOST_GAPS + 1, 3] {
            assert_eq!([of(size, 3.0), of(size, 4.0)], [3.0, 3.0]);
            let kept: Vec<usize> = known.0.read().unwrap().iter().map(|((size, _), _)| *size).collect();
            assert!(kept.len() == 1 || kept.iter().sum::<usize>() <= MOST_GAPS, "{kept:?}");
        }
        assert_eq!(of(2000, 5.0), 5.0);
    }

    #[test]
    fn bridges_have_their_covariance_at_every_sample_size() {
        // 20,000 paths: a sample covariance of numbers of variance at most 1/4 has a standard error below 0.0025.
        for sample_size in [3, 10, 600] {
            let mut cells = vec![0.0; LEAST_CELLS.max(4 * sample_size).next_power_of_two() + 1];
            let nodes = [sample_size / 3, sample_size / 2, sample_size - 1].map(|node| node.max(1));
            let places = nodes.map(|node| GridPosition::of(node, sample_size, cells.len() - 1));
            let mut sums = [[0.0; 3]; 3];
            for path in 0..20_000 {
                refine(&mut cells, &mut stream(5, "bridge", 0, path));
                let mut between = stream(5, "bridge in cells", sample_size, path);
                let values = places.each_ref().map(|place| place.value(&cells, &mut between));
                for (row, left) in sums.iter_mut().zip(values) {
                    row.iter_mut().zip(values).for_each(|(sum, right)| *sum += left * right / 20_000.0);
                }
            }
            for (row, left) in sums.iter().zip(nodes) {
                for (&found, right) in row.iter().zip(nodes) {
                    let [s, t] = [left.min(right), left.max(right)].map(|node| node as f64 / sample_size as f64);
                    let expected = s * (1.0 - t);
                    assert!((found - expected).abs() < 0.01, "{sample_size}: {found} against {expected}");
                }
            }
        }
    }

    #[test]
    fn the_length_of_a_path_is_chi() {
        // The mean of m squares of a standard normal, with four standard errors over 2000 paths.
        let chi_square = |squares: &[f64], freedom: f64| {
            let mean = squares.iter().sum::<f64>() / squares.len() as f64;
            let allowed = 4.0 * (2.0 * freedom / squares.len() as f64).sqrt();
            assert!((mean - freedom).abs() < allowed, "{freedom}: {mean}");
        };
        let middle = |whole: &AbsoluteBridges, unit: &AbsoluteBridges, node: usize| -> Vec<f64> {
            // If the direction is small its last bit matters, so such paths are left out; the length is independent of
            // it.
            let is_large = |(_, direction): &(f64, f64)| *direction > 1000.0 * unit.units[node];
            let ratios = whole.at(node).zip(unit.at(node)).filter(is_large);
            ratios.map(|(value, direction)| (value / direction).powi(2)).collect()
        };
        let (directions, paths) = (AbsoluteBridges::simulate(10, 2000, 7), AbsoluteBridges::whole(10, 2000, 7));
        chi_square(&middle(&paths, &directions, 4), 9.0);
        let (directions, paths) = (AbsoluteBridges::graded(2000, 7), AbsoluteBridges::whole_graded(2000, 7));
        chi_square(&middle(&paths, &directions, 270), directions.units.len() as f64);
    }

    #[test]
    fn sixteen_bits_are_off_by_half_of_the_last_at_most() {
        for size in [2, 10, 600] {
            let bridges = AbsoluteBridges::simulate(size, 300, 5);
            let cells = LEAST_CELLS.max(4 * size).next_power_of_two();
            let places: Vec<GridPosition> = (1..size).map(|node| GridPosition::of(node, size, cells)).collect();
            let times: Vec<f64> = (1..size).map(|node| node as f64 / size as f64).collect();
            let mut bridge = vec![0.0; cells + 1];
            for index in 0..300 {
                refine(&mut bridge, &mut stream(5, "bridge", 0, index));
                let mut between = stream(5, "bridge in cells", size, index);
                let path: Vec<f64> = places.iter().map(|place| place.value(&bridge, &mut between)).collect();
                let length = length(&times, &path);
                for ((time, value), unit) in path.iter().enumerate().zip(&bridges.units) {
                    let kept = f64::from(bridges.values[index / PATHS * (size - 1) + time][index % PATHS]);
                    assert!((kept - value.abs() / length / unit).abs() < 0.5 + 1e-9, "{size} {index} {time}");
                }
            }
        }
    }

    #[test]
    fn a_path_is_the_same_at_every_sample_size() {
        let (few, many) = (AbsoluteBridges::whole(4, 50, 3), AbsoluteBridges::whole(2048, 50, 3));
        // Node 2 of 4 and node 1024 of 2048 are both the middle.
        assert!(few.at(1).eq(many.at(1023)));
    }
}
