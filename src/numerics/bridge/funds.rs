//! The factor by which a ball must be wider than one fund's own radius so that the laws of all funds of several assets
//! lie in their balls at once.
//!
//! A fund with shares theta has the log-return `zeta = ln sum_i theta_i e^(z_i)`. Its bridge statistic
//!
//!   H_theta = (1 / sqrt n) sum_k | sum_(i<=k) (g_(i) - mean g) | (zeta_(k+1) - zeta_(k)),
//!
//! with a normal g for each date and the dates sorted by zeta, has the law of `numerics/bridge.rs`. All funds share the
//! normals, so their statistics vary together as the funds do. Let Q_theta be the (1 - alpha)-quantile of H_theta. The
//! joint factor is the (1 - alpha)-quantile of the largest H_theta / Q_theta: 1 for one asset, where there is one fund.
//! Xu and Huang (2022), Central limit theorem for the sliced 1-Wasserstein distance and the max-sliced 1-Wasserstein
//! distance, arXiv:2205.14624, show that the laws of all linear slices converge at the rate 1 / sqrt n in any
//! dimension. The statistic, and the assumption that funds behave alike, are the project's; `docs/measurements.md`
//! counts how often the balls hold.
//!
//! The search for the largest ratio over all funds covers the single assets, equal shares, inverse volatilities and
//! twenty fixed draws. It then tries points between the single assets and the fund that is largest most often in the
//! tail. A finite search errs low: by little if assets move together, and by more than a tenth for a dozen independent
//! assets, where thousands of funds differ (see the test `the_joint_factor_of_independent_assets_errs_low` in
//! `tests/solver/assets.rs`).

use rand::RngExt;
use rand_distr::StandardNormal;

use crate::numerics::bridge::Quantile;
use crate::numerics::bridge::scale_mixture::ScaleMixture;
use crate::numerics::machine::streams::stream;
use crate::numerics::transport::water_filling::inverse_volatility;

/// The number of funds drawn uniformly over all shares; the draws are fixed, so every call uses the same funds.
const DRAWN_FUNDS: usize = 20;
/// The fractions of the way from the largest fund to each single asset that are tried in turn.
const SEARCH_STEPS: [f64; 3] = [0.5, 0.25, 0.125];

/// Returns the log-returns of a fund that is rebalanced to the shares `fund` every period: `ln sum_i theta_i e^(z_i)`.
pub fn fund_returns(rows: &[Vec<f64>], fund: &[f64]) -> Vec<f64> {
    let of =
        |row: &Vec<f64>| row.iter().zip(fund).map(|(log_return, share)| share * log_return.exp()).sum::<f64>().ln();
    rows.iter().map(of).collect()
}

/// Bridges of all funds of the assets with log-returns `rows`, one row a date, at least two dates.
pub struct FundBridges<'a> {
    rows: &'a [Vec<f64>],
    /// The centred normals of the dates, scaled to length 1, path after path.
    directions: Vec<f64>,
    lengths: ScaleMixture,
}

impl<'a> FundBridges<'a> {
    /// Simulates the bridges; path p uses the stream (seed, "fund bridge", 0, p). Cost O(n paths).
    pub fn simulate(rows: &'a [Vec<f64>], paths: usize, seed: u64) -> Self {
        let dates = rows.len();
        let mut directions = Vec::with_capacity(dates * paths);
        for path in 0..paths {
            let mut generator = stream(seed, "fund bridge", 0, path);
            let normals: Vec<f64> = (0..dates).map(|_| generator.sample(StandardNormal)).collect();
            let mean = normals.iter().sum::<f64>() / dates as f64;
            let length = normals.iter().map(|normal| (normal - mean).powi(2)).sum::<f64>().sqrt();
            directions.extend(normals.iter().map(|normal| (normal - mean) / length));
        }
        FundBridges { rows, directions, lengths: ScaleMixture::chi(dates.saturating_sub(1).max(1)) }
    }

    /// Returns H of a fund divided by the length, for each path. Cost O(n (paths + ln n)).
    fn statistic(&self, fund: &[f64]) -> Vec<f64> {
        let dates = self.rows.len();
        let zeta = fund_returns(self.rows, fund);
        let mut order: Vec<usize> = (0..dates).collect();
        order.sort_by(|&left, &right| zeta[left].total_cmp(&zeta[right]));
        let root = (dates as f64).sqrt();
        let gaps: Vec<(usize, f64)> =
            order.windows(2).map(|pair| (pair[0], (zeta[pair[1]] - zeta[pair[0]]) / root)).collect();
        let of = |direction: &[f64]| {
            let (mut sum, mut partial) = (0.0, 0.0_f64);
            for &(date, gap) in &gaps {
                partial += direction[date];
                sum += partial.abs() * gap;
            }
            sum
        };
        self.directions.chunks_exact(dates).map(of).collect()
    }

    /// Returns the (1 - alpha)-quantile of a fund's H, with the standard error of its simulation.
    pub fn quantile(&self, fund: &[f64], alpha: f64) -> Quantile {
        let (value, standard_error) = self.lengths.quantile_with_error(1.0 - alpha, &self.statistic(fund));
        Quantile { value, standard_error }
    }

    /// Returns the (1 - alpha)-quantile of the largest H / Q among `funds`, with the standard error of its simulation.
    pub fn factor_among(&self, funds: &[Vec<f64>], alpha: f64) -> Quantile {
        let mut largest = Largest::none(self);
        funds.iter().for_each(|fund| largest.admit(fund, alpha));
        largest.factor(alpha)
    }

    /// Returns the joint factor of all funds; exactly 1 for one asset. Cost O(funds n (paths + ln n)), with about 20 +
    /// 4 d funds.
    pub fn joint_factor(&self, alpha: f64) -> Quantile {
        let assets = self.rows.first().map_or(0, Vec::len);
        if assets < 2 {
            return Quantile { value: 1.0, standard_error: 0.0 };
        }
        let mut largest = Largest::none(self);
        funds(self.rows).iter().for_each(|fund| largest.admit(fund, alpha));
        for part in SEARCH_STEPS {
            let from = largest.most_often(alpha);
            for asset in 0..assets {
                let towards =
                    |(index, share): (usize, &f64)| (1.0 - part) * share + if index == asset { part } else { 0.0 };
                largest.admit(&from.iter().enumerate().map(towards).collect::<Vec<f64>>(), alpha);
            }
        }
        largest.factor(alpha)
    }
}

/// Returns the single assets, equal shares, inverse volatilities and the fixed draws, uniform over all shares that sum
/// to 1.
fn funds(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let assets = rows.first().map_or(0, Vec::len);
    let single = |asset: usize| (0..assets).map(|index| if index == asset { 1.0 } else { 0.0 }).collect();
    let mut funds: Vec<Vec<f64>> = (0..assets).map(single).collect();
    funds.push(vec![1.0 / assets as f64; assets]);
    funds.push(inverse_volatility(rows));
    for index in 0..DRAWN_FUNDS {
        let mut generator = stream(0, "funds", assets, index);
        let draws: Vec<f64> = (0..assets).map(|_| -(1.0 - generator.random::<f64>()).ln()).collect();
        let whole: f64 = draws.iter().sum();
        funds.push(draws.iter().map(|draw| draw / whole).collect());
    }
    funds
}

/// The largest H / Q among some funds for each path, and the fund that attains it.
struct Largest<'b, 'a> {
    bridges: &'b FundBridges<'a>,
    ratios: Vec<f64>,
    funds: Vec<Vec<f64>>,
    whose: Vec<usize>,
}

impl<'b, 'a> Largest<'b, 'a> {
    fn none(bridges: &'b FundBridges<'a>) -> Self {
        let paths = bridges.directions.len() / bridges.rows.len().max(1);
        Largest { bridges, ratios: vec![0.0; paths], funds: Vec::new(), whose: vec![0; paths] }
    }

    /// Adds a fund. A fund whose return does not vary is never the largest.
    fn admit(&mut self, fund: &[f64], alpha: f64) {
        let statistic = self.bridges.statistic(fund);
        let quantile = self.bridges.lengths.quantile(1.0 - alpha, &statistic);
        for ((ratio, whose), value) in self.ratios.iter_mut().zip(&mut self.whose).zip(statistic) {
            if value > *ratio * quantile {
                (*ratio, *whose) = (value / quantile, self.funds.len());
            }
        }
        self.funds.push(fund.to_vec());
    }

    fn factor(&self, alpha: f64) -> Quantile {
        let (value, standard_error) = self.bridges.lengths.quantile_with_error(1.0 - alpha, &self.ratios);
        Quantile { value, standard_error }
    }

    /// Returns the fund that is largest most often among the share alpha of paths with the largest ratios.
    fn most_often(&self, alpha: f64) -> Vec<f64> {
        let mut sorted = self.ratios.clone();
        sorted.sort_by(f64::total_cmp);
        let least = sorted.get(((1.0 - alpha) * sorted.len() as f64) as usize).copied().unwrap_or_default();
        let mut counts = vec![0_usize; self.funds.len()];
        for (ratio, whose) in self.ratios.iter().zip(&self.whose) {
            counts[*whose] += usize::from(*ratio >= least);
        }
        let most = (0..counts.len()).max_by_key(|&fund| counts[fund]).unwrap_or_default();
        self.funds.get(most).cloned().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::bridge::paths::AbsoluteBridges;
    use crate::numerics::law::empirical::EmpiricalDistribution;

    fn sample(assets: usize, dates: usize) -> Vec<Vec<f64>> {
        let mut generator = stream(8, "fund test", assets, 0);
        let row = |_| {
            let common: f64 = generator.sample(StandardNormal);
            let own = |_| 0.01 + 0.03 * common + 0.03 * generator.sample::<f64, _>(StandardNormal);
            (0..assets).map(own).collect()
        };
        (0..dates).map(row).collect()
    }

    #[test]
    fn one_asset_has_the_bridge_of_one_asset_and_the_factor_1() {
        let rows = sample(1, 40);
        let funds = FundBridges::simulate(&rows, 20_000, 3);
        assert_eq!(funds.joint_factor(0.1), Quantile { value: 1.0, standard_error: 0.0 });
        let law = EmpiricalDistribution::new(&rows.concat());
        let one = AbsoluteBridges::simulate(40, 20_000, 5).bridge_quantile_with_error(&law, 0.1);
        let fund = funds.quantile(&[1.0], 0.1);
        let allowed = 4.0 * one.standard_error.hypot(fund.standard_error);
        assert!((fund.value - one.value).abs() < allowed, "{fund:?} {one:?}");
        // With one fund the largest ratio is that fund's: the quantile over itself.
        assert!((funds.factor_among(&[vec![1.0]], 0.1).value - 1.0).abs() < 1e-8);
    }

    #[test]
    fn more_funds_never_lower_the_factor_and_equal_assets_leave_it_at_1() {
        let rows = sample(3, 60);
        let bridges = FundBridges::simulate(&rows, 2000, 3);
        let all = funds(&rows);
        let factors: Vec<f64> = (1..=all.len()).map(|count| bridges.factor_among(&all[..count], 0.1).value).collect();
        // Each of the two quantiles is accurate to 1e-9 of itself.
        assert!(factors.windows(2).all(|pair| pair[1] > pair[0] - 1e-8), "{factors:?}");
        assert!(bridges.joint_factor(0.1).value > factors[factors.len() - 1] - 1e-8);
        let alike: Vec<Vec<f64>> = rows.iter().map(|row| vec![row[0]; 3]).collect();
        let factor = FundBridges::simulate(&alike, 2000, 3).joint_factor(0.1).value;
        assert!((factor - 1.0).abs() < 1e-8, "{factor}");
    }
}
