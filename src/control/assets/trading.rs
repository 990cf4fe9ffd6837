//! The step of an investor who already holds some of the assets, if trading costs:
//!
//!   max_a  V(a) + ln(1 - c T(a)),   T(a) = sum_i |a_i - h_i|,
//!
//! V is the log certainty equivalent of the step, and `c T` the share of wealth lost by trading from the holdings h.
//! Under power and log utility the certainty equivalent is concave and proportional to wealth, so V and the whole are
//! concave. The search maximises the step less `p T` in relative utility. At the optimum of the whole,
//! `p = c / (1 - c T) dU/dV` makes the two agree, and p is found by iteration. Any law F in the ball bounds the whole
//! by the tangent of V_F, which is also concave, at any a:
//!
//!   the whole  <=  V_F(a) + ln(1 - c T(a)) + max_b [ grad V_F(a) . (b - a) - c / (1 - c T(a)) (T(b) - T(a)) ].

use super::{AssetsSolution, BARRIER_NEAR, BARRIERS, CONTENT, PortfolioStep, REACH};
use crate::control::problem::actions::ActionInterval;

/// Largest number of searches.
const SEARCHES: usize = 12;
/// A holding that changes by less is kept if that costs no more than the bounds may lie apart.
const LEAST_TRADE: f64 = 1e-4;
/// Relative change of the price of trading above which the search runs again.
const PRICE_STANDS: f64 = 1e-7;

/// Holdings before trading, and the loss of relative utility per unit of wealth traded. By default nothing is held and
/// trading is free.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Trading {
    /// Asset by asset; empty if trading is free.
    pub holdings: Vec<f64>,
    pub price: f64,
}

/// The linear bound that a law of the ball gives on every allocation: mean utility `mean` at `shares`, with gradient
/// `slopes`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tangent {
    pub shares: Vec<f64>,
    pub mean: f64,
    pub slopes: Vec<f64>,
}

impl Trading {
    pub fn holding(&self, asset: usize) -> f64 {
        self.holdings.get(asset).copied().unwrap_or(0.0)
    }

    /// Returns T, in shares of wealth.
    pub fn turnover(&self, allocation: &[f64]) -> f64 {
        self.holdings.iter().zip(allocation).map(|(held, share)| (share - held).abs()).sum()
    }

    /// Returns the cost of trading, in relative utility.
    pub fn utility_cost(&self, allocation: &[f64]) -> f64 {
        self.price * self.turnover(allocation)
    }

    /// Restricts this to some of the assets, which are all that are held.
    pub fn among(&self, held: &[usize]) -> Self {
        let holdings =
            if self.holdings.is_empty() { Vec::new() } else { held.iter().map(|&asset| self.holding(asset)).collect() };
        Trading { holdings, price: self.price }
    }

    /// Returns the maximum of `slopes . b - price T(b)` over allocations b whose sum is within `total`. Existing
    /// holdings are kept in the order of slopes, and more is bought of the steepest. Cost O(d ln d).
    pub fn most(&self, slopes: &[f64], total: ActionInterval) -> f64 {
        // The gain per share of wealth, and how many shares are available at it.
        let kept = self.holdings.iter().zip(slopes).map(|(held, slope)| (slope + self.price, *held));
        let bought = slopes.iter().map(|slope| (slope - self.price, f64::INFINITY));
        let mut pieces: Vec<(f64, f64)> = kept.chain(bought).collect();
        pieces.sort_by(|left, right| right.0.total_cmp(&left.0));
        let (mut filled, mut most) = (0.0, -self.utility_cost(&vec![0.0; self.holdings.len()]));
        for (slope, room) in pieces {
            let wanted = if slope > 0.0 { total.highest } else { total.lowest };
            let part = room.min(wanted - filled).max(0.0);
            if part > 0.0 {
                (filled, most) = (filled + part, most + part * slope);
            }
        }
        most
    }
}

impl PortfolioStep {
    /// Solves for the best allocation given `holdings`, one for each asset, if each unit of wealth bought or sold loses
    /// the share `cost` of wealth. `value` and `bound` are net of that cost. Under power and log utility. Cost: some
    /// searches. Checked by: `tests/solver/assets.rs::holdings_and_a_cost_are_best_by_direct_search`.
    pub fn solve_from(&self, holdings: &[f64], cost: f64, near: Option<&AssetsSolution>) -> AssetsSolution {
        if cost <= 0.0 {
            return self.solve(near);
        }
        let mut step = self.clone();
        step.trading = Trading { holdings: holdings.to_vec(), price: cost };
        let mut best = step.without_assets(cost);
        let (mut barriers, mut near, mut reach) = (BARRIERS.into_iter(), near.cloned(), REACH);
        for _ in 0..SEARCHES {
            let barrier = match &near {
                Some(_) => Some(BARRIER_NEAR),
                None => barriers.next(),
            };
            let Some(barrier) = barrier else { break };
            let (found, tangent) = step.search(step.first_held(near.as_ref()), near.as_ref(), barrier, reach);
            let found = step.less_cost(found, tangent, cost);
            let price = step.price_of_trading(&found, cost);
            let stands = (price - step.trading.price).abs() < PRICE_STANDS * price;
            near = (!stands).then(|| found.clone());
            best = best.or(found);
            if best.is_certified() {
                break;
            }
            if stands {
                reach = f64::INFINITY;
            }
            step.trading.price = price;
        }
        AssetsSolution { bound: best.bound.max(best.value), ..best }
    }

    /// Returns the solution that sells everything, if that is allowed; nothing is worth more than the best growth seen.
    fn without_assets(&self, cost: f64) -> AssetsSolution {
        let nothing = vec![0.0; self.assets];
        let may = self.total.lowest <= 0.0;
        AssetsSolution {
            value: if may { (-cost * self.trading.turnover(&nothing)).ln_1p() } else { f64::NEG_INFINITY },
            bound: self.most_growth(),
            multiplier: 0.0,
            mean_moves: nothing.clone(),
            allocation: nothing,
            evaluations: 0,
        }
    }

    /// Converts a solution of the search to log certainty equivalent less the cost. Holdings that it hardly changes are
    /// kept. Without a tangent the bound is infinite.
    fn less_cost(&self, found: AssetsSolution, tangent: Option<Tangent>, cost: f64) -> AssetsSolution {
        let trading = &self.trading;
        let kept = |(held, share): (&f64, &f64)| if (share - held).abs() < LEAST_TRADE { *held } else { *share };
        let kept: Vec<f64> = trading.holdings.iter().zip(&found.allocation).map(kept).collect();
        let whole: f64 = kept.iter().sum();
        let fits = (self.total.lowest..=self.total.highest).contains(&whole) && self.allows(&kept);
        let worth = |allocation: &[f64]| {
            let utility = self.value_at(allocation, found.multiplier) + trading.utility_cost(allocation);
            self.utility.inverse(utility) + (-cost * trading.turnover(allocation)).ln_1p()
        };
        let (mut allocation, mut value) = (found.allocation.clone(), worth(&found.allocation));
        if fits && kept != allocation {
            let other = worth(&kept);
            if other > value - CONTENT {
                (allocation, value) = (kept, other);
            }
        }
        let bound = tangent.map_or(f64::INFINITY, |tangent| self.bound_by(&tangent, cost));
        AssetsSolution { allocation, value, bound, ..found }
    }

    /// Returns an upper bound on the value of every allocation, less the cost, by the tangent of a law.
    fn bound_by(&self, tangent: &Tangent, cost: f64) -> f64 {
        let trading = &self.trading;
        let lost = cost * trading.turnover(&tangent.shares);
        let slope = self.utility.inverse_slope(tangent.mean);
        let slopes: Vec<f64> = tangent.slopes.iter().map(|rise| slope * rise).collect();
        let free = Trading { holdings: trading.holdings.clone(), price: cost / (1.0 - lost) };
        let along: f64 = slopes.iter().zip(&tangent.shares).map(|(slope, share)| slope * share).sum();
        self.utility.inverse(tangent.mean) + (-lost).ln_1p() + self.greatest_rise(&free, &slopes).bound - along
            + free.utility_cost(&tangent.shares)
    }

    /// Returns p at an allocation: `c / (1 - c T) dU/dV`.
    fn price_of_trading(&self, found: &AssetsSolution, cost: f64) -> f64 {
        let utility = self.value_at(&found.allocation, found.multiplier) + self.trading.utility_cost(&found.allocation);
        cost / (1.0 - cost * self.trading.turnover(&found.allocation)) / self.utility.inverse_slope(utility)
    }
}
