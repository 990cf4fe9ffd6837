//! The regression target of the value surrogate, and its map back to the floor gain.

use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::utility::{certainty_equivalent, utility};
use crate::control::request::specification::{Specification, SurrogateTarget, UtilitySpecification};

/// The map between the floor gain and the value target of a step.
#[derive(Debug, Clone, Copy)]
pub struct TargetMap {
    target: SurrogateTarget,
    utility: UtilitySpecification,
    wealth_matters: bool,
    /// The worth of a unit of wealth in the bank.
    bank: f64,
}

impl TargetMap {
    /// Builds the map of a completed specification at `step`.
    pub fn new(specification: &Specification, step: usize) -> Self {
        let problem = &specification.problem;
        TargetMap {
            target: specification.surrogate.target,
            utility: problem.utility,
            wealth_matters: problem.depends_on_wealth(),
            bank: Dynamics::of(problem)[step].safe_worth(problem.horizon - step),
        }
    }

    /// Returns the worth in the bank, the unit of the value; it is that of unit wealth if wealth does not matter.
    fn floor(&self, total: f64) -> f64 {
        (if self.wealth_matters { total } else { 1.0 }) * self.bank
    }

    /// Returns true if the value itself is regressed.
    pub fn is_value(&self) -> bool {
        self.target == SurrogateTarget::Value
    }

    /// Returns the regression target of a floor gain, at a state whose total wealth is `total` once everything is sold.
    pub fn target(&self, gain: f64, total: f64) -> f64 {
        match self.target {
            SurrogateTarget::FloorGain => gain,
            SurrogateTarget::Value => utility(self.utility, self.floor(total) * gain.exp()),
        }
    }

    /// Returns the floor gain behind a predicted target, not clamped.
    pub fn gain(&self, target: f64, total: f64) -> f64 {
        match self.target {
            SurrogateTarget::FloorGain => target,
            SurrogateTarget::Value => {
                let gain = (certainty_equivalent(self.utility, target) / self.floor(total)).ln();
                // A prediction beyond the utility's range has no certainty equivalent.
                if gain.is_nan() { f64::INFINITY } else { gain }
            }
        }
    }
}
