//! The payoff of a robust step at every return, as the pricing of actions evaluates it.

use crate::control::problem::dynamics::Trade;

/// The value of the next state over everything that one robust step can reach.
pub trait Field {
    /// Returns the returns at which the field is exact, ascending.
    fn returns(&self) -> &[f64];

    /// Returns true if the worst value of an action is concave in it, but for dents of the surrogates.
    fn is_concave(&self) -> bool {
        true
    }

    /// Prepares evaluation at fixed returns.
    fn at<'f>(&'f self, returns: &[f64]) -> Box<dyn Payoffs<'f> + 'f>;

    /// Returns a lower bound on the payoff, also outside the returns; it increases with the return.
    fn least_payoff(&self, trade: Trade, log_return: f64) -> f64;
}

/// A field restricted to fixed returns.
pub trait Payoffs<'f> {
    /// Prepares evaluation at other returns, which are ascending, as those prepared now must be. What was computed for a
    /// return in both lists is used again.
    fn moved_to(&self, returns: &[f64]) -> Box<dyn Payoffs<'f> + 'f>;

    /// Returns the relative utility of the next state's certainty equivalent, return by return.
    fn payoff(&self, trade: Trade) -> Vec<f64>;
}

/// Returns the place of each of `returns` among `known`, if it is there; both are ascending.
pub(super) fn places(known: &[f64], returns: &[f64]) -> Vec<Option<usize>> {
    let mut next = 0;
    let place = |log_return: &f64| {
        while known.get(next).is_some_and(|known| known < log_return) {
            next += 1;
        }
        (known.get(next) == Some(log_return)).then_some(next)
    };
    returns.iter().map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::places;

    #[test]
    fn places_are_found_wherever_lists_overlap() {
        let known = [-0.3, -0.1, 0.0, 0.2];
        assert_eq!(places(&known, &[-0.4, -0.3, -0.2, 0.0, 0.2, 0.5]), [None, Some(0), None, Some(2), Some(3), None]);
        assert_eq!(places(&known, &known), [Some(0), Some(1), Some(2), Some(3)]);
        assert_eq!(places(&[], &[0.1]), [None]);
        assert!(places(&known, &[]).is_empty());
    }
}
