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
//! The search for the largest ratio begins with the single assets, equal shares, inverse volatilities and twenty fixed
//! draws. Then it looks at the paths just below the quantile, one after the other, and climbs from the fund that is
//! largest on such a path to a fund that is larger there, by the gradient of ln H less ln E H, where the mean E H is in
//! closed form. Each fund found counts on every path. Only the paths near the quantile matter, so few funds do what
//! thousands of draws would: see `the_joint_factor_is_that_of_thousands_of_funds` in `tests/solver/assets.rs`.

use rand::RngExt;
use rand_distr::StandardNormal;

use crate::numerics::bridge::Quantile;
use crate::numerics::bridge::scale_mixture::ScaleMixture;
use crate::numerics::machine::dispatch::dispatched;
use crate::numerics::machine::interruption;
use crate::numerics::machine::streams::stream;
use crate::numerics::transport::water_filling::inverse_volatility;

/// The number of funds drawn uniformly over all shares; the draws are fixed, so every call uses the same funds.
const DRAWN_FUNDS: usize = 20;
/// Paths from which funds are sought.
const SOUGHT: usize = 256;
/// Share of alpha whose paths are above the quantile for sure, whatever else is found.
const DECIDED: f64 = 0.8;
/// Evaluations of one climb.
const CLIMB: usize = 12;
/// The first step of a climb, in the log of a share, and its factors after a success and after a failure.
const FIRST_STEP: f64 = 1.0;
const LONGER: f64 = 1.5;
const SHORTER: f64 = 0.3;
/// Part of equal shares in the fund from which a climb starts, so that every asset can enter.
const EQUAL_PART: f64 = 0.1;
/// Paths whose statistics are summed together: their sums stay in the first-level cache.
const PATHS: usize = 64;

/// Returns the log-returns of a fund that is rebalanced to the shares `fund` every period: `ln sum_i theta_i e^(z_i)`.
pub fn fund_returns(rows: &[Vec<f64>], fund: &[f64]) -> Vec<f64> {
    rows.iter().map(|row| growth(row.iter().map(|log_return| log_return.exp()), fund).ln()).collect()
}

/// Returns `sum_i theta_i e^(z_i)`, the growth of a fund in a period in which its assets grow by these factors.
fn growth(growths: impl Iterator<Item = f64>, fund: &[f64]) -> f64 {
    growths.zip(fund).map(|(growth, share)| share * growth).sum()
}

/// Bridges of all funds of the assets with log-returns `rows`, one row a date, at least two dates.
pub struct FundBridges<'a> {
    rows: &'a [Vec<f64>],
    /// `e^z`, in the shape of `rows`.
    growths: Vec<Vec<f64>>,
    /// The centred normals of the dates, scaled to length 1: block after block of paths, each date by date. Unused paths
    /// of the last block are 0.
    directions: Vec<[f64; PATHS]>,
    paths: usize,
    lengths: ScaleMixture,
}

impl<'a> FundBridges<'a> {
    /// Simulates the bridges; path p uses the stream (seed, "fund bridge", 0, p). Cost O(n paths).
    pub fn simulate(rows: &'a [Vec<f64>], paths: usize, seed: u64) -> Self {
        let dates = rows.len();
        let mut directions = vec![[0.0; PATHS]; dates * paths.div_ceil(PATHS)];
        for path in 0..paths {
            interruption::checkpoint();
            let mut generator = stream(seed, "fund bridge", 0, path);
            let normals: Vec<f64> = (0..dates).map(|_| generator.sample(StandardNormal)).collect();
            let mean = normals.iter().sum::<f64>() / dates as f64;
            let length = normals.iter().map(|normal| (normal - mean).powi(2)).sum::<f64>().sqrt();
            let block = &mut directions[path / PATHS * dates..][..dates];
            let values = block.iter_mut().map(|paths| &mut paths[path % PATHS]);
            values.zip(&normals).for_each(|(value, normal)| *value = (normal - mean) / length);
        }
        let growths = rows.iter().map(|row| row.iter().map(|log_return| log_return.exp()).collect()).collect();
        let lengths = ScaleMixture::chi(dates.saturating_sub(1).max(1));
        FundBridges { rows, growths, directions, paths, lengths }
    }

    /// Returns H of a fund divided by the length, for each path. Cost O(n (paths + ln n)).
    fn statistic(&self, fund: &[f64]) -> Vec<f64> {
        interruption::checkpoint();
        let sorted = SortedFund::new(&self.growths, fund);
        let root = (self.rows.len() as f64).sqrt();
        let gaps: Vec<(usize, f64)> = sorted.gaps().map(|(date, gap)| (date, gap / root)).collect();
        let of = |block: &[[f64; PATHS]]| dispatched!(statistics(block, &gaps));
        let mut all = self.directions.chunks_exact(self.rows.len().max(1)).flat_map(of).collect::<Vec<f64>>();
        all.truncate(self.paths);
        all
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

    /// Returns the joint factor of all funds; exactly 1 for one asset. Cost O(funds n (paths + climb d + ln n)), with
    /// about 280 + d funds.
    /// Checked by: tests/solver/assets.rs, the_joint_factor_is_that_of_thousands_of_funds.
    pub fn joint_factor(&self, alpha: f64) -> Quantile {
        let assets = self.rows.first().map_or(0, Vec::len);
        if assets < 2 {
            return Quantile { value: 1.0, standard_error: 0.0 };
        }
        let mut largest = Largest::none(self);
        funds(self.rows).iter().for_each(|fund| largest.admit(fund, alpha));
        for _ in 0..SOUGHT {
            let Some(path) = largest.next(alpha) else { break };
            let from = largest.funds[largest.whose[path]].clone();
            largest.admit(&self.climb(path, from), alpha);
        }
        largest.factor(alpha)
    }

    /// Returns a fund whose H over E H is larger on `path` than that of `from`, by steps in the logs of its shares.
    fn climb(&self, path: usize, mut from: Vec<f64>) -> Vec<f64> {
        let equal = EQUAL_PART / from.len() as f64;
        from.iter_mut().for_each(|share| *share = (1.0 - EQUAL_PART) * *share + equal);
        let (mut best, mut slopes) = self.ratio(path, &from);
        let mut step = FIRST_STEP;
        for _ in 0..CLIMB {
            let mean: f64 = from.iter().zip(&slopes).map(|(share, slope)| share * slope).sum();
            let steepest = slopes.iter().map(|slope| (slope - mean).abs()).fold(0.0, f64::max);
            if steepest <= 0.0 {
                break;
            }
            let mut next: Vec<f64> = from
                .iter()
                .zip(&slopes)
                .map(|(share, slope)| share * (step * (slope - mean) / steepest).exp())
                .collect();
            let whole: f64 = next.iter().sum();
            next.iter_mut().for_each(|share| *share /= whole);
            let (ratio, there) = self.ratio(path, &next);
            if ratio > best {
                (from, best, slopes, step) = (next, ratio, there, LONGER * step);
            } else {
                step *= SHORTER;
            }
        }
        from
    }

    /// Returns ln H - ln E H of a fund on a path, up to a constant, and its slopes in the shares:
    ///
    ///   H ~ sum_k |P_k| gap_k,   E H ~ sum_k sqrt(t_k (1 - t_k)) gap_k,   t_k = k / n
    ///
    /// Cost O(n (d + ln n)).
    fn ratio(&self, path: usize, fund: &[f64]) -> (f64, Vec<f64>) {
        let dates = self.rows.len();
        let sorted = SortedFund::new(&self.growths, fund);
        let block = &self.directions[path / PATHS * dates..][..dates];
        let (mut statistic, mut mean, mut partial) = (0.0, 0.0, 0.0_f64);
        // The weights of each date's log-return in both sums: of the gap that it ends less of the gap that it begins.
        let mut weights = vec![[0.0; 2]; dates];
        let mut ends = [0.0; 2];
        for (place, (date, gap)) in sorted.gaps().enumerate() {
            partial += block[date][path % PATHS];
            let time = (place + 1) as f64 / dates as f64;
            let begins = [partial.abs(), (time * (1.0 - time)).sqrt()];
            (statistic, mean) = (statistic + begins[0] * gap, mean + begins[1] * gap);
            weights[date] = [ends[0] - begins[0], ends[1] - begins[1]];
            ends = begins;
        }
        if let Some(last) = sorted.order.last() {
            weights[*last] = ends;
        }
        if statistic <= 0.0 || mean <= 0.0 {
            return (f64::NEG_INFINITY, vec![0.0; fund.len()]);
        }
        let mut slopes = vec![0.0; fund.len()];
        for ((growths, weights), whole) in self.growths.iter().zip(&weights).zip(&sorted.growths) {
            let weight = (weights[0] / statistic - weights[1] / mean) / whole;
            slopes.iter_mut().zip(growths).for_each(|(slope, growth)| *slope += weight * growth);
        }
        ((statistic / mean).ln(), slopes)
    }
}

/// The returns of a fund in order.
struct SortedFund {
    /// Its [`growth`] on each date, and the log-return, the log of that.
    growths: Vec<f64>,
    zeta: Vec<f64>,
    /// The dates, ascending by log-return.
    order: Vec<usize>,
}

impl SortedFund {
    fn new(growths: &[Vec<f64>], fund: &[f64]) -> Self {
        let growths: Vec<f64> = growths.iter().map(|row| growth(row.iter().copied(), fund)).collect();
        let zeta: Vec<f64> = growths.iter().map(|growth| growth.ln()).collect();
        let mut order: Vec<usize> = (0..zeta.len()).collect();
        order.sort_by(|&left, &right| zeta[left].total_cmp(&zeta[right]));
        SortedFund { growths, zeta, order }
    }

    /// Returns the dates but the last, ascending by log-return, each with the gap to the next.
    fn gaps(&self) -> impl Iterator<Item = (usize, f64)> {
        self.order.windows(2).map(|pair| (pair[0], self.zeta[pair[1]] - self.zeta[pair[0]]))
    }
}

/// Returns the sums of `|partial sum| gap` over the gaps, for each path of a block.
#[inline(always)]
fn statistics(block: &[[f64; PATHS]], gaps: &[(usize, f64)]) -> [f64; PATHS] {
    let (mut sums, mut partials) = ([0.0; PATHS], [0.0_f64; PATHS]);
    for &(date, gap) in gaps {
        let normals = &block[date];
        for path in 0..PATHS {
            partials[path] += normals[path];
            sums[path] += partials[path].abs() * gap;
        }
    }
    sums
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
    /// True for each path whose largest fund was sought.
    sought: Vec<bool>,
}

impl<'b, 'a> Largest<'b, 'a> {
    fn none(bridges: &'b FundBridges<'a>) -> Self {
        let paths = bridges.paths;
        let (ratios, whose, sought) = (vec![0.0; paths], vec![0; paths], vec![false; paths]);
        Largest { bridges, ratios, funds: Vec::new(), whose, sought }
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

    /// Returns the next path to seek a fund for: of those not sought yet, the one with the largest ratio that is not far
    /// above the quantile. `None` if there is none. Cost O(paths).
    fn next(&mut self, alpha: f64) -> Option<usize> {
        let mut sorted = self.ratios.clone();
        let rank = ((1.0 - DECIDED * alpha) * sorted.len() as f64) as usize;
        let (_, &mut decided, _) = sorted.select_nth_unstable_by(rank.min(self.ratios.len() - 1), f64::total_cmp);
        let open = (0..self.ratios.len()).filter(|&path| !self.sought[path] && self.ratios[path] <= decided);
        let next = open.max_by(|&left, &right| self.ratios[left].total_cmp(&self.ratios[right]))?;
        self.sought[next] = true;
        Some(next)
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
