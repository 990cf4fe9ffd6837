//! What the value surrogate regresses, and the way back to the floor gain.

use crate::control::problem::utility::{certainty_equivalent, utility};
use crate::control::request::specification::{Specification, SurrogateTarget, UtilitySpecification};

/// How the value target of a step maps to and from the floor gain.
#[derive(Debug, Clone, Copy)]
pub struct TargetMap {
    target: SurrogateTarget,
    utility: UtilitySpecification,
    wealth_matters: bool,
    /// What the bank makes of a unit of wealth until the horizon.
    bank: f64,
}

impl TargetMap {
    /// Of a completed specification at `step`.
    pub fn new(specification: &Specification, step: usize) -> Self {
        let problem = &specification.problem;
        TargetMap {
            target: specification.surrogate.target,
            utility: problem.utility,
            wealth_matters: problem.depends_on_wealth(),
            bank: (1.0 + problem.rate_per_step).powf((problem.horizon - step) as f64),
        }
    }

    /// Terminal all-bank wealth in whose units the value is taken: of unit wealth where wealth does not matter.
    fn floor(&self, total: f64) -> f64 {
        (if self.wealth_matters { total } else { 1.0 }) * self.bank
    }

    /// True where the value itself is regressed.
    pub fn is_value(&self) -> bool {
        self.target == SurrogateTarget::Value
    }

    /// The regression target of a floor gain, at a state whose total wealth is `total` once everything is sold.
    pub fn target(&self, gain: f64, total: f64) -> f64 {
        match self.target {
            SurrogateTarget::FloorGain => gain,
            SurrogateTarget::Value => utility(self.utility, self.floor(total) * gain.exp()),
        }
    }

    /// The floor gain behind a predicted target, not clamped.
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
