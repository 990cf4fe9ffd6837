//! The Wasserstein-1 distance from a sample to a continuous law.
//!
//!   W1 = integral over u in (0, 1) of |F_n^{-1}(u) - F^{-1}(u)|
//!
//! On the cell (a, b) of one of n sorted values z the sample's quantile function is z, and the law's crosses it once, at
//! F(z). With B(u) = E[Z; Z <= F^{-1}(u)] and c = F(z) clamped to [a, b] the cell contributes, exactly,
//!
//!   z (2c - a - b) + B(a) + B(b) - 2 B(c)
//!
//! so all it takes is F and B at the values, once each, and B at the ends of the cells, once a sample size.

use std::collections::HashMap;

use super::law::ContinuousLaw;

/// A value, and where the law puts it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// The value itself.
    pub value: f64,
    /// F(value).
    share: f64,
    /// E[Z; Z <= value].
    partial_mean: f64,
}

/// Distances to one law, prepared for some sample sizes.
pub struct LawDistance {
    law: ContinuousLaw,
    /// `ends[n][i]` is B(i/n), i = 0 to n.
    ends: HashMap<usize, Vec<f64>>,
}

impl LawDistance {
    /// Cost: a quantile of the law for each value of each sample size.
    pub fn new(law: ContinuousLaw, sample_sizes: impl IntoIterator<Item = usize>) -> Self {
        let ends = |size: usize| {
            let inner = (1..size).map(|cell| law.cumulative(law.quantile(cell as f64 / size as f64)).1);
            std::iter::once(0.0).chain(inner).chain([law.mean()]).collect()
        };
        let ends = sample_sizes.into_iter().map(|size| (size, ends(size))).collect();
        LawDistance { law, ends }
    }

    /// The value with what the distance needs to know of it.
    pub fn place(&self, value: f64) -> Placed {
        let (share, partial_mean) = self.law.cumulative(value);
        Placed { value, share, partial_mean }
    }

    /// The distance of the empirical law of `sample`, ascending by value; not a number where its size was not prepared.
    /// Cost O(n).
    pub fn distance(&self, sample: &[Placed]) -> f64 {
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
}

/// Puts one more value in its place.
pub fn insert(sample: &mut Vec<Placed>, placed: Placed) {
    let position = sample.partition_point(|other| other.value.total_cmp(&placed.value).is_le());
    sample.insert(position, placed);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distance(law: ContinuousLaw, sample: &[f64]) -> f64 {
        let distances = LawDistance::new(law, [sample.len()]);
        let mut placed = Vec::new();
        sample.iter().for_each(|&value| insert(&mut placed, distances.place(value)));
        distances.distance(&placed)
    }

    fn normal() -> ContinuousLaw {
        ContinuousLaw::GaussianMixture(vec![(1.0, 0.0, 1.0)])
    }

    #[test]
    fn one_point_is_at_its_mean_absolute_deviation() {
        // E|N - a| = a (2 Phi(a) - 1) + 2 phi(a).
        let (phi, cdf) = (crate::numerics::student::normal_density, crate::numerics::student::normal_cdf);
        for a in [0.0, 0.7, -2.0, 5.0] {
            assert!((distance(normal(), &[a]) - (a * (2.0 * cdf(a) - 1.0) + 2.0 * phi(a))).abs() < 1e-14);
        }
    }

    #[test]
    fn two_points_far_out_are_at_the_distance_of_the_halves() {
        // Each half of the normal moves out whole: a - E|N|.
        let expected = 9.0 - (2.0 / std::f64::consts::PI).sqrt();
        assert!((distance(normal(), &[-9.0, 9.0]) - expected).abs() < 1e-12);
    }

    #[test]
    fn mixtures_and_student_agree_with_adaptive_quadrature() {
        // scipy.integrate.quad of |F_n - F| between the atoms and the crossings of F.
        let (first, second) = (0.016_f64.sqrt(), 0.00625_f64.sqrt());
        let mixture = ContinuousLaw::GaussianMixture(vec![(0.4, 0.006, first), (0.6, 0.016, second)]);
        let student = ContinuousLaw::StudentT { location: 0.01, scale: 0.05, degrees_of_freedom: 4.0 };
        let sample = [0.02, -0.05, 0.11, 0.04, 0.04, -0.3, 0.2];
        for (law, expected) in [(mixture, 0.04577174826500554), (student, 0.062448282185574695)] {
            let found = distance(law, &sample);
            assert!((found - expected).abs() < 1e-9, "{found} against {expected}");
        }
    }
}
