//! Paths of Brownian bridges, in absolute value, at the times that laws of one size or of all large sizes ask for.
//!
//! A bridge at m times is a direction times a length: `sum (dB)^2 / dt` over the m + 1 intervals is chi-square with m
//! degrees of freedom and independent of the direction. A statistic that grows with the path as |B| does can therefore
//! be simulated over directions alone, and its length be integrated out.

use std::sync::OnceLock;

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::scale_mixture::ScaleMixture;
use super::streams::stream;

/// Simulated `|B(t)|` over the length of the path, at ascending times: common random numbers for laws.
///
/// Whole numbers of 16 bits: a statistic reads them as fast as memory gives them, and is off by some 1e-6 of itself, another way in
/// every path, which is far below what 2000 paths tell.
#[derive(Debug, Clone)]
pub struct AbsoluteBridges {
    pub(super) times: Times,
    pub(super) paths: usize,
    /// In the unit of their time: block after block of paths, of which each is stored time by time, because a statistic adds time
    /// after time. Paths that the last block lacks are 0.
    pub(super) values: Vec<[u16; PATHS]>,
    /// Of each time.
    pub(super) units: Vec<f64>,
    /// The law of the lengths that the paths are divided by.
    pub(super) lengths: ScaleMixture,
    /// Of laws of one size: where the gaps of one whose values weigh the same count in each statistic, once that was asked.
    pub(super) shares: [OnceLock<Vec<[Share; 4]>>; 2],
}

/// The times at which paths are kept.
#[derive(Debug, Clone)]
pub(super) enum Times {
    /// i/n, i = 1 to n - 1: for laws of one sample size n.
    Sample(usize),
    /// For laws of any size: these, between which `|B|` is interpolated.
    Graded {
        /// With 0 before the first and 1 after the last.
        times: Vec<f64>,
        /// Of a bridge there.
        deviations: Vec<f64>,
    },
}

/// A time of the bridges, and what of the length of a gap counts there, in the unit of the values at that time.
pub(super) type Share = (usize, f64);

/// The standard deviation of a bridge at a time.
pub(super) fn deviation(time: f64) -> f64 {
    (time * (1.0 - time)).sqrt()
}

/// From this sample size on laws share the graded times: their nodes would lie closer than those.
pub const GRADED_FROM: usize = 1025;
/// Equal cells of the graded times.
const GRADED_CELLS: usize = 512;
/// Halvings of the first and of the last cell: the tails of a large sample lie there.
const HALVINGS: u32 = 14;

/// Paths that are added up together: their sums stay in the first-level cache.
pub(super) const PATHS: usize = 256;

/// Deviations of `|B|` that 16 bits tell apart from none; one value in 500 million is larger, and counts as that.
const LARGEST: f64 = 6.0;

/// Cells of the dyadic grid that carries the paths, at least.
const LEAST_CELLS: usize = 1024;

/// Fills `bridge`, of 2^m + 1 values, by midpoint displacement (Levy's construction), coarse levels first: a finer
/// grid refines the same path.
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

/// Where a node lies in the dyadic grid: between `left` and the next grid point, with these weights. What they leave of
/// the variance is that of a normal of this deviation, 0 at a grid point.
struct Place {
    left: usize,
    weights: [f64; 2],
    deviation: f64,
}

impl Place {
    /// Node i/n among `cells`: given the grid's path, B is normal about the line between its neighbours.
    fn of(node: usize, sample_size: usize, cells: usize) -> Self {
        let position = node as f64 / sample_size as f64 * cells as f64;
        let left = (position as usize).min(cells - 1);
        let share = position - left as f64;
        let deviation = (share * (1.0 - share) / cells as f64).sqrt();
        Place { left, weights: [1.0 - share, share], deviation }
    }

    fn value(&self, bridge: &[f64], generator: &mut impl Rng) -> f64 {
        let line = self.weights[0] * bridge[self.left] + self.weights[1] * bridge[self.left + 1];
        if self.deviation == 0.0 { line } else { line + self.deviation * generator.sample::<f64, _>(StandardNormal) }
    }
}

impl AbsoluteBridges {
    /// The directions of `paths` standard Brownian bridges at the times i/n.
    ///
    /// Path p is the same path at every sample size, so that the quantile moves from one sample size to the next more as
    /// the law does than as two simulations differ: the stream (seed, "bridge", 0, p) refines it by midpoints on 2^m
    /// cells, m the least with at least 1024 and 4n of them. B(i/n) is drawn given their ends from the stream (seed,
    /// "bridge in cells", n, p), and the length, of which neighbouring sizes share most but not all, is theirs.
    /// Cost O(n paths) and a few thousand normals a path.
    pub fn simulate(sample_size: usize, paths: usize, seed: u64) -> Self {
        AbsoluteBridges::simulated(sample_size, paths, seed, Divisor::Length)
    }

    /// [`Self::simulate`], with every path over its divisor.
    fn simulated(sample_size: usize, paths: usize, seed: u64, divisor: Divisor) -> Self {
        let nodes = sample_size.saturating_sub(1);
        let cells = LEAST_CELLS.max(4 * sample_size).next_power_of_two();
        let places: Vec<Place> = (1..=nodes).map(|node| Place::of(node, sample_size, cells)).collect();
        let times: Vec<f64> = (1..=nodes).map(|node| node as f64 / sample_size as f64).collect();
        let mut bridge = vec![0.0; cells + 1];
        let path = |index: usize, path: &mut [f64]| {
            refine(&mut bridge, &mut stream(seed, "bridge", 0, index));
            let mut between = stream(seed, "bridge in cells", sample_size, index);
            path.iter_mut().zip(&places).for_each(|(value, place)| *value = place.value(&bridge, &mut between));
        };
        AbsoluteBridges::gather(&times, Times::Sample(sample_size), paths, divisor, path)
    }

    /// The same paths at times that serve every sample size from about [`GRADED_FROM`] on: 512 equal cells, of which the
    /// first and the last are halved 14 times towards the ends. Between two times `|B|` is interpolated and scaled to its
    /// exact mean; the product of two values within a cell is off by less than the cell.
    pub fn graded(paths: usize, seed: u64) -> Self {
        AbsoluteBridges::simulated_graded(paths, seed, Divisor::Length)
    }

    /// [`Self::graded`], with every path over its divisor.
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

    /// Bytes that the bridges of laws of `sample_size` values take.
    pub fn bytes_of(sample_size: usize, paths: usize) -> usize {
        let times = if sample_size < GRADED_FROM { sample_size } else { GRADED_CELLS + 2 * HALVINGS as usize };
        let of_a_time = size_of::<u16>().saturating_mul(paths.saturating_add(PATHS - 1) / PATHS * PATHS);
        of_a_time.saturating_add(2 * size_of::<[Share; 4]>()).saturating_mul(times)
    }

    /// The values of each block of paths, time by time.
    pub(super) fn blocks(&self) -> impl Iterator<Item = &[[u16; PATHS]]> {
        self.values.chunks(self.units.len().max(1))
    }

    /// All paths, each written by `draw` given its index, over their divisors.
    fn gather(
        at: &[f64],
        times: Times,
        paths: usize,
        divisor: Divisor,
        mut draw: impl FnMut(usize, &mut [f64]),
    ) -> Self {
        let largest = match divisor {
            Divisor::One => LARGEST,
            // A value is no larger than its deviation times the length.
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
        let (lengths, shares) = (ScaleMixture::chi(at.len().max(1)), Default::default());
        AbsoluteBridges { times, paths, values, units, lengths, shares }
    }
}

/// What a path is divided by.
#[derive(Clone, Copy)]
enum Divisor {
    /// Its length, which leaves the direction.
    Length,
    /// Nothing: the statistic of whole paths is H itself, the plain form that directions are checked against.
    #[cfg_attr(not(test), expect(dead_code))]
    One,
}

/// `sqrt(sum (dB)^2 / dt)` over the intervals between 0, `times` and 1, of a path that is 0 at both ends.
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
    pub(super) fn whole(sample_size: usize, paths: usize, seed: u64) -> Self {
        AbsoluteBridges::simulated(sample_size, paths, seed, Divisor::One)
    }

    pub(super) fn whole_graded(paths: usize, seed: u64) -> Self {
        AbsoluteBridges::simulated_graded(paths, seed, Divisor::One)
    }

    /// `|B|` at a time, path by path.
    pub(super) fn at(&self, time: usize) -> impl Iterator<Item = f64> {
        let of_block = move |block: &[[u16; PATHS]]| block[time].map(|value| f64::from(value) * self.units[time]);
        self.blocks().flat_map(of_block).take(self.paths)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bridges_have_their_covariance_at_every_sample_size() {
        // 20,000 paths: a sample covariance of numbers of variance at most 1/4 has a standard error below 0.0025.
        for sample_size in [3, 10, 600] {
            let mut cells = vec![0.0; LEAST_CELLS.max(4 * sample_size).next_power_of_two() + 1];
            let nodes = [sample_size / 3, sample_size / 2, sample_size - 1].map(|node| node.max(1));
            let places = nodes.map(|node| Place::of(node, sample_size, cells.len() - 1));
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
        // The mean of m squares of a standard normal, and four standard errors of it over 2000 paths.
        let chi_square = |squares: &[f64], freedom: f64| {
            let mean = squares.iter().sum::<f64>() / squares.len() as f64;
            let allowed = 4.0 * (2.0 * freedom / squares.len() as f64).sqrt();
            assert!((mean - freedom).abs() < allowed, "{freedom}: {mean}");
        };
        let middle = |whole: &AbsoluteBridges, unit: &AbsoluteBridges, node: usize| -> Vec<f64> {
            // Where the direction is small its last bit counts; the length is independent of it.
            let told = |(_, direction): &(f64, f64)| *direction > 1000.0 * unit.units[node];
            let ratios = whole.at(node).zip(unit.at(node)).filter(told);
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
            let places: Vec<Place> = (1..size).map(|node| Place::of(node, size, cells)).collect();
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
