//! The regression target of the policy surrogate: the action, continued past the bounds of the interval.
//!
//! Actions stick to a bound over whole regions of states, and a surrogate of them would be wrong on either side of the
//! region's edge. Continued, they cross the bound without a kink, and a prediction is clamped to the interval
//! afterwards.

/// Step of the one-sided derivatives at a bound, in action: wide enough to exceed the error of the value surrogate. It
/// is smaller if the interval is narrower than four such steps.
const DERIVATIVE_STEP: f64 = 5e-2;
/// The curvature there is clamped to within this factor of relative risk aversion times variance.
const CURVATURE_RANGE: f64 = 4.0;
/// How far past a bound the target may go, in action: far enough for the surrogate to see a slope.
const LARGEST_EXTENSION: f64 = 2.0;

/// Returns the target of an action, moved past the bound if the action is at a bound. An action so near a bound that an
/// error of the next step's value may have put it there counts as at it. The move is the Newton step of the one-sided
/// derivatives, to the optimum of the parabola that touches the robust gain at the bound. So the target crosses the
/// bound without a kink. `gain` is the robust gain of `action`, `reference` the expected curvature: relative risk
/// aversion times variance.
pub fn policy_target(action: f64, highest: f64, gain: f64, reference: f64, gain_at: impl Fn(f64) -> f64) -> f64 {
    let step = DERIVATIVE_STEP.min(highest / 4.0);
    if step <= 0.0 {
        return action;
    }
    let (bound, inward) = if action < step {
        (0.0, 1.0)
    } else if action > highest - step {
        (highest, -1.0)
    } else {
        return action;
    };
    let gain = if action == bound { gain } else { gain_at(bound) };
    let [near, far] = [1.0, 2.0].map(|steps| gain_at(bound + inward * steps * step));
    let slope = (4.0 * near - far - 3.0 * gain) / (2.0 * step);
    if slope > 0.0 {
        return action;
    }
    let curvature = (2.0 * near - far - gain) / (step * step);
    let curvature = curvature.clamp(reference / CURVATURE_RANGE, reference * CURVATURE_RANGE);
    // Far beyond the bound the target levels off smoothly, because an action that is never optimal needs no resolution.
    bound + inward * LARGEST_EXTENSION * (slope / curvature / LARGEST_EXTENSION).tanh()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a gain of curvature -1.6 with its optimum at `best`.
    fn parabola(best: f64) -> impl Fn(f64) -> f64 {
        move |action: f64| 0.3 - 0.8 * (action - best).powi(2)
    }

    fn target(action: f64, best: f64) -> f64 {
        let gain = parabola(best);
        policy_target(action, 1.0, gain(action), 1.6, &gain)
    }

    #[test]
    fn a_parabola_is_continued_to_its_optimum() {
        // tanh turns a step of 0.1 into 0.0999.
        assert!((target(0.0, -0.1) + 0.1).abs() < 2e-4, "{}", target(0.0, -0.1));
        assert!((target(1.0, 1.1) - 1.1).abs() < 2e-4, "{}", target(1.0, 1.1));
    }

    #[test]
    fn inside_and_at_a_bound_that_is_no_corner_the_action_is_its_own_target() {
        assert_eq!(target(0.4, 0.4), 0.4);
        assert_eq!(target(0.01, 0.01), 0.01);
    }

    #[test]
    fn far_beyond_a_bound_the_target_levels_off() {
        for best in [-3.0, -30.0, -3000.0] {
            let found = target(0.0, best);
            assert!((-LARGEST_EXTENSION..-1.5).contains(&found) || found == -LARGEST_EXTENSION, "{best}: {found}");
        }
        // A curvature that comes from the value's error is clamped to a factor of the expected one.
        assert!(policy_target(0.0, 1.0, 0.0, 1.6, |action| -action) >= -LARGEST_EXTENSION);
    }
}
