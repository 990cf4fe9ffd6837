//! Shares that depend on the state of a plan.

/// The number that describes the state of a plan, besides the period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DescribedBy {
    /// None: the period alone decides.
    Period,
    /// Wealth over the reserve, at most 1.
    Funds,
    /// The value of a unit that stays invested, over its highest so far.
    Unit,
}

/// Shares by the number that describes the state of a plan, linear between.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ByState {
    /// Ascending, one at least.
    pub(super) states: Vec<f64>,
    /// One for each.
    pub(super) shares: Vec<f64>,
}

impl ByState {
    /// One share in all states.
    pub(super) fn always(share: f64) -> Self {
        ByState { states: vec![0.0], shares: vec![share] }
    }

    /// Gives states in which nothing is decided the share of the next one in which something is.
    #[must_use]
    pub(super) fn where_decided(mut self, decides: impl Fn(f64) -> bool) -> Self {
        for place in (1..self.states.len()).rev() {
            if !decides(self.states[place - 1]) {
                self.shares[place - 1] = self.shares[place];
            }
        }
        self
    }

    /// Returns the share in a state.
    pub(super) fn at(&self, state: f64) -> f64 {
        let (place, weight) = between(&self.states, state);
        let near = self.shares[place];
        if weight == 0.0 { near } else { near + weight * (self.shares[place + 1] - near) }
    }
}

/// Returns the place of the last of `nodes` that is not above `at`, or the first, and how far `at` is on the way to the next.
pub(super) fn between(nodes: &[f64], at: f64) -> (usize, f64) {
    let place = nodes.partition_point(|node| *node <= at).saturating_sub(1);
    match nodes.get(place + 1) {
        Some(next) if at > nodes[place] => (place, (at - nodes[place]) / (next - nodes[place])),
        _ => (place, 0.0),
    }
}
