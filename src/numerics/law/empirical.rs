//! Empirical distributions and their moments.

/// The law of n observed values, in which the value seen k values ago has weight `d^k`, d the *retention* in (0, 1]:
/// mass
///
///   w_k = d^k / (1 + d + ... + d^(n-1)).
///
/// At d = 1 every value has mass 1/n. One more value z turns F into `(1 - w) F + w delta_z` with
/// `w = 1 / (1 + d + ... + d^n)`, which tends to 1/(n + 1) as d tends to 1, and to 1 - d as n grows.
///
/// Values are kept in ascending order, and every statistic is computed in that order. Pushing values one by one equals
/// starting from the whole sample, bit for bit. At d = 1 the order of arrival has no effect.
/// Checked by: `weights_are_the_powers_of_the_retention`.
#[derive(Debug, Clone, PartialEq)]
pub struct EmpiricalDistribution {
    sorted: Vec<f64>,
    /// Weight `d^k` of each value, in the order of the values.
    weights: Vec<f64>,
    retention: f64,
    /// True if the weights follow from the order of arrival alone.
    by_age: bool,
    /// Sums of the weights and of their squares, in the order of arrival.
    total: f64,
    squares: f64,
}

impl EmpiricalDistribution {
    /// Creates the law of `sample`, which must be finite, with equal weights. Cost O(n ln n).
    pub fn new(sample: &[f64]) -> Self {
        EmpiricalDistribution::decaying(sample, 1.0)
    }

    /// Creates the law of `sample`, finite and oldest first, at a retention in (0, 1]. Cost O(n ln n).
    pub fn decaying(sample: &[f64], retention: f64) -> Self {
        let (mut total, mut squares) = (0.0, 0.0);
        let mut weighted: Vec<(f64, f64)> = sample.iter().copied().zip(weights(sample.len(), retention)).collect();
        weighted.sort_by(|left, right| left.0.total_cmp(&right.0));
        for _ in sample {
            (total, squares) = one_more(total, squares, retention);
        }
        let (sorted, weights) = weighted.into_iter().unzip();
        EmpiricalDistribution { sorted, weights, retention, by_age: true, total, squares }
    }

    /// Creates the law of `sample`, finite and oldest first, with these positive weights; values added later shrink them
    /// by `retention`. Cost O(n ln n).
    pub fn weighted(sample: &[f64], weights: &[f64], retention: f64) -> Self {
        let (total, squares) = (weights.iter().sum(), weights.iter().map(|weight| weight * weight).sum());
        let mut weighted: Vec<(f64, f64)> = sample.iter().copied().zip(weights.iter().copied()).collect();
        weighted.sort_by(|left, right| left.0.total_cmp(&right.0));
        let (sorted, weights) = weighted.into_iter().unzip();
        EmpiricalDistribution { sorted, weights, retention, by_age: false, total, squares }
    }

    /// Adds one observation. Cost O(n).
    pub fn push(&mut self, value: f64) {
        let position = self.sorted.partition_point(|&atom| atom.total_cmp(&value).is_le());
        self.weights.iter_mut().for_each(|weight| *weight *= self.retention);
        self.sorted.insert(position, value);
        self.weights.insert(position, 1.0);
        (self.total, self.squares) = one_more(self.total, self.squares, self.retention);
    }

    /// Adds many observations, oldest first. Cost O(n) and a sort of the new; at a retention below 1, also a pass over
    /// all for each.
    pub fn extend(&mut self, values: &[f64]) {
        for _ in values {
            if self.retention < 1.0 {
                self.weights.iter_mut().for_each(|weight| *weight *= self.retention);
            }
            (self.total, self.squares) = one_more(self.total, self.squares, self.retention);
        }
        let mut new: Vec<(f64, f64)> = values.iter().copied().zip(weights(values.len(), self.retention)).collect();
        new.sort_by(|left, right| left.0.total_cmp(&right.0));
        let known = (std::mem::take(&mut self.sorted), std::mem::take(&mut self.weights));
        let size = known.0.len() + values.len();
        (self.sorted, self.weights) = (Vec::with_capacity(size), Vec::with_capacity(size));
        let mut passed = 0;
        for (value, weight) in new {
            let position = passed + known.0[passed..].partition_point(|atom| atom.total_cmp(&value).is_le());
            self.sorted.extend_from_slice(&known.0[passed..position]);
            self.weights.extend_from_slice(&known.1[passed..position]);
            self.sorted.push(value);
            self.weights.push(weight);
            passed = position;
        }
        self.sorted.extend_from_slice(&known.0[passed..]);
        self.weights.extend_from_slice(&known.1[passed..]);
    }

    /// Returns the atoms in ascending order, repeated if observed repeatedly.
    pub fn atoms(&self) -> &[f64] {
        &self.sorted
    }

    /// Returns the weights of the atoms, in their order; the newest value has weight 1.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Returns the sum of the weights: n if they are equal.
    pub fn total_weight(&self) -> f64 {
        self.total
    }

    /// Returns true if the weights follow from the order of arrival alone.
    pub fn is_by_age(&self) -> bool {
        self.by_age
    }

    /// Returns true if all weights are equal.
    pub fn is_even(&self) -> bool {
        self.by_age && self.retention >= 1.0
    }

    /// Returns d, the factor by which a value's weight shrinks when another value is added.
    pub fn retention(&self) -> f64 {
        self.retention
    }

    /// Returns the number of observations, n.
    pub fn sample_size(&self) -> usize {
        self.sorted.len()
    }

    /// Returns the effective sample size, `1 / sum of the squared masses`: the number of equally weighted values that
    /// determine a mean as well. It is n at d = 1, and
    ///
    ///   (1 + d) (1 - d^n) / ((1 - d) (1 + d^n))
    ///
    /// for d < 1. Checked by: `src/control/request/learning.rs::the_effective_size_has_its_closed_form`.
    pub fn effective_size(&self) -> f64 {
        self.total * self.total / self.squares
    }

    /// Returns the effective sample size after one more observation, and after two.
    pub fn effective_sizes_ahead(&self) -> [f64; 2] {
        let mut sums = (self.total, self.squares);
        [(); 2].map(|()| {
            sums = one_more(sums.0, sums.1, self.retention);
            sums.0 * sums.0 / sums.1
        })
    }

    /// Returns the raw moments `m_k = sum_j w_j z_j^k`, w the masses, for k = 1 to `count`. Cost O(n count).
    pub fn raw_moments(&self, count: usize) -> Vec<f64> {
        let mut sums = vec![0.0; count];
        for (&atom, &weight) in self.sorted.iter().zip(&self.weights) {
            let mut power = 1.0;
            for sum in &mut sums {
                power *= atom;
                *sum += weight * power;
            }
        }
        sums.iter().map(|sum| sum / self.total).collect()
    }
}

/// Returns the weights `d^k` of `count` values, oldest first: the newest has weight 1.
pub fn weights(count: usize, retention: f64) -> Vec<f64> {
    let mut weights = vec![1.0; count];
    for age in 1..count {
        weights[count - 1 - age] = weights[count - age] * retention;
    }
    weights
}

/// Returns the sums of the weights and of their squares after one more value.
fn one_more(total: f64, squares: f64, retention: f64) -> (f64, f64) {
    (total * retention + 1.0, squares * (retention * retention) + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLE: [f64; 6] = [0.03, -0.11, 0.07, 0.02, -0.11, 0.16];

    #[test]
    fn weights_are_the_powers_of_the_retention() {
        for retention in [1.0, 0.9, 0.5] {
            let law = EmpiricalDistribution::decaying(&SAMPLE, retention);
            let mut pushed = EmpiricalDistribution::decaying(&SAMPLE[..2], retention);
            for (age, &value) in SAMPLE.iter().enumerate().skip(2) {
                // F' = (1 - w) F + w delta_z, w = 1 / (1 + d + ... + d^n), checked by the mean, which is linear in the
                // law.
                let before = pushed.raw_moments(1)[0];
                let newest = 1.0 / (0..=age).map(|power| retention.powi(power as i32)).sum::<f64>();
                pushed.push(value);
                let after = (1.0 - newest) * before + newest * value;
                // A dozen roundings of numbers below 1.
                assert!((pushed.raw_moments(1)[0] - after).abs() < 1e-15);
            }
            assert_eq!(pushed, law, "one by one and the whole sample are one law");
            let mut extended = EmpiricalDistribution::decaying(&SAMPLE[..2], retention);
            extended.extend(&SAMPLE[2..]);
            assert_eq!(extended, law, "many at once and the whole sample are one law");
            // By hand: the values in ascending order were seen 4, 1, 2, 5, 3 and 0 values ago.
            let ages = [4, 1, 2, 5, 3, 0].map(|age| retention.powi(age));
            for (found, expected) in law.weights().iter().zip(ages) {
                assert!((found - expected).abs() < 1e-15, "{found} against {expected}");
            }
            let masses = ages.map(|weight| weight / ages.iter().sum::<f64>());
            let effective = 1.0 / masses.iter().map(|mass| mass * mass).sum::<f64>();
            assert!((law.effective_size() / effective - 1.0).abs() < 1e-14);
            let mut larger = law.clone();
            let ahead = [0.4, 0.1].map(|value| {
                larger.push(value);
                larger.effective_size()
            });
            assert_eq!(law.effective_sizes_ahead(), ahead);
        }
        assert_eq!(EmpiricalDistribution::new(&SAMPLE).effective_size(), 6.0);
    }
}
