//! Certainty equivalent of a strategy per year, and its excess over another's, with intervals.

use crate::control::evaluation::account::Account;
use crate::control::evaluation::backtest_report::BootstrapEstimate;
use crate::control::problem::utility::RelativeUtility;
use crate::control::request::specification::UtilitySpecification;
use crate::numerics::statistics::long_run_mean::{DRAWS, LongRunMean, simultaneous_spread};

/// Wealth at the start of the record, and of every year whose utility is taken.
pub const INITIAL_WEALTH: f64 = 100.0;
/// Consecutive years that may depend on each other.
pub const YEAR_BLOCK: usize = 3;
/// Intended coverage probability of an interval.
pub const CONFIDENCE: f64 = 0.9;
/// Step of a mix's share in a finite difference of its worth.
const SHARE_STEP: f64 = 1e-3;

/// Units and seed of yearly figures.
pub struct Scale {
    /// Periods in a year.
    pub periods_per_year: usize,
    /// Utility of wealth at the end of a year.
    pub utility: UtilitySpecification,
    /// Seed of the resamples.
    pub seed: u64,
}

/// The certainty equivalent of mean utility over years that each start with [`INITIAL_WEALTH`], and the contribution of
/// each year to it:
///
///   C = U^-1( mean U(x_i) ),   part_i = (U(x_i) - mean U) / U'(C),
///
/// the influence of year i, so that C is a mean of the parts to first order.
#[derive(Debug, Clone)]
pub struct YearlyWorth {
    certainty_equivalent: f64,
    parts: Vec<f64>,
}

/// The accounts of a constant mix of a strategy's average share, and of a mix with a slightly larger or smaller share.
#[derive(Debug, Clone)]
pub struct MixBooks {
    at_mean: Account,
    nearby: Account,
    step: f64,
}

impl MixBooks {
    /// Computes the accounts of the mix of `share` with `keep`.
    pub fn new(share: f64, keep: impl Fn(f64) -> Account) -> Self {
        let step = if share > 0.5 { -SHARE_STEP } else { SHARE_STEP };
        MixBooks { at_mean: keep(share), nearby: keep(share + step), step }
    }
}

impl YearlyWorth {
    /// Computes the worth from the growth of wealth in each year.
    pub fn new(utility: UtilitySpecification, growth: &[f64]) -> Self {
        let relative = RelativeUtility::new(utility, INITIAL_WEALTH);
        let values: Vec<f64> = growth.iter().map(|growth| relative.value(growth.ln())).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let certainty_equivalent = INITIAL_WEALTH * relative.inverse(mean).exp();
        let slope = certainty_equivalent * relative.inverse_slope(mean);
        let parts = values.into_iter().map(|value| slope * (value - mean)).collect();
        YearlyWorth { certainty_equivalent, parts }
    }

    /// Returns the worth with its own interval.
    pub fn estimate(&self) -> BootstrapEstimate {
        let mean = LongRunMean::new(self.certainty_equivalent, &self.parts, YEAR_BLOCK);
        BootstrapEstimate { value: mean.value(), interval: mean.interval(CONFIDENCE) }
    }

    /// Returns its rank among `worths` by the certainty equivalent, 1 for the best; equal ones share it.
    pub fn place<'a>(&self, worths: impl Iterator<Item = &'a YearlyWorth>) -> usize {
        1 + worths.filter(|other| other.certainty_equivalent > self.certainty_equivalent).count()
    }

    /// Returns its excess over another worth of the same years.
    pub fn beyond(&self, other: &YearlyWorth) -> LongRunMean {
        let parts: Vec<f64> = self.parts.iter().zip(&other.parts).map(|(own, other)| own - other).collect();
        LongRunMean::new(self.certainty_equivalent - other.certainty_equivalent, &parts, YEAR_BLOCK)
    }

    /// Returns its excess over the mix of the average share of `account`, whose worth this is. That share is itself an
    /// average over the years, so each year is corrected by the worth of its deviation from it:
    ///
    ///   part_i = own_i - mix_i - dC_mix/da (a_i - mean a).
    ///
    /// Checked by: `the_share_of_the_own_mix_is_an_average_too`.
    pub fn beyond_own_mix(&self, account: &Account, mix: &MixBooks, scale: &Scale) -> LongRunMean {
        let year = scale.periods_per_year;
        let worth = |account: &Account| YearlyWorth::new(scale.utility, &account.yearly_growth(year));
        let [at_mean, nearby] = [&mix.at_mean, &mix.nearby].map(worth);
        let slope = (nearby.certainty_equivalent - at_mean.certainty_equivalent) / mix.step;
        let held = account.yearly_allocation(year);
        let average = held.iter().sum::<f64>() / held.len() as f64;
        let part = |((own, mix), held): ((&f64, &f64), &f64)| own - mix - slope * (held - average);
        let parts: Vec<f64> = self.parts.iter().zip(&at_mean.parts).zip(&held).map(part).collect();
        LongRunMean::new(self.certainty_equivalent - at_mean.certainty_equivalent, &parts, YEAR_BLOCK)
    }
}

/// Returns simultaneous intervals, which also hold for whichever comparison looks best.
pub fn at_once(differences: &[LongRunMean], seed: u64) -> Vec<BootstrapEstimate> {
    let spread = simultaneous_spread(differences, CONFIDENCE, DRAWS, seed);
    let estimate = |mean: &LongRunMean| BootstrapEstimate { value: mean.value(), interval: mean.within(spread) };
    differences.iter().map(estimate).collect()
}

/// As [`at_once`], if some have nothing to be compared with.
pub fn present_at_once(differences: Vec<Option<LongRunMean>>, seed: u64) -> Vec<Option<BootstrapEstimate>> {
    let present: Vec<LongRunMean> = differences.iter().flatten().cloned().collect();
    let mut estimates = at_once(&present, seed).into_iter();
    differences.iter().map(|difference| difference.as_ref().and_then(|_| estimates.next())).collect()
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_distr::StandardNormal;

    use super::*;
    use crate::control::evaluation::account::keep;
    use crate::control::evaluation::walk_forward::ActualPeriod;
    use crate::control::problem::actions::Band;
    use crate::numerics::machine::streams::stream;

    #[test]
    fn the_worth_is_the_certainty_equivalent_and_its_parts_are_what_a_year_adds() {
        let even = YearlyWorth::new(UtilitySpecification::Power { risk_aversion: 2.0 }, &[0.8, 1.2]);
        // Harmonic mean: 2 / (1/80 + 1/120).
        assert!((even.certainty_equivalent - 96.0).abs() < 1e-10);
        // At risk aversion 30, U(100) keeps 1e-58 of 1/29, and relative utility has all its digits.
        let averse = UtilitySpecification::Power { risk_aversion: 30.0 };
        let expected = 100.0 * ((0.9_f64.powi(-29) + 1.1_f64.powi(-29)) / 2.0).powf(-1.0 / 29.0);
        assert!((YearlyWorth::new(averse, &[0.9, 1.1]).certainty_equivalent - expected).abs() < 1e-9);
        // A ten-thousandth more weight on one year of five moves the worth by that much of its part.
        let growth = [0.7, 1.1, 1.2, 0.95, 1.3];
        let worth = YearlyWorth::new(averse, &growth);
        let weighted = |index: usize, more: f64| {
            let sum: f64 = growth.iter().map(|growth| growth.powi(-29)).sum();
            100.0 * ((1.0 - more) * sum / 5.0 + more * growth[index].powi(-29)).powf(-1.0 / 29.0)
        };
        for (index, part) in worth.parts.iter().enumerate() {
            let found = (weighted(index, 1e-6) - weighted(index, -1e-6)) / 2e-6;
            assert!((found - part).abs() < 1e-5 * part.abs(), "{found} {part}");
        }
    }

    #[test]
    fn equal_worths_share_a_place() {
        let worths = [1.1, 1.2, 1.1, 0.9].map(|growth| YearlyWorth::new(UtilitySpecification::Log {}, &[growth, 1.0]));
        assert_eq!(worths.each_ref().map(|worth| worth.place(worths.iter())), [2, 1, 2, 4]);
    }

    /// Checks shares that change at random from year to year. The truth is the average loss against the mix of the
    /// expected share, and the interval accounts for the deviation of the realised average from it.
    #[test]
    fn the_share_of_the_own_mix_is_an_average_too() {
        let scale = Scale { periods_per_year: 1, utility: UtilitySpecification::Power { risk_aversion: 3.0 }, seed: 1 };
        let mut generator = stream(4, "test", 0, 0);
        let mut record = |years: usize| {
            let shares: Vec<f64> = (0..years).map(|_| f64::from(u8::from(generator.random::<f64>() < 0.5))).collect();
            let normal = |_| 0.06 + 0.15 * generator.sample::<f64, _>(StandardNormal);
            let periods = (0..years).map(normal).map(|log_return| ActualPeriod { log_return, bank_return: 0.01 });
            (shares, periods.collect::<Vec<ActualPeriod>>())
        };
        let beyond = |(shares, periods): (Vec<f64>, Vec<ActualPeriod>)| {
            let kept = |shares: &[f64]| keep(shares.iter().map(|share| Band::of(&[*share])), &periods, 0.0, 100.0);
            let account = kept(&shares);
            let mix = MixBooks::new(account.mean_allocation(), |share| kept(&vec![share; shares.len()]));
            YearlyWorth::new(scale.utility, &account.yearly_growth(1)).beyond_own_mix(&account, &mix, &scale)
        };
        // Over one long record wealth would overflow.
        let truth = (0..1000).map(|_| beyond(record(400)).value()).sum::<f64>() / 1000.0;
        let trials = 600;
        let held = (0..trials)
            .filter(|_| {
                let [low, high] = beyond(record(40)).interval(CONFIDENCE);
                low <= truth && truth <= high
            })
            .count();
        // 90 % of 600 within three standard errors, and a little more for the linearisation over forty years.
        assert!((505..=565).contains(&held), "{held}");
    }
}
