//! Utilities, in units of the all-bank floor.
//!
//! A utility enters the Bellman step only up to a positive affine map, so it is normalised at the terminal wealth L of
//! all-bank: with `w = ln(x_T / L)`, `u(0) = 0` and `u'(0) = 1`. Rounding is then relative to the gain that matters to
//! the investor, at any wealth and risk aversion.

use crate::control::request::specification::UtilitySpecification;
use crate::numerics::machine::dispatch::dispatched;
use crate::numerics::machine::elementary::{exp_m1, ln};

/// Largest exponent used: exp(600) is finite, and a loss that deep is never chosen.
const LARGEST_EXPONENT: f64 = 600.0;

/// Largest whole risk aversion, and smallest wealth, for which powers are multiplied out:
/// `U(W) = (W - 1) (W^-1 + ... + W^(1-eta)) / (eta - 1)`. This is `(1 - W^(1-eta)) / (eta - 1)` without the
/// cancellation near 1.
const MOST_MULTIPLIED: f64 = 16.0;
const LEAST_MULTIPLIED: f64 = 1e-12;

/// Utility of the log gain over the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RelativeUtility {
    /// `u(w) = (1 - exp(-k (e^w - 1))) / k`, k the risk aversion times the floor.
    Exponential {
        /// Dimensionless.
        k: f64,
    },
    /// `u(w) = (e^((1 - eta) w) - 1) / (1 - eta)`, eta the risk aversion.
    Power {
        /// Dimensionless, above 1.
        eta: f64,
    },
    /// `u(w) = w`.
    Log,
}

/// Returns the utility of a worth relative to another: 0 there, with slope 1 in the log of their ratio.
pub fn relative_utility(utility: UtilitySpecification, worth: f64, from: f64) -> f64 {
    RelativeUtility::new(utility, from).value((worth / from).ln())
}

/// Returns the worth whose utility relative to another is `relative`: the inverse of [`relative_utility`].
pub fn worth_of_utility(utility: UtilitySpecification, relative: f64, from: f64) -> f64 {
    from * RelativeUtility::new(utility, from).inverse(relative).exp()
}

impl RelativeUtility {
    /// Builds the utility relative to a floor of terminal wealth `floor`.
    pub fn new(utility: UtilitySpecification, floor: f64) -> Self {
        match utility {
            UtilitySpecification::Exponential { risk_aversion, .. } => {
                RelativeUtility::Exponential { k: risk_aversion * floor }
            }
            UtilitySpecification::Power { risk_aversion } => RelativeUtility::Power { eta: risk_aversion },
            UtilitySpecification::Log {} => RelativeUtility::Log,
        }
    }

    /// Returns u(w).
    pub fn value(self, log_gain: f64) -> f64 {
        match self {
            RelativeUtility::Exponential { k } => -(-k * log_gain.exp_m1()).min(LARGEST_EXPONENT).exp_m1() / k,
            RelativeUtility::Power { eta } => ((1.0 - eta) * log_gain).min(LARGEST_EXPONENT).exp_m1() / (1.0 - eta),
            RelativeUtility::Log => log_gain,
        }
    }

    /// Returns u(ln(relative_j) + gains_j) for all j, in the vector `relative`: wealth over all-bank wealth, positive.
    pub fn values(self, mut relative: Vec<f64>, gains: &[f64]) -> Vec<f64> {
        dispatched!(match self {
            RelativeUtility::Exponential { k } => {
                for (value, gain) in relative.iter_mut().zip(gains) {
                    let excess = (*value - 1.0) + *value * exp_m1(*gain);
                    let loss = -k * excess;
                    *value = -exp_m1(if loss < LARGEST_EXPONENT { loss } else { LARGEST_EXPONENT }) / k;
                }
            }
            RelativeUtility::Power { eta } => {
                for (value, gain) in relative.iter_mut().zip(gains) {
                    let power = (1.0 - eta) * (ln(*value) + gain);
                    let power = if power < LARGEST_EXPONENT { power } else { LARGEST_EXPONENT };
                    *value = exp_m1(power) / (1.0 - eta);
                }
            }
            RelativeUtility::Log => {
                for (value, gain) in relative.iter_mut().zip(gains) {
                    *value = ln(*value) + gain;
                }
            }
        });
        relative
    }

    /// Returns the utility and its derivative at relative wealth W = e^w, above 0: U(W) = u(ln W) and U'(W).
    pub fn at(self, wealth: f64) -> (f64, f64) {
        match self {
            RelativeUtility::Exponential { k } => {
                let exponent = (-k * (wealth - 1.0)).min(LARGEST_EXPONENT);
                let power = exponent.exp_m1();
                (-power / k, power + 1.0)
            }
            RelativeUtility::Power { eta }
                if eta.fract() == 0.0 && eta <= MOST_MULTIPLIED && wealth > LEAST_MULTIPLIED =>
            {
                let (inverse, mut power, mut sum) = (1.0 / wealth, 1.0, 0.0);
                for _ in 1..eta as usize {
                    power *= inverse;
                    sum += power;
                }
                ((wealth - 1.0) * sum / (eta - 1.0), power * inverse)
            }
            RelativeUtility::Power { eta } => {
                let power = ((1.0 - eta) * wealth.ln()).min(LARGEST_EXPONENT).exp_m1();
                (power / (1.0 - eta), (power + 1.0) / wealth)
            }
            RelativeUtility::Log => (wealth.ln(), 1.0 / wealth),
        }
    }

    /// Returns the weight in a mean utility of a path that ends at this log gain: `W U'(W)`, W relative wealth.
    pub fn weight(self, log_gain: f64) -> f64 {
        match self {
            RelativeUtility::Exponential { k } => (log_gain - k * log_gain.exp_m1()).min(LARGEST_EXPONENT).exp(),
            RelativeUtility::Power { eta } => ((1.0 - eta) * log_gain).min(LARGEST_EXPONENT).exp(),
            RelativeUtility::Log => 1.0,
        }
    }

    /// Returns `-W U''(W) / U'(W)`.
    pub fn relative_aversion(self, wealth: f64) -> f64 {
        match self {
            RelativeUtility::Exponential { k } => k * wealth,
            RelativeUtility::Power { eta } => eta,
            RelativeUtility::Log => 1.0,
        }
    }

    /// Returns the y at which `U'(b + y) y` is largest, b `fixed`; it rises up to there and falls from there on.
    pub fn steepest(self, fixed: f64) -> f64 {
        match self {
            RelativeUtility::Exponential { k } => 1.0 / k,
            RelativeUtility::Power { eta } => fixed / (eta - 1.0),
            RelativeUtility::Log => f64::INFINITY,
        }
    }

    /// Returns the limit of `U'(b + y) y` as y falls to 0, b `fixed`: 0 if b is positive.
    pub fn steepness_of_ruin(self, fixed: f64) -> f64 {
        match self {
            RelativeUtility::Log if fixed <= 0.0 => 1.0,
            RelativeUtility::Power { .. } if fixed <= 0.0 => f64::INFINITY,
            _ => 0.0,
        }
    }

    /// Returns the log gain whose utility is `value`: the log certainty equivalent over the floor. It is minus infinity
    /// if no wealth above 0 has so low a utility, and infinity if no wealth has so high a one.
    /// Checked by: `tests::no_wealth_has_a_utility_beyond_the_highest`.
    pub fn inverse(self, value: f64) -> f64 {
        match self {
            RelativeUtility::Exponential { k } if value >= 1.0 / k => f64::INFINITY,
            RelativeUtility::Power { eta } if value >= 1.0 / (eta - 1.0) => f64::INFINITY,
            RelativeUtility::Exponential { k } => (-(-k * value).ln_1p() / k).max(-1.0).ln_1p(),
            RelativeUtility::Power { eta } => ((1.0 - eta) * value).ln_1p() / (1.0 - eta),
            RelativeUtility::Log => value,
        }
    }

    /// Returns the derivative of [`Self::inverse`] at `value`: log gain per unit of utility.
    pub fn inverse_slope(self, value: f64) -> f64 {
        match self {
            RelativeUtility::Exponential { k } => 1.0 / ((1.0 - k * value) * (1.0 - (-k * value).ln_1p() / k)),
            RelativeUtility::Power { eta } => 1.0 / (1.0 + (1.0 - eta) * value),
            RelativeUtility::Log => 1.0,
        }
    }

    /// Returns the relative risk aversion at the floor, `-u''(0) + 1` in log wealth.
    pub fn relative_risk_aversion(self) -> f64 {
        match self {
            RelativeUtility::Exponential { k } => k,
            RelativeUtility::Power { eta } => eta,
            RelativeUtility::Log => 1.0,
        }
    }
}

/// Returns U(x), as the request defines it.
pub fn utility(utility: UtilitySpecification, wealth: f64) -> f64 {
    match utility {
        UtilitySpecification::Exponential { risk_aversion, .. } => -(-risk_aversion * wealth).exp_m1() / risk_aversion,
        UtilitySpecification::Power { risk_aversion } => {
            ((1.0 - risk_aversion) * wealth.ln()).exp_m1() / (1.0 - risk_aversion)
        }
        UtilitySpecification::Log {} => wealth.ln(),
    }
}

/// Returns U'(x).
pub fn marginal_utility(utility: UtilitySpecification, wealth: f64) -> f64 {
    match utility {
        UtilitySpecification::Exponential { risk_aversion, .. } => (-risk_aversion * wealth).exp(),
        UtilitySpecification::Power { risk_aversion } => wealth.powf(-risk_aversion),
        UtilitySpecification::Log {} => 1.0 / wealth,
    }
}

/// Returns U^{-1}(v): the certainty equivalent of the value v.
pub fn certainty_equivalent(utility: UtilitySpecification, value: f64) -> f64 {
    match utility {
        UtilitySpecification::Exponential { risk_aversion, .. } => -(-risk_aversion * value).ln_1p() / risk_aversion,
        // At unit wealth these are the relative utilities.
        _ => RelativeUtility::new(utility, 1.0).inverse(value).exp(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The highest utilities are 1 / k and 1 / (eta - 1).
    #[test]
    fn no_wealth_has_a_utility_beyond_the_highest() {
        for (utility, highest) in
            [(RelativeUtility::Exponential { k: 140.7 }, 1.0 / 140.7), (RelativeUtility::Power { eta: 3.7 }, 1.0 / 2.7)]
        {
            for value in [highest, 1.1 * highest, f64::INFINITY] {
                assert_eq!(utility.inverse(value), f64::INFINITY);
            }
            assert!(utility.inverse(0.999 * highest).is_finite());
        }
        assert_eq!(RelativeUtility::Exponential { k: 2.0 }.inverse(f64::NEG_INFINITY), f64::NEG_INFINITY);
    }

    #[test]
    fn many_values_equal_one_by_one() {
        let (relative, gains): (Vec<f64>, [f64; 5]) = (vec![0.01, 0.7, 1.0, 1.2, 3.0], [0.0, 0.01, 0.0, 0.2, 0.5]);
        for utility in [
            RelativeUtility::Exponential { k: 1.2 },
            RelativeUtility::Exponential { k: 1e-16 },
            RelativeUtility::Power { eta: 3.0 },
            RelativeUtility::Log,
        ] {
            let expected = relative.iter().zip(gains).map(|(relative, gain)| utility.value(relative.ln() + gain));
            for (found, expected) in utility.values(relative.clone(), &gains).iter().zip(expected) {
                // Relative error of two exponentials, and the rounding of 1.
                assert!(
                    (found - expected).abs() < 4e-14 * expected.abs() + 2e-16,
                    "{utility:?}: {found} against {expected}"
                );
            }
        }
    }

    #[test]
    fn by_wealth_it_is_the_utility_of_its_logarithm_and_steepest_where_it_says() {
        let powers = [2.0, 2.5, 3.0].map(|eta| RelativeUtility::Power { eta });
        for utility in powers.into_iter().chain([RelativeUtility::Exponential { k: 1.2 }, RelativeUtility::Log]) {
            for wealth in [0.2, 0.9, 1.0, 1.7_f64] {
                let (value, slope) = utility.at(wealth);
                assert!((value - utility.value(wealth.ln())).abs() < 1e-14 * (1.0 + value.abs()));
                // Central differences: their error is 1e-8 of the third derivative, below 2000 here.
                let difference = |step: f64| (utility.at(wealth + step).0 - utility.at(wealth - step).0) / (2.0 * step);
                assert!((difference(1e-4) - slope).abs() < 1e-4 * slope, "{utility:?} {wealth}");
                let falls = (utility.at(wealth + 1e-4).1 - utility.at(wealth - 1e-4).1) / -2e-4;
                assert!((wealth * falls / slope / utility.relative_aversion(wealth) - 1.0).abs() < 1e-4);
            }
            let scaled_slope = |moving: f64| utility.at(0.4 + moving).1 * moving;
            let peak = utility.steepest(0.4).min(1e6);
            assert!(
                scaled_slope(peak) >= scaled_slope(0.9 * peak) && scaled_slope(peak) >= scaled_slope(1.1 * peak)
                    || peak == 1e6,
                "{utility:?}"
            );
            assert!((scaled_slope(1e-9) - utility.steepness_of_ruin(0.4)).abs() < 1e-7);
        }
        assert_eq!(RelativeUtility::Log.steepness_of_ruin(0.0), 1.0);
        assert_eq!(RelativeUtility::Power { eta: 3.0 }.steepness_of_ruin(0.0), f64::INFINITY);
    }

    #[test]
    fn relative_utility_is_an_affine_map_of_the_utility() {
        let floor = 120.0_f64;
        for (kind, slope) in [
            (UtilitySpecification::exponential(0.02), floor * (-0.02 * floor).exp()),
            (UtilitySpecification::Power { risk_aversion: 3.0 }, floor.powi(-2)),
            (UtilitySpecification::Log {}, 1.0),
        ] {
            let relative = RelativeUtility::new(kind, floor);
            for gain in [-1.5, -0.1, 0.0, 0.02, 0.7_f64] {
                let direct = (utility(kind, floor * gain.exp()) - utility(kind, floor)) / slope;
                // Power utility cancels from 0.5 to 1e-5: eleven digits are left, of which the test checks eight.
                assert!((relative.value(gain) - direct).abs() < 1e-8 * (1.0 + direct.abs()), "{kind:?} {gain}");
                assert!((relative.inverse(relative.value(gain)) - gain).abs() < 1e-12);
                let back = certainty_equivalent(kind, utility(kind, floor * gain.exp()));
                assert!((back / (floor * gain.exp()) - 1.0).abs() < 1e-9);
            }
        }
    }
}
