//! The definition of a controlled problem: the paper's section 2, for any state, action set, dynamics and utility with
//! one real noise.
//!
//! The investor's problem is one of them, with and without trading cost and contributions (`investor.rs`). It has a
//! faster solver, because wealth after a period is affine in the action. `examples/hedge.rs` is another, written
//! outside this crate.

use crate::control::problem::actions::ActionSet;

/// A controlled state, its actions, and its worth at the horizon. The law of the noise is not part of it.
///
/// Worths are amounts at the horizon. Each state has a baseline, to which its certainty equivalent is compared: the
/// surrogates regress the gain over it.
pub trait Controlled: Sync {
    /// X, the set of states.
    type State: Clone + Send + Sync;

    /// Returns A: what each action of the period after `step` may be, the others being what they are.
    fn actions(&self, step: usize, state: &Self::State) -> Vec<ActionSet>;

    /// Returns S(x, a, z): the state after a period in which the noise was z. There is one action for each set of
    /// [`Self::actions`].
    fn next(&self, step: usize, state: &Self::State, actions: &[f64], noise: f64) -> Self::State;

    /// Returns the features of a state: as few numbers as its gain depends on.
    fn describe(&self, step: usize, state: &Self::State) -> Vec<f64>;

    /// Returns the baseline of a state. At the horizon it is the worth itself. Before, it is that of a safe policy,
    /// which no law can take away, or any worth if no policy is safe.
    fn baseline(&self, step: usize, state: &Self::State) -> f64;

    /// Returns true if the baseline is worth having for certain, and no less after a higher noise. Then laws may put
    /// mass anywhere, and a certificate proves where it goes. Otherwise the support of the noise must be bounded.
    fn has_floor(&self) -> bool {
        true
    }

    /// Returns true if the certainty equivalent is concave in the actions. Otherwise the best of many even actions is found
    /// before a search around it, and a search over several actions starts several times.
    fn is_concave(&self) -> bool {
        true
    }

    /// Returns the utility of a worth relative to another: 0 there, with slope 1 in the gain. Concave and increasing.
    fn utility(&self, worth: f64, from: f64) -> f64;

    /// Returns the worth whose utility relative to another is `utility`.
    fn certainty_equivalent(&self, utility: f64, from: f64) -> f64;

    /// Returns the gain of a worth over a baseline.
    fn gain(&self, worth: f64, baseline: f64) -> f64 {
        worth - baseline
    }

    /// Returns the worth of a gain over a baseline.
    fn worth(&self, gain: f64, baseline: f64) -> f64 {
        baseline + gain
    }
}

/// A controlled problem whose states one number describes.
pub trait Gridded: Controlled {
    /// Returns ascending numbers at which the states of a step are solved: one for the first step, else two at least.
    fn nodes(&self, step: usize) -> Vec<f64>;

    /// Returns a state of a step that a number describes.
    fn at(&self, step: usize, number: f64) -> Self::State;

    /// Returns the gain of a state, given that of its robust step. They differ if something is decided before it.
    fn gain_before(&self, _step: usize, gain: f64) -> f64 {
        gain
    }
}
