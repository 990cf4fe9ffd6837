//! Spending at the start of a period as an action, and its utility as a reward.
//!
//! With log or power utility, the value of a state is that of a sure level of spending: as much in every period left, in
//! money of now, and as much wealth at the horizon. It is proportional to wealth, `x m_t(F)`. With W_t the total weight
//! of the periods left, b_t the weight of what comes after, r_t the worth of a unit left after spending, and i the rise
//! of prices:
//!
//!   m_t^p = max over c of  w c^p + (1 - w) ((1 - c) r_t)^p,   w = 1 / W_t,  W_t = 1 + b_t W_(t+1),  p = 1 - risk aversion,
//!   r_t = max over a, min over F' of the certainty equivalent of ((1-a)(1+r) + a e^Z) m_(t+1)(F with Z) / (1 + i).
//!
//! The maximum over c comes after the robust step for r_t, because it increases with r_t: the worst law does not depend
//! on c. So a step with spending is the robust step without, followed by one formula. At p = 0, log utility, powers are
//! logarithms and c is w. Without a bound the best share is `c = (w m_t^-p)^(1 / risk aversion)`, and with bounds the
//! nearer one, since m_t is then beyond its value at the bound. If amounts are secured, "wealth" is the surplus here, wealth
//! above the reserve that pays for them (`control/request/spending.rs`). Source: Samuelson (1969), Lifetime portfolio selection by
//! dynamic stochastic programming, whose law is known.

use crate::control::request::specification::ProblemSpecification;

/// Spending in one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeriodSpending {
    /// w, the weight of this period's spending among all that is left.
    now: f64,
    /// p, one less the relative risk aversion.
    power: f64,
    /// The lowest and the highest share of wealth that may be spent.
    bounds: [f64; 2],
    /// The log of the worth of a unit that is left after spending and stays in the bank to the horizon.
    bank: f64,
    /// The log of the worth of a unit before spending, the rest of which stays in the bank to the horizon.
    safe: f64,
    /// s p_t, what is secured in the period.
    pub secured: f64,
    /// R_t, wealth that pays from the bank for it and for what is secured later.
    pub reserve: f64,
}

impl PeriodSpending {
    /// Returns the spending of every period of a problem; empty without spending.
    pub fn of(problem: &ProblemSpecification) -> Vec<Self> {
        let Some(spending) = &problem.spending else { return Vec::new() };
        let power = problem.utility.power();
        let (mut safe, mut weight) = (0.0, spending.bequest);
        let reserves = spending.reserves(problem.rate_per_step, problem.horizon);
        let mut before = |step: usize| {
            let bank = problem.rate_per_step.ln_1p() - spending.inflation.ln_1p() + safe;
            weight = 1.0 + spending.weight_after(step) * weight;
            let bounds = [spending.lowest, spending.highest];
            let [secured, reserve] = reserves[step];
            let own = PeriodSpending { now: 1.0 / weight, power, bounds, bank, safe: 0.0, secured, reserve };
            safe = own.worth(bank);
            PeriodSpending { safe, ..own }
        };
        let mut periods: Vec<Self> = (0..problem.horizon).rev().map(&mut before).collect();
        periods.reverse();
        periods
    }

    /// Returns the worth of a unit of wealth that is spent at best and otherwise stays in the bank: its sure level of
    /// spending.
    pub fn safe_worth(&self) -> f64 {
        self.safe.exp()
    }

    /// Returns the worth of a unit that is left after spending and stays in the bank: its sure level of spending.
    pub fn left_worth(&self) -> f64 {
        self.bank.exp()
    }

    /// Returns ln(m / its value in the bank), given `left`, ln of the worth of a unit left after spending over its value
    /// in the bank. It is 0 at 0 and increases.
    pub fn gain(&self, left: f64) -> f64 {
        self.worth(self.bank + left) - self.safe
    }

    /// Returns the derivative of [`Self::gain`]: the share of what is left in the value.
    pub fn slope(&self, left: f64) -> f64 {
        let left = self.bank + left;
        let [_, kept] = self.split(left);
        ((1.0 - self.now).ln() + self.power * (kept + left - self.worth(left))).exp()
    }

    /// Returns c, the best share of wealth or of the surplus to spend in a state with this gain.
    pub fn share(&self, gain: f64) -> f64 {
        self.share_at(self.safe + gain)
    }

    fn share_at(&self, worth: f64) -> f64 {
        let best = ((self.now.ln() - self.power * worth) / (1.0 - self.power)).exp();
        best.clamp(self.bounds[0], self.bounds[1])
    }

    /// Returns ln m, given ln r.
    fn worth(&self, left: f64) -> f64 {
        let [spent, kept] = self.split(left);
        self.mean([spent, kept + left])
    }

    /// Returns ln c and ln(1 - c) of the best share, given ln r.
    fn split(&self, left: f64) -> [f64; 2] {
        let log_odds = |share: f64| share.ln() - (-share).ln_1p();
        let best = (log_odds(self.now) - self.power * left) / (1.0 - self.power);
        let odds = best.clamp(log_odds(self.bounds[0]), log_odds(self.bounds[1]));
        [-(-odds).exp().ln_1p(), -odds.exp().ln_1p()]
    }

    /// Returns the log of the power mean of two amounts, given their logs: from the larger term, so that no power is out
    /// of range, and none is divided by a power near 0.
    fn mean(&self, [spent, kept]: [f64; 2]) -> f64 {
        let above = |log: f64, other: f64, weight: f64| match self.power {
            0.0 => log + weight * (other - log),
            power => log + (weight * (power * (other - log)).exp_m1()).ln_1p() / power,
        };
        if self.power * (kept - spent) <= 0.0 {
            above(spent, kept, 1.0 - self.now)
        } else {
            above(kept, spent, self.now)
        }
    }
}
