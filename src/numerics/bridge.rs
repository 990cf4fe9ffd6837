//! The bridge statistic: the limit law of the Wasserstein distance between an empirical law and the true one.

use std::ops::Range;
use std::sync::OnceLock;

use super::bridge_paths::{AbsoluteBridges, Times};
use super::dispatch::dispatched;
use super::empirical::EmpiricalDistribution;
use super::harrell_davis::{HarrellDavis, LastEstimate};
use super::scale_mixture::LastQuantile;

/// A statistic of a law of n values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Statistic {
    /// Of the law itself, over bridges of sample size n.
    Now,
    /// The mean over the n laws that have one of its values twice, over bridges of sample size n + 1: what the statistic
    /// becomes, on average, when the next value comes from the law itself. A value doubled at rank j moves the gaps above
    /// it one node up, so that gap i lies at node i in n - i of the laws and at node i + 1 in the other i.
    OneLater,
}

/// A simulated quantile and the standard error of its simulation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantile {
    pub value: f64,
    pub standard_error: f64,
}

/// The (1 - alpha)-quantile of a statistic over simulated paths: of directions with the length integrated out, of whole
/// paths from their order statistics.
#[derive(Debug, Clone)]
pub struct UpperQuantile {
    alpha: f64,
    paths: usize,
    /// Made when whole paths first ask for them.
    order_statistics: OnceLock<OrderStatistics>,
}

#[derive(Debug, Clone)]
struct OrderStatistics {
    at: HarrellDavis,
    /// One standard deviation of the share of paths below and above.
    beside: [HarrellDavis; 2],
}

/// What one quantile leaves for the next of a similar law.
#[derive(Default)]
struct Last {
    directions: LastQuantile,
    paths: LastEstimate,
}

impl UpperQuantile {
    /// `alpha` in [0.001, 0.999], over `paths` >= 1.
    pub fn new(paths: usize, alpha: f64) -> Self {
        UpperQuantile { alpha, paths, order_statistics: OnceLock::new() }
    }

    fn order_statistics(&self) -> &OrderStatistics {
        self.order_statistics.get_or_init(|| {
            let (alpha, paths) = (self.alpha, self.paths);
            let deviation = (alpha * (1.0 - alpha) / paths as f64).sqrt();
            let shares =
                [(1.0 - alpha - deviation).max(0.5 * (1.0 - alpha)), (1.0 - alpha + deviation).min(1.0 - 0.5 * alpha)];
            let at = HarrellDavis::new(paths, 1.0 - alpha);
            OrderStatistics { at, beside: shares.map(|share| HarrellDavis::new(paths, share)) }
        })
    }

    fn alone(&self, bridges: &AbsoluteBridges, statistic: &[f64]) -> f64 {
        match &bridges.lengths {
            Some(lengths) => lengths.quantile(1.0 - self.alpha, statistic),
            None => self.order_statistics().at.estimate(statistic),
        }
    }

    fn next(&self, bridges: &AbsoluteBridges, statistic: &[f64], last: &mut Last) -> f64 {
        match &bridges.lengths {
            Some(lengths) => lengths.quantile_next(1.0 - self.alpha, statistic, &mut last.directions),
            None => self.order_statistics().at.estimate_next(statistic, &mut last.paths),
        }
    }

    fn with_error(&self, bridges: &AbsoluteBridges, statistic: &[f64]) -> Quantile {
        let Some(lengths) = &bridges.lengths else {
            let OrderStatistics { at, beside: [below, above] } = self.order_statistics();
            let [value, below, above] = HarrellDavis::estimates([at, below, above], statistic);
            return Quantile { value, standard_error: 0.5 * (above - below) };
        };
        let (value, standard_error) = lengths.quantile_with_error(1.0 - self.alpha, statistic);
        Quantile { value, standard_error }
    }
}

impl AbsoluteBridges {
    /// `H = sum_{i=1}^{n-1} |B(i/n)| (z_(i+1) - z_(i))` on every path, or what it becomes; over the length of the
    /// path where directions are kept. `atoms` ascending, n of them. Cost O(min(n, 540) paths). Source: the paper,
    /// section 2.1.
    pub fn statistic(&self, atoms: &[f64], which: Statistic) -> Vec<f64> {
        let mut weights = Weights::new(self);
        for (pair, gap) in atoms.windows(2).zip(1..) {
            weights.place(gap, atoms.len(), pair[1] - pair[0], which);
        }
        let mut statistic = vec![0.0; self.paths];
        weights.pour(&mut statistic);
        statistic
    }

    /// The quantile of a statistic of `law`.
    pub fn quantile(&self, law: &EmpiricalDistribution, which: Statistic, estimator: &UpperQuantile) -> f64 {
        estimator.alone(self, &self.statistic(law.atoms(), which))
    }

    /// That of the law itself, with the standard error of its simulation. Of order statistics it is half the distance of
    /// the quantiles one standard deviation of the share of paths to either side.
    pub fn quantile_with_error(&self, law: &EmpiricalDistribution, estimator: &UpperQuantile) -> Quantile {
        estimator.with_error(self, &self.statistic(law.atoms(), Statistic::Now))
    }

    /// Quantiles of a statistic of the laws of `atoms` (m of them, ascending) with one more value, for every value in
    /// ascending `values`. Cost O((min(m, 540) + values) paths): between two values only the gaps that they enclose move.
    pub fn quantiles_with(
        &self,
        atoms: &[f64],
        values: &[f64],
        which: Statistic,
        estimator: &UpperQuantile,
    ) -> Vec<f64> {
        let (count, size) = (atoms.len(), atoms.len() + 1);
        let mut weights = Weights::new(self);
        // Gap j lies between atoms j - 1 and j: below the value at node j, above it at node j + 1.
        let gap = |j: usize| atoms[j] - atoms[j - 1];
        (1..count).for_each(|j| weights.place(j + 1, size, gap(j), which));
        let mut carried = vec![0.0; self.paths];
        weights.pour(&mut carried);
        let mut below = 0;
        let mut statistic = vec![0.0; self.paths];
        let mut last = Last::default();
        let mut quantiles = Vec::with_capacity(values.len());
        for &value in values {
            while below < count && atoms[below] <= value {
                below += 1;
                // The gap under the atom passed is below the value now; the one above it is to be cut in two.
                if below >= 2 {
                    weights.place(below - 1, size, gap(below - 1), which);
                }
                if below < count {
                    weights.place(below + 1, size, -gap(below), which);
                }
            }
            weights.pour(&mut carried);
            statistic.copy_from_slice(&carried);
            if below > 0 {
                weights.place(below, size, value - atoms[below - 1], which);
            }
            if below < count {
                weights.place(below + 1, size, atoms[below] - value, which);
            }
            weights.pour(&mut statistic);
            quantiles.push(estimator.next(self, &statistic, &mut last));
        }
        quantiles
    }
}

/// What is yet to be added to a statistic: a weight for each time of the bridges.
struct Weights<'a> {
    bridges: &'a AbsoluteBridges,
    weights: Vec<f64>,
    /// Times outside have weight zero.
    touched: Range<usize>,
}

impl<'a> Weights<'a> {
    fn new(bridges: &'a AbsoluteBridges) -> Self {
        Weights { bridges, weights: vec![0.0; bridges.values.len() / bridges.paths], touched: 0..0 }
    }

    /// Gap `gap`, of 1 to n - 1, of a law of `size` = n values, `length` wide.
    fn place(&mut self, gap: usize, size: usize, length: f64, which: Statistic) {
        match which {
            Statistic::Now => self.place_at(gap, size, length),
            Statistic::OneLater => {
                let share = gap as f64 / size as f64;
                self.place_at(gap, size + 1, (1.0 - share) * length);
                self.place_at(gap + 1, size + 1, share * length);
            }
        }
    }

    /// `length` at the time node/size.
    fn place_at(&mut self, node: usize, size: usize, length: f64) {
        match &self.bridges.times {
            Times::Sample(own) => {
                assert_eq!(*own, size, "bridges of the sample size of the law");
                self.put(node - 1, length);
            }
            Times::Graded(times) => {
                let time = node as f64 / size as f64;
                let after = times.partition_point(|&known| known < time);
                let known = |index: usize| times.get(index).copied().unwrap_or(1.0);
                let (low, high) = (if after == 0 { 0.0 } else { known(after - 1) }, known(after));
                let share = (time - low) / (high - low);
                let deviation = |time: f64| (time * (1.0 - time)).sqrt();
                let interpolated = (1.0 - share) * deviation(low) + share * deviation(high);
                let scaled = length * deviation(time) / interpolated;
                if after > 0 {
                    self.put(after - 1, (1.0 - share) * scaled);
                }
                if after < times.len() {
                    self.put(after, share * scaled);
                }
            }
        }
    }

    fn put(&mut self, time: usize, weight: f64) {
        self.weights[time] += weight;
        let Range { start, end } = self.touched;
        self.touched = if start == end { time..time + 1 } else { start.min(time)..end.max(time + 1) };
    }

    /// Adds what is waiting to `statistic`.
    fn pour(&mut self, statistic: &mut [f64]) {
        let touched = std::mem::take(&mut self.touched);
        let paths = self.bridges.paths;
        let values = &self.bridges.values[touched.start * paths..touched.end * paths];
        let weights = &mut self.weights[touched];
        dispatched!(add_nodes(weights, values, statistic));
        weights.fill(0.0);
    }
}

/// Nodes added in one pass over the statistic.
const NODES: usize = 4;

/// Adds `gaps[i]` times node i of every path, node after node, to `statistic`. Nothing is fused and the order is that of
/// the nodes: the bits do not depend on the width of the processor's vectors.
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
    use crate::numerics::bridge_paths::BridgeForm;

    #[test]
    fn carrying_sums_equals_building_each_law() {
        let law = EmpiricalDistribution::new(&[0.02, -0.05, 0.11, 0.04, 0.04]);
        let values = [-0.4, -0.05, 0.0, 0.04, 0.05, 0.3];
        // The tolerance of one of many quantiles; six additions and subtractions of numbers below 1.
        for (form, allowed) in [(BridgeForm::Directions, 1e-6), (BridgeForm::WholePaths, 1e-14)] {
            let bridges = AbsoluteBridges::simulate(6, 300, 9, form);
            let estimator = UpperQuantile::new(300, 0.1);
            let carried = bridges.quantiles_with(law.atoms(), &values, Statistic::Now, &estimator);
            for (value, quantile) in values.iter().zip(carried) {
                let mut larger = law.clone();
                larger.push(*value);
                assert!((bridges.quantile(&larger, Statistic::Now, &estimator) - quantile).abs() < allowed);
            }
        }
    }

    #[test]
    fn the_statistic_is_the_plain_sum_to_the_last_bit() {
        for size in [2, 4, 5, 6, 9, 11] {
            let bridges = AbsoluteBridges::simulate(size, 37, 4, BridgeForm::WholePaths);
            let atoms: Vec<f64> = (0..size).map(|k| (k as f64).powf(1.3)).collect();
            let mut plain = vec![0.0; 37];
            for (pair, column) in atoms.windows(2).zip(bridges.values.chunks_exact(bridges.paths)) {
                plain.iter_mut().zip(column).for_each(|(sum, value)| *sum += (pair[1] - pair[0]) * value);
            }
            assert_eq!(bridges.statistic(&atoms, Statistic::Now), plain);
        }
    }

    #[test]
    fn the_quantile_is_continuous_in_the_law() {
        for form in [BridgeForm::Directions, BridgeForm::WholePaths] {
            let bridges = AbsoluteBridges::simulate(5, 2000, 1, form);
            let estimator = UpperQuantile::new(2000, 0.1);
            let quantile =
                |sample: &[f64]| bridges.quantile_with_error(&EmpiricalDistribution::new(sample), &estimator);
            let before = quantile(&[0.02, -0.05, 0.11, 0.04, 0.07]);
            let after = quantile(&[0.02, -0.05, 0.11 + 1e-9, 0.04, 0.07]);
            // One gap grows by 1e-9 and |B| stays below 3 on 2000 paths.
            assert!((before.value - after.value).abs() < 3e-9);
            assert!(before.standard_error > 0.0);
        }
    }

    /// Deviation, over many simulations, of an estimate.
    fn deviation(estimates: &[f64]) -> f64 {
        let mean = estimates.iter().sum::<f64>() / estimates.len() as f64;
        (estimates.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (estimates.len() - 1) as f64).sqrt()
    }

    #[test]
    fn directions_need_fewer_paths_and_say_how_far_they_are_off() {
        let law = EmpiricalDistribution::new(&[0.02, -0.05, 0.11, 0.04, 0.07, -0.13, 0.005, 0.062, -0.02, 0.09]);
        let [directions, paths] = [BridgeForm::Directions, BridgeForm::WholePaths].map(|form| {
            let estimator = UpperQuantile::new(200, 0.1);
            let found = (0..200)
                .map(|seed| AbsoluteBridges::simulate(10, 200, seed, form).quantile_with_error(&law, &estimator));
            let (values, errors): (Vec<f64>, Vec<f64>) = found.map(|found| (found.value, found.standard_error)).unzip();
            (deviation(&values), errors.iter().sum::<f64>() / 200.0)
        });
        assert!(directions.0 < 0.85 * paths.0, "{directions:?} against {paths:?}");
        // A deviation over 200 simulations has a standard error of 5 %.
        assert!((directions.1 / directions.0 - 1.0).abs() < 0.2, "{directions:?}");
    }

    #[test]
    fn one_later_is_the_mean_over_the_values_of_the_law() {
        let law = EmpiricalDistribution::new(&[0.02, -0.05, 0.11, 0.04, 0.07]);
        let bridges = AbsoluteBridges::simulate(6, 20, 1, BridgeForm::Directions);
        let mut mean = vec![0.0; 20];
        for &atom in law.atoms() {
            let mut doubled = law.clone();
            doubled.push(atom);
            let statistic = bridges.statistic(doubled.atoms(), Statistic::Now);
            mean.iter_mut().zip(statistic).for_each(|(sum, value)| *sum += value / 5.0);
        }
        for (found, expected) in bridges.statistic(law.atoms(), Statistic::OneLater).iter().zip(mean) {
            // A dozen roundings of numbers below 1.
            assert!((found - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn graded_times_serve_large_samples() {
        // A Student-like sample: its widest gaps lie where the grid is finest.
        let sample: Vec<f64> = (0..1500).map(|k| (f64::from(k) - 749.5) / (f64::from(k.min(1499 - k)) + 0.5)).collect();
        let law = EmpiricalDistribution::new(&sample);
        for form in [BridgeForm::Directions, BridgeForm::WholePaths] {
            let exact = AbsoluteBridges::simulate(1500, 2000, 4, form);
            let graded = AbsoluteBridges::graded(2000, 4, form);
            let estimator = UpperQuantile::new(2000, 0.1);
            let expected = exact.quantile_with_error(&law, &estimator);
            let found = graded.quantile_with_error(&law, &estimator);
            // Paths inside a cell are other draws: four standard deviations of the difference, were all of it so.
            let allowed = 4.0 * expected.standard_error.hypot(found.standard_error);
            assert!((found.value - expected.value).abs() < allowed, "{found:?} against {expected:?}");
            if form == BridgeForm::WholePaths {
                let sum =
                    |bridges: &AbsoluteBridges| bridges.statistic(law.atoms(), Statistic::Now).iter().sum::<f64>();
                // The statistic's deviation is about half its mean: four standard errors of the mean of 2000 are 5 %.
                assert!((sum(&graded) / sum(&exact) - 1.0).abs() < 0.05);
            }
        }
    }

    #[test]
    fn graded_sums_are_carried_too() {
        let atoms: Vec<f64> = (0..3000).map(|k| (f64::from(k) / 1500.0 - 1.0).powi(3)).collect();
        let estimator = UpperQuantile::new(50, 0.1);
        let values = [-2.0, -0.7, 0.001, 0.4, 0.41, 3.0];
        // The tolerance of one of many quantiles; thousands of roundings of weights that sum to 5.
        for (form, allowed) in [(BridgeForm::Directions, 1e-6), (BridgeForm::WholePaths, 1e-12)] {
            let bridges = AbsoluteBridges::graded(50, 2, form);
            for which in [Statistic::Now, Statistic::OneLater] {
                let carried = bridges.quantiles_with(&atoms, &values, which, &estimator);
                for (value, quantile) in values.iter().zip(carried) {
                    let mut larger = EmpiricalDistribution::new(&atoms);
                    larger.push(*value);
                    assert!((bridges.quantile(&larger, which, &estimator) - quantile).abs() < allowed);
                }
            }
        }
    }
}
