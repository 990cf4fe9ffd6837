//! The bridge statistic: the limit law of the Wasserstein distance between an empirical law and the true one.

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::dispatch::dispatched;
use super::empirical::EmpiricalDistribution;
use super::harrell_davis::HarrellDavis;
use super::streams::stream;

/// Simulated `|B(i/n)|`, i = 1 to n - 1, for one sample size n: common random numbers for every law of that size.
///
/// Stored node by node (all paths of i = 1, then of i = 2, ...), because a statistic adds node after node.
#[derive(Debug, Clone)]
pub struct AbsoluteBridges {
    sample_size: usize,
    paths: usize,
    values: Vec<f64>,
}

/// A simulated quantile and the standard error of its simulation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantile {
    pub value: f64,
    pub standard_error: f64,
}

/// The (1 - alpha)-quantile of a statistic over simulated paths.
#[derive(Debug, Clone, PartialEq)]
pub struct UpperQuantile {
    at: HarrellDavis,
    /// One standard deviation of the share of paths below and above.
    beside: [HarrellDavis; 2],
}

impl UpperQuantile {
    /// `alpha` in (0, 1), `paths` at least 1. Cost O(paths).
    pub fn new(paths: usize, alpha: f64) -> Self {
        let deviation = (alpha * (1.0 - alpha) / paths as f64).sqrt();
        let shares =
            [(1.0 - alpha - deviation).max(0.5 * (1.0 - alpha)), (1.0 - alpha + deviation).min(1.0 - 0.5 * alpha)];
        let at = HarrellDavis::new(paths, 1.0 - alpha);
        UpperQuantile { at, beside: shares.map(|share| HarrellDavis::new(paths, share)) }
    }
}

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
    /// Simulates `paths` standard Brownian bridges on the grid i/n.
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
        AbsoluteBridges { sample_size, paths, values }
    }

    pub fn sample_size(&self) -> usize {
        self.sample_size
    }

    /// Adds `gap` times node `node` (1 to n - 1) of every path to `statistic`.
    fn add(&self, node: usize, gap: f64, statistic: &mut [f64]) {
        let column = &self.values[(node - 1) * self.paths..node * self.paths];
        dispatched!(statistic.iter_mut().zip(column).for_each(|(sum, value)| *sum += gap * value));
    }

    /// `H = sum_{i=1}^{n-1} |B(i/n)| (z_(i+1) - z_(i))` on every path. `atoms` ascending, n of them. Cost O(n paths).
    /// Source: the paper, section 2.1.
    pub fn statistic(&self, atoms: &[f64]) -> Vec<f64> {
        let gaps: Vec<f64> = atoms.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mut statistic = vec![0.0; self.paths];
        dispatched!(add_nodes(&gaps, &self.values, &mut statistic));
        statistic
    }

    /// The quantile of the statistic of `law`, whose sample size must be n.
    pub fn quantile(&self, law: &EmpiricalDistribution, estimator: &UpperQuantile) -> f64 {
        estimator.at.estimate(&mut self.statistic(law.atoms()))
    }

    /// The same with the standard error of its simulation: half the distance of the quantiles one standard deviation of
    /// the share of paths to either side.
    pub fn quantile_with_error(&self, law: &EmpiricalDistribution, estimator: &UpperQuantile) -> Quantile {
        let [below, above] = &estimator.beside;
        let all = [&estimator.at, below, above];
        let [value, below, above] = HarrellDavis::estimates(all, &mut self.statistic(law.atoms()));
        Quantile { value, standard_error: 0.5 * (above - below) }
    }

    /// Columns whose statistic, for a law of n - 1 values, is the mean of this one's over the n - 1 laws that have one of
    /// its values twice: what the statistic becomes, on average, when the next value comes from the law itself. A value
    /// doubled at rank j moves the gaps above it one node up, so that gap i lies at node i in n - 1 - i of them and at
    /// node i + 1 in the other i. Cost O(n paths).
    pub fn one_ahead(&self) -> AbsoluteBridges {
        let sample_size = self.sample_size.saturating_sub(1);
        let mut values = Vec::with_capacity(sample_size.saturating_sub(1) * self.paths);
        for node in 1..sample_size {
            let share = node as f64 / sample_size as f64;
            let at = |node: usize| &self.values[(node - 1) * self.paths..node * self.paths];
            values.extend(at(node).iter().zip(at(node + 1)).map(|(low, high)| (1.0 - share) * low + share * high));
        }
        AbsoluteBridges { sample_size, paths: self.paths, values }
    }

    /// Quantiles of the laws of `atoms` (n - 1 of them, ascending) with one more value, for every value in
    /// ascending `values`. Cost O((n + values) paths): sums left and right of the value are carried along.
    pub fn quantiles_with(&self, atoms: &[f64], values: &[f64], estimator: &UpperQuantile) -> Vec<f64> {
        let size = atoms.len();
        let mut left = vec![0.0; self.paths];
        let mut right = vec![0.0; self.paths];
        for gap in 1..size {
            self.add(gap + 1, atoms[gap] - atoms[gap - 1], &mut right);
        }
        let mut below = 0;
        let mut statistic = vec![0.0; self.paths];
        let mut quantiles = Vec::with_capacity(values.len());
        for &value in values {
            while below < size && atoms[below] <= value {
                below += 1;
                // The gap below `below` joins the left side, the gap above it leaves the right side.
                if below >= 2 {
                    self.add(below - 1, atoms[below - 1] - atoms[below - 2], &mut left);
                }
                if below < size {
                    self.add(below + 1, -(atoms[below] - atoms[below - 1]), &mut right);
                }
            }
            for ((sum, l), r) in statistic.iter_mut().zip(&left).zip(&right) {
                *sum = l + r;
            }
            if below > 0 {
                self.add(below, value - atoms[below - 1], &mut statistic);
            }
            if below < size {
                self.add(below + 1, atoms[below] - value, &mut statistic);
            }
            quantiles.push(estimator.at.estimate(&mut statistic));
        }
        quantiles
    }
}

/// Nodes added in one pass over the statistic.
const NODES: usize = 4;

/// Adds `gaps[i]` times node i + 1 of every path, node after node, to `statistic`. Nothing is fused and the order is that
/// of the nodes: the bits do not depend on the width of the processor's vectors.
#[inline(always)]
fn add_nodes(gaps: &[f64], nodes: &[f64], statistic: &mut [f64]) {
    let paths = statistic.len();
    for (gaps, nodes) in gaps.chunks(NODES).zip(nodes.chunks(NODES * paths)) {
        if let ([a, b, c, d], (near, far)) = (gaps, nodes.split_at(nodes.len() / 2)) {
            let ((first, second), (third, fourth)) = (near.split_at(paths), far.split_at(paths));
            for ((((sum, p), q), r), s) in statistic.iter_mut().zip(first).zip(second).zip(third).zip(fourth) {
                *sum = *sum + a * p + b * q + c * r + d * s;
            }
        } else {
            for (gap, node) in gaps.iter().zip(nodes.chunks_exact(paths)) {
                statistic.iter_mut().zip(node).for_each(|(sum, value)| *sum += gap * value);
            }
        }
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

    #[test]
    fn carrying_sums_equals_building_each_law() {
        let law = EmpiricalDistribution::new(&[0.02, -0.05, 0.11, 0.04, 0.04]);
        let bridges = AbsoluteBridges::simulate(6, 300, 9);
        let values = [-0.4, -0.05, 0.0, 0.04, 0.05, 0.3];
        let estimator = UpperQuantile::new(300, 0.1);
        let carried = bridges.quantiles_with(law.atoms(), &values, &estimator);
        for (value, quantile) in values.iter().zip(carried) {
            let mut larger = law.clone();
            larger.push(*value);
            // Six additions and subtractions of numbers below 1.
            assert!((bridges.quantile(&larger, &estimator) - quantile).abs() < 1e-14);
        }
    }

    #[test]
    fn the_statistic_is_the_plain_sum_to_the_last_bit() {
        for size in [2, 4, 5, 6, 9, 11] {
            let bridges = AbsoluteBridges::simulate(size, 37, 4);
            let atoms: Vec<f64> = (0..size).map(|k| (k as f64).powf(1.3)).collect();
            let mut plain = vec![0.0; 37];
            (1..size).for_each(|node| bridges.add(node, atoms[node] - atoms[node - 1], &mut plain));
            assert_eq!(bridges.statistic(&atoms), plain);
        }
    }

    #[test]
    fn the_quantile_is_continuous_in_the_law() {
        let bridges = AbsoluteBridges::simulate(5, 2000, 1);
        let estimator = UpperQuantile::new(2000, 0.1);
        let quantile = |sample: &[f64]| bridges.quantile_with_error(&EmpiricalDistribution::new(sample), &estimator);
        let before = quantile(&[0.02, -0.05, 0.11, 0.04, 0.07]);
        let after = quantile(&[0.02, -0.05, 0.11 + 1e-9, 0.04, 0.07]);
        // One gap grows by 1e-9 and |B| stays below 3 on 2000 paths.
        assert!((before.value - after.value).abs() < 3e-9);
        assert!(before.standard_error > 0.0);
    }

    #[test]
    fn one_ahead_is_the_mean_over_the_values_of_the_law() {
        let law = EmpiricalDistribution::new(&[0.02, -0.05, 0.11, 0.04, 0.07]);
        let bridges = AbsoluteBridges::simulate(6, 20, 1);
        let mut mean = vec![0.0; 20];
        for &atom in law.atoms() {
            let mut doubled = law.clone();
            doubled.push(atom);
            let statistic = bridges.statistic(doubled.atoms());
            mean.iter_mut().zip(statistic).for_each(|(sum, value)| *sum += value / 5.0);
        }
        for (found, expected) in bridges.one_ahead().statistic(law.atoms()).iter().zip(mean) {
            // A dozen roundings of numbers below 1.
            assert!((found - expected).abs() < 1e-14);
        }
    }
}
