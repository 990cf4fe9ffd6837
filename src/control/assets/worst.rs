//! The worst law against a given allocation.
//!
//! The dual is concave in the price of distance alone: its slope is the distance that the atoms take, less the radius. Between a
//! price at which they take too much and one at which they take too little, the next is where the two tangents meet, kept off the
//! ends; the two laws, mixed so that the radius is just spent, are the worst law, and their value the primal.

use super::AssetsStep;
use super::branches::Branches;

/// Prices tried at most.
const PRICES: usize = 200;
/// Relative utility between the primal and the dual value, and the relative width of prices between which a jump of the distance lies.
const TOLERANCE: f64 = 1e-11;
const WIDTH: f64 = 1e-14;
/// A price that no atom moves at is sought by this factor.
const GROWTH: f64 = 4.0;
/// Beyond it an allocation is worth nothing: some atom is worth the less the further it is moved, at any price.
const HIGHEST_PRICE: f64 = 1e15;

/// What an allocation is worth against the worst law for it.
#[derive(Debug, Clone, PartialEq)]
pub struct AssetsWorth {
    /// Log certainty equivalent over the bank: at least this, by duality.
    pub value: f64,
    /// The same under a law in the ball; minus infinity where no atom has a last place to be moved to.
    pub primal: f64,
    /// Lost relative utility per unit of radius.
    pub multiplier: f64,
}

/// One price: the dual, the distance taken, and the mean utility of the atoms where they are put.
#[derive(Clone, Copy)]
struct Priced {
    price: f64,
    dual: f64,
    distance: f64,
}

impl AssetsStep {
    /// What an allocation is worth. Cost: some 20 to 60 evaluations.
    pub fn worth(&self, allocation: &[f64]) -> AssetsWorth {
        let mut branches = Branches::default();
        let mut at = |price: f64| {
            branches.find(self, allocation, price);
            let (dual, distance) = self.dual(&branches, price);
            Priced { price, dual, distance }
        };
        let told = |dual: f64, primal: f64, price: f64| AssetsWorth {
            value: self.utility.inverse(dual),
            primal: self.utility.inverse(primal),
            multiplier: price,
        };
        // A price of 0 is no price: an atom that gains nothing by a move stays.
        let mut low = Priced { price: 0.0, dual: f64::NEG_INFINITY, distance: f64::INFINITY };
        let mut high = at(1.0);
        while high.distance > self.radius {
            if high.price > HIGHEST_PRICE {
                return told(f64::NEG_INFINITY, f64::NEG_INFINITY, high.price);
            }
            low = high;
            high = at(GROWTH * high.price);
        }
        let primal = |priced: &Priced| priced.dual + priced.price * (self.radius - priced.distance);
        for _ in 0..PRICES {
            // Mixed so that the radius is spent, or the high one alone, which spends less.
            let share = if low.distance.is_finite() && low.distance > high.distance {
                (self.radius - high.distance) / (low.distance - high.distance)
            } else {
                0.0
            };
            let mixed = if share > 0.0 { share * primal(&low) + (1.0 - share) * primal(&high) } else { primal(&high) };
            let (dual, price) = if low.dual > high.dual { (low.dual, low.price) } else { (high.dual, high.price) };
            if mixed - dual < TOLERANCE || high.price - low.price < WIDTH * high.price {
                return told(dual, mixed, price);
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
        told(best.dual, f64::NEG_INFINITY, best.price)
    }
}
