//! What a controlled problem is: the paper's section 2, for any state, action set, dynamics and utility with one real noise.
//!
//! The investor's problem is one of them, with and without trading cost and contributions (`investor.rs`), and has a faster
//! solver, since wealth after a period is affine in the action. `examples/hedge.rs` is another, written outside this crate.

use crate::control::problem::actions::ActionInterval;

/// A controlled state, what may be done in it, and what it is worth in the end. The law of the noise is not its matter.
///
/// Worths are amounts at the horizon. Each state has a baseline, to which its certainty equivalent is compared: the surrogates
/// regress the gain over it.
pub trait Controlled: Sync {
    /// X.
    type State: Clone + Send + Sync;

    /// A: the actions of the period after `step`.
    fn actions(&self, step: usize, state: &Self::State) -> ActionInterval;

    /// S(x, a, z): the state after a period in which the noise was z.
    fn next(&self, step: usize, state: &Self::State, action: f64, noise: f64) -> Self::State;

    /// What a surrogate sees of a state: as few numbers as its gain depends on.
    fn describe(&self, step: usize, state: &Self::State) -> Vec<f64>;

    /// At the horizon the worth itself; before it that of a safe policy, which no law can take away, or any worth where no policy
    /// is safe.
    fn baseline(&self, step: usize, state: &Self::State) -> f64;

    /// Whether the baseline is worth having for certain, and no less after a higher noise: then laws may put mass anywhere, and
    /// where it goes is proved. Where it is not, the support of the noise must be bounded.
    fn has_floor(&self) -> bool {
        true
    }

    /// Utility of a worth as seen from another: 0 there, with slope 1 in the gain. Concave and increasing.
    fn utility(&self, worth: f64, from: f64) -> f64;

    /// The worth whose utility is `utility`, as seen from another.
    fn certainty_equivalent(&self, utility: f64, from: f64) -> f64;

    /// A worth over a baseline.
    fn gain(&self, worth: f64, baseline: f64) -> f64 {
        worth - baseline
    }

    /// The worth of a gain over a baseline.
    fn worth(&self, gain: f64, baseline: f64) -> f64 {
        baseline + gain
    }
}
