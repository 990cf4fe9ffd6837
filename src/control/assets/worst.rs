//! The worst law against a given allocation.
//!
//! The dual is concave in the price of distance alone. Its slope is the distance that the atoms use, less the radius.
//! The search keeps a price at which they use too much and one at which they use too little. The next price is where
//! the two tangents meet, kept off the ends. The two laws, mixed so that the radius is just used up, are the worst law,
//! and its value is the primal.

use super::PortfolioStep;
use super::branches::Branches;

/// Largest number of prices tried.
const PRICES: usize = 200;
/// Relative utility between the primal and the dual value, and the relative width of a bracket of prices around a jump
/// of the distance.
const TOLERANCE: f64 = 1e-11;
const WIDTH: f64 = 1e-14;
/// Growth factor of the search for a price at which the radius suffices.
const GROWTH: f64 = 4.0;
/// At a higher price an allocation is worth nothing: the payoff of some atom falls the further it is moved, at any
/// price.
const HIGHEST_PRICE: f64 = 1e15;

/// The value of an allocation against the worst law for it.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustValue {
    /// Lower bound on the log certainty equivalent over the bank, by duality.
    pub value: f64,
    /// The log certainty equivalent under a law in the ball; minus infinity if some atom has no furthest point to be
    /// moved to.
    pub primal: f64,
    /// Lost relative utility per unit of radius.
    pub multiplier: f64,
}

/// The dual at one price, and the distance that the atoms use.
#[derive(Clone, Copy)]
struct Priced {
    price: f64,
    dual: f64,
    distance: f64,
}

impl PortfolioStep {
    /// Returns the worth of an allocation. Cost: some 20 to 60 evaluations.
    pub fn worth(&self, allocation: &[f64]) -> RobustValue {
        let mut branches = Branches::default();
        let mut at = |price: f64| {
            branches.find(self, allocation, price);
            let (dual, distance) = self.dual(&branches, price);
            Priced { price, dual, distance }
        };
        let robust_value = |dual: f64, primal: f64, price: f64| RobustValue {
            value: self.utility.inverse(dual),
            primal: self.utility.inverse(primal),
            multiplier: price,
        };
        // A price of 0 cannot be evaluated: an atom that gains nothing by a move stays.
        let mut low = Priced { price: 0.0, dual: f64::NEG_INFINITY, distance: f64::INFINITY };
        let mut high = at(1.0);
        while high.distance > self.radius {
            if high.price > HIGHEST_PRICE {
                return robust_value(f64::NEG_INFINITY, f64::NEG_INFINITY, high.price);
            }
            low = high;
            high = at(GROWTH * high.price);
        }
        let primal = |priced: &Priced| priced.dual + priced.price * (self.radius - priced.distance);
        for _ in 0..PRICES {
            // Mixed so that the radius is used up, or the high one alone, which uses less.
            let share = if low.distance.is_finite() && low.distance > high.distance {
                (self.radius - high.distance) / (low.distance - high.distance)
            } else {
                0.0
            };
            let mixed = if share > 0.0 { share * primal(&low) + (1.0 - share) * primal(&high) } else { primal(&high) };
            let (dual, price) = if low.dual > high.dual { (low.dual, low.price) } else { (high.dual, high.price) };
            if mixed - dual < TOLERANCE || high.price - low.price < WIDTH * high.price {
                return robust_value(dual, mixed, price);
            }
            let meet = if share > 0.0 { (primal(&high) - primal(&low)) / (low.distance - high.distance) } else { 0.0 };
            let margin = 0.01 * (high.price - low.price);
            let next = if share > 0.0 {
                meet.clamp(low.price + margin, high.price - margin)
            } else {
                0.5 * (low.price + high.price)
            };
            let priced = at(next);
            if priced.distance > self.radius { low = priced } else { high = priced }
        }
        let best = if low.dual > high.dual { low } else { high };
        robust_value(best.dual, f64::NEG_INFINITY, best.price)
    }
}
