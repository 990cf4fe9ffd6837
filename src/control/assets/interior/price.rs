//! The price of distance that a search starts from.

use super::{Interior, top};

/// Prices tried for the start at most, and how far its law may be, over the radius or under it.
const PRICES: usize = 8;
const SPREAD: f64 = 3.0;
/// Factors by which the first prices tried are apart, near a similar step and elsewhere.
const PRICE_NEAR: f64 = 1.03;
const PRICE_FAR: f64 = 1.5;

/// Of the dual, which is concave, at a price of distance.
#[derive(Debug, Clone, Copy)]
struct Tangent {
    price: f64,
    value: f64,
    slope: f64,
}

impl Tangent {
    /// The price at which this one, which rises, meets one at a higher price, which falls; halfway where there is no value.
    fn meets(self, high: Tangent) -> f64 {
        let along = (high.value - self.value - high.slope * (high.price - self.price)) / (self.slope - high.slope);
        let between = (0.0..=high.price - self.price).contains(&along);
        self.price + if between { along } else { 0.5 * (high.price - self.price) }
    }
}

impl Interior<'_> {
    /// Finds a price at which the centred laws at the start are about as far away as the radius. Prices are ever further apart
    /// until one is too low and one too high; the next is where the tangents of the dual at both meet, which finds the price at
    /// which all atoms begin to move however sharp it is.
    pub(super) fn price_the_start(&mut self, is_near: bool) {
        let mut wider = if is_near { PRICE_NEAR } else { PRICE_FAR };
        let assets = self.step.assets();
        let (mut low, mut high): (Option<Tangent>, Option<Tangent>) = (None, None);
        for _ in 0..PRICES {
            let price = self.point[assets];
            self.find();
            let mut distance = 0.0;
            for atom in 0..self.step.atoms() {
                let top = top(&self.branches, atom, self.barrier);
                for branch in &self.branches.all[self.branches.of(atom)] {
                    distance += self.step.masses[atom] * self.barrier / (branch.payoff - top) * branch.cost;
                }
            }
            if (self.step.radius / SPREAD..=SPREAD * self.step.radius).contains(&distance) {
                return;
            }
            let (value, exact) = self.step.dual(&self.branches, price);
            let tangent = Tangent { price, value, slope: exact - self.step.radius };
            *(if tangent.slope > 0.0 { &mut low } else { &mut high }) = Some(tangent);
            self.point[assets] = match (low, high) {
                (Some(low), Some(high)) => low.meets(high),
                (Some(_), None) => wider * price,
                _ => price / wider,
            };
            wider *= wider;
        }
        self.find();
    }
}
