//! The payoff of a robust step at every return, as the pricing of actions evaluates it.

use crate::control::problem::dynamics::Trade;

/// The value of the next state over everything that one robust step can reach.
pub trait Field {
    /// Returns the returns at which the field is exact, ascending.
    fn returns(&self) -> &[f64];

    /// Prepares evaluation at fixed returns.
    fn at(&self, returns: &[f64]) -> Box<dyn Payoffs + '_>;

    /// Returns a lower bound on the payoff, also outside the returns; it increases with the return.
    fn least_payoff(&self, trade: Trade, log_return: f64) -> f64;
}

/// A field restricted to fixed returns.
pub trait Payoffs {
    /// Returns the relative utility of the next state's certainty equivalent, return by return.
    fn payoff(&self, trade: Trade) -> Vec<f64>;
}
