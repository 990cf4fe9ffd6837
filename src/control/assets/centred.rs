//! A utility in units of its slope at a wealth C, the centre: `(U(W) - U(C)) / U'(C)`, W and C wealth over the bank's.
//!
//! Far from the bank's wealth a utility of high risk aversion is that of infinite wealth, up to rounding, or huge. Around
//! the wealth that is reached it is neither. With W' = W / C it is C times the utility of W' around 1, of the same
//! relative risk aversion at C.

use crate::control::problem::utility::RelativeUtility;

/// At most this risk aversion, a search starts well at the bank's wealth.
const MILD: f64 = 4.0;
/// The lowest centre, where an allocation is worth nothing.
const LOWEST: f64 = 1e-9;

/// A utility around a wealth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CentredUtility {
    /// The utility of W / C around 1.
    scaled: RelativeUtility,
    centre: f64,
}

impl From<RelativeUtility> for CentredUtility {
    fn from(scaled: RelativeUtility) -> Self {
        CentredUtility { scaled, centre: 1.0 }
    }
}

impl CentredUtility {
    /// Returns the same preferences around another wealth, whose logarithm is given.
    pub fn around(self, log_centre: f64) -> Self {
        let centre = log_centre.exp().max(LOWEST);
        let scaled = match self.scaled {
            RelativeUtility::Exponential { k } => RelativeUtility::Exponential { k: k / self.centre * centre },
            other => other,
        };
        CentredUtility { scaled, centre }
    }

    /// Returns the utility of half the risk aversion around the same wealth; `None` if that is low.
    pub fn milder(self) -> Option<Self> {
        let scaled = match self.scaled {
            RelativeUtility::Exponential { k } if k > MILD => RelativeUtility::Exponential { k: 0.5 * k },
            RelativeUtility::Power { eta } if eta > MILD => RelativeUtility::Power { eta: 0.5 * eta },
            _ => return None,
        };
        Some(CentredUtility { scaled, ..self })
    }

    /// Returns the utility and its derivative at a wealth.
    #[inline(always)]
    pub fn at(self, wealth: f64) -> (f64, f64) {
        let (utility, slope) = self.scaled.at(wealth / self.centre);
        (self.centre * utility, slope)
    }

    /// Returns `-W U''(W) / U'(W)`.
    pub fn relative_aversion(self, wealth: f64) -> f64 {
        self.scaled.relative_aversion(wealth / self.centre)
    }

    /// As [`RelativeUtility::steepest`].
    pub fn steepest(self, fixed: f64) -> f64 {
        self.centre * self.scaled.steepest(fixed / self.centre)
    }

    /// As [`RelativeUtility::steepness_of_ruin`].
    pub fn steepness_of_ruin(self, fixed: f64) -> f64 {
        self.centre * self.scaled.steepness_of_ruin(fixed)
    }

    /// As [`RelativeUtility::inverse`]: the log certainty equivalent over the bank.
    pub fn inverse(self, value: f64) -> f64 {
        self.scaled.inverse(value / self.centre) + self.centre.ln()
    }

    /// As [`RelativeUtility::inverse_slope`].
    pub fn inverse_slope(self, value: f64) -> f64 {
        self.scaled.inverse_slope(value / self.centre) / self.centre
    }

    /// Returns the relative risk aversion at the centre.
    pub fn risk_aversion(self) -> f64 {
        self.scaled.relative_risk_aversion()
    }

    pub fn is_log(self) -> bool {
        self.scaled == RelativeUtility::Log
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A positive affine map of the utility around the bank's wealth, with the same certainty equivalents.
    #[test]
    fn around_another_wealth_it_is_an_affine_map() {
        for utility in [
            RelativeUtility::Exponential { k: 7.3 },
            RelativeUtility::Power { eta: 3.0 },
            RelativeUtility::Power { eta: 22.7 },
            RelativeUtility::Log,
        ] {
            let (bank, centred) =
                (CentredUtility::from(utility), CentredUtility::from(utility).around(0.3_f64.ln_1p()));
            let (origin, slope) = bank.at(1.3);
            for wealth in [0.6, 1.0, 1.29, 1.7] {
                let ((value, rise), (expected, steep)) = (centred.at(wealth), bank.at(wealth));
                // The rounding of numbers of about 1, where a difference of two of them is scaled up.
                let scale = (1.0 + expected.abs() + origin.abs()) / slope;
                assert!((value - (expected - origin) / slope).abs() < 1e-14 * scale, "{utility:?} at {wealth}");
                // A slope is computed as the difference of 1 and a number close to it.
                let rounded = 1e-14 * (1.0 + 1.0 / steep);
                assert!((rise - steep / slope).abs() < rounded * rise, "{utility:?} at {wealth}");
                let certain = 1e-14 * (1.0 + value.abs()) / (rise * wealth);
                assert!((centred.inverse(value) - wealth.ln()).abs() < certain, "{utility:?} at {wealth}");
                assert!((centred.relative_aversion(wealth) - bank.relative_aversion(wealth)).abs() < 1e-12);
                assert!((centred.inverse_slope(value) * rise * wealth - 1.0).abs() < 1e-9, "{utility:?} at {wealth}");
            }
            assert!(utility == RelativeUtility::Log || (centred.steepest(0.4) - bank.steepest(0.4)).abs() < 1e-14);
        }
    }
}
