//! What becomes of money in a period: the paper's S, with the share held and the cost of changing it.
//!
//! Who holds the share h and wants a pays `c |a - h|` of wealth x, and the return z then moves both:
//!
//!   x' = x (1 - c |a - h|) ((1-a)(1+r) + a e^z),     h' = a e^z / ((1-a)(1+r) + a e^z).
//!
//! The safe policy sells all now: its terminal wealth `x (1 - c h) (1+r)^n` is the floor. The simulator, live
//! sessions and the books of a backtest call these functions; the tables of the robust step hold the same formulas over many
//! returns at once (`control/bellman/gain_field.rs`), which `tests/bellman.rs` compares.

use crate::control::problem::actions::Band;
use crate::control::problem::state::State;
use crate::control::request::specification::ProblemSpecification;

/// Bank return and trading cost of a period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dynamics {
    /// r, per step.
    pub rate_per_step: f64,
    /// c, of the wealth that is moved between bank and asset.
    pub trading_cost: f64,
}

/// A holding brought to an action.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trade {
    /// Share of wealth held afterwards.
    pub action: f64,
    /// Wealth left, over what selling everything leaves: 1 without a cost.
    pub kept: f64,
}

/// Which way a holding is changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// `c (a - h)` is paid. Of an action below the holding this is negative, so that what an action is worth has no kink.
    Buying,
    /// `c (h - a)` is paid.
    Selling,
}

impl Dynamics {
    /// Of every period of a problem.
    pub fn of(problem: &ProblemSpecification) -> Self {
        Dynamics { rate_per_step: problem.rate_per_step, trading_cost: problem.trading_cost }
    }

    /// Wealth after a period, per unit of wealth at its start after trading: `(1-a)(1+r) + a e^z`.
    pub fn growth(self, action: f64, log_return: f64) -> f64 {
        (1.0 - action) * (1.0 + self.rate_per_step) + action * log_return.exp()
    }

    /// Wealth after trading, per unit of wealth before: `1 - c |a - h|`.
    pub fn left(self, holding: f64, action: f64) -> f64 {
        1.0 - self.trading_cost * f64::abs(action - holding)
    }

    /// Wealth after selling everything, per unit of wealth: `1 - c h`.
    pub fn liquidation(self, holding: f64) -> f64 {
        1.0 - self.trading_cost * holding
    }

    /// S(x, a, z): wealth after the holding was brought to `action` and held through `log_return`.
    pub fn next_wealth(self, wealth: f64, holding: f64, action: f64, log_return: f64) -> f64 {
        wealth * self.left(holding, action) * self.growth(action, log_return)
    }

    /// The share held after `log_return`.
    pub fn drifted(self, action: f64, log_return: f64) -> f64 {
        action * log_return.exp() / self.growth(action, log_return)
    }

    /// G(y, a, z): next wealth and holding, and the law with the return learned.
    pub fn next_state(self, state: &State, action: f64, log_return: f64) -> State {
        let mut law = state.law.clone();
        law.push(log_return);
        State {
            wealth: self.next_wealth(state.wealth, state.holding, action, log_return),
            holding: self.drifted(action, log_return),
            law,
        }
    }

    /// Terminal wealth of selling everything and staying in the bank for `steps` steps.
    pub fn floor(self, wealth: f64, holding: f64, steps: usize) -> f64 {
        wealth * self.liquidation(holding) * (1.0 + self.rate_per_step).powf(steps as f64)
    }

    /// The ways in which a holding is worth changing: one where that costs nothing.
    pub fn sides(self) -> &'static [Side] {
        if self.trading_cost > 0.0 { &[Side::Buying, Side::Selling] } else { &[Side::Buying] }
    }

    /// Bringing `holding` to `action`, at the cost of one side.
    pub fn trade(self, side: Side, holding: f64, action: f64) -> Trade {
        let change = match side {
            Side::Buying => action - holding,
            Side::Selling => holding - action,
        };
        Trade { action, kept: (1.0 - self.trading_cost * change) / self.liquidation(holding) }
    }

    /// Bringing `holding` to `action`, at what it costs.
    pub fn trade_to(self, holding: f64, action: f64) -> Trade {
        self.trade(if action < holding { Side::Selling } else { Side::Buying }, holding, action)
    }

    /// Bringing `holding` to the nearer end of a band; nothing inside it.
    pub fn trade_into(self, band: Band, holding: f64) -> Trade {
        self.trade_to(holding, band.nearest(holding))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COSTLY: Dynamics = Dynamics { rate_per_step: 0.01, trading_cost: 0.02 };

    /// 100 with 30 in the asset. Buying 20 more costs 0.4; of the 99.6 left half is held, and the asset rises by a fifth:
    /// 49.8 x 1.01 + 49.8 x 1.2 = 110.058, of which 59.76 are in the asset.
    #[test]
    fn a_period_agrees_with_pencil_and_paper() {
        let rise = 1.2_f64.ln();
        assert!((COSTLY.next_wealth(100.0, 0.3, 0.5, rise) - 110.058).abs() < 1e-12);
        assert!((COSTLY.drifted(0.5, rise) - 59.76 / 110.058).abs() < 1e-15);
        // 30 sold for 29.4, two years in the bank.
        assert!((COSTLY.floor(100.0, 0.3, 2) - 99.4 * 1.01 * 1.01).abs() < 1e-12);
    }

    #[test]
    fn what_a_trade_keeps_is_measured_by_what_selling_all_keeps() {
        assert_eq!(COSTLY.trade_to(0.3, 0.0), Trade { action: 0.0, kept: 1.0 });
        let bought = COSTLY.trade_into(Band { low: 0.5, high: 0.7 }, 0.3);
        assert!((bought.kept - 99.6 / 99.4).abs() < 1e-15 && bought.action == 0.5);
        let stayed = COSTLY.trade_into(Band { low: 0.2, high: 0.7 }, 0.3);
        assert!((stayed.kept - 100.0 / 99.4).abs() < 1e-15 && stayed.action == 0.3);
        let free = Dynamics { trading_cost: 0.0, ..COSTLY };
        assert_eq!((free.trade_to(0.3, 0.9).kept, free.sides().len()), (1.0, 1));
    }
}
