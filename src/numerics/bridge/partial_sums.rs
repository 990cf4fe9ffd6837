//! The factor by which the bridge's radius must grow so that the balls of several sample sizes in a row hold the law
//! together.
//!
//! With k returns seen, k (F_k - F) is close to K(k, F), the Kiefer process. It is a sum of k independent Brownian
//! bridges, and one more return adds one bridge. The distance after t more returns, times the root of their number, is
//!
//!   S_t = (integral of |K(n + t, F(x))| dx) / sqrt(n + t),   t = 0, ..., T - 1.
//!
//! S_0 has the law of the bridge statistic. The factor is the quotient of the (1 - alpha)-quantiles of max S_t and S_0.
//! Both come from the same paths, so most of their errors cancel. Source: Kiefer (1972), Skorohod embedding of
//! multivariate random variables, and the sample distribution function, Zeitschrift fuer Wahrscheinlichkeitstheorie 24.

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use crate::numerics::bridge::paths::deviation;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::machine::streams::stream;
use crate::numerics::statistics::summary::interpolated_quantile;

/// Largest number of equal cells of probability between which a bridge is simulated.
pub const CELLS: usize = 64;

/// Returns the weight of `|K|` at each inner end of equal cells, for a law of equal masses. A gap of the law counts at
/// the nearest end, scaled to the deviation of a bridge at its own time; with a cell for each return this is exact.
fn weights(law: &EmpiricalDistribution) -> Vec<f64> {
    let atoms = law.atoms();
    let cells = atoms.len().min(CELLS);
    let mut weights = vec![0.0; cells.saturating_sub(1)];
    for (below, pair) in atoms.windows(2).enumerate() {
        let time = (below + 1) as f64 / atoms.len() as f64;
        let node = ((time * cells as f64).round() as usize).clamp(1, cells - 1);
        weights[node - 1] += (pair[1] - pair[0]) * deviation(time) / deviation(node as f64 / cells as f64);
    }
    weights
}

/// Sums of random walks at the ends of the cells. Less its last value times the time, a walk is a bridge.
struct WalkSum(Vec<f64>);

impl WalkSum {
    /// Adds a Brownian motion times `scale`.
    fn add(&mut self, scale: f64, generator: &mut impl Rng) {
        let deviation = scale / (self.0.len() as f64).sqrt();
        let mut walk = 0.0;
        for sum in &mut self.0 {
            walk += deviation * generator.sample::<f64, _>(StandardNormal);
            *sum += walk;
        }
    }

    /// Returns the weighted sum of `|K|`.
    fn statistic(&self, weights: &[f64]) -> f64 {
        let (cells, last) = (self.0.len() as f64, self.0.last().copied().unwrap_or_default());
        let value =
            |(index, (sum, weight)): (usize, (&f64, &f64))| weight * (sum - last * (index + 1) as f64 / cells).abs();
        self.0.iter().zip(weights).enumerate().map(value).sum()
    }
}

/// Returns the factor on the radius of a law of equal masses, and on those of the laws after each of `steps` - 1 more
/// returns: at least 1, and 1 for a single step. At 2,000 paths and alpha 0.1 its standard error is 1 to 2 %. Streams:
/// (seed, "joint radius", 0, path). Cost: `steps` times 64 normals a path.
///
/// Checked by: `the_factor_restores_the_level_that_many_steps_miss`, and by
/// `lab/src/coverage/horizon.rs::joint_balls_hold_the_law_through_a_horizon_that_those_of_single_steps_leave`.
pub fn all_steps_factor(law: &EmpiricalDistribution, steps: usize, paths: usize, alpha: f64, seed: u64) -> f64 {
    let (weights, size) = (weights(law), law.sample_size() as f64);
    let of_path = |path: usize| {
        let mut generator = stream(seed, "joint radius", 0, path);
        let mut sum = WalkSum(vec![0.0; weights.len() + 1]);
        sum.add(size.sqrt(), &mut generator);
        let first = sum.statistic(&weights) / size.sqrt();
        let later = (1..steps).map(|step| {
            sum.add(1.0, &mut generator);
            sum.statistic(&weights) / (size + step as f64).sqrt()
        });
        (first, later.fold(first, f64::max))
    };
    let (mut first, mut largest): (Vec<f64>, Vec<f64>) = (0..paths).map(of_path).unzip();
    let [first, largest] = [&mut first, &mut largest].map(|statistics| {
        statistics.sort_by(f64::total_cmp);
        interpolated_quantile(statistics, 1.0 - alpha)
    });
    if first > 0.0 { largest / first } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::law::ContinuousLaw;
    use crate::numerics::law::law_distance::{LawDistance, Placed};

    /// Returns the quotient of the 90 % quantiles of the largest and the first `W1 sqrt(size)` along simulated records
    /// of a law: the factor itself, without a bridge.
    fn simulated(law: &ContinuousLaw, size: usize, steps: usize, records: usize) -> f64 {
        let distance = LawDistance::new(law.clone(), 1.0, size..size + steps);
        let of_record = |index: usize| {
            let mut generator = stream(8, "records", size, index);
            let (mut sample, mut largest, mut first) = (Vec::<Placed>::new(), 0.0_f64, None);
            for count in 1..size + steps {
                distance.learn(&mut sample, [distance.place(law.draw(&mut generator), 1.0)]);
                if count >= size {
                    let found = distance.distance(&sample) * (count as f64).sqrt();
                    first.get_or_insert(found);
                    largest = largest.max(found);
                }
            }
            (first.unwrap(), largest)
        };
        let (mut first, mut largest): (Vec<f64>, Vec<f64>) = (0..records).map(of_record).unzip();
        let [first, largest] = [&mut first, &mut largest].map(|values| {
            values.sort_by(f64::total_cmp);
            interpolated_quantile(values, 0.9)
        });
        largest / first
    }

    fn law_of(law: &ContinuousLaw, size: usize) -> EmpiricalDistribution {
        let values: Vec<f64> = (0..size).map(|cell| law.quantile((cell as f64 + 0.5) / size as f64)).collect();
        EmpiricalDistribution::new(&values)
    }

    #[test]
    fn the_factor_restores_the_level_that_many_steps_miss() {
        let normal = ContinuousLaw::mixture(vec![(1.0, 0.01, 0.1)]);
        let student = ContinuousLaw::StudentT { location: 0.0, scale: 0.1, degrees_of_freedom: 4.0 };
        // The factors of normal laws by code outside the project, which draws records and integrates |F_n - F|. Their
        // standard errors are at most 0.005.
        for (size, steps, expected) in [(20, 10, 1.158), (60, 12, 1.108), (240, 12, 1.056), (240, 120, 1.192)] {
            let found = all_steps_factor(&law_of(&normal, size), steps, 20_000, 0.1, 1);
            println!("{size} {steps}: {found} {expected}");
            // Three standard errors: 0.5 % by 20,000 paths, and 0.4 % of the figure.
            assert!((found / expected - 1.0).abs() < 0.02, "{size} {steps}: {found} {expected}");
        }
        for (law, size, steps) in [(&normal, 20, 10), (&student, 60, 12), (&student, 60, 60)] {
            let (found, expected) =
                (all_steps_factor(&law_of(law, size), steps, 8000, 0.1, 2), simulated(law, size, steps, 8000));
            println!("{size} {steps}: {found} {expected}");
            // Three standard errors of two simulations of 8,000, each 0.7 % at most.
            assert!((found / expected - 1.0).abs() < 0.03, "{size} {steps}: {found} {expected}");
        }
    }

    #[test]
    fn one_step_needs_no_factor_and_more_steps_need_more() {
        let law = law_of(&ContinuousLaw::mixture(vec![(1.0, 0.0, 0.1)]), 30);
        let factors = [1, 2, 10, 40].map(|steps| all_steps_factor(&law, steps, 500, 0.1, 3));
        assert_eq!(factors[0], 1.0);
        // More steps on the same paths cannot lower a maximum.
        assert!(factors.is_sorted_by(|fewer, more| fewer < more), "{factors:?}");
    }

    #[test]
    fn cells_keep_the_mean_of_the_statistic() {
        // The mean of |B(t)| is deviation(t) sqrt(2 / pi), so the mean statistic is a sum over the gaps.
        for size in [2, 3, 64, 65, 1000] {
            let law = law_of(&ContinuousLaw::mixture(vec![(1.0, 0.0, 0.1)]), size);
            let gaps = law.atoms().windows(2).enumerate();
            let exact: f64 =
                gaps.map(|(at, pair)| (pair[1] - pair[0]) * deviation((at + 1) as f64 / size as f64)).sum();
            let weights = weights(&law);
            let cells = (weights.len() + 1) as f64;
            let found: f64 =
                weights.iter().enumerate().map(|(at, weight)| weight * deviation((at + 1) as f64 / cells)).sum();
            // Equal up to rounding.
            assert!((found / exact - 1.0).abs() < 1e-12, "{size}: {found} {exact}");
        }
    }
}
