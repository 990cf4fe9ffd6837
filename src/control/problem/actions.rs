//! The set A of actions: what share of wealth may be held in the risky asset.

/// Equal parts of the interval that are tried before a search between the best one's neighbours: robust values are concave
/// in the action but for the error of the surrogate, whose dents are narrower than an eighth.
const COARSE_ACTIONS: usize = 8;

/// A closed interval of shares of wealth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActionInterval {
    /// A share of wealth.
    pub lowest: f64,
    /// A share of wealth.
    pub highest: f64,
}

impl ActionInterval {
    /// The neighbours of the best of the actions that cut the interval into equal parts.
    pub fn bracket(self, value: impl Fn(f64) -> f64) -> (f64, f64) {
        let ActionInterval { lowest, highest } = self;
        let part = (highest - lowest) / COARSE_ACTIONS as f64;
        let mut best = (lowest, value(lowest));
        for index in 1..=COARSE_ACTIONS {
            let action = lowest + index as f64 * part;
            let tried = value(action);
            if tried > best.1 {
                best = (action, tried);
            }
        }
        ((best.0 - part).max(lowest), (best.0 + part).min(highest))
    }
}
