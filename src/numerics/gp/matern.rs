//! The Matern-5/2 kernel with a length scale for each dimension, over contiguous slices.
//!
//! Every loop is compiled once for each instruction set, and the version is chosen at run time. Fused operations are
//! written as such and every sum has `LANES` fixed accumulators, so the bits of a result do not depend on the
//! processor.

use crate::numerics::machine::dispatch::dispatched;
use crate::numerics::machine::elementary::exp;

/// Accumulators of a sum: two 256-bit vectors of four, or one of eight.
pub(in crate::numerics) const LANES: usize = 8;
/// Values staged on the stack between the two passes of a kernel sum; a multiple of `LANES`.
const BLOCK: usize = 256;
/// Returns the correlation at squared scaled distance d2: (1 + r + r^2/3) exp(-r) with r = sqrt(5 d2).
#[inline(always)]
fn correlation(squared: f64) -> f64 {
    let r = (5.0 * squared).sqrt();
    (r * (1.0 / 3.0)).mul_add(r, 1.0 + r) * exp(-r)
}

/// Returns (5/3)(1 + r) exp(-r): minus twice the derivative of [`correlation`] with respect to d2.
#[inline(always)]
fn steepness(squared: f64) -> f64 {
    let r = (5.0 * squared).sqrt();
    (5.0 / 3.0) * (1.0 + r) * exp(-r)
}

/// Adds left_j right_j to accumulator j mod `LANES`. Every call but the last must get whole blocks.
#[inline(always)]
fn accumulate(lanes: &mut [f64; LANES], left: &[f64], right: &[f64]) {
    let (left_blocks, right_blocks) = (left.chunks_exact(LANES), right.chunks_exact(LANES));
    let tails = (left_blocks.remainder(), right_blocks.remainder());
    for (left, right) in left_blocks.zip(right_blocks) {
        for lane in 0..LANES {
            lanes[lane] = left[lane].mul_add(right[lane], lanes[lane]);
        }
    }
    for ((lane, left), right) in lanes.iter_mut().zip(tails.0).zip(tails.1) {
        *lane = left.mul_add(*right, *lane);
    }
}

#[inline(always)]
fn total(lanes: &[f64; LANES]) -> f64 {
    ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]))
}

/// Returns sum_j left_j right_j, for use inside a dispatched loop.
#[inline(always)]
pub(super) fn dot_inline(left: &[f64], right: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    accumulate(&mut lanes, left, right);
    total(&lanes)
}

/// Returns sum_j left_j right_j over slices of one length. Cost O(n).
pub fn dot(left: &[f64], right: &[f64]) -> f64 {
    assert_eq!(left.len(), right.len());
    dispatched!(dot_inline(left, right))
}

/// Returns sum_j values_j. Cost O(n).
pub fn sum(values: &[f64]) -> f64 {
    dispatched!({
        let mut lanes = [0.0; LANES];
        let blocks = values.chunks_exact(LANES);
        let tail = blocks.remainder();
        for block in blocks {
            for lane in 0..LANES {
                lanes[lane] += block[lane];
            }
        }
        lanes.iter_mut().zip(tail).for_each(|(lane, value)| *lane += value);
        total(&lanes)
    })
}

/// Returns sum_j w_j (1 + r_j + r_j^2/3) exp(-r_j) with r_j = sqrt(5 d2_j), without the signal variance.
///
/// Shapes: one weight for each squared scaled distance. No allocation. Cost O(n).
/// Source: Rasmussen and Williams 2006, eqs. (2.27) and (4.17).
pub fn weighted_sum(squared_distances: &[f64], weights: &[f64]) -> f64 {
    assert_eq!(squared_distances.len(), weights.len());
    let mut lanes = [0.0; LANES];
    let mut staged = [0.0; BLOCK];
    for (squared, weights) in squared_distances.chunks(BLOCK).zip(weights.chunks(BLOCK)) {
        let staged = &mut staged[..squared.len()];
        staged.copy_from_slice(squared);
        // Dispatched separately, because in one function with the sum LLVM does not vectorise the loop over the
        // exponential.
        matern_from_squared(staged);
        dispatched!(accumulate(&mut lanes, staged, weights));
    }
    total(&lanes)
}

/// Replaces each squared scaled distance by its correlation (1 + r + r^2/3) exp(-r), r = sqrt(5 d2). Cost O(n).
pub fn matern_from_squared(squared: &mut [f64]) {
    dispatched!({
        for value in squared.iter_mut() {
            *value = correlation(*value);
        }
    });
}

/// Writes the correlation with each input to `values`, and to `derivatives` its derivative with respect to u, the first
/// entry of the query:
///
///   (5/3)(1 + r_j) exp(-r_j) (x_j - u),   r_j^2 = 5 ((x_j - u)^2 + others_j)
///
/// `column` holds the first entries x_j of the inputs, `others` the squared distances in all other entries, all in
/// length scales. Cost O(n), one exponential each.
pub(super) fn matern_along(column: &[f64], u: f64, others: &[f64], values: &mut [f64], derivatives: &mut [f64]) {
    let n = column.len();
    assert!([others.len(), values.len(), derivatives.len()] == [n; 3], "one entry for each input");
    dispatched!({
        for (((value, derivative), x), other) in values.iter_mut().zip(derivatives.iter_mut()).zip(column).zip(others) {
            let difference = x - u;
            let r = (5.0 * difference.mul_add(difference, *other)).sqrt();
            let decay = exp(-r);
            *value = (r * (1.0 / 3.0)).mul_add(r, 1.0 + r) * decay;
            *derivative = (5.0 / 3.0) * (1.0 + r) * decay * difference;
        }
    });
}

/// Writes sum_i (x_ij - centre_i)^2 to each `out[j]`.
///
/// `columns` holds x column by column, `stride` entries each. `out` belongs to the rows from `first` on. All are
/// already divided by the length scales. Each block of `LANES` sums stays in registers over the columns. Cost O(n d).
pub(super) fn squared_distances(columns: &[f64], stride: usize, first: usize, centre: &[f64], out: &mut [f64]) {
    assert!(columns.len() == stride * centre.len() && first + out.len() <= stride, "a block of the columns");
    dispatched!({
        let count = out.len();
        let mut blocks = out.chunks_exact_mut(LANES);
        for (block, at) in blocks.by_ref().zip((first..).step_by(LANES)) {
            let mut sums = [0.0; LANES];
            for (column, centre) in columns.chunks_exact(stride).zip(centre) {
                let values = &column[at..at + LANES];
                for lane in 0..LANES {
                    let difference = values[lane] - centre;
                    sums[lane] = difference.mul_add(difference, sums[lane]);
                }
            }
            block.copy_from_slice(&sums);
        }
        let tail = blocks.into_remainder();
        let at = first + count - tail.len();
        tail.fill(0.0);
        for (column, &centre) in columns.chunks_exact(stride).zip(centre) {
            for (out, &x) in tail.iter_mut().zip(&column[at..]) {
                let difference = x - centre;
                *out = difference.mul_add(difference, *out);
            }
        }
    });
}

/// Contracts one column of a symmetric weight matrix with the derivatives of the kernel matrix.
///
/// On entry `squared[j]` is a squared scaled distance and `weights[j]` its weight w_j. On return `weights[j]` is
/// w_j (5/3)(1 + r_j) exp(-r_j), the factor of each squared coordinate difference in dk / d log l; the returned
/// number is sum_j w_j k_j. Both without the signal variance. Cost O(n).
pub fn contract_column(squared: &[f64], weights: &mut [f64]) -> f64 {
    let value = weighted_sum(squared, weights);
    dispatched!({
        for (weight, &squared) in weights.iter_mut().zip(squared) {
            *weight *= steepness(squared);
        }
    });
    value
}

/// Returns sum_j weights_j (column_j - centre)^2. Cost O(n).
pub fn weighted_squares(column: &[f64], centre: f64, weights: &[f64]) -> f64 {
    assert_eq!(column.len(), weights.len());
    dispatched!({
        let mut lanes = [0.0; LANES];
        let (columns, weights) = (column.chunks_exact(LANES), weights.chunks_exact(LANES));
        let tail = columns.remainder().iter().zip(weights.remainder());
        let add = |lane: &mut f64, x: f64, weight: f64| *lane = ((x - centre) * (x - centre)).mul_add(weight, *lane);
        for (column, weights) in columns.zip(weights) {
            for lane in 0..LANES {
                add(&mut lanes[lane], column[lane], weights[lane]);
            }
        }
        lanes.iter_mut().zip(tail).for_each(|(lane, (x, weight))| add(lane, *x, *weight));
        total(&lanes)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fast_sum_equals_the_plain_formula() {
        for n in [0, 1, 7, 8, 9, 127, 128, 129, 1000] {
            let squared: Vec<f64> = (0..n).map(|j| f64::from(j) * f64::from(j) * 1e-3).collect();
            let weights: Vec<f64> = (0..n).map(|j| f64::from(j * 37 % 11) - 5.0).collect();
            let plain = |d2: f64| {
                let r = d2.sqrt();
                (1.0 + 5f64.sqrt() * r + 5.0 * r * r / 3.0) * (-(5f64.sqrt()) * r).exp()
            };
            let expected: f64 = squared.iter().zip(&weights).map(|(&d2, w)| w * plain(d2)).sum();
            assert!((weighted_sum(&squared, &weights) - expected).abs() < 1e-12, "n = {n}");
            let mut values = squared.clone();
            matern_from_squared(&mut values);
            for (value, &d2) in values.iter().zip(&squared) {
                assert!((value - plain(d2)).abs() < 1e-15);
            }
        }
    }
}
