//! The laws that records are drawn from, and the drawing of records.

use rand::RngExt;
use rand_distr::StandardNormal;

use super::report::Bootstrap;
use crate::control::error::FieldError;
use crate::control::request::learning::SMALLEST_DEVIATION;
use crate::control::request::support::Interval;
use crate::numerics::machine::streams::stream;

/// Approximate number of atoms of a smoothed law; each past return is spread over equally many atoms, at least two.
const ATOMS: usize = 4096;
/// Most atoms of one return.
const MOST_SPREAD: usize = 16;
/// Most draws of a record: one in which an asset never moves has no volatility and is drawn again.
const DRAWS: usize = 100;

/// A law of log-returns with atoms of equal mass, one for each date.
pub(super) struct RecordLaw {
    pub(super) rows: Vec<Vec<f64>>,
    pub(super) bandwidth: f64,
}

impl RecordLaw {
    /// Returns the empirical law of the past returns.
    pub(super) fn of(rows: &[Vec<f64>]) -> Self {
        RecordLaw { rows: rows.to_vec(), bandwidth: 0.0 }
    }

    /// Returns the smoothed law: each past return is spread over a few draws of a normal law with `bandwidth^2` times
    /// the covariance of the record. The result is rescaled to the record's means and variances: Silverman's smoothed
    /// bootstrap that keeps the variance. The bandwidth is Silverman's rule of thumb, `(4 / ((d + 2) n))^(1 / (d +
    /// 4))`. Values beyond `support` are clamped to its ends, which changes means and variances.
    ///
    /// Source: Silverman (1986), Density estimation, sections 4.3.2 and 6.4.1. Checked by: `means_and_variances_stay`.
    pub(super) fn smoothed(rows: &[Vec<f64>], support: Option<Interval>, seed: u64) -> Self {
        let (count, width) = (rows.len(), rows.first().map_or(0, Vec::len));
        let (size, dimension) = (count as f64, width as f64);
        let bandwidth = (4.0 / ((dimension + 2.0) * size)).powf(1.0 / (dimension + 4.0));
        let (means, deviations) = moments(rows);
        let pairs = (ATOMS / count).clamp(2, MOST_SPREAD) / 2;
        let mut generator = stream(seed, "kernel", 0, 0);
        // A normally weighted sum of the record's own deviations has the record's covariance.
        let noise: Vec<Vec<f64>> = (0..pairs * count)
            .map(|_| {
                let mut noise = vec![0.0; width];
                for row in rows {
                    let normal: f64 = generator.sample(StandardNormal);
                    let add = |(noise, (value, mean)): (&mut f64, (&f64, &f64))| *noise += normal * (value - mean);
                    noise.iter_mut().zip(row.iter().zip(&means)).for_each(add);
                }
                noise.into_iter().map(|value| value * bandwidth / size.sqrt()).collect()
            })
            .collect();
        let spread = |(index, noise): (usize, &Vec<f64>)| {
            let row = &rows[index % count];
            let moved = |sign: f64| row.iter().zip(noise).map(|(value, noise)| value + sign * noise).collect();
            [1.0, -1.0].map(moved)
        };
        let mut spread: Vec<Vec<f64>> = noise.iter().enumerate().flat_map(spread).collect();
        let (_, wider) = moments(&spread);
        for row in &mut spread {
            for (asset, value) in row.iter_mut().enumerate() {
                let mean = means[asset];
                *value = mean + (*value - mean) * deviations[asset] / wider[asset];
                if let Some(Interval { min, max }) = support {
                    *value = value.clamp(min, max);
                }
            }
        }
        RecordLaw { rows: spread, bandwidth }
    }

    /// Returns this law moved so that every asset's mean simple return is that of the bank, whose growth per period is
    /// `bank`. An asset with a lower mean is moved up. The returns may leave the support.
    pub(super) fn without_premium(&self, bank: f64) -> Self {
        let width = self.rows.first().map_or(0, Vec::len);
        let size = self.rows.len() as f64;
        let mean = |asset: usize| self.rows.iter().map(|row| row[asset].exp()).sum::<f64>() / size;
        let moves: Vec<f64> = (0..width).map(|asset| (bank / mean(asset)).ln()).collect();
        let moved = |row: &Vec<f64>| row.iter().zip(&moves).map(|(value, moved)| value + moved).collect();
        RecordLaw { rows: self.rows.iter().map(moved).collect(), bandwidth: self.bandwidth }
    }

    /// Draws a record of `count` dates. Stream: (seed, "smoothed" or "blocks", 0, index).
    ///
    /// # Errors
    /// An asset that moves so rarely that no drawn record shows a change.
    pub(super) fn record(
        &self,
        kind: Bootstrap,
        count: usize,
        seed: u64,
        index: usize,
    ) -> Result<Vec<Vec<f64>>, FieldError> {
        let (purpose, length) = match kind {
            Bootstrap::Smoothed { .. } | Bootstrap::WithoutPremium { .. } => ("smoothed", 1),
            Bootstrap::Block { length } => ("blocks", length),
        };
        let mut generator = stream(seed, purpose, 0, index);
        let mut draw = || {
            let mut record = Vec::with_capacity(count);
            while record.len() < count {
                let start = generator.random_range(0..self.rows.len());
                let block =
                    (start..start + length.min(count - record.len())).map(|at| self.rows[at % self.rows.len()].clone());
                record.extend(block);
            }
            record
        };
        let varies =
            |record: &Vec<Vec<f64>>| moments(record).1.iter().all(|deviation| *deviation >= SMALLEST_DEVIATION);
        (0..DRAWS).map(|_| draw()).find(varies).ok_or_else(|| {
            let rule = "must vary more often: hardly any record drawn from it shows how much each asset varies";
            FieldError::new("problem.history", format!("{count} periods"), rule)
        })
    }
}

/// Returns mean and deviation of every column.
fn moments(rows: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
    let (size, width) = (rows.len() as f64, rows.first().map_or(0, Vec::len));
    let column = |asset: usize| rows.iter().map(move |row| row[asset]);
    let means: Vec<f64> = (0..width).map(|asset| column(asset).sum::<f64>() / size).collect();
    let squares = |asset: usize| column(asset).map(|value| (value - means[asset]).powi(2)).sum::<f64>() / size;
    let deviations = (0..width).map(|asset| squares(asset).sqrt()).collect();
    (means, deviations)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(count: usize, width: usize) -> Vec<Vec<f64>> {
        let value = |date: usize, asset: usize| 0.01 * (((date * 7919 + asset * 104_729) % 101) as f64 / 25.0 - 1.9);
        (0..count).map(|date| (0..width).map(|asset| value(date, asset)).collect()).collect()
    }

    #[test]
    fn means_and_variances_stay() {
        for width in [1, 3] {
            let rows = rows(60, width);
            let law = RecordLaw::smoothed(&rows, None, 5);
            let ((means, deviations), (smooth_means, smooth_deviations)) = (moments(&rows), moments(&law.rows));
            assert_eq!(law.rows.len(), 60 * 16);
            for asset in 0..width {
                assert!((means[asset] - smooth_means[asset]).abs() < 1e-15);
                assert!((deviations[asset] / smooth_deviations[asset] - 1.0).abs() < 1e-12);
            }
            // By hand, at d = 1 and n = 60: (4 / 180)^(1/5).
            assert!(width > 1 || (law.bandwidth - 0.467_043_7).abs() < 1e-6, "{}", law.bandwidth);
            let even = law.without_premium(1.01);
            let mean = even.rows.iter().map(|row| row[width - 1].exp()).sum::<f64>() / even.rows.len() as f64;
            assert!((mean - 1.01).abs() < 1e-14 * 960.0);
            assert!((moments(&even.rows).1[0] / deviations[0] - 1.0).abs() < 1e-12);
            let within = RecordLaw::smoothed(&rows, Some(Interval { min: -0.005, max: 0.005 }), 5);
            assert!(within.rows.iter().flatten().all(|value| value.abs() <= 0.005));
        }
    }

    #[test]
    fn a_block_is_drawn_in_a_row_and_the_last_is_followed_by_the_first() {
        let rows: Vec<Vec<f64>> = (0..10).map(|date| vec![f64::from(date)]).collect();
        let record = RecordLaw::of(&rows).record(Bootstrap::Block { length: 4 }, 10, 1, 3).unwrap();
        assert_eq!(record.len(), 10);
        for block in record.chunks(4) {
            for pair in block.windows(2) {
                assert_eq!(pair[1][0], (pair[0][0] + 1.0) % 10.0);
            }
        }
        assert_eq!(record, RecordLaw::of(&rows).record(Bootstrap::Block { length: 4 }, 10, 1, 3).unwrap());
        let still = RecordLaw::of(&vec![vec![0.01]; 10]);
        assert_eq!(still.record(Bootstrap::Block { length: 1 }, 10, 1, 0).unwrap_err().field, "problem.history");
        assert_ne!(record, RecordLaw::of(&rows).record(Bootstrap::Block { length: 4 }, 10, 1, 4).unwrap());
    }
}
