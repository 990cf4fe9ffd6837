//! The joint confidence region for the mean and the variance of a normal sample, and its worst law.
//!
//!   C = { (mu, s2) : n (mu - m)^2 / v + n (s2 - v)^2 / (2 v^2) <= kappa, s2 >= 0 },  kappa = -2 ln(alpha)
//!
//! m and v are the maximum-likelihood estimates from n values, and n diag(1/v, 1/(2 v^2)) is the information at them.
//! kappa is the (1 - alpha)-quantile of chi-square with two degrees of freedom, so C contains the truth with
//! probability 1 - alpha as n grows. Source: Bielecki, Chen, Cialenco, Cousin and Jeanblanc (2019), SIAM J. Control
//! Optim. 57, with the estimates in the denominators as there. The region is cut at zero variance, which the ellipse
//! crosses if n < 2 kappa.
//!
//! The expectation of a fixed payoff under N(mu, s2), as a function of mu and s2, solves the heat equation with s2 as
//! time. By its maximum principle the least value over C lies on the boundary, so only one angle has to be searched.

use std::f64::consts::TAU;

use crate::numerics::search::minimise::maximise_concave_scalar;

/// Number of angles that are tried before the search around each local minimum.
const ANGLES: usize = 48;
const ANGLE_TOLERANCE: f64 = 1e-6;
/// Expectations that differ by less than this share of their size count as equal.
const ROUNDING: f64 = 1e-14;
/// Half-width of the quadrature in standard deviations: 1e-15 of the mass lies outside.
const REACH: f64 = 8.0;
/// Nodes on either side of the mean. The trapezoidal rule with step 1/4 is exact to rounding for a payoff that is
/// smooth on the scale of the standard deviation. It is third order in the step where the payoff's curvature jumps.
const NODES: i32 = 32;
/// Share of the radius by which the difference quotient of a multiplier changes it.
const RADIUS_STEP: f64 = 1e-3;

/// A normal law, or the point mass at the mean if the variance is 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalLaw {
    /// The mean, mu.
    pub mean: f64,
    /// The variance s2, at least 0.
    pub variance: f64,
}

/// The law of a region with the least expected payoff.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorstNormal {
    /// The law.
    pub law: NormalLaw,
    /// Expected payoff under the law.
    pub expectation: f64,
    /// Position on the boundary: an angle of [`ConfidenceRegion::at`].
    pub angle: f64,
}

/// The region around an estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConfidenceRegion {
    /// The maximum-likelihood estimate (m, v), with v positive.
    pub estimate: NormalLaw,
    /// `sqrt(kappa / n)`: half the width in the mean, in standard deviations.
    pub radius: f64,
}

impl NormalLaw {
    /// Returns the nodes of the quadrature, ascending. Their masses are those of [`Quadrature`].
    pub fn nodes(self) -> impl Iterator<Item = f64> {
        let step = REACH / f64::from(NODES) * self.variance.sqrt();
        (-NODES..=NODES).map(move |index| self.mean + f64::from(index) * step)
    }
}

/// The masses of a normal law's nodes, which are the same for every law.
pub struct Quadrature {
    masses: Vec<f64>,
}

impl Default for Quadrature {
    fn default() -> Self {
        let step = REACH / f64::from(NODES);
        let mut masses: Vec<f64> =
            (-NODES..=NODES).map(|index| (-0.5 * (f64::from(index) * step).powi(2)).exp()).collect();
        let total: f64 = masses.iter().sum();
        masses.iter_mut().for_each(|mass| *mass /= total);
        Quadrature { masses }
    }
}

impl Quadrature {
    /// Returns the number of nodes of a law.
    pub fn count(&self) -> usize {
        self.masses.len()
    }

    /// Returns the expectation of a payoff that is given at the nodes of a law.
    pub fn expectation(&self, payoff: &[f64]) -> f64 {
        self.masses.iter().zip(payoff).map(|(mass, value)| mass * value).sum()
    }
}

/// Returns `sqrt(kappa / n)` at miscoverage `alpha` in (0, 1] and sample size n; for a weighted sample n is its
/// effective size.
pub fn radius(alpha: f64, sample_size: f64) -> f64 {
    (-2.0 * alpha.ln() / sample_size).max(0.0).sqrt()
}

impl ConfidenceRegion {
    /// Returns the angles at which [`Self::worst`] needs the expectation first; only one if the region is a point.
    pub fn angles(&self) -> impl Iterator<Item = f64> {
        let count = if self.radius > 0.0 { ANGLES } else { 1 };
        (0..count).map(|index| TAU * index as f64 / ANGLES as f64)
    }

    /// Returns the law on the boundary at `angle`: right of the estimate at 0, and above it (larger variance) at a
    /// quarter turn.
    ///
    ///   mu = m + radius sqrt(v) cos(angle),  s2 = max(v + radius sqrt(2) v sin(angle), 0)
    ///
    /// If the ellipse runs below zero variance, its points are moved up to the segment that cuts it.
    pub fn at(&self, angle: f64) -> NormalLaw {
        self.scaled(1.0, angle)
    }

    /// Returns the law on the ellipse of `share` times the radius.
    fn scaled(&self, share: f64, angle: f64) -> NormalLaw {
        let NormalLaw { mean, variance } = self.estimate;
        let reach = share * self.radius;
        NormalLaw {
            mean: mean + reach * variance.sqrt() * angle.cos(),
            variance: (variance * (1.0 + reach * 2.0_f64.sqrt() * angle.sin())).max(0.0),
        }
    }

    /// Returns the largest variance in the region.
    pub fn largest_variance(&self) -> f64 {
        self.estimate.variance * (1.0 + self.radius * 2.0_f64.sqrt())
    }

    /// Returns an interval that contains the nodes of every law in the region.
    pub fn window(&self) -> (f64, f64) {
        let NormalLaw { mean, variance } = self.estimate;
        let reach = self.radius * variance.sqrt() + REACH * self.largest_variance().sqrt();
        (mean - reach, mean + reach)
    }

    /// Finds the worst law by a search around every local minimum of `tried`, the expectations at [`Self::angles`].
    ///
    /// The angle is accurate to 1e-6, and the expectation to its square times the curvature. Cost: about ten
    /// expectations.
    pub fn worst(&self, tried: &[f64], expectation: impl Fn(NormalLaw) -> f64) -> WorstNormal {
        let spacing = TAU / ANGLES as f64;
        let start = WorstNormal { law: self.at(0.0), expectation: tried[0], angle: 0.0 };
        let least = tried.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = tried.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if tried.len() < ANGLES || largest - least <= ROUNDING * largest.abs() {
            return start;
        }
        let mut worst = WorstNormal { expectation: f64::INFINITY, ..start };
        for index in 0..ANGLES {
            let (before, after) = (tried[(index + ANGLES - 1) % ANGLES], tried[(index + 1) % ANGLES]);
            if tried[index] < before && tried[index] <= after {
                let middle = index as f64 * spacing;
                let negated = |angle: f64| -expectation(self.at(angle));
                let (angle, value) =
                    maximise_concave_scalar(negated, middle - spacing, middle + spacing, ANGLE_TOLERANCE);
                if -value < worst.expectation {
                    worst = WorstNormal { law: self.at(angle), expectation: -value, angle };
                }
            }
        }
        worst
    }

    /// Returns the expectation lost per unit of radius. The derivative at the worst angle is the derivative of the
    /// minimum, so a central difference at this angle suffices, to 1e-6 relative.
    pub fn multiplier(&self, worst: &WorstNormal, expectation: impl Fn(NormalLaw) -> f64) -> f64 {
        if self.radius <= 0.0 {
            return 0.0;
        }
        let at = |share: f64| expectation(self.scaled(share, worst.angle));
        ((at(1.0 - RADIUS_STEP) - at(1.0 + RADIUS_STEP)) / (2.0 * RADIUS_STEP * self.radius)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Function = fn(f64) -> f64;
    type Expectation = fn(f64, f64) -> f64;

    /// Payoffs and their expectations under N(mu, s2) in closed form.
    const PAYOFFS: [(Function, Expectation); 4] = [
        (|z| z.exp(), |mu, s2| (mu + 0.5 * s2).exp()),
        (|z| -(-3.0 * z).exp(), |mu, s2| -(-3.0 * mu + 4.5 * s2).exp()),
        (|z| (z - 0.02).powi(2), |mu, s2| (mu - 0.02).powi(2) + s2),
        (|z| (9.0 * z).cos(), |mu, s2| (-40.5 * s2).exp() * (9.0 * mu).cos()),
    ];

    fn region(size: f64) -> ConfidenceRegion {
        ConfidenceRegion { estimate: NormalLaw { mean: 0.03, variance: 0.01 }, radius: radius(0.1, size) }
    }

    fn expectation(payoff: Function, law: NormalLaw) -> f64 {
        let values: Vec<f64> = law.nodes().map(payoff).collect();
        Quadrature::default().expectation(&values)
    }

    #[test]
    fn the_worst_of_the_boundary_is_the_worst_of_the_whole_region() {
        // With nine returns or fewer the ellipse crosses zero variance.
        for size in [3, 8, 10, 20, 500] {
            let region = region(f64::from(size));
            for (payoff, exact) in PAYOFFS {
                let tried: Vec<f64> = region.angles().map(|angle| expectation(payoff, region.at(angle))).collect();
                let worst = region.worst(&tried, |law| expectation(payoff, law));
                assert!((exact(worst.law.mean, worst.law.variance) - worst.expectation).abs() < 1e-13);
                let (width, height) = (region.radius * 0.1, region.radius * 2.0_f64.sqrt() * 0.01);
                for row in -400..=400 {
                    for column in -400..=400 {
                        let (x, y) = (f64::from(column) / 400.0, f64::from(row) / 400.0);
                        let (mu, s2) = (0.03 + width * x, 0.01 + height * y);
                        if x * x + y * y <= 1.0 && s2 >= 0.0 {
                            assert!(exact(mu, s2) >= worst.expectation - 1e-12, "{size}: {mu} {s2} below {worst:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn the_level_is_that_of_chi_square_with_two_degrees_of_freedom() {
        // P(chi-square(2) > 4.605170) = 0.1.
        assert!((radius(0.1, 20.0).powi(2) * 20.0 - 4.605_170_185_988_09).abs() < 1e-12);
        assert_eq!(radius(1.0, 20.0), 0.0);
        assert_eq!(region(20.0).at(0.0), NormalLaw { mean: 0.03 + radius(0.1, 20.0) * 0.1, variance: 0.01 });
    }
}
