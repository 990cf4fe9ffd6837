//! What the value surrogate regresses, and the way back to the floor gain.

use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::utility::{certainty_equivalent, depends_on_wealth, utility};
use crate::control::request::specification::{Specification, SurrogateTarget, UtilitySpecification};

/// How the value target of a step maps to and from the floor gain.
#[derive(Debug, Clone, Copy)]
pub struct TargetMap {
    target: SurrogateTarget,
    utility: UtilitySpecification,
    dynamics: Dynamics,
    steps_left: usize,
}

impl TargetMap {
    /// Of a completed specification at `step`.
    pub fn new(specification: &Specification, step: usize) -> Self {
        TargetMap {
            target: specification.surrogate.target,
            utility: specification.problem.utility,
            dynamics: Dynamics::of(&specification.problem),
            steps_left: specification.problem.horizon - step,
        }
    }

    /// Terminal all-bank wealth in whose units the value is taken: of unit wealth where wealth does not matter. `wealth` is in
    /// the bank.
    fn floor(&self, wealth: f64) -> f64 {
        let wealth = if depends_on_wealth(self.utility) { wealth } else { 1.0 };
        self.dynamics.floor(wealth, 0.0, self.steps_left)
    }

    /// True where the value itself is regressed.
    pub fn is_value(&self) -> bool {
        self.target == SurrogateTarget::Value
    }

    /// The regression target of a floor gain, at a state that selling everything leaves with `wealth`.
    pub fn target(&self, gain: f64, wealth: f64) -> f64 {
        match self.target {
            SurrogateTarget::FloorGain => gain,
            SurrogateTarget::Value => utility(self.utility, self.floor(wealth) * gain.exp()),
        }
    }

    /// The floor gain behind a predicted target, not clamped.
    pub fn gain(&self, target: f64, wealth: f64) -> f64 {
        match self.target {
            SurrogateTarget::FloorGain => target,
            SurrogateTarget::Value => {
                let gain = (certainty_equivalent(self.utility, target) / self.floor(wealth)).ln();
                // A prediction beyond the utility's range has no certainty equivalent.
                if gain.is_nan() { f64::INFINITY } else { gain }
            }
        }
    }
}
