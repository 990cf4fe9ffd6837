//! The bridge statistic: the limit law of the Wasserstein distance between an empirical law and the true one.

use rand::RngExt;
use rand_distr::StandardNormal;

use super::empirical::EmpiricalDistribution;
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

impl AbsoluteBridges {
    /// Simulates `paths` standard Brownian bridges on the grid i/n: `B(i/n) = W(i/n) - (i/n) W(1)`.
    /// Path p draws from the stream (seed, "bridge", n, p). Cost O(n paths).
    pub fn simulate(sample_size: usize, paths: usize, seed: u64) -> Self {
        let nodes = sample_size.saturating_sub(1);
        let mut values = vec![0.0; nodes * paths];
        let scale = 1.0 / (sample_size as f64).sqrt();
        let mut walk = vec![0.0; sample_size];
        for path in 0..paths {
            let mut generator = stream(seed, "bridge", sample_size, path);
            let mut position = 0.0;
            for point in &mut walk {
                position += scale * generator.sample::<f64, _>(StandardNormal);
                *point = position;
            }
            for node in 0..nodes {
                let time = (node + 1) as f64 / sample_size as f64;
                values[node * paths + path] = (walk[node] - time * position).abs();
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
        for (sum, value) in statistic.iter_mut().zip(column) {
            *sum += gap * value;
        }
    }

    /// `H = sum_{i=1}^{n-1} |B(i/n)| (z_(i+1) - z_(i))` on every path. `atoms` ascending, n of them. Cost O(n paths).
    /// Source: the paper, section 2.1.
    pub fn statistic(&self, atoms: &[f64]) -> Vec<f64> {
        let mut statistic = vec![0.0; self.paths];
        for (index, pair) in atoms.windows(2).enumerate() {
            self.add(index + 1, pair[1] - pair[0], &mut statistic);
        }
        statistic
    }

    /// The (1 - alpha)-quantile of the statistic of `law`, whose sample size must be n.
    pub fn quantile(&self, law: &EmpiricalDistribution, alpha: f64) -> Quantile {
        let mut statistic = self.statistic(law.atoms());
        let value = upper_quantile(&mut statistic, alpha);
        let half_width = (statistic.len() as f64 * alpha * (1.0 - alpha)).sqrt() / statistic.len() as f64;
        let above = upper_quantile(&mut statistic, (alpha - half_width).max(0.0));
        let below = upper_quantile(&mut statistic, (alpha + half_width).min(1.0));
        Quantile { value, standard_error: 0.5 * (above - below) }
    }

    /// Quantiles of the laws of `atoms` (n - 1 of them, ascending) with one more value, for every value in
    /// ascending `values`. Cost O((n + values) paths): sums left and right of the value are carried along.
    pub fn quantiles_with(&self, atoms: &[f64], values: &[f64], alpha: f64) -> Vec<f64> {
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
            quantiles.push(upper_quantile(&mut statistic, alpha));
        }
        quantiles
    }
}

/// The (1 - alpha)-quantile by linear interpolation of order statistics (Hyndman and Fan, type 7). Reorders `sample`.
fn upper_quantile(sample: &mut [f64], alpha: f64) -> f64 {
    let position = (sample.len() - 1) as f64 * (1.0 - alpha);
    let index = (position.floor() as usize).min(sample.len() - 1);
    let (_, &mut low, above) = sample.select_nth_unstable_by(index, f64::total_cmp);
    let high = above.iter().copied().fold(f64::INFINITY, f64::min);
    if high.is_finite() { low + (position - index as f64) * (high - low) } else { low }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn carrying_sums_equals_building_each_law() {
        let law = EmpiricalDistribution::new(&[0.02, -0.05, 0.11, 0.04, 0.04]);
        let bridges = AbsoluteBridges::simulate(6, 300, 9);
        let values = [-0.4, -0.05, 0.0, 0.04, 0.05, 0.3];
        let carried = bridges.quantiles_with(law.atoms(), &values, 0.1);
        for (value, quantile) in values.iter().zip(carried) {
            let mut larger = law.clone();
            larger.push(*value);
            // Six additions and subtractions of numbers below 1.
            assert!((bridges.quantile(&larger, 0.1).value - quantile).abs() < 1e-14);
        }
    }

    #[test]
    fn the_quantile_is_continuous_in_the_law() {
        let bridges = AbsoluteBridges::simulate(5, 2000, 1);
        let before = bridges.quantile(&EmpiricalDistribution::new(&[0.02, -0.05, 0.11, 0.04, 0.07]), 0.1);
        let after = bridges.quantile(&EmpiricalDistribution::new(&[0.02, -0.05, 0.11 + 1e-9, 0.04, 0.07]), 0.1);
        // One gap grows by 1e-9 and |B| stays below 3 on 2000 paths.
        assert!((before.value - after.value).abs() < 3e-9);
        assert!(before.standard_error > 0.0);
    }
}
