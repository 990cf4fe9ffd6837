//! The Wasserstein-1 distance from a sample to a continuous law.
//!
//!   W1 = integral over u in (0, 1) of |F_n^{-1}(u) - F^{-1}(u)|
//!
//! On the cell (a, b) of one of n sorted values z the sample's quantile function is z, and the law's crosses it once,
//! at F(z). With B(u) = E[Z; Z <= F^{-1}(u)] and c = F(z) clamped to [a, b], the cell contributes exactly
//!
//!   z (2c - a - b) + B(a) + B(b) - 2 B(c)
//!
//! So F and B are needed once at each value, and B at the ends of the cells once for each sample size. If newer values
//! weigh more, every sample has different cells, and the same distance is
//!
//!   W1 = integral over z of |F_n(z) - F(z)|
//!
//! Between adjacent values a and b, F_n is c. Let G(z) = z F(z) - B(z), the integral of F up to z. The contribution is
//! G(b) - G(a) - c (b - a), or its negative. If F crosses c at q, it is 2 (c q - G(q)) + G(a) + G(b) - c (a + b), which
//! changes with the square of an error of q.

use std::collections::HashMap;

use crate::numerics::law::ContinuousLaw;

/// Tolerance of a crossing, as a share of the probability between its values: its square is lost in rounding.
const CROSSED: f64 = 1e-7;
const CROSSING_STEPS: usize = 60;

/// A value with its position in the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// The value itself.
    pub value: f64,
    /// F(value).
    share: f64,
    /// E[Z; Z <= value].
    partial_mean: f64,
    /// Weight in the sample; the weight of one return is 1 while it is the newest.
    weight: f64,
}

impl Placed {
    /// Returns G(value).
    fn integral(&self) -> f64 {
        self.value * self.share - self.partial_mean
    }
}

/// Distances to one law, prepared for some sample sizes.
pub struct LawDistance {
    law: ContinuousLaw,
    /// The factor by which a value's weight shrinks when another value is added.
    retention: f64,
    /// `ends[n][i]` is B(i/n), i = 0 to n; empty if weights decay.
    ends: HashMap<usize, Vec<f64>>,
}

impl LawDistance {
    /// Prepares distances of samples with this retention. At retention 1 the cost is a quantile of the law for each
    /// value of each sample size. If no size is prepared, or the retention is below 1, values may have any weight.
    pub fn new(law: ContinuousLaw, retention: f64, sample_sizes: impl IntoIterator<Item = usize>) -> Self {
        let ends = |size: usize| {
            let inner = (1..size).map(|cell| law.cumulative(law.quantile(cell as f64 / size as f64)).1);
            std::iter::once(0.0).chain(inner).chain([law.mean()]).collect()
        };
        let sizes = sample_sizes.into_iter().filter(|_| retention >= 1.0);
        let ends = sizes.map(|size| (size, ends(size))).collect();
        LawDistance { law, retention, ends }
    }

    /// Returns a value of this weight with the numbers that the distance needs.
    pub fn place(&self, value: f64, weight: f64) -> Placed {
        let (share, partial_mean) = self.law.cumulative(value);
        Placed { value, share, partial_mean, weight }
    }

    /// Adds the parts of one more return to `sample`, which is ascending by value. Cost O(n) for each value.
    pub fn learn(&self, sample: &mut Vec<Placed>, placed: impl IntoIterator<Item = Placed>) {
        sample.iter_mut().for_each(|other| other.weight *= self.retention);
        for placed in placed {
            let position = sample.partition_point(|other| other.value.total_cmp(&placed.value).is_le());
            sample.insert(position, placed);
        }
    }

    /// Returns the distance of the empirical law of `sample`, ascending by value; NaN if its size was not prepared.
    /// Cost O(n), and if weights differ about sqrt(n) values of F and B.
    pub fn distance(&self, sample: &[Placed]) -> f64 {
        if self.ends.is_empty() {
            return self.weighted(sample);
        }
        let Some(ends) = self.ends.get(&sample.len()) else { return f64::NAN };
        let size = sample.len() as f64;
        let cell = |(index, placed): (usize, &Placed)| {
            let (a, b) = (index as f64 / size, (index + 1) as f64 / size);
            let (c, below) = match placed.share {
                share if share <= a => (a, ends[index]),
                share if share >= b => (b, ends[index + 1]),
                share => (share, placed.partial_mean),
            };
            placed.value * (2.0 * c - a - b) + ends[index] + ends[index + 1] - 2.0 * below
        };
        sample.iter().enumerate().map(cell).sum()
    }

    /// Returns the same distance by the integral over the values.
    fn weighted(&self, sample: &[Placed]) -> f64 {
        let (Some(first), Some(last)) = (sample.first(), sample.last()) else { return f64::NAN };
        let total: f64 = sample.iter().map(|placed| placed.weight).sum();
        let mut below = 0.0;
        let between = sample.windows(2).map(|pair| {
            let (a, b) = (&pair[0], &pair[1]);
            below += a.weight;
            let level = below / total;
            let above = b.integral() - a.integral() - level * (b.value - a.value);
            if level <= a.share {
                above
            } else if level >= b.share {
                -above
            } else {
                2.0 * self.crossing(a, b, level) + a.integral() + b.integral() - level * (a.value + b.value)
            }
        });
        let between: f64 = between.sum();
        first.integral() + between + self.law.mean() - last.partial_mean - last.value * (1.0 - last.share)
    }

    /// Returns c q - G(q) with F(q) = c, between two values, by false position (Illinois).
    fn crossing(&self, a: &Placed, b: &Placed, level: f64) -> f64 {
        let (mut low, mut high) = ((a.value, a.share - level), (b.value, b.share - level));
        let enough = CROSSED * (b.share - a.share);
        let mut found = a.value * level - a.integral();
        for _ in 0..CROSSING_STEPS {
            let at = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
            let (share, partial_mean) = self.law.cumulative(at);
            let off = share - level;
            found = at * (level - share) + partial_mean;
            if off.abs() <= enough {
                break;
            }
            if off < 0.0 {
                (low, high.1) = ((at, off), 0.5 * high.1);
            } else {
                (high, low.1) = ((at, off), 0.5 * low.1);
            }
        }
        found
    }
}

/// Returns the distance of the laws of two samples, ascending by value, with their weights. Cost O(n).
///
/// Checked by: `tests/solver/evaluate.rs::the_share_inside_the_first_ball_is_what_sorted_returns_give`.
pub fn distance_of_samples(one: &[Placed], other: &[Placed]) -> f64 {
    let masses = |sample: &[Placed]| {
        let total: f64 = sample.iter().map(|placed| placed.weight).sum();
        sample.iter().map(|placed| (placed.value, placed.weight / total)).collect::<Vec<_>>()
    };
    distance_of_laws(masses(one), masses(other))
}

/// Returns the distance of two laws, each given by its atoms, ascending, with their masses. Cost O(atoms).
pub fn distance_of_laws(one: impl IntoIterator<Item = (f64, f64)>, other: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    let other = other.into_iter().map(|(atom, mass)| (atom, -mass));
    let mut apart: Vec<(f64, f64)> = one.into_iter().chain(other).collect();
    // A stable sort merges two ascending parts in one pass.
    apart.sort_by(|left, right| left.0.total_cmp(&right.0));
    let (atoms, apart): (Vec<f64>, Vec<f64>) = apart.into_iter().unzip();
    distance_of_masses(&atoms, &apart)
}

/// Returns the distance of two laws on the same ascending atoms: the integral of the difference of their distribution
/// functions. `apart` is the difference of their masses at each atom. Cost O(atoms).
///
/// Checked by: `src/numerics/bridge/calibration.rs::the_law_in_atoms_is_the_smoothed_one`.
pub fn distance_of_masses(atoms: &[f64], apart: &[f64]) -> f64 {
    let mut above = 0.0;
    let between = atoms.windows(2).zip(apart).map(|(pair, apart)| {
        above += apart;
        above.abs() * (pair[1] - pair[0])
    });
    between.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distance(law: ContinuousLaw, sample: &[f64]) -> f64 {
        let distances = LawDistance::new(law, 1.0, [sample.len()]);
        let mut placed = Vec::new();
        sample.iter().for_each(|&value| distances.learn(&mut placed, [distances.place(value, 1.0)]));
        let found = distances.distance(&placed);
        let other_way = distances.weighted(&placed);
        // About a dozen roundings of numbers up to 9.
        assert!((found - other_way).abs() < 1e-12, "{found} and {other_way}");
        found
    }

    #[test]
    fn a_value_of_twice_the_weight_is_two_values() {
        // Added in this order at a retention of 1/2: weights 1/4, 1/2 and 1 equal one, two and four values.
        let distances = LawDistance::new(normal(), 0.5, []);
        let mut placed = Vec::new();
        [0.7, -0.4, 1.3].into_iter().for_each(|value| distances.learn(&mut placed, [distances.place(value, 1.0)]));
        let expected = distance(normal(), &[0.7, -0.4, -0.4, 1.3, 1.3, 1.3, 1.3]);
        let found = distances.distance(&placed);
        assert!((found - expected).abs() < 1e-12, "{found} against {expected}");
    }

    #[test]
    fn a_value_in_parts_weighs_what_its_parts_do() {
        let distances = LawDistance::new(normal(), 1.0, []);
        let mut placed = Vec::new();
        let parts = |low: f64, high: f64| [distances.place(high, 0.75), distances.place(low, 0.25)];
        distances.learn(&mut placed, parts(-0.4, 1.3));
        distances.learn(&mut placed, parts(0.7, 0.2));
        let expected = distance(normal(), &[-0.4, 1.3, 1.3, 1.3, 0.7, 0.2, 0.2, 0.2]);
        let found = distances.distance(&placed);
        assert!((found - expected).abs() < 1e-12, "{found} against {expected}");
    }

    fn normal() -> ContinuousLaw {
        ContinuousLaw::mixture(vec![(1.0, 0.0, 1.0)])
    }

    #[test]
    fn one_point_is_at_its_mean_absolute_deviation() {
        // E|N - a| = a (2 Phi(a) - 1) + 2 phi(a).
        let (phi, cdf) = (crate::numerics::law::student::normal_density, crate::numerics::law::student::normal_cdf);
        for a in [0.0, 0.7, -2.0, 5.0] {
            assert!((distance(normal(), &[a]) - (a * (2.0 * cdf(a) - 1.0) + 2.0 * phi(a))).abs() < 1e-14);
        }
    }

    #[test]
    fn two_points_far_out_are_at_the_distance_of_the_halves() {
        // Each half of the normal moves out as a whole: a - E|N|.
        let expected = 9.0 - (2.0 / std::f64::consts::PI).sqrt();
        assert!((distance(normal(), &[-9.0, 9.0]) - expected).abs() < 1e-12);
    }

    #[test]
    fn mixtures_and_student_agree_with_adaptive_quadrature() {
        // scipy.integrate.quad of |F_n - F| between the atoms and the crossings of F.
        let (first, second) = (0.016_f64.sqrt(), 0.00625_f64.sqrt());
        let mixture = ContinuousLaw::mixture(vec![(0.4, 0.006, first), (0.6, 0.016, second)]);
        let student = ContinuousLaw::StudentT { location: 0.01, scale: 0.05, degrees_of_freedom: 4.0 };
        let sample = [0.02, -0.05, 0.11, 0.04, 0.04, -0.3, 0.2];
        for (law, expected) in [(mixture, 0.04577174826500554), (student, 0.062448282185574695)] {
            let found = distance(law, &sample);
            assert!((found - expected).abs() < 1e-9, "{found} against {expected}");
        }
    }
}
