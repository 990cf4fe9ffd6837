//! Solves another controlled problem: the seller of a European call hedges it with shares of its asset.
//!
//!     cargo run --example hedge [TRADING_COST]
//!
//! The example shows how to use the method for a problem that the library does not know. `Seller` defines the state, the actions
//! and the final value, and the general solver of the library does the rest. The seller knows eight returns of the asset, and is
//! robust against every law of the next three within a Wasserstein distance of theirs. The premium is the lowest price of the
//! call that leaves the seller as well off with the call as without it.
//!
//! Nested enumeration computes the same premium without the library. It uses a lattice of prices, and finds the worst law of each
//! action by the dual of the transport problem. The two must agree to half a basis point of the premium.

use std::error::Error;

use ballast::control::controlled_training::ControlledPolicy;
use ballast::control::problem::actions::{ActionInterval, ActionSet};
use ballast::control::problem::controlled::Controlled;
use ballast::control::progress::Watch;
use ballast::control::request::specification::Specification;
use ballast::numerics::law::empirical::EmpiricalDistribution;
use serde_json::json;

const PERIODS: usize = 3;
const RATE: f64 = 0.002;
const PRICE: f64 = 100.0;
const STRIKE: f64 = 100.0;
/// Absolute risk aversion, per unit of wealth.
const RISK_AVERSION: f64 = 0.05;
/// Observed log-returns.
const HISTORY: [f64; 8] = [0.05, -0.045, 0.04, 0.005, -0.05, 0.07, -0.03, 0.0];
/// Radius of the ball around their law.
const RADIUS: f64 = 0.004;
/// Range of possible returns. Without a bound on the price no hedge of a call is robust.
const SUPPORT: [f64; 2] = [-0.25, 0.25];
const BASIS_POINTS: f64 = 1e4;

/// A seller of calls who holds shares.
struct Seller {
    /// Number of calls sold: 1, or 0 for the comparison.
    calls: f64,
    /// Share of every traded amount that is lost.
    cost: f64,
}

#[derive(Clone)]
struct Book {
    /// Price of a share.
    price: f64,
    /// Wealth in the bank and in shares together.
    wealth: f64,
    /// Shares held before trading.
    shares: f64,
}

impl Controlled for Seller {
    type State = Book;

    /// The action is the number of shares held through the period.
    fn actions(&self, _: usize, _: &Book) -> Vec<ActionSet> {
        vec![ActionSet::Interval(ActionInterval { lowest: 0.0, highest: 1.0 })]
    }

    fn next(&self, _: usize, state: &Book, actions: &[f64], log_return: f64) -> Book {
        let Book { price, wealth, shares: before } = *state;
        let shares = actions[0];
        let traded = wealth - self.cost * price * (shares - before).abs();
        let next = price * log_return.exp();
        Book { price: next, wealth: (traded - shares * price) * (1.0 + RATE) + shares * next, shares }
    }

    /// Describes a state by the price and, if trading has a cost, the shares. Wealth only shifts the certainty equivalent.
    fn describe(&self, _: usize, state: &Book) -> Vec<f64> {
        let mut described = vec![state.price.ln()];
        if self.cost > 0.0 {
            described.push(state.shares);
        }
        described
    }

    /// Returns the wealth with everything in the bank until the horizon, less the mean payoff of the calls under the law of the
    /// observed returns. The surrogates fit the difference, which is smaller and smoother than the certainty equivalent.
    fn baseline(&self, step: usize, state: &Book) -> f64 {
        let periods = PERIODS - step;
        state.wealth * (1.0 + RATE).powi(periods as i32) - self.calls * mean_owed(state.price, periods)
    }

    /// No amount of wealth is certain, because the payoff of the call may exceed it.
    fn has_floor(&self) -> bool {
        false
    }

    fn utility(&self, worth: f64, from: f64) -> f64 {
        -(-RISK_AVERSION * (worth - from)).exp_m1() / RISK_AVERSION
    }

    fn certainty_equivalent(&self, utility: f64, from: f64) -> f64 {
        from - (-RISK_AVERSION * utility).ln_1p() / RISK_AVERSION
    }
}

/// Returns the mean payoff of a call after `periods` periods.
fn mean_owed(price: f64, periods: usize) -> f64 {
    match periods {
        0 => (price - STRIKE).max(0.0),
        _ => HISTORY.iter().map(|z| mean_owed(price * z.exp(), periods - 1)).sum::<f64>() / HISTORY.len() as f64,
    }
}

/// Returns the certainty equivalent and the first action that the library finds.
fn by_the_library(seller: &Seller) -> Result<(f64, f64), Box<dyn Error>> {
    let specification: Specification = serde_json::from_value(json!({
        "problem": { "framework": "static", "horizon": PERIODS, "rate_per_step": RATE, "history": HISTORY,
            "radius": { "rule": "fixed", "radius": RADIUS }, "support": { "rule": "between", "min": SUPPORT[0], "max": SUPPORT[1] } },
        // Wide enough for the design to cover every state that the adversary can reach.
        "design": { "count": 200, "sampling_law":
            { "kind": "gaussian_mixture", "components": [{ "weight": 1.0, "mean": 0.0, "variance": 0.03 }] } }
    }))?;
    let start = Book { price: PRICE, wealth: 0.0, shares: 0.0 };
    let policy = ControlledPolicy::train(seller, &start, &specification, &Watch::unwatched())?;
    let found = policy.step(seller, 0).solve(&start, &EmpiricalDistribution::new(&HISTORY));
    Ok((found.certainty_equivalent, found.actions[0]))
}

/// Spacing of the lattice of log-returns, and the largest return in units of it.
const SPACING: f64 = 0.005;
const REACH: usize = 50;

/// Returns the certainty equivalent of a wealth of 0 and the first action, by nested enumeration without trading costs. It computes
/// the certainty equivalent at every price of the lattice, from the horizon back.
fn by_enumeration(calls: f64) -> (f64, f64) {
    let (mut later, mut first) = (Vec::new(), 0.0);
    for step in (0..PERIODS).rev() {
        let prices = step * 2 * REACH + 1;
        let price = |index: usize| PRICE * ((index as f64 - (step * REACH) as f64) * SPACING).exp();
        let solve = |index: usize| {
            // From price number i, return number k leads to price number i + k of the next step.
            let value = |shares: f64| {
                let payoff: Vec<f64> = (0..=2 * REACH)
                    .map(|k| {
                        let next = price(index) * ((k as f64 - REACH as f64) * SPACING).exp();
                        let wealth = shares * (next - price(index) * (1.0 + RATE));
                        let left = (PERIODS - step - 1) as i32;
                        let owed = if left == 0 { -calls * (next - STRIKE).max(0.0) } else { later[index + k] };
                        -(-RISK_AVERSION * (wealth * (1.0 + RATE).powi(left) + owed)).exp()
                    })
                    .collect();
                worst_expectation(&payoff)
            };
            let shares = best(0.0, 1.0, 1e-7, value);
            (-(-value(shares)).ln() / RISK_AVERSION, shares)
        };
        let solved: Vec<(f64, f64)> = (0..prices).map(solve).collect();
        first = solved[0].1;
        later = solved.into_iter().map(|(worth, _)| worth).collect();
    }
    (later[0], first)
}

/// min { E_F[payoff] : W1(F, empirical law) <= radius } = max over l of -l radius + mean_j min_z { payoff(z) + l |z - z_j| }.
fn worst_expectation(payoff: &[f64]) -> f64 {
    let dual = |multiplier: f64| {
        let nearest = |atom: &f64| {
            let at = ((atom - SUPPORT[0]) / SPACING).round() as usize;
            let moved = |(k, payoff): (usize, &f64)| payoff + multiplier * SPACING * k.abs_diff(at) as f64;
            payoff.iter().enumerate().map(moved).fold(f64::INFINITY, f64::min)
        };
        HISTORY.iter().map(nearest).sum::<f64>() / HISTORY.len() as f64 - multiplier * RADIUS
    };
    let steepest = payoff.windows(2).map(|pair| (pair[1] - pair[0]).abs() / SPACING).fold(0.0, f64::max);
    dual(best(0.0, steepest, 1e-9 * steepest, dual))
}

/// Returns the maximiser of a concave function, by golden-section search.
fn best(mut low: f64, mut high: f64, tolerance: f64, function: impl Fn(f64) -> f64) -> f64 {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let [mut left, mut right] = [high - golden * (high - low), low + golden * (high - low)];
    let [mut at_left, mut at_right] = [left, right].map(&function);
    while high - low > tolerance {
        if at_left > at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - golden * (high - low);
            at_left = function(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + golden * (high - low);
            at_right = function(right);
        }
    }
    0.5 * (low + high)
}

fn main() -> Result<(), Box<dyn Error>> {
    let cost = std::env::args().nth(1).map_or(Ok(0.002), |cost| cost.parse::<f64>())?;
    let bank = (1.0 + RATE).powi(PERIODS as i32);
    println!(
        "A call on {PRICE} at {STRIKE}, {PERIODS} periods, against the worst law within {RADIUS} of eight returns\n"
    );
    println!("{:<28}{:>12}{:>20}", "", "premium", "shares held first");
    let premium = |of: &dyn Fn(f64) -> Result<(f64, f64), Box<dyn Error>>, name: &str| {
        let ((with, shares), (without, _)) = (of(1.0)?, of(0.0)?);
        let premium = (without - with) / bank;
        println!("{name:<28}{premium:>12.6}{shares:>20.4}");
        Ok::<f64, Box<dyn Error>>(premium)
    };
    let solved = premium(&|calls| by_the_library(&Seller { calls, cost: 0.0 }), "by the library")?;
    let enumerated = premium(&|calls| Ok(by_enumeration(calls)), "by nested enumeration")?;
    let apart = BASIS_POINTS * (solved / enumerated - 1.0);
    println!("{:<28}{apart:>12.3} basis points of the premium", "apart");
    let costly =
        premium(&|calls| by_the_library(&Seller { calls, cost }), &format!("with a cost of {:.2} %", 100.0 * cost))?;
    let holds = apart.abs() <= 0.5 && costly >= solved;
    if holds { Ok(()) } else { Err("the two do not agree, or a cost makes the call cheaper".into()) }
}
