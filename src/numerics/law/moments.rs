//! Moments of a sample, and of the sample with one more value.

use crate::numerics::law::empirical::EmpiricalDistribution;

/// Highest moment order supported.
pub const ORDERS: usize = 6;

/// Mean and central power sums `M_p = sum_j w_j (z_j - mean)^p`, p = 2 to 6, of values with weights w. The weights sum
/// to n, which is the number of values if every weight is 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CentralMoments {
    size: f64,
    /// The factor by which every weight shrinks when one more value is added.
    retention: f64,
    mean: f64,
    /// `sums[p]` is M_p; entries 0 and 1 are n and 0.
    sums: [f64; ORDERS + 1],
}

impl CentralMoments {
    /// Computes the moments in two passes over the sample. Cost O(n).
    pub fn of(law: &EmpiricalDistribution) -> Self {
        let (size, retention) = (law.total_weight(), law.retention());
        let weighted = || law.atoms().iter().zip(law.weights());
        let mean = weighted().map(|(atom, weight)| weight * atom).sum::<f64>() / size;
        let mut sums = [0.0; ORDERS + 1];
        for (atom, weight) in weighted() {
            let mut power = *weight;
            for sum in &mut sums {
                *sum += power;
                power *= atom - mean;
            }
        }
        sums[1] = 0.0;
        CentralMoments { size, retention, mean, sums }
    }

    /// Returns the moments after one more value z of weight 1. First n and every M_p are multiplied by the retention.
    /// With d = z - mean, n' = n + 1 and e = d / n':
    ///
    ///   M_p' = M_p + sum_{k=1}^{p-2} C(p,k) M_{p-k} (-e)^k + (n e)^p (1 - (-1/n)^(p-1))
    ///
    /// Cost O(1). Source: Pebay (2008), Sandia report SAND2008-6212, eq. 3.1 with a second set of one value.
    pub fn with(&self, value: f64) -> Self {
        let kept = self.size * self.retention;
        let size = kept + 1.0;
        let shift = (value - self.mean) / size;
        let before = self.sums.map(|sum| sum * self.retention);
        let mut sums = before;
        sums[0] = size;
        for (order, sum) in sums.iter_mut().enumerate().skip(2) {
            let mut total = before[order];
            let (mut binomial, mut power) = (1.0, 1.0);
            for k in 1..=order.saturating_sub(2) {
                binomial *= (order - k + 1) as f64 / k as f64;
                power *= -shift;
                total += binomial * before[order - k] * power;
            }
            let sign = (-1.0 / kept).powi(order as i32 - 1);
            *sum = total + (kept * shift).powi(order as i32) * (1.0 - sign);
        }
        CentralMoments { size, mean: self.mean + shift, sums, ..*self }
    }

    /// Returns the mean, in the unit of the values.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Returns the central moment of order p, `M_p / n`.
    pub fn central(&self, order: usize) -> f64 {
        self.sums[order] / self.size
    }

    /// Returns the population variance, M_2 / n.
    pub fn variance(&self) -> f64 {
        self.central(2)
    }

    /// Returns the raw moment of order p, by the binomial theorem.
    pub fn raw(&self, order: usize) -> f64 {
        let (mut binomial, mut total) = (1.0, 0.0);
        for k in 0..=order {
            let central = if k == 0 { 1.0 } else { self.central(k) };
            total += binomial * central * self.mean.powi((order - k) as i32);
            binomial *= (order - k) as f64 / (k + 1) as f64;
        }
        total
    }

    /// Returns the shape of order p: the mean, the log standard deviation, then for p >= 3 the standardised moment:
    /// itself for odd p, and its logarithm for even p. `smallest_deviation` bounds the standard deviation below.
    pub fn shape(&self, order: usize, smallest_deviation: f64) -> f64 {
        let deviation = self.variance().max(0.0).sqrt().max(smallest_deviation);
        match order {
            1 => self.mean,
            2 => deviation.ln(),
            _ if order % 2 == 1 => self.central(order) / deviation.powi(order as i32),
            _ => (self.central(order) / deviation.powi(order as i32)).max(f64::MIN_POSITIVE).ln(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_more_value_equals_the_whole_sample() {
        let sample = [0.03, -0.11, 0.07, 0.02, -0.045, 0.16];
        for (retention, value) in [1.0, 0.8].into_iter().flat_map(|d| [0.4, -0.9, 0.02].map(|value| (d, value))) {
            let law = EmpiricalDistribution::decaying(&sample, retention);
            let updated = CentralMoments::of(&law).with(value);
            let mut larger = law.clone();
            larger.push(value);
            let whole = CentralMoments::of(&larger);
            let raw = larger.raw_moments(ORDERS);
            for order in 2..=ORDERS {
                // A dozen roundings of terms below 1.
                assert!((updated.central(order) - whole.central(order)).abs() < 1e-14, "order {order}");
                assert!((updated.raw(order) - raw[order - 1]).abs() < 1e-14, "raw order {order}");
            }
            assert!((updated.raw(1) - raw[0]).abs() < 1e-15);
        }
    }
}
