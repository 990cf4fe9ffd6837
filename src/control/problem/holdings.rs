//! Shares of wealth held before trading, at which the value is known if trading costs.
//!
//! The value of a state depends on the share h held before trading only through the cost of reaching the band. Up to
//! the highest action it is smooth along h, except that the second derivative jumps at either end of the band. It is
//! stored at even holdings and interpolated by the cubic through the four nearest. The error at an end of the band is
//! below a twentieth of the jump of the second derivative, 2 c over the width of the band, times the square of the
//! distance. Beyond the highest action, where a holding may have drifted, the excess must be sold, and a formula
//! continues the value.

use crate::control::problem::dynamics::Dynamics;

/// Number of holdings at which the value of a design point is computed, if trading costs.
pub const HOLDINGS: usize = 17;
/// Number of holdings if there is a single law, and hundreds of steps may follow each other.
pub const HOLDINGS_OF_ONE_LAW: usize = 257;

/// Evenly spaced holdings from 0 to the highest action, at which a function of the holding is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Holdings {
    count: usize,
    highest: f64,
}

impl Holdings {
    /// Takes `count` even holdings up to the highest action: one for a function that does not depend on the holding,
    /// otherwise at least four.
    pub fn new(count: usize, highest: f64) -> Self {
        Holdings { count, highest }
    }

    /// Returns the number of holdings.
    pub fn count(self) -> usize {
        self.count
    }

    /// Returns true if the function depends on the holding.
    pub fn matter(self) -> bool {
        self.count > 1
    }

    /// Returns the holdings, ascending.
    pub fn nodes(self) -> impl Iterator<Item = f64> {
        let last = self.count.saturating_sub(1).max(1) as f64;
        (0..self.count).map(move |index| self.highest * index as f64 / last)
    }

    /// Returns the same holdings with those halfway between them.
    pub fn halved(self) -> Self {
        Holdings { count: if self.matter() { 2 * self.count - 1 } else { self.count }, ..self }
    }

    /// Returns the holding at which the function is evaluated for `holding`, which may have drifted beyond the highest
    /// action.
    pub fn within(self, holding: f64) -> f64 {
        holding.max(0.0).min(self.highest)
    }

    /// Returns the excess of the floor gain of a holding beyond the highest action over that of the highest: the rest
    /// must be sold,
    ///
    ///   ln(s (1 - c (h - a)) (1 - c a) / (1 - c h) + 1 - s),   a the highest action,
    ///
    /// s the share of total wealth `in_hand`; good to c^2 if the band ends below a. It is 0 up to the highest action,
    /// and if the holding does not matter.
    pub fn beyond(self, dynamics: Dynamics, holding: f64, in_hand: f64) -> f64 {
        let highest = self.highest;
        if !self.matter() || holding <= highest {
            return 0.0;
        }
        let kept =
            dynamics.left(f64::abs(highest - holding)) * dynamics.liquidation(highest) / dynamics.liquidation(holding);
        (in_hand * kept + (1.0 - in_hand)).ln()
    }

    /// Returns the index of the first of the four values used at `holding`, and the weights of the cubic through them.
    pub fn cubic(self, holding: f64) -> (usize, [f64; 4]) {
        let position = self.within(holding) / self.highest * (self.count - 1) as f64;
        let first = (position as usize).saturating_sub(1).min(self.count - 4);
        let t = position - first as f64;
        let (t1, t2, t3) = (t - 1.0, t - 2.0, t - 3.0);
        (first, [-t1 * t2 * t3 / 6.0, 0.5 * t * t2 * t3, -0.5 * t * t1 * t3, t * t1 * t2 / 6.0])
    }

    /// Returns the function at `holding`, from its values; beyond the highest action, the function at the highest.
    pub fn at(self, values: &[f64], holding: f64) -> f64 {
        if let [only] = values {
            return *only;
        }
        let (first, weights) = self.cubic(holding);
        weights.iter().zip(&values[first..]).map(|(weight, value)| weight * value).sum()
    }

    /// Returns the floor gain at `holding`, from its values.
    pub fn gain(self, values: &[f64], dynamics: Dynamics, holding: f64, in_hand: f64) -> f64 {
        self.at(values, holding).max(0.0) + self.beyond(dynamics, holding, in_hand)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn costly() -> Dynamics {
        Dynamics::plain(0.0, 0.02)
    }

    /// Starts with 70 of 100 held and 50 allowed: 20 are sold for 19.6. Selling all 70 would leave 98.6, all 50 of a
    /// hundred 99.
    #[test]
    fn beyond_the_highest_action_the_rest_is_sold() {
        let (of_highest, holdings) = (0.03, Holdings::new(5, 0.5));
        let values = [0.0, 0.01, 0.02, 0.025, of_highest];
        let expected = of_highest + (99.6_f64 / 100.0 * 99.0 / 98.6).ln();
        let gain = |holding, in_hand| holdings.gain(&values, costly(), holding, in_hand);
        assert!((gain(0.7, 1.0) - expected).abs() < 1e-15 && (gain(0.5, 1.0) - of_highest).abs() < 1e-15);
        // With the same amount still to come: 198.6 after selling all, 99.6 / 100 of 99 and 100 after selling 20.
        let with_more = of_highest + ((99.6_f64 / 100.0 * 99.0 + 100.0) / 198.6).ln();
        assert!((gain(0.7, 98.6 / 198.6) - with_more).abs() < 1e-15);
    }

    #[test]
    fn a_cubic_is_read_exactly_everywhere() {
        let cubic = |h: f64| 0.3 - h + 2.0 * h * h - 0.7 * h * h * h;
        for count in [4, 5, 17] {
            let holdings = Holdings::new(count, 0.8);
            let values: Vec<f64> = holdings.nodes().map(cubic).collect();
            for step in 0..=80 {
                let holding = f64::from(step) / 100.0;
                assert!((holdings.at(&values, holding) - cubic(holding)).abs() < 1e-14, "{count} at {holding}");
            }
        }
    }

    /// The value at an end of the band behaves as half a parabola of second derivative 1.
    #[test]
    fn a_bend_is_read_to_a_twentieth_of_its_jump_times_the_square_of_the_distance() {
        let (count, mut worst) = (17, 0.0_f64);
        for place in 0..1000 {
            let bend = 0.3 + f64::from(place) / 1000.0 / 16.0;
            let value = |h: f64| 0.5 * (h - bend).max(0.0).powi(2);
            let holdings = Holdings::new(count, 1.0);
            let values: Vec<f64> = holdings.nodes().map(value).collect();
            for step in 0..=400 {
                let holding = f64::from(step) / 400.0;
                worst = worst.max((holdings.at(&values, holding) - value(holding)).abs());
            }
        }
        assert!(worst < 1.0 / 20.0 / 256.0 && worst > 1.0 / 200.0 / 256.0, "{worst}");
    }

    #[test]
    fn one_value_is_read_at_any_holding() {
        let one = Holdings::new(1, 0.5);
        assert_eq!((one.gain(&[0.2], costly(), 0.7, 1.0), one.matter()), (0.2, false));
    }
}
