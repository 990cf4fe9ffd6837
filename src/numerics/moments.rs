//! Moments of a sample, and of the sample with one more value.

use super::empirical::EmpiricalDistribution;

/// Highest moment order supported.
pub const ORDERS: usize = 6;

/// Mean and central power sums `M_p = sum_j (z_j - mean)^p`, p = 2 to 6, of n values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CentralMoments {
    size: f64,
    mean: f64,
    /// `sums[p]` is M_p; entries 0 and 1 are n and 0.
    sums: [f64; ORDERS + 1],
}

impl CentralMoments {
    /// Two passes over the sample. Cost O(n).
    pub fn of(law: &EmpiricalDistribution) -> Self {
        let size = law.sample_size() as f64;
        let mean = law.atoms().iter().sum::<f64>() / size;
        let mut sums = [0.0; ORDERS + 1];
        for atom in law.atoms() {
            let mut power = 1.0;
            for sum in &mut sums {
                *sum += power;
                power *= atom - mean;
            }
        }
        sums[1] = 0.0;
        CentralMoments { size, mean, sums }
    }

    /// The moments after one more value z. With d = z - mean, n' = n + 1 and e = d / n':
    ///
    ///   M_p' = M_p + sum_{k=1}^{p-2} C(p,k) M_{p-k} (-e)^k + (n e)^p (1 - (-1/n)^(p-1))
    ///
    /// Cost O(1). Source: Pebay (2008), Sandia report SAND2008-6212, eq. 3.1 with a second set of one value.
    pub fn with(&self, value: f64) -> Self {
        let size = self.size + 1.0;
        let shift = (value - self.mean) / size;
        let mut sums = self.sums;
        sums[0] = size;
        for (order, sum) in sums.iter_mut().enumerate().skip(2) {
            let mut total = self.sums[order];
            let (mut binomial, mut power) = (1.0, 1.0);
            for k in 1..=order.saturating_sub(2) {
                binomial *= (order - k + 1) as f64 / k as f64;
                power *= -shift;
                total += binomial * self.sums[order - k] * power;
            }
            let sign = (-1.0 / self.size).powi(order as i32 - 1);
            *sum = total + (self.size * shift).powi(order as i32) * (1.0 - sign);
        }
        CentralMoments { size, mean: self.mean + shift, sums }
    }

    /// m, in the unit of the values.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Central moment of order p, `M_p / n`.
    pub fn central(&self, order: usize) -> f64 {
        self.sums[order] / self.size
    }

    /// Population variance, M_2 / n.
    pub fn variance(&self) -> f64 {
        self.central(2)
    }

    /// Raw moment of order p by the binomial theorem.
    pub fn raw(&self, order: usize) -> f64 {
        let (mut binomial, mut total) = (1.0, 0.0);
        for k in 0..=order {
            let central = if k == 0 { 1.0 } else { self.central(k) };
            total += binomial * central * self.mean.powi((order - k) as i32);
            binomial *= (order - k) as f64 / (k + 1) as f64;
        }
        total
    }

    /// Shape of order p: mean, log standard deviation, then for p >= 3 the standardised moment,
    /// itself for odd p and its logarithm for even p. `smallest_deviation` bounds the standard deviation below.
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
        let mut law = EmpiricalDistribution::new(&sample);
        let before = CentralMoments::of(&law);
        for value in [0.4, -0.9, 0.02] {
            let updated = before.with(value);
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
        law.push(0.1);
        assert_eq!(law.sample_size(), sample.len() + 1);
    }
}
