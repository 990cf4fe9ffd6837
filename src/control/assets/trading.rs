//! The step of who holds some of the assets already, where trading costs:
//!
//!   max_a  V(a) + ln(1 - c T(a)),   T(a) = sum_i |a_i - h_i|,
//!
//! V the log certainty equivalent of the step and `c T` of wealth lost on the way from the holdings h. Under power and log utility
//! the certainty equivalent is concave and grows with wealth alone, so that V and the whole are concave. The search is that of the
//! step less `p T` in relative utility: at its best, `p = c / (1 - c T) dU/dV` makes it the best of the whole, and p is found by
//! going on from there. Any law F in the ball bounds the whole by the tangent of V_F, which is concave too, at any a:
//!
//!   the whole  <=  V_F(a) + ln(1 - c T(a)) + max_b [ grad V_F(a) . (b - a) - c / (1 - c T(a)) (T(b) - T(a)) ].

use super::{AssetsSolution, AssetsStep, BARRIER_NEAR, BARRIERS, CONTENT, LEAST_SHARE};
use crate::control::problem::actions::ActionInterval;

/// Searches at most.
const SEARCHES: usize = 12;
/// Relative change of the price of trading that asks for another search.
const PRICE_STANDS: f64 = 1e-7;

/// What is held before trading, and what a unit of wealth that is traded takes in relative utility. Nothing is held, and trading is
/// free, unless it is given.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Trading {
    /// Asset by asset; none where trading is free.
    pub holdings: Vec<f64>,
    pub price: f64,
}

/// What a law of the ball says of every allocation: at `shares` it gives the mean utility `mean`, which rises by `slopes`.
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

    /// T, in shares of wealth.
    pub fn turnover(&self, allocation: &[f64]) -> f64 {
        self.holdings.iter().zip(allocation).map(|(held, share)| (share - held).abs()).sum()
    }

    /// In relative utility.
    pub fn taken(&self, allocation: &[f64]) -> f64 {
        self.price * self.turnover(allocation)
    }

    /// That of some of the assets, which are all that are held.
    pub fn among(&self, held: &[usize]) -> Self {
        let holdings =
            if self.holdings.is_empty() { Vec::new() } else { held.iter().map(|&asset| self.holding(asset)).collect() };
        Trading { holdings, price: self.price }
    }

    /// The most of `slopes . b - price T(b)` over allocations b whose sum is within `total`: what is held is kept in the order of
    /// slopes, and more is bought of the steepest. Cost O(d ln d).
    pub fn most(&self, slopes: &[f64], total: ActionInterval) -> f64 {
        // What a share of wealth adds, and how much of it there is.
        let kept = self.holdings.iter().zip(slopes).map(|(held, slope)| (slope + self.price, *held));
        let bought = slopes.iter().map(|slope| (slope - self.price, f64::INFINITY));
        let mut pieces: Vec<(f64, f64)> = kept.chain(bought).collect();
        pieces.sort_by(|left, right| right.0.total_cmp(&left.0));
        let (mut filled, mut most) = (0.0, -self.taken(&vec![0.0; self.holdings.len()]));
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

impl AssetsStep {
    /// The best allocation for who holds `holdings`, one for each asset, and loses the share `cost` of wealth for each unit of it that
    /// is bought or sold; `value` and `bound` are less that cost. Under power and log utility. Cost: some searches.
    /// Checked by: `tests/solver/assets.rs::holdings_and_a_cost_are_best_by_direct_search`.
    pub fn solve_from(&self, holdings: &[f64], cost: f64, near: Option<&AssetsSolution>) -> AssetsSolution {
        if cost <= 0.0 {
            return self.solve(near);
        }
        let mut step = self.clone();
        step.trading = Trading { holdings: holdings.to_vec(), price: cost };
        let mut best = step.without_assets(cost);
        let (mut barriers, mut near, mut evaluations) = (BARRIERS.into_iter(), near.cloned(), 0);
        for _ in 0..SEARCHES {
            let barrier = match &near {
                Some(_) => Some(BARRIER_NEAR),
                None => barriers.next(),
            };
            let Some(barrier) = barrier else { break };
            let (found, tangent) = step.search(step.first_held(near.as_ref()), near.as_ref(), barrier);
            evaluations += found.evaluations;
            let found = step.less_cost(found, tangent, cost);
            let bound = best.bound.min(found.bound);
            let price = step.price_of_trading(&found, cost);
            let stands = (price - step.trading.price).abs() < PRICE_STANDS * price;
            near = (!stands).then(|| found.clone());
            let better = if found.value > best.value { found } else { best };
            best = AssetsSolution { bound, ..better };
            if best.bound - best.value < CONTENT {
                break;
            }
            step.trading.price = price;
        }
        AssetsSolution { bound: best.bound.max(best.value), evaluations, ..best }
    }

    /// Everything sold, where that is allowed; nothing is worth more than the best growth seen.
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

    /// A solution of the search in log certainty equivalent less the cost. Holdings that it hardly changes are kept. Where no law told
    /// a tangent there is no bound.
    fn less_cost(&self, found: AssetsSolution, tangent: Option<Tangent>, cost: f64) -> AssetsSolution {
        let trading = &self.trading;
        let kept = |(held, share): (&f64, &f64)| if (share - held).abs() < LEAST_SHARE { *held } else { *share };
        let kept: Vec<f64> = trading.holdings.iter().zip(&found.allocation).map(kept).collect();
        let whole: f64 = kept.iter().sum();
        let fits = (self.total.lowest..=self.total.highest).contains(&whole);
        let worth = |allocation: &[f64]| {
            let utility = self.value_at(allocation, found.multiplier) + trading.taken(allocation);
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

    /// What no allocation is worth more than, less the cost, by the tangent of a law.
    fn bound_by(&self, tangent: &Tangent, cost: f64) -> f64 {
        let trading = &self.trading;
        let lost = cost * trading.turnover(&tangent.shares);
        let slope = self.utility.inverse_slope(tangent.mean);
        let slopes: Vec<f64> = tangent.slopes.iter().map(|rise| slope * rise).collect();
        let free = Trading { holdings: trading.holdings.clone(), price: cost / (1.0 - lost) };
        let along: f64 = slopes.iter().zip(&tangent.shares).map(|(slope, share)| slope * share).sum();
        self.utility.inverse(tangent.mean) + (-lost).ln_1p() + free.most(&slopes, self.total) - along
            + free.taken(&tangent.shares)
    }

    /// p at an allocation: `c / (1 - c T) dU/dV`.
    fn price_of_trading(&self, found: &AssetsSolution, cost: f64) -> f64 {
        let utility = self.value_at(&found.allocation, found.multiplier) + self.trading.taken(&found.allocation);
        cost / (1.0 - cost * self.trading.turnover(&found.allocation)) / self.utility.inverse_slope(utility)
    }
}
