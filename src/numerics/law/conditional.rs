//! Weights of past values by how much their time resembled the present: the conditional law of Nadaraya and Watson.
//!
//!   w_j  =  a_j exp( -((s_j - s) / (h sd))^2 / 2 ),
//!
//! with s_j what was known before value j, s what is known now, sd the standard deviation of the s_j, h the bandwidth
//! and a_j a weight by age. Source: Nguyen, Zhang, Wang, Blanchet, Delage and Ye (2025), Robustifying conditional
//! portfolio decisions via optimal transport, Operations Research 73.

/// Halvings of the search for the least bandwidth.
const HALVINGS: usize = 60;

/// Returns the weights of the values by what was known before each. `known` has one number more than there are values,
/// the last for now; `ages` are their weights by age. If fewer than `least` values would count (as the effective number
/// `(sum w)^2 / sum w^2`), the bandwidth is widened until so many do, or all. Weights of 1 are exact for a bandwidth
/// without bound. Cost O(n).
///
/// Checked by: `tests/solver/conditional.rs`.
pub fn kernel_weights(known: &[f64], ages: &[f64], bandwidth: f64, least: f64) -> Vec<f64> {
    let Some((now, before)) = known.split_last() else { return Vec::new() };
    let mean = before.iter().sum::<f64>() / before.len() as f64;
    let variance = before.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / before.len() as f64;
    if variance <= 0.0 {
        return ages.to_vec();
    }
    let squares: Vec<f64> = before.iter().map(|value| (value - now).powi(2) / variance).collect();
    // Only ratios of weights matter: the nearest has that of its age.
    let nearest = squares.iter().copied().fold(f64::INFINITY, f64::min);
    let weights = |bandwidth: f64| -> Vec<f64> {
        let weight = |(square, age): (&f64, &f64)| age * (-0.5 * (square - nearest) / (bandwidth * bandwidth)).exp();
        squares.iter().zip(ages).map(weight).collect()
    };
    let found = weights(bandwidth);
    if effective(&found) >= least {
        return found;
    }
    if effective(ages) <= least {
        return ages.to_vec();
    }
    let (mut low, mut high) = (bandwidth, bandwidth);
    while effective(&weights(high)) < least * (1.0 - 1e-9) {
        high *= 2.0;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        *(if effective(&weights(middle)) < least { &mut low } else { &mut high }) = middle;
    }
    weights(high)
}

/// Returns the effective number of values with these weights.
pub fn effective(weights: &[f64]) -> f64 {
    weights.iter().sum::<f64>().powi(2) / weights.iter().map(|weight| weight * weight).sum::<f64>()
}

/// Returns `count` values that stand for those of `values` with their `weights`, in their order: the value at each of
/// `count` even steps of the weight. All of them once if the weights are equal and `count` is their number.
pub fn representative(values: &[f64], weights: &[f64], count: usize) -> Vec<f64> {
    let total: f64 = weights.iter().sum();
    let (mut place, mut passed) = (0, weights.first().copied().unwrap_or_default());
    let mut at = |index: usize| {
        let wanted = (index as f64 + 0.5) / count as f64 * total;
        while passed < wanted && place + 1 < values.len() {
            place += 1;
            passed += weights[place];
        }
        values[place]
    };
    (0..count).map(&mut at).collect()
}
