//! The posterior mean at points that differ in the first input alone.

use std::f64::consts::FRAC_1_SQRT_2;

use crate::numerics::gp::GpMean;
use crate::numerics::gp::matern;
use crate::numerics::statistics::summary::range;

/// Largest distance between the points, in length scales, over which the mean is interpolated.
const LONGEST: f64 = 0.5;
/// Places where the mean is evaluated, as shares of the distance: the zeros of a Chebyshev polynomial.
const PLACES: [f64; 2] = [0.5 - 0.5 * FRAC_1_SQRT_2, 0.5 + 0.5 * FRAC_1_SQRT_2];

impl GpMean {
    /// Returns m of every function at points that differ from `query` in the first input alone, whose values are
    /// `firsts`: point by point, function by function.
    ///
    /// Three and more points within half a length scale are interpolated by the cubic with the mean's values and
    /// derivatives at two places. Over a distance of h length scales it errs by at most h^4 / 1536 times the largest
    /// fourth derivative per length scale. Cost O(n (d + 4 functions)), and O(n (d + points functions)) over longer
    /// distances.
    /// Checked by: tests/solver/gp.rs, means_along_an_input_are_those_at_its_points.
    pub fn means_along_first(&self, query: &[f64], firsts: &[f64]) -> Vec<f64> {
        let n = self.input_count();
        let (mut others, mut values, mut derivatives) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        self.squared_distances(query, 1..query.len(), &mut others);
        let column = &self.inputs.as_slice()[..n];
        let points: Vec<f64> = firsts.iter().map(|first| first / self.lengthscales[0]).collect();
        let [low, high] = range(points.iter().copied());
        let distance = high - low;
        let interpolates = points.len() > PLACES.len() && distance > 0.0 && distance <= LONGEST;
        let mut means = Vec::with_capacity(points.len() * self.weights.len());
        if !interpolates {
            for point in points {
                matern::matern_along(column, point, &others, &mut values, &mut derivatives);
                means.extend(self.weighted(&values));
            }
            return means;
        }
        let [from, to] = PLACES.map(|share| low + share * distance);
        let [start, end] = [from, to].map(|place| {
            matern::matern_along(column, place, &others, &mut values, &mut derivatives);
            self.weighted(&values).zip(self.weighted(&derivatives)).collect::<Vec<(f64, f64)>>()
        });
        for point in points {
            let [at_start, slope_at_start, at_end, slope_at_end] = hermite((point - from) / (to - from), to - from);
            means.extend(
                start.iter().zip(&end).map(|((m0, d0), (m1, d1))| {
                    (at_start * m0 + slope_at_start * d0) + (at_end * m1 + slope_at_end * d1)
                }),
            );
        }
        means
    }
}

/// Returns the weights of value and derivative at the start, and at the end, of an interval of length `between` in the
/// cubic at share `t` of it, which may lie outside.
fn hermite(t: f64, between: f64) -> [f64; 4] {
    let rest = 1.0 - t;
    [(1.0 + 2.0 * t) * rest * rest, between * t * rest * rest, t * t * (3.0 - 2.0 * t), -between * t * t * rest]
}
