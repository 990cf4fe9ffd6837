//! Laws that can be sampled and integrated against.
//!
//! Its modules hold empirical laws and their moments, and what is estimated from them.

pub mod concentration;
pub mod conditional;
pub mod confidence_region;
pub mod empirical;
pub mod exponential_mean;
pub mod law_distance;
pub mod moments;
pub mod student;
pub mod volatility;

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal, StudentT};

use crate::numerics::law::student::{normal_cdf, normal_density, student_cdf, student_density};

/// A continuous law on the line.
#[derive(Debug, Clone)]
pub enum ContinuousLaw {
    /// Made by [`ContinuousLaw::mixture`].
    GaussianMixture {
        /// (weight, mean, standard deviation); weights sum to 1.
        components: Vec<(f64, f64, f64)>,
        /// The cumulative weight up to and including each component.
        reached: Vec<f64>,
    },
    /// Location, scale, degrees of freedom.
    StudentT {
        /// The mean.
        location: f64,
        /// The factor of a standard t variable.
        scale: f64,
        /// Degrees of freedom, above 2.
        degrees_of_freedom: f64,
    },
}

/// Nodes of a standard normal component. The trapezoidal rule of step 1/4 on [-8, 8] is exact to rounding for
/// integrands that are smooth on the scale of the standard deviation.
const NORMAL_NODES: i32 = 32;
const NORMAL_STEP: f64 = 0.25;
/// The step of a coarser rule for mixtures with many components; the error is below 1e-12 for the density itself.
const COARSE_STEP: f64 = 0.5;
const MANY_COMPONENTS: usize = 16;

impl ContinuousLaw {
    /// Creates a mixture of normals with these (weight, mean, standard deviation); weights sum to 1.
    pub fn mixture(components: Vec<(f64, f64, f64)>) -> Self {
        let mut sum = 0.0;
        let weights = components.iter().map(|(weight, ..)| weight);
        let reached = weights.map(|weight| {
            sum += weight;
            sum
        });
        ContinuousLaw::GaussianMixture { reached: reached.collect(), components }
    }

    /// Creates the smoothed bootstrap of a weighted sample: a normal around each value, with Silverman's bandwidth at
    /// the effective size. Values are shrunk towards the mean so that the mean and variance are the sample's own.
    /// Source: Silverman (1986), section 6.4.1.
    pub fn smoothed_bootstrap(sample: &[f64], weights: &[f64]) -> Self {
        let total: f64 = weights.iter().sum();
        let weighted = || sample.iter().zip(weights);
        let mean = weighted().map(|(z, weight)| weight * z).sum::<f64>() / total;
        let variance = weighted().map(|(z, weight)| weight * (z - mean).powi(2)).sum::<f64>() / total;
        let size = total * total / weights.iter().map(|weight| weight * weight).sum::<f64>();
        let bandwidth = 1.06 * variance.sqrt() * size.powf(-0.2);
        let shrink = (1.0 + bandwidth * bandwidth / variance).sqrt().recip();
        let component = |(z, weight): (&f64, &f64)| (weight / total, mean + shrink * (z - mean), shrink * bandwidth);
        ContinuousLaw::mixture(weighted().map(component).collect())
    }

    /// Draws one value. Cost O(log components).
    pub fn draw(&self, generator: &mut impl Rng) -> f64 {
        match self {
            ContinuousLaw::GaussianMixture { components, reached } => {
                let uniform: f64 = generator.random();
                let normal: f64 = generator.sample(StandardNormal);
                // Rounding may leave the sum of all weights below the number drawn.
                let chosen = components.get(reached.partition_point(|&sum| sum <= uniform)).or(components.last());
                let (_, mean, deviation) = chosen.copied().unwrap_or((1.0, 0.0, 0.0));
                mean + deviation * normal
            }
            ContinuousLaw::StudentT { location, scale, degrees_of_freedom } => match StudentT::new(*degrees_of_freedom)
            {
                Ok(standard) => location + scale * standard.sample(generator),
                Err(_) => *location,
            },
        }
    }

    /// Returns `E[Z]`.
    pub fn mean(&self) -> f64 {
        match self {
            ContinuousLaw::GaussianMixture { components, .. } => components.iter().map(|c| c.0 * c.1).sum(),
            ContinuousLaw::StudentT { location, .. } => *location,
        }
    }

    /// Returns P(Z <= z), and the partial mean E[Z; Z <= z].
    pub fn cumulative(&self, z: f64) -> (f64, f64) {
        match self {
            ContinuousLaw::GaussianMixture { components, .. } => {
                let component = |(sum, mean_below): (f64, f64), &(weight, mean, deviation): &(f64, f64, f64)| {
                    let normal = (z - mean) / deviation;
                    let share = normal_cdf(normal);
                    (sum + weight * share, mean_below + weight * (mean * share - deviation * normal_density(normal)))
                };
                components.iter().fold((0.0, 0.0), component)
            }
            ContinuousLaw::StudentT { location, scale, degrees_of_freedom: freedom } => {
                let t = (z - location) / scale;
                let share = student_cdf(t, *freedom);
                let lower = (freedom + t * t) / (freedom - 1.0) * student_density(t, *freedom);
                (share, location * share - scale * lower)
            }
        }
    }

    /// Returns the z with P(Z <= z) = `share`, in (0, 1), to rounding, by bisection.
    pub fn quantile(&self, share: f64) -> f64 {
        let (mean, mut reach) = (self.mean(), 1.0);
        while self.cumulative(mean - reach).0 > share || self.cumulative(mean + reach).0 < share {
            reach *= 2.0;
        }
        let (mut low, mut high) = (mean - reach, mean + reach);
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                return middle;
            }
            if self.cumulative(middle).0 < share { low = middle } else { high = middle }
        }
    }

    /// Returns a quadrature: ascending atoms and positive masses that sum to 1. It uses the trapezoidal rule, in z / sd
    /// for normals and in asinh of z / scale for Student's t. For such densities it converges faster than any power of
    /// the step. Source: Trefethen and Weideman (2014), SIAM Review 56.
    pub fn quadrature(&self) -> (Vec<f64>, Vec<f64>) {
        let mut nodes: Vec<(f64, f64)> = Vec::new();
        match self {
            ContinuousLaw::GaussianMixture { components, .. } => {
                let step = if components.len() > MANY_COMPONENTS { COARSE_STEP } else { NORMAL_STEP };
                let reach = (NORMAL_NODES as f64 * NORMAL_STEP / step) as i32;
                for &(weight, mean, deviation) in components {
                    for index in -reach..=reach {
                        let normal = index as f64 * step;
                        nodes.push((mean + deviation * normal, weight * (-0.5 * normal * normal).exp()));
                    }
                }
            }
            ContinuousLaw::StudentT { location, scale, degrees_of_freedom } => {
                const NODES: i32 = 200;
                const STEP: f64 = 0.05;
                for index in -NODES..=NODES {
                    let parameter = index as f64 * STEP;
                    let t = parameter.sinh();
                    let log_density = -0.5 * (degrees_of_freedom + 1.0) * (t * t / degrees_of_freedom).ln_1p();
                    nodes.push((location + scale * t, log_density.exp() * parameter.cosh()));
                }
            }
        }
        let total: f64 = nodes.iter().map(|node| node.1).sum();
        nodes.retain(|node| node.1 > 1e-18 * total);
        nodes.sort_by(|left, right| left.0.total_cmp(&right.0));
        let total: f64 = nodes.iter().map(|node| node.1).sum();
        nodes.into_iter().map(|(atom, mass)| (atom, mass / total)).unzip()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::machine::streams::stream;

    #[test]
    fn quadrature_has_the_moments_of_the_law() {
        let mixture = ContinuousLaw::mixture(vec![(0.4, 0.006, 0.016_f64.sqrt()), (0.6, 0.016, 0.00625_f64.sqrt())]);
        let (atoms, masses) = mixture.quadrature();
        let exact: f64 = 0.4 * (0.006_f64 + 0.008).exp() + 0.6 * (0.016_f64 + 0.003125).exp();
        let sum: f64 = atoms.iter().zip(&masses).map(|(z, p)| p * z.exp()).sum();
        // Trapezoidal rule on a Gaussian: aliasing error exp(-2 pi^2 / h^2) is below rounding, 1e-15 per node.
        assert!((sum - exact).abs() < 1e-13);
        let student = ContinuousLaw::StudentT { location: 0.01, scale: 0.05, degrees_of_freedom: 6.0 };
        let (atoms, masses) = student.quadrature();
        let variance: f64 = atoms.iter().zip(&masses).map(|(z, p)| p * (z - 0.01).powi(2)).sum();
        // The variance of t is nu / (nu - 2); the tails beyond sinh(10) carry less than 1e-12 of it.
        assert!((variance / (0.05 * 0.05 * 1.5) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_smoothed_bootstrap_keeps_mean_and_variance() {
        // Computed by hand; the second has mean (0.04 + 2 x 0.01) / 3 and variance 0.0002.
        for (sample, weights, expected_mean, expected_variance) in [
            (&[0.02, -0.05, 0.11, 0.04, 0.07][..], &[1.0; 5][..], 0.038, 0.002_856),
            (&[0.04, 0.01], &[0.5, 1.0], 0.02, 0.0002),
        ] {
            let law = ContinuousLaw::smoothed_bootstrap(sample, weights);
            let mut generator = stream(3, "test", 0, 0);
            let draws: Vec<f64> = (0..200_000).map(|_| law.draw(&mut generator)).collect();
            let mean = draws.iter().sum::<f64>() / draws.len() as f64;
            let variance = draws.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / draws.len() as f64;
            // Standard deviation 0.053 at most; four standard errors of 200,000 draws are 0.00048 for the mean.
            assert!((mean - expected_mean).abs() < 5e-4, "{mean}");
            assert!((variance / expected_variance - 1.0).abs() < 0.02, "{variance}");
        }
    }
}
