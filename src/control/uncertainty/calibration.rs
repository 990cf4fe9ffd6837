//! The factor on the radius under `calibrated` and `joint`, found from the history.

use super::radius::{Calibration, CalibrationGoal, RadiusEstimator};
use crate::control::request::radius_rule::RadiusRule;
use crate::numerics::bridge::calibration::calibration_factor;
use crate::numerics::bridge::partial_sums::all_steps_factor;

impl RadiusEstimator {
    /// Returns the rule with the result of a calibration: it gives every law the same radius, without the history.
    pub fn calibrated_rule(&self) -> RadiusRule {
        match self.rule {
            RadiusRule::Bridge { alpha, paths, scale, correction } => {
                RadiusRule::Bridge { alpha, paths, scale: self.calibrated(scale, alpha, paths), correction }
            }
            rule => rule,
        }
    }

    /// Returns `scale` times the factor of the calibration. That of `joint` includes the correction, so its rule has no
    /// other.
    fn calibrated(&self, scale: f64, alpha: f64, paths: usize) -> f64 {
        let Some(Calibration { history, retention, goal, factor }) = self.calibration.as_ref().filter(|_| scale > 0.0)
        else {
            return scale;
        };
        let find = || match *goal {
            CalibrationGoal::SmoothedLaw => {
                calibration_factor(&self.bridges(history.len(), paths), history, *retention, alpha, self.seed)
            }
            CalibrationGoal::AllSteps(steps) => {
                self.correction(alpha, paths) * all_steps_factor(&self.learned, steps, paths, alpha, self.seed)
            }
        };
        scale * factor.get_or_init(find)
    }

    /// Returns the calibrated scale times the correction, which applies to every radius by the bridge.
    pub(super) fn factor(&self, scale: f64, alpha: f64, paths: usize) -> f64 {
        self.calibrated(scale, alpha, paths) * self.correction_at(alpha, paths)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::control::cache::Cache;
    use crate::control::request::specification::Specification;
    use crate::control::uncertainty::radius::RadiusEstimator;
    use crate::numerics::law::empirical::EmpiricalDistribution;

    const HISTORY: [f64; 8] = [0.02, -0.01, 0.04, 0.01, -0.06, 0.03, 0.0, 0.015];

    fn radii(rule: &str, framework: &str, horizon: usize) -> Vec<f64> {
        let radius: Value = json!({ "rule": rule, "alpha": 0.2, "paths": 500 });
        let request = json!({ "problem": { "framework": framework, "horizon": horizon, "rate_per_step": 0.0,
            "radius": radius, "history": HISTORY } });
        let kept = Cache::default();
        let specification: Specification = serde_json::from_value(request).unwrap();
        let estimator = RadiusEstimator::new(&specification.completed().unwrap().resolved(&kept), kept);
        let law = EmpiricalDistribution::new(&HISTORY);
        let ahead = estimator.radii_with(&law, &[-0.02, 0.03]);
        let radius = estimator.radius(&law);
        let here = [radius, estimator.radii(&law, radius).radius_ahead];
        here.into_iter().chain(ahead.into_iter().flat_map(|radii| [radii.radius, radii.radius_ahead])).collect()
    }

    #[test]
    fn a_joint_ball_of_one_step_is_that_of_the_bridge() {
        for (framework, horizon) in [("adaptive", 1), ("static", 1), ("static", 12)] {
            let [bridge, joint] = ["bridge", "joint"].map(|rule| radii(rule, framework, horizon));
            // Equal bit for bit: the factor is 1, and both have the correction of the history.
            assert_eq!(bridge, joint, "{framework} {horizon}");
        }
    }

    #[test]
    fn a_joint_ball_is_refused_if_weights_decay() {
        let request = json!({ "problem": { "horizon": 4, "rate_per_step": 0.0, "radius": { "rule": "joint" },
            "learning": { "kind": "decay", "half_life": 9.0 }, "history": HISTORY } });
        let refused = serde_json::from_value::<Specification>(request).unwrap().completed().unwrap_err();
        assert_eq!(refused.field, "problem.radius.rule");
    }

    #[test]
    fn joint_balls_of_many_steps_are_those_of_the_bridge_times_one_factor() {
        let [bridge, joint] = ["bridge", "joint"].map(|rule| radii(rule, "adaptive", 12));
        let factor = joint[0] / bridge[0];
        assert!(factor > 1.1, "{factor}");
        for (plain, scaled) in bridge.into_iter().zip(joint) {
            // Equal up to rounding.
            assert!((scaled / plain / factor - 1.0).abs() < 1e-12, "{plain} {scaled} {factor}");
        }
    }
}
