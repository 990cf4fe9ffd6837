//! Wealth accounts of strategies, and the figures computed from them.

use crate::control::evaluation::walk_forward::ActualPeriod;
use crate::control::problem::actions::Band;
use crate::control::problem::dynamics::Dynamics;
use crate::control::request::annualised::compounded;

/// The account of one strategy: one entry per period, and one more for wealth.
#[derive(Debug, Clone, PartialEq)]
pub struct Account {
    /// Wealth at the start of each period and at the end of the last.
    pub wealth: Vec<f64>,
    /// Share of wealth held in each period, in all assets together.
    pub allocations: Vec<f64>,
    /// Share of wealth moved between bank and assets, or between assets, at the start of each period.
    pub traded: Vec<f64>,
}

/// Computes the account of a strategy. At the start of a period the holding, which the last return moved, is brought
/// into the strategy's band. A trade costs `cost` of the amount traded, paid at once ([`Dynamics`]). Wealth starts in
/// the bank, and the interest rate is the rate that the bank paid.
pub fn keep(
    bands: impl IntoIterator<Item = Band>,
    periods: &[ActualPeriod],
    cost: f64,
    initial_wealth: f64,
) -> Account {
    let (mut wealth, mut traded) = (vec![initial_wealth], Vec::with_capacity(periods.len()));
    let (mut allocations, mut now, mut holding) = (Vec::with_capacity(periods.len()), initial_wealth, 0.0);
    for (band, period) in bands.into_iter().zip(periods) {
        let dynamics = Dynamics::plain(period.bank_return, cost);
        let allocation = band.nearest(holding);
        traded.push(f64::abs(allocation - holding));
        (now, holding) = dynamics.next(now, holding, allocation, period.log_return);
        wealth.push(now);
        allocations.push(allocation);
    }
    Account { wealth, allocations, traded }
}

/// Computes the account of a strategy in several assets. At the start of a period each holding, which its last return
/// moved, is brought to its share of wealth in `held`. The cost, `cost` of the amount traded, is paid from wealth at
/// once. `rows` are log-returns, date by date, and `bank` is the interest the bank paid. Checked by:
/// `assets_that_are_one_give_the_books_of_one`.
pub fn keep_assets(held: &[Vec<f64>], rows: &[Vec<f64>], bank: &[f64], cost: f64, initial_wealth: f64) -> Account {
    let (mut wealth, mut traded, mut now) = (vec![initial_wealth], Vec::with_capacity(held.len()), initial_wealth);
    let mut before = vec![0.0; held.first().map_or(0, Vec::len)];
    for ((shares, log_returns), rate) in held.iter().zip(rows).zip(bank) {
        let moved: f64 = shares.iter().zip(&before).map(|(share, had)| f64::abs(share - had)).sum();
        before = shares.iter().zip(log_returns).map(|(share, z)| share * z.exp()).collect();
        let growth = (1.0 - shares.iter().sum::<f64>()) * (1.0 + rate) + before.iter().sum::<f64>();
        before.iter_mut().for_each(|position| *position /= growth);
        now = now * (1.0 - cost * moved) * growth;
        traded.push(moved);
        wealth.push(now);
    }
    Account { wealth, allocations: held.iter().map(|shares| shares.iter().sum()).collect(), traded }
}

impl Account {
    /// Returns the simple returns, net of cost.
    pub fn returns(&self) -> Vec<f64> {
        self.wealth.windows(2).map(|pair| pair[1] / pair[0] - 1.0).collect()
    }

    /// Returns, at each time, how far wealth is below its highest value so far, as a share of that value.
    pub fn drawdowns(&self) -> Vec<f64> {
        let mut highest = 0.0_f64;
        let below = |&wealth: &f64| {
            highest = highest.max(wealth);
            1.0 - wealth / highest
        };
        self.wealth.iter().map(below).collect()
    }

    /// Returns the largest of the [`drawdowns`](Self::drawdowns).
    pub fn max_drawdown(&self) -> f64 {
        self.drawdowns().into_iter().fold(0.0, f64::max)
    }

    /// Returns wealth at the end.
    pub fn final_wealth(&self) -> f64 {
        self.wealth.last().copied().unwrap_or_default()
    }

    /// Returns the mean share of wealth held in assets.
    pub fn mean_allocation(&self) -> f64 {
        self.allocations.iter().sum::<f64>() / self.allocations.len() as f64
    }

    /// Returns wealth at the end of each whole year per unit at its start. The last year ends with the last period. The
    /// [`uncounted_periods`] before the first year belong to none.
    pub fn yearly_growth(&self, year: usize) -> Vec<f64> {
        self.rolling_growth(year).skip(uncounted_periods(self.traded.len(), year)).step_by(year).collect()
    }

    /// Returns the mean share held in each of these years.
    pub fn yearly_allocation(&self, year: usize) -> Vec<f64> {
        let counted = &self.allocations[uncounted_periods(self.allocations.len(), year)..];
        counted.chunks_exact(year).map(|held| held.iter().sum::<f64>() / year as f64).collect()
    }

    /// Returns the growth of wealth over the year that begins with each period.
    pub fn rolling_growth(&self, year: usize) -> impl Iterator<Item = f64> {
        self.wealth.windows(year + 1).map(move |whole| whole[year] / whole[0])
    }
}

/// Returns how many periods at the start belong to no whole year, because years are counted back from the last period.
pub fn uncounted_periods(periods: usize, year: usize) -> usize {
    periods % year
}

/// Terminal wealth of a strategy on a path, and its largest fall on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathOutcome {
    /// Terminal wealth.
    pub wealth: f64,
    /// The largest fall below the highest value so far, as a share of it. Contributions and withdrawals are neither
    /// gain nor fall.
    pub fall: f64,
    /// Current value over the highest so far.
    level: f64,
}

impl PathOutcome {
    /// Returns the state at the start.
    pub fn at(wealth: f64) -> Self {
        PathOutcome { wealth, fall: 0.0, level: 1.0 }
    }

    /// Returns the state after a period that ends with `wealth`, of which `added` is a contribution.
    #[must_use]
    pub fn after(self, wealth: f64, added: f64) -> Self {
        let level = f64::min(1.0, self.level * (wealth - added) / self.wealth);
        PathOutcome { wealth, fall: self.fall.max(1.0 - level), level }
    }
}

/// Returns terminal wealth and largest fall of a constant mix.
pub fn mix_ended(periods: &[Dynamics], initial_wealth: f64, mix: f64, returns: &[f64]) -> PathOutcome {
    shares_ended(periods, initial_wealth, std::iter::repeat(mix), returns)
}

/// Returns terminal wealth and largest fall of holding these shares, period after period.
pub fn shares_ended(
    periods: &[Dynamics],
    initial_wealth: f64,
    shares: impl Iterator<Item = f64>,
    returns: &[f64],
) -> PathOutcome {
    let step = |(ended, holding): (PathOutcome, f64), ((dynamics, &log_return), share): ((&Dynamics, &f64), f64)| {
        let allocation = dynamics.highest_action(ended.wealth, share);
        let (wealth, holding) = dynamics.next(ended.wealth, holding, allocation, log_return);
        (ended.after(wealth, dynamics.contribution), holding)
    };
    periods.iter().zip(returns).zip(shares).fold((PathOutcome::at(initial_wealth), 0.0), step).0
}

/// Mean, volatility and Sharpe ratio per year, from per-period returns. The mean is compounded, the ratio's excess over
/// the bank is arithmetic, and deviations grow with the square root of time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Annual {
    /// Mean simple return per year, compounded: `(1 + m)^p - 1`, m the mean per period and p the periods per year.
    pub mean: f64,
    /// Standard deviation of simple returns, per square root of a year.
    pub volatility: f64,
    /// Mean excess over the bank divided by its deviation; 0 if the excess never varies.
    pub sharpe_ratio: f64,
}

impl Annual {
    /// Computes the figures from simple returns of the strategy and of the bank, period by period.
    pub fn of(returns: &[f64], bank: &[f64], periods_per_year: f64) -> Self {
        let excess: Vec<f64> = returns.iter().zip(bank).map(|(ours, bank)| ours - bank).collect();
        let (mean, deviation) = mean_and_deviation(returns);
        let (excess, excess_deviation) = mean_and_deviation(&excess);
        // A deviation of this size is rounding and counts as 0.
        let ratio = if excess_deviation > 1e-12 { excess / excess_deviation } else { 0.0 };
        Annual {
            mean: compounded(mean, periods_per_year),
            volatility: deviation * periods_per_year.sqrt(),
            sharpe_ratio: ratio * periods_per_year.sqrt(),
        }
    }
}

/// Returns the mean and the sample standard deviation.
fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns of +20 %, -10 % and +5 %, the bank at 1 %, half held throughout, 1 % of each trade lost:
    ///
    ///   month 1: 50 % bought, 0.5 lost, 99.5 (0.5 * 1.01 + 0.5 * 1.2) = 109.9475, the holding now 0.6 / 1.105
    ///   month 2: 0.5 - 0.6/1.105 sold, then the factor 0.5 * 1.01 + 0.5 * 0.9 = 0.955, the holding 0.45 / 0.955
    ///   month 3: 0.5 - 0.45/0.955 bought, then the factor 0.5 * 1.01 + 0.5 * 1.05 = 1.03
    #[test]
    fn three_months_agree_with_pencil_and_paper() {
        let period = |simple: f64| ActualPeriod { log_return: simple.ln_1p(), bank_return: 0.01 };
        let account = keep([Band::of(&[0.5]); 3], &[period(0.2), period(-0.1), period(0.05)], 0.01, 100.0);
        let traded = [0.5, 0.042_986_425_339_366_5, 0.028_795_811_518_324_6];
        let second = 109.9475 * (1.0 - 0.000_429_864_253_393_665) * 0.955;
        let wealth = [100.0, 109.9475, second, second * (1.0 - 0.000_287_958_115_183_246) * 1.03];
        for (found, expected) in account.traded.iter().chain(&account.wealth).zip(traded.iter().chain(&wealth)) {
            assert!((found - expected).abs() < 1e-12 * expected, "{account:?}");
        }
        assert!((account.drawdowns()[2] - (1.0 - second / 109.9475)).abs() < 1e-12);
        assert_eq!(account.drawdowns()[..2], [0.0, 0.0]);
        assert_eq!(account.yearly_growth(3), [account.wealth[3] / 100.0]);
        // The last two months are a year, and the first belongs to none.
        assert_eq!(account.yearly_growth(2), [account.wealth[3] / account.wealth[1]]);
    }

    #[test]
    fn growth_and_shares_are_of_the_same_years() {
        let account = Account {
            wealth: vec![8.0, 4.0, 2.0, 6.0, 6.0, 9.0],
            allocations: vec![1.0, 0.1, 0.3, 0.5, 0.7],
            traded: vec![0.0; 5],
        };
        assert_eq!((account.yearly_growth(2), account.yearly_allocation(2)), (vec![1.5, 1.5], vec![0.2, 0.6]));
    }

    /// Shares of 10 % and 30 % in two assets with the same returns equal 40 % in one. A later trade between the two
    /// costs twice the amount moved, although the total is unchanged.
    #[test]
    fn assets_that_are_one_give_the_books_of_one() {
        let returns = [0.2, -0.1, 0.05].map(f64::ln_1p);
        let rows = returns.map(|z| vec![z, z]);
        let (bank, one) = ([0.01; 3], [0.4, 0.3, 0.6]);
        let periods = returns.map(|log_return| ActualPeriod { log_return, bank_return: 0.01 });
        let expected = keep(one.map(|share| Band::of(&[share])), &periods, 0.01, 100.0);
        let held = one.map(|share| vec![0.25 * share, 0.75 * share]);
        let found = keep_assets(&held, &rows, &bank, 0.01, 100.0);
        let all = |account: &Account| [&account.wealth[..], &account.allocations, &account.traded].concat();
        for (found, expected) in all(&found).iter().zip(all(&expected)) {
            assert!((found - expected).abs() < 1e-12 * expected, "{found} {expected}");
        }
        let exchanged = [vec![0.4, 0.0], vec![0.0, 0.4]];
        let traded = keep_assets(&exchanged, &rows, &bank, 0.01, 100.0).traded;
        // 0.48 / 1.086 of the first asset is sold, and 0.4 of the second is bought.
        assert!((traded[1] - (0.48 / 1.086 + 0.4)).abs() < 1e-12, "{traded:?}");
    }

    /// From 100 up to 120, and 10 added: 130. A quarter is lost, 10 withdrawn: 87.5. A fifth is gained: 105, still 10 %
    /// below the highest. Half of that is lost: 45 % of the highest are left.
    #[test]
    fn what_is_added_or_withdrawn_is_neither_gain_nor_fall() {
        let course = [(130.0, 10.0), (87.5, -10.0), (105.0, 0.0), (52.5, 0.0)];
        let ended = course.iter().fold(PathOutcome::at(100.0), |ended, &(wealth, added)| ended.after(wealth, added));
        assert!((ended.fall - 0.55).abs() < 1e-12 && ended.wealth == 52.5, "{ended:?}");
        // With all wealth in the bank, withdrawals alone make no fall.
        assert_eq!(
            [(60.0, -41.0), (10.0, -50.5)].iter().fold(PathOutcome::at(100.0), |e, &(w, a)| e.after(w, a)).fall,
            0.0
        );
    }

    #[test]
    fn annual_figures_are_those_of_their_definitions() {
        let annual = Annual::of(&[0.01, 0.03], &[0.0, 0.01], 4.0);
        // Mean 2 %, 8.24 % in four quarters; deviation 0.01 sqrt 2; excesses of 1 and 2 %, mean 1.5 %, deviation 0.005
        // sqrt 2.
        assert!((annual.mean - (1.02_f64.powi(4) - 1.0)).abs() < 1e-15);
        assert!((annual.volatility - 0.02 * 2_f64.sqrt()).abs() < 1e-15);
        assert!((annual.sharpe_ratio - 2.0 * 0.015 / (0.005 * 2_f64.sqrt())).abs() < 1e-12);
        assert_eq!(Annual::of(&[0.01, 0.02], &[0.01, 0.02], 12.0).sharpe_ratio, 0.0);
    }
}
