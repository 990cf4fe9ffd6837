//! The factor by which the bridge's radius must grow so that its balls hold the law as often as stated, estimated on
//! records drawn from a smoothed law of the given record.
//!
//! A record of a few returns shows less spread than its law has. The radius follows that spread, so for more than a
//! share alpha of records the balls are too small to hold the law. Each drawn record gives the factor that its own ball
//! needs,
//!
//!   W1(F*, S) sqrt(n) / Q(F*),   S the smoothed law, F* the empirical law of n draws of it, Q the bridge's quantile,
//!
//! and the (1 - alpha)-quantile of these factors is the common factor. Source: Efron and Tibshirani (1993), An
//! introduction to the bootstrap, section 18 (calibration of a level by the bootstrap), with the smoothed law of
//! Silverman (1986), section 6.4.1.

use rand::{Rng, RngExt};

use crate::numerics::bridge::paths::AbsoluteBridges;
use crate::numerics::bridge::sized_gaps::Statistic;
use crate::numerics::law::ContinuousLaw;
use crate::numerics::law::empirical::{EmpiricalDistribution, weights};
use crate::numerics::law::law_distance::distance_of_masses;
use crate::numerics::machine::streams::stream;
use crate::numerics::statistics::summary::interpolated_quantile;

/// Number of atoms over which each value of the record is spread.
const SPREAD: usize = 16;
/// Number of records drawn: at alpha = 0.1 the factor has a standard error of about 2 %, and more at smaller alpha.
const RECORDS: usize = 1000;
/// A record of one repeated value is drawn again, at most this many times.
const DRAWS: usize = 100;

/// A record's law with each value spread by a normal kernel into `SPREAD` atoms. Its mean and variance are the record's
/// own.
struct SmoothedLaw {
    /// Atoms, ascending.
    atoms: Vec<f64>,
    /// Masses of the atoms, in their order; they sum to 1.
    masses: Vec<f64>,
    /// The index of atom k of value i among all atoms, at `SPREAD i + k`.
    places: Vec<usize>,
    /// Shares of the values, oldest first; a drawn record of as many values has the same shares.
    shares: Vec<f64>,
    /// Cumulative sums of the shares.
    cumulative: Vec<f64>,
}

impl SmoothedLaw {
    /// Smooths a record, oldest first, in which older values weigh less.
    fn of(record: &[f64], retention: f64) -> Self {
        let weights = weights(record.len(), retention);
        let total: f64 = weights.iter().sum();
        let nodes = normal_nodes();
        let spread: Vec<(f64, f64)> = match ContinuousLaw::smoothed_bootstrap(record, &weights) {
            ContinuousLaw::GaussianMixture { components, .. } => components
                .iter()
                .flat_map(|&(weight, mean, deviation)| {
                    nodes.map(|node| (mean + deviation * node, weight / SPREAD as f64))
                })
                .collect(),
            ContinuousLaw::StudentT { .. } => Vec::new(),
        };
        let mut order: Vec<usize> = (0..spread.len()).collect();
        order.sort_by(|&one, &other| spread[one].0.total_cmp(&spread[other].0));
        let mut places = vec![0; order.len()];
        order.iter().enumerate().for_each(|(place, &atom)| places[atom] = place);
        let (atoms, masses) = order.iter().map(|&atom| spread[atom]).unzip();
        let shares: Vec<f64> = weights.iter().map(|weight| weight / total).collect();
        let sum_up = |sum: &mut f64, share: &f64| {
            *sum += share;
            Some(*sum)
        };
        let cumulative = shares.iter().scan(0.0, sum_up).collect();
        SmoothedLaw { atoms, masses, places, shares, cumulative }
    }

    /// Draws as many atoms as the record has values, and returns their indices, oldest first.
    fn draw(&self, generator: &mut impl Rng) -> Vec<usize> {
        let count = self.cumulative.len();
        let one = |_| {
            let share: f64 = generator.random();
            let value = self.cumulative.partition_point(|&cumulative| cumulative <= share).min(count - 1);
            self.places[SPREAD * value + generator.random_range(0..SPREAD)]
        };
        (0..count).map(one).collect()
    }

    /// Returns the Wasserstein-1 distance to the law of draws with these indices, oldest first. Cost O(atoms).
    fn distance(&self, places: &[usize]) -> f64 {
        let mut apart = self.masses.iter().map(|mass| -mass).collect::<Vec<f64>>();
        places.iter().zip(&self.shares).for_each(|(&place, share)| apart[place] += share);
        distance_of_masses(&self.atoms, &apart)
    }
}

/// Returns the medians of `SPREAD` equally likely parts of a standard normal law, scaled to variance 1.
fn normal_nodes() -> [f64; SPREAD] {
    let normal = ContinuousLaw::mixture(vec![(1.0, 0.0, 1.0)]);
    let nodes: [f64; SPREAD] = std::array::from_fn(|part| normal.quantile((part as f64 + 0.5) / SPREAD as f64));
    let variance = nodes.iter().map(|node| node * node).sum::<f64>() / SPREAD as f64;
    nodes.map(|node| node / variance.sqrt())
}

/// Returns the factor for the radius at a miscoverage. `bridges` must have the sample size of `record`, which is oldest
/// first and has at least two different values. Streams: (seed, "calibration", 0, index). Cost O(1000 (n paths + n ln
/// n)).
///
/// Checked by: `balls_of_fresh_records_hold_the_smoothed_law_as_often_as_they_say`, and by `ballast-lab coverage` on laws
/// that are not those of a record.
pub fn calibration_factor(bridges: &AbsoluteBridges, record: &[f64], retention: f64, alpha: f64, seed: u64) -> f64 {
    let mut needed = needed(bridges, record, retention, alpha, |index| stream(seed, "calibration", 0, index));
    needed.sort_by(f64::total_cmp);
    interpolated_quantile(&needed, 1.0 - alpha)
}

/// Returns, for each of many drawn records, the factor that its ball needs to hold the smoothed law of `record`.
fn needed<R: Rng>(
    bridges: &AbsoluteBridges,
    record: &[f64],
    retention: f64,
    alpha: f64,
    generator: impl Fn(usize) -> R,
) -> Vec<f64> {
    let law = SmoothedLaw::of(record, retention);
    let of_record = |index: usize| {
        let mut generator = generator(index);
        let needed = (0..DRAWS).find_map(|_| {
            let places = law.draw(&mut generator);
            let values: Vec<f64> = places.iter().map(|&place| law.atoms[place]).collect();
            let seen = EmpiricalDistribution::decaying(&values, retention);
            let radius = bridges.bridge_quantile(&seen, Statistic::Current, alpha) / seen.effective_size().sqrt();
            (radius > 0.0).then(|| law.distance(&places) / radius)
        });
        needed.unwrap_or(1.0)
    };
    (0..RECORDS).map(of_record).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::law::law_distance::LawDistance;

    fn record(count: usize) -> Vec<f64> {
        let mut generator = stream(3, "record", 0, count);
        let law = ContinuousLaw::StudentT { location: 0.005, scale: 0.04, degrees_of_freedom: 4.0 };
        (0..count).map(|_| law.draw(&mut generator)).collect()
    }

    #[test]
    fn balls_of_fresh_records_hold_the_smoothed_law_as_often_as_they_say() {
        for (count, retention, alpha) in [(20, 1.0, 0.1), (60, 1.0, 0.5), (40, 0.95, 0.1)] {
            let record = record(count);
            let bridges = match retention {
                1.0 => AbsoluteBridges::simulate(count, 500, 7),
                _ => AbsoluteBridges::graded(500, 7),
            };
            let factor = calibration_factor(&bridges, &record, retention, alpha, 1);
            let fresh = needed(&bridges, &record, retention, alpha, |index| stream(2, "fresh", 0, index));
            let held = fresh.iter().filter(|needed| **needed <= factor).count() as f64 / RECORDS as f64;
            // Four standard errors of the difference between two shares of 1000 records.
            let tolerance = 4.0 * (2.0 * alpha * (1.0 - alpha) / RECORDS as f64).sqrt();
            assert!((held - (1.0 - alpha)).abs() < tolerance, "{count} {held} {factor}");
            let without = fresh.iter().filter(|needed| **needed <= 1.0).count() as f64 / RECORDS as f64;
            assert!(without < held, "the factor {factor} is needed: {without}");
        }
    }

    #[test]
    fn the_law_in_atoms_is_the_smoothed_one() {
        let record = record(50);
        let (law, weights) = (SmoothedLaw::of(&record, 1.0), [1.0; 50]);
        assert!((law.masses.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let mean =
            |of: &dyn Fn(f64) -> f64| law.atoms.iter().zip(&law.masses).map(|(z, mass)| mass * of(*z)).sum::<f64>();
        let seen = |of: &dyn Fn(f64) -> f64| record.iter().map(|z| of(*z)).sum::<f64>() / 50.0;
        for moment in [|z: f64| z, |z: f64| z * z] {
            assert!((mean(&moment) - seen(&moment)).abs() < 1e-15);
        }
        // A record of draws is as far from the atoms as from the mixture they represent; the latter uses another
        // algorithm.
        let mixture = LawDistance::new(ContinuousLaw::smoothed_bootstrap(&record, &weights), 1.0, [50]);
        for index in 0..5 {
            let places = law.draw(&mut stream(5, "draws", 0, index));
            let mut sample = Vec::new();
            places.iter().for_each(|&place| mixture.learn(&mut sample, [mixture.place(law.atoms[place], 1.0)]));
            let (found, expected) = (law.distance(&places), mixture.distance(&sample));
            // Sixteen atoms represent a normal law of half a deviation.
            assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
        }
    }
}
