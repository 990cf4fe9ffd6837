//! Empirical distributions and their moments.

use serde::{Deserialize, Serialize};

/// The law that puts mass 1/n on each of n observed values.
///
/// Values are kept in ascending order, and every statistic is computed from that order, so the order of
/// arrival cannot be felt, and pushing values one by one equals starting from the whole sample, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct EmpiricalDistribution {
    sorted: Vec<f64>,
}

impl EmpiricalDistribution {
    /// The law of `sample`, which must be finite. Cost O(n ln n).
    pub fn new(sample: &[f64]) -> Self {
        let mut sorted = sample.to_vec();
        sorted.sort_by(f64::total_cmp);
        EmpiricalDistribution { sorted }
    }

    /// Adds one observation: `(n F + delta_z) / (n + 1)`. Cost O(n).
    pub fn push(&mut self, value: f64) {
        let position = self.sorted.partition_point(|&atom| atom.total_cmp(&value).is_le());
        self.sorted.insert(position, value);
    }

    /// The atoms in ascending order, repeated where observed repeatedly.
    pub fn atoms(&self) -> &[f64] {
        &self.sorted
    }

    /// Number of observations, n.
    pub fn sample_size(&self) -> usize {
        self.sorted.len()
    }

    /// Raw moments `m_k = (1/n) sum_j z_j^k` for k = 1 to `count`. Cost O(n count).
    pub fn raw_moments(&self, count: usize) -> Vec<f64> {
        let mut sums = vec![0.0; count];
        for &atom in &self.sorted {
            let mut power = 1.0;
            for sum in &mut sums {
                power *= atom;
                *sum += power;
            }
        }
        sums.iter().map(|sum| sum / self.sorted.len() as f64).collect()
    }
}
