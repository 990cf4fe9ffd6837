//! The set A of actions: for the investor the share of wealth that may be held in the risky asset; and the band, the
//! policy's no-trade region.

use serde::{Deserialize, Serialize};

use crate::control::error::FieldError;

/// Equal parts of the interval that are tried before a search on both sides of the best one. Robust values are concave
/// in the action except for the error of the surrogate, whose dents are narrower than an eighth.
const COARSE_ACTIONS: usize = 8;
/// Number of falls in a row after which no further action is tried.
const FALLS: usize = 2;
/// Equal parts that are all tried if values are not concave.
pub const FINE_ACTIONS: usize = 64;

/// A closed interval of actions. An investor's are shares of wealth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActionInterval {
    /// The lowest action.
    pub lowest: f64,
    /// The highest action.
    pub highest: f64,
}

/// The choice of one action of a controlled problem.
#[derive(Debug, Clone, PartialEq)]
pub enum ActionSet {
    /// Any number of an interval.
    Interval(ActionInterval),
    /// One of these, of which there is one at least.
    Values(Vec<f64>),
}

/// The policy at one state: a holding inside is kept, one outside trades to the nearer end. If trading costs nothing
/// both ends are the action.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 2]", into = "[f64; 2]")]
pub struct Band {
    /// A share of wealth.
    pub low: f64,
    /// A share of wealth, at least the lower one.
    pub high: f64,
}

/// Rounding of an action that is one of the set, as a share of it.
const ROUNDING: f64 = 1e-9;

impl ActionSet {
    /// Checks that an action is one of the set, but for rounding.
    ///
    /// # Errors
    /// It is not.
    pub fn checked(&self, field: &str, action: f64) -> Result<f64, FieldError> {
        let near = |other: f64| ROUNDING * (1.0 + other.abs());
        let (is_inside, rule) = match self {
            ActionSet::Interval(ActionInterval { lowest, highest }) => (
                (lowest - near(*lowest)..=highest + near(*highest)).contains(&action),
                format!("must lie in [{lowest}, {highest}], the actions at this state"),
            ),
            ActionSet::Values(values) => (
                values.iter().any(|value| (value - action).abs() <= near(*value)),
                format!("must be one of {values:?}"),
            ),
        };
        if is_inside { Ok(action) } else { Err(FieldError::new(field, action, rule)) }
    }

    /// Returns the action at a share of the set, from 0 to 1. An interval whose ends are in the wrong order is its lowest.
    pub fn at(&self, share: f64) -> f64 {
        match self {
            ActionSet::Interval(ActionInterval { lowest, highest }) => lowest + (highest - lowest).max(0.0) * share,
            ActionSet::Values(values) => values[((values.len() as f64 * share) as usize).min(values.len() - 1)],
        }
    }
}

impl Band {
    /// Builds the band from its ends, or from one action that is both; an upper end below the lower one is moved up to
    /// it.
    pub fn of(ends: &[f64]) -> Self {
        let [low, high] = [ends.first(), ends.last()].map(|end| end.copied().unwrap_or_default());
        Band { low, high: high.max(low) }
    }

    /// Returns the point of the band to which a holding trades.
    pub fn nearest(self, holding: f64) -> f64 {
        holding.max(self.low).min(self.high)
    }
}

impl From<[f64; 2]> for Band {
    fn from([low, high]: [f64; 2]) -> Self {
        Band { low, high }
    }
}

impl From<Band> for [f64; 2] {
    fn from(Band { low, high }: Band) -> Self {
        [low, high]
    }
}

impl ActionInterval {
    /// Returns the two actions on either side of the best of the actions that cut the interval into equal parts. Concave
    /// values rise to the best and fall from there, except for dents: one fall does not end the search, two in a row do.
    /// If they are not concave, all of more parts are tried.
    pub fn bracket(self, is_concave: bool, value: impl Fn(f64) -> f64) -> (f64, f64) {
        let ActionInterval { lowest, highest } = self;
        let (parts, most_falls) = if is_concave { (COARSE_ACTIONS, FALLS) } else { (FINE_ACTIONS, usize::MAX) };
        let part = (highest - lowest) / parts as f64;
        let (mut best, mut falls) = ((lowest, value(lowest)), 0);
        for index in 1..=parts {
            let action = lowest + index as f64 * part;
            let tried = value(action);
            (best, falls) = if tried > best.1 { ((action, tried), 0) } else { (best, falls + 1) };
            if falls == most_falls {
                break;
            }
        }
        ((best.0 - part).max(lowest), (best.0 + part).min(highest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tries best actions all over [0.2, 1], also with a dent in which the value dips once.
    #[test]
    fn a_bracket_holds_the_best_action() {
        let actions = ActionInterval { lowest: 0.2, highest: 1.0 };
        for best in (0..=40).map(|index| 0.2 + 0.02 * f64::from(index)) {
            let dented = |action: f64| if (action - 0.5).abs() < 0.02 { -9.0 } else { -(action - best).powi(2) };
            for value in [&dented as &dyn Fn(f64) -> f64, &|action: f64| -(action - best).powi(2)] {
                let (low, high) = actions.bracket(true, value);
                assert!(low <= best + 1e-12 && best - 1e-12 <= high && high - low < 0.21, "{best}: [{low}, {high}]");
            }
        }
    }
}
