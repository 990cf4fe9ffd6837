//! Paths of Brownian bridges, in absolute value, at the times that laws of one size or of all large sizes ask for.

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::streams::stream;

/// Simulated `|B(t)|` at ascending times: common random numbers for laws.
///
/// Stored time by time (all paths of the first, then of the second, ...), because a statistic adds time after time.
#[derive(Debug, Clone)]
pub struct AbsoluteBridges {
    pub(super) times: Times,
    pub(super) paths: usize,
    pub(super) values: Vec<f64>,
}

/// The times at which paths are kept.
#[derive(Debug, Clone)]
pub(super) enum Times {
    /// i/n, i = 1 to n - 1: for laws of one sample size n.
    Sample(usize),
    /// For laws of any size: these, between which `|B|` is interpolated.
    Graded(Vec<f64>),
}

/// From this sample size on laws share the graded times: their nodes would lie closer than those.
pub const GRADED_FROM: usize = 1025;
/// Equal cells of the graded times.
const GRADED_CELLS: usize = 512;
/// Halvings of the first and of the last cell: the tails of a large sample lie there.
const HALVINGS: u32 = 14;

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

/// Where a node lies in the dyadic grid: between `left` and the next grid point, with these weights.
struct Place {
    left: usize,
    weights: [f64; 2],
}

impl Place {
    /// Node i/n among `cells`; the weights are those of linear interpolation, scaled to the variance i/n (1 - i/n).
    fn of(node: usize, sample_size: usize, cells: usize) -> Self {
        let time = node as f64 / sample_size as f64;
        let position = time * cells as f64;
        let left = (position as usize).min(cells - 1);
        let share = position - left as f64;
        let (start, end) = (left as f64 / cells as f64, (left + 1) as f64 / cells as f64);
        let variance = (1.0 - share).powi(2) * start * (1.0 - start)
            + share * share * end * (1.0 - end)
            + 2.0 * share * (1.0 - share) * start * (1.0 - end);
        let scale = (time * (1.0 - time) / variance).sqrt();
        Place { left, weights: [scale * (1.0 - share), scale * share] }
    }

    fn interpolate(&self, bridge: &[f64]) -> f64 {
        self.weights[0] * bridge[self.left] + self.weights[1] * bridge[self.left + 1]
    }
}

impl AbsoluteBridges {
    /// Simulates `paths` standard Brownian bridges at the times i/n.
    ///
    /// Path p is the same path at every sample size, so that the quantile moves from one sample size to the next as the
    /// law does, and not as two simulations differ: the stream (seed, "bridge", 0, p) refines it by midpoints on 2^m
    /// cells, m the least with at least 1024 and 4n of them, and B(i/n) is interpolated between their ends and scaled
    /// to its exact variance i/n (1 - i/n). Covariances are off by less than the cell, 1/1024. Cost O(n paths) and a
    /// few thousand normals a path.
    pub fn simulate(sample_size: usize, paths: usize, seed: u64) -> Self {
        let nodes = sample_size.saturating_sub(1);
        let mut values = vec![0.0; nodes * paths];
        let cells = LEAST_CELLS.max(4 * sample_size).next_power_of_two();
        let places: Vec<Place> = (1..=nodes).map(|node| Place::of(node, sample_size, cells)).collect();
        let mut bridge = vec![0.0; cells + 1];
        for path in 0..paths {
            refine(&mut bridge, &mut stream(seed, "bridge", 0, path));
            for (node, place) in places.iter().enumerate() {
                values[node * paths + path] = place.interpolate(&bridge).abs();
            }
        }
        AbsoluteBridges { times: Times::Sample(sample_size), paths, values }
    }

    /// The same paths at times that serve every sample size from about [`GRADED_FROM`] on: 512 equal cells, of which the
    /// first and the last are halved 14 times towards the ends. Between two times `|B|` is interpolated and scaled to its
    /// exact mean; the product of two values within a cell is off by less than the cell.
    pub fn graded(paths: usize, seed: u64) -> Self {
        let cell = 1.0 / GRADED_CELLS as f64;
        let halved = |power: u32| cell * 0.5_f64.powi(power as i32);
        let ends = (1..=HALVINGS).rev().map(halved);
        let inside = (1..GRADED_CELLS).map(|node| node as f64 * cell);
        let times: Vec<f64> = ends.clone().chain(inside).chain(ends.rev().map(|time| 1.0 - time)).collect();
        let mut values = vec![0.0; times.len() * paths];
        let mut bridge = vec![0.0; GRADED_CELLS + 1];
        let halvings = HALVINGS as usize;
        for path in 0..paths {
            let mut generator = stream(seed, "bridge", 0, path);
            refine(&mut bridge, &mut generator);
            let mut keep = |time: usize, value: f64| values[time * paths + path] = value.abs();
            let last = times.len() - 1;
            (1..GRADED_CELLS).for_each(|node| keep(halvings + node - 1, bridge[node]));
            let (mut low, mut high) = (bridge[1], bridge[GRADED_CELLS - 1]);
            for halving in 0..HALVINGS {
                let deviation = 0.5 * halved(halving).sqrt();
                low = 0.5 * low + deviation * generator.sample::<f64, _>(StandardNormal);
                high = 0.5 * high + deviation * generator.sample::<f64, _>(StandardNormal);
                let distance = halvings - 1 - halving as usize;
                keep(distance, low);
                keep(last - distance, high);
            }
        }
        AbsoluteBridges { times: Times::Graded(times), paths, values }
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
                let values = places.each_ref().map(|place| place.interpolate(&cells));
                for (row, left) in sums.iter_mut().zip(values) {
                    row.iter_mut().zip(values).for_each(|(sum, right)| *sum += left * right / 20_000.0);
                }
            }
            for (row, left) in sums.iter().zip(nodes) {
                for (&found, right) in row.iter().zip(nodes) {
                    let [s, t] = [left.min(right), left.max(right)].map(|node| node as f64 / sample_size as f64);
                    assert!((found - s * (1.0 - t)).abs() < 0.01, "{sample_size}: {found} against {}", s * (1.0 - t));
                }
            }
        }
    }

    #[test]
    fn a_path_is_the_same_at_every_sample_size() {
        let (few, many) = (AbsoluteBridges::simulate(4, 50, 3), AbsoluteBridges::simulate(2048, 50, 3));
        for path in 0..50 {
            // Node 2 of 4 and node 1024 of 2048 are both the middle.
            assert_eq!(few.values[50 + path], many.values[1023 * 50 + path]);
        }
    }
}
