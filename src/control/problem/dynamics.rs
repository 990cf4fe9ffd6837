//! The change of wealth in a period: the paper's S, with the share held, the cost of changing it, and the contribution.
//!
//! Changing the share held from h to a costs `c |a - h|` of wealth x; the return z then moves both, and C is added to
//! the bank:
//!
//!   x' = x (1 - c |a - h|) ((1-a)(1+r) + a e^z) + C,     h' = x (1 - c |a - h|) a e^z / x'.
//!
//! Future contributions have the present value P at the bank's rate: `P = (C + P') / (1 + r)`, P' that of the period
//! after and 0 after the last. Total wealth x + P then moves as wealth without contributions does, with the share b
//! held:
//!
//!   x' + P' = (x + P) ((1 - b)(1+r) + b e^z),   b = a x / (x + P),     if trading costs nothing.
//!
//! The safe policy sells all now: `(x (1 - c h) + P) (1+r)^n` at the horizon is the floor. Withdrawals must be paid for
//! any return of the asset, if P is negative and also before late contributions. So the reserve
//! `D = max(0, (D' - C) / (1 + r))` stays in the bank, and bounds the actions by `1 - D / (x (1 - c))`.
//!
//! With spending, a share of wealth is spent at the start of the period, before anything else moves
//! (`control/problem/spending.rs`), and worths are levels of spending. The reserve for what is secured then counts as
//! money that is still to be paid, and actions are shares of the surplus, which is all of total wealth. [`Advisor`] turns
//! them into shares of wealth.
//!
//! [`Advisor`]: crate::control::policy::advisor::Advisor
//!
//! The simulator, live sessions and the accounts of a backtest call these functions. The tables of the robust step hold
//! the same formulas over many returns at once (`control/bellman/gain_field.rs`), which `tests/solver/bellman.rs`
//! compares.

use crate::control::problem::actions::Band;
use crate::control::problem::spending::PeriodSpending;
use crate::control::request::specification::ProblemSpecification;

/// Least margin of a starting wealth over the reserve, as a share of it. At the reserve itself nothing is left to
/// decide, and total wealth may be rounding.
const SPARE: f64 = 0.01;

/// Rates, costs and flows of a period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dynamics {
    /// r, per step.
    pub rate_per_step: f64,
    /// c, per unit of wealth moved between bank and asset.
    pub trading_cost: f64,
    /// C, money added at the end of the period; negative if it is withdrawn.
    pub contribution: f64,
    /// P, the present value of this contribution and all later ones, by the bank; less the reserve for what is secured.
    pub to_come: f64,
    /// D, the wealth that must stay in the bank through the period to pay every future withdrawal.
    pub reserve: f64,
    /// Spending at the start of the period, if there is any.
    pub spending: Option<PeriodSpending>,
}

/// The trade from a holding to an action.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trade {
    /// Share of wealth held afterwards.
    pub action: f64,
    /// Wealth left, over the wealth left by selling everything: 1 without a cost.
    pub kept: f64,
}

/// The direction of a trade.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// `c (a - h)` is paid. It is negative for an action below the holding, so that the worth of an action has no kink.
    Buying,
    /// `c (h - a)` is paid.
    Selling,
}

impl Dynamics {
    /// Returns the dynamics of every period of a problem, and of the time after the last, without future contributions.
    pub fn of(problem: &ProblemSpecification) -> Vec<Self> {
        let mut after = Dynamics::plain(problem.rate_per_step, problem.trading_cost);
        let mut periods = vec![after];
        let spending = PeriodSpending::of(problem);
        for step in (0..problem.horizon).rev() {
            let (contribution, bank) = (problem.contributions.at(step), 1.0 + problem.rate_per_step);
            let to_come = (contribution + after.to_come) / bank;
            let reserve = ((after.reserve - contribution) / bank).max(0.0);
            let spending = spending.get(step).copied();
            let to_come = spending.map_or(to_come, |own| -own.reserve);
            after = Dynamics { contribution, to_come, reserve, spending, ..after };
            periods.push(after);
        }
        periods.reverse();
        periods
    }

    /// Returns the dynamics of a period without any contributions.
    pub fn plain(rate_per_step: f64, trading_cost: f64) -> Self {
        Dynamics { rate_per_step, trading_cost, contribution: 0.0, to_come: 0.0, reserve: 0.0, spending: None }
    }

    /// Returns the growth of a unit of wealth after trading: `(1-a)(1+r) + a e^z`.
    pub fn growth(self, action: f64, log_return: f64) -> f64 {
        (1.0 - action) * (1.0 + self.rate_per_step) + action * log_return.exp()
    }

    /// Returns the wealth after the share `traded` of it was bought and sold, per unit of wealth before:
    /// `1 - c |a - h|`.
    pub fn left(self, traded: f64) -> f64 {
        1.0 - self.trading_cost * traded
    }

    /// Returns the wealth after selling everything, per unit of wealth: `1 - c h`.
    pub fn liquidation(self, holding: f64) -> f64 {
        1.0 - self.trading_cost * holding
    }

    /// Returns S(x, a, z): wealth and the share of it held, after trading from the holding to `action` and holding it
    /// through `log_return`.
    pub fn next(self, wealth: f64, holding: f64, action: f64, log_return: f64) -> (f64, f64) {
        self.next_after(wealth, f64::abs(action - holding), action, log_return)
    }

    /// Returns S after the share `traded` of wealth was bought and sold. With several assets this exceeds the change of
    /// their total.
    pub fn next_after(self, wealth: f64, traded: f64, action: f64, log_return: f64) -> (f64, f64) {
        let growth = self.growth(action, log_return);
        let grown = wealth * self.left(traded) * growth;
        // If everything was held and lost, nothing is held any more.
        let share = if growth > 0.0 { action * log_return.exp() / growth } else { 0.0 };
        let next = grown + self.contribution;
        // If wealth cannot pay for a withdrawal nothing is left; if it hardly can, the asset is sold as well.
        (next, if next > 0.0 { (share * (grown / next)).min(1.0) } else { share })
    }

    /// Returns total wealth: the wealth after selling everything, plus the present value of future contributions, `x (1
    /// - c h) + P`.
    pub fn total(self, wealth: f64, holding: f64) -> f64 {
        wealth * self.liquidation(holding) + self.to_come
    }

    /// Returns the share of total wealth that is in hand after selling everything, `x (1 - c h) / (x (1 - c h) + P)`: 1
    /// without future contributions, and of the surplus.
    pub fn in_hand(self, wealth: f64, holding: f64) -> f64 {
        if self.spending.is_some() {
            return 1.0;
        }
        wealth * self.liquidation(holding) / self.total(wealth, holding)
    }

    /// Returns the worth of a unit of total wealth in the bank for `steps` steps: at the horizon, or with spending the
    /// level that it pays for.
    pub fn safe_worth(self, steps: usize) -> f64 {
        let grown = || (1.0 + self.rate_per_step).powf(steps as f64);
        self.spending.map_or_else(grown, |spending| spending.safe_worth())
    }

    /// Returns the worth of selling everything and staying in the bank for `steps` steps.
    pub fn floor(self, wealth: f64, holding: f64, steps: usize) -> f64 {
        self.total(wealth, holding) * self.safe_worth(steps)
    }

    /// Returns the floor gain of a state, given that of what is left after spending: both are one without.
    pub fn gain(self, left: f64) -> f64 {
        self.spending.map_or(left, |spending| spending.gain(left))
    }

    /// Returns the derivative of [`Self::gain`].
    pub fn slope_of_gain(self, left: f64) -> f64 {
        self.spending.map_or(1.0, |spending| spending.slope(left))
    }

    /// Returns the wealth that pays for every future withdrawal, with a hundredth to spare, even if all of it is held
    /// and must be sold.
    pub fn least_wealth(self) -> f64 {
        (1.0 + SPARE) * self.reserve / self.liquidation(1.0)
    }

    /// Returns the highest action up to `highest` that leaves the reserve in the bank after any trade of the holding:
    /// `1 - D / (x (1 - c))`, and at least 0.
    pub fn highest_action(self, wealth: f64, highest: f64) -> f64 {
        let free = 1.0 - self.reserve / (wealth * self.liquidation(1.0));
        highest.min(free).max(0.0)
    }

    /// Returns the directions in which a trade may pay: one if trading costs nothing.
    pub fn sides(self) -> &'static [Side] {
        if self.trading_cost > 0.0 { &[Side::Buying, Side::Selling] } else { &[Side::Buying] }
    }

    /// Returns the trade from `holding` to `action`, at the cost of one side.
    pub fn trade(self, side: Side, holding: f64, action: f64) -> Trade {
        let change = match side {
            Side::Buying => action - holding,
            Side::Selling => holding - action,
        };
        Trade { action, kept: (1.0 - self.trading_cost * change) / self.liquidation(holding) }
    }

    /// Returns the trade from `holding` to `action`, at its true cost.
    pub fn trade_to(self, holding: f64, action: f64) -> Trade {
        self.trade(if action < holding { Side::Selling } else { Side::Buying }, holding, action)
    }

    /// Returns the trade from `holding` to the nearer end of a band; none inside it.
    pub fn trade_into(self, band: Band, holding: f64) -> Trade {
        self.trade_to(holding, band.nearest(holding))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::request::contributions::Contributions;
    use crate::control::request::withdrawals::check_bank;

    fn costly() -> Dynamics {
        Dynamics::plain(0.01, 0.02)
    }

    /// Follows 100 with 30 in the asset. Buying 20 more costs 0.4; of the 99.6 left half is held, and the asset rises
    /// by a fifth: 49.8 x 1.01 + 49.8 x 1.2 = 110.058, of which 59.76 are in the asset.
    #[test]
    fn a_period_agrees_with_pencil_and_paper() {
        let rise = 1.2_f64.ln();
        let (wealth, holding) = costly().next(100.0, 0.3, 0.5, rise);
        assert!((wealth - 110.058).abs() < 1e-12 && (holding - 59.76 / 110.058).abs() < 1e-15);
        // 30 sold for 29.4, two years in the bank.
        assert!((costly().floor(100.0, 0.3, 2) - 99.4 * 1.01 * 1.01).abs() < 1e-12);
    }

    /// Adds 5 at the end of that period, and withdraws 21 a year later: 5 / 1.01 - 21 / 1.01^2 = -15.6357... is to
    /// come, and the same amount must stay in the bank. The 99.4 left by selling pay for both.
    #[test]
    fn what_is_added_and_withdrawn_agrees_with_pencil_and_paper() {
        let problem = ProblemSpecification {
            horizon: 2,
            trading_cost: 0.02,
            contributions: Contributions::Listed(vec![5.0, -21.0]),
            ..ProblemSpecification::of(vec![0.01, -0.01], 0.01)
        };
        let periods = Dynamics::of(&problem);
        let (wealth, holding) = periods[0].next(100.0, 0.3, 0.5, 1.2_f64.ln());
        assert!((wealth - 115.058).abs() < 1e-12 && (holding - 59.76 / 115.058).abs() < 1e-15);
        let to_come = 5.0 / 1.01 - 21.0 / (1.01 * 1.01);
        assert!((periods[0].to_come - to_come).abs() < 1e-14 && (periods[0].reserve + to_come).abs() < 1e-14);
        assert!((periods[1].reserve - 21.0 / 1.01).abs() < 1e-14 && periods[2] == Dynamics::plain(0.01, 0.02));
        let floor = (99.4 * 1.01 + 5.0) * 1.01 - 21.0;
        assert!((periods[0].floor(100.0, 0.3, 2) - floor).abs() < 1e-12);
        // Of 98, after the most expensive trade, the reserve is kept.
        let free = periods[0].highest_action(100.0, 1.0);
        assert!((98.0 * (1.0 - free) + to_come).abs() < 1e-12, "{free}");
        assert!(check_bank(&periods, 15.6).unwrap_err().contains("the end of period 2"));
        assert!(check_bank(&periods[1..], 20.7).unwrap_err().contains("the end of period 1"));
        assert_eq!((check_bank(&periods, 15.7), check_bank(&periods[1..], 20.8)), (Ok(()), Ok(())));
        // Wealth that cannot pay, and wealth that can only by selling the asset itself.
        assert!(periods[1].next(40.0, 1.0, 1.0, -0.8).0 < 0.0 && periods[1].next(40.0, 1.0, 1.0, -0.8).1 == 1.0);
        assert_eq!(periods[1].next(40.0, 0.9, 0.9, 0.0).1, 1.0);
    }

    #[test]
    fn what_a_trade_keeps_is_measured_by_what_selling_all_keeps() {
        assert_eq!(costly().trade_to(0.3, 0.0), Trade { action: 0.0, kept: 1.0 });
        let bought = costly().trade_into(Band { low: 0.5, high: 0.7 }, 0.3);
        assert!((bought.kept - 99.6 / 99.4).abs() < 1e-15 && bought.action == 0.5);
        let stayed = costly().trade_into(Band { low: 0.2, high: 0.7 }, 0.3);
        assert!((stayed.kept - 100.0 / 99.4).abs() < 1e-15 && stayed.action == 0.3);
        let free = Dynamics::plain(0.01, 0.0);
        assert_eq!((free.trade_to(0.3, 0.9).kept, free.sides().len()), (1.0, 1));
    }
}
