//! A declared problem's policy as a player: every step is solved, as in a session.

use std::sync::Arc;

use super::{GameMove, GamePlayer, Opening, Promise, World};
use crate::control::error::FieldError;
use crate::control::policy::declared::DeclaredAdvisor;
use crate::control::problem::controlled::Controlled;
use crate::control::problem::declared::EarnedState;

/// A policy followed from a state on. Amounts are those of the first period played.
pub struct DeclaredPlayer {
    advisor: Arc<DeclaredAdvisor>,
    /// The baseline of the start, to which utilities are relative.
    from: f64,
    /// The discount of the first period played.
    discounted: f64,
}

/// A state, and the noises that were seen before it, in the unit of the solver.
#[derive(Debug, Clone)]
pub struct ReachedState {
    /// The states, and what was earned since the first period played.
    pub state: EarnedState,
    /// Noises since the start of the policy.
    pub seen: Vec<f64>,
}

impl DeclaredPlayer {
    /// Prepares the futures of a policy from `start` on, after `step` periods in which the noises `seen`, in the unit of the
    /// solver, were observed. What was earned before does not count.
    pub fn opening(advisor: Arc<DeclaredAdvisor>, step: usize, start: EarnedState, seen: Vec<f64>) -> Opening<Self> {
        let (record, seed) = (advisor.law(&seen), advisor.specification().seed);
        let start = ReachedState { state: EarnedState { earned: 0.0, ..start }, seen };
        let problem = advisor.problem();
        let (from, discounted) = (problem.baseline(step, &start.state), problem.discounted(step));
        Opening { player: DeclaredPlayer { advisor, from, discounted }, step, start, record, seed }
    }
}

impl GamePlayer for DeclaredPlayer {
    type State = ReachedState;

    fn horizon(&self) -> usize {
        self.advisor.policy().specification().problem.horizon
    }

    fn noun(&self) -> &'static str {
        "period"
    }

    fn floor(&self) -> Option<f64> {
        None
    }

    fn names(&self) -> Vec<String> {
        self.advisor.problem().states_named().iter().cloned().chain(["earned".to_owned()]).collect()
    }

    fn figures(&self, at: &ReachedState) -> Vec<f64> {
        at.state.values.iter().copied().chain([at.state.earned / self.discounted]).collect()
    }

    fn decide(&self, step: usize, at: &ReachedState, _: World) -> Result<GameMove, FieldError> {
        let problem = self.advisor.problem().afresh();
        let found = self.advisor.solved(&problem, step, &at.state, &at.seen)?;
        problem.fault().map_or(Ok(()), |fault| Err(fault.clone()))?;
        let worth = self.advisor.problem().utility(found.certainty_equivalent, self.from);
        Ok(GameMove { actions: found.actions, worst: Some((found.adversary, worth)) })
    }

    fn next(
        &self,
        step: usize,
        at: &ReachedState,
        decision: &GameMove,
        noise: f64,
    ) -> Result<ReachedState, FieldError> {
        let problem = self.advisor.problem().afresh();
        let state = problem.next(step, &at.state, &decision.actions, noise);
        problem.fault().map_or(Ok(()), |fault| Err(fault.clone()))?;
        Ok(ReachedState { state, seen: at.seen.iter().copied().chain([noise]).collect() })
    }

    fn utility(&self, step: usize, at: &ReachedState) -> f64 {
        let problem = self.advisor.problem();
        let worth = match step == self.horizon() {
            true => problem.baseline(step, &at.state),
            false => self.advisor.worth_after(step, &at.state, &at.seen).unwrap_or(f64::NAN),
        };
        problem.utility(worth, self.from)
    }

    fn promise(&self, step: usize, _: &ReachedState, decision: &GameMove) -> Promise {
        let worth = decision.worst.as_ref().map_or(f64::NAN, |(_, utility)| self.certain(*utility));
        let error = self.advisor.value_error(step, worth * self.discounted);
        Promise { worth, stated_error: error.map(|error| error / self.discounted) }
    }

    fn certain(&self, utility: f64) -> f64 {
        self.advisor.problem().certainty_equivalent(utility, self.from) / self.discounted
    }
}
