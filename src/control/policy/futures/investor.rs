//! An investor's policy as a player: the allocations that its sessions are advised, and the worst law for each.

use std::sync::Arc;

use super::{GameMove, GamePlayer, Opening, Promise, World};
use crate::control::bellman::BellmanStep;
use crate::control::bellman::next_value::NextValue;
use crate::control::bellman::solution::RobustSolution;
use crate::control::error::FieldError;
use crate::control::policy::advisor::{AdviceMode, Advisor};
use crate::control::problem::state::{PeriodOutcome, State};
use crate::control::problem::utility::RelativeUtility;
use crate::control::request::frequency::Frequency;

/// A policy followed from a state. Utility is relative to the all-bank floor of that state.
pub struct InvestorPlayer {
    advisor: Arc<Advisor>,
    utility: RelativeUtility,
    floor: f64,
}

impl InvestorPlayer {
    /// Prepares the futures of a policy from `start` on, after `step` periods.
    pub fn opening(advisor: Arc<Advisor>, step: usize, start: State) -> Opening<Self> {
        let floor = advisor.problem.floor(step, &start);
        let utility = RelativeUtility::new(advisor.specification().problem.utility, floor);
        let (record, seed) = (start.law.clone(), advisor.specification().seed);
        Opening { player: InvestorPlayer { advisor, utility, floor }, step, start, record, seed }
    }

    /// Returns the worth of holding `allocation` after `step` periods against the law that is worst for it. Cost: a
    /// robust step with one action.
    fn price(&self, step: usize, state: &State, allocation: f64) -> RobustSolution {
        let after = self.advisor.policy().steps().get(step + 1).map(|after| &after.solution);
        let next = NextValue::new(self.advisor.specification(), step + 1, after);
        BellmanStep { problem: &self.advisor.problem, step, next: &next }.price(state, allocation)
    }

    fn of_amount(&self, amount: f64) -> f64 {
        self.utility.value((amount.max(f64::MIN_POSITIVE) / self.floor).ln())
    }
}

impl GamePlayer for InvestorPlayer {
    type State = State;

    fn horizon(&self) -> usize {
        self.advisor.specification().problem.horizon
    }

    fn noun(&self) -> &'static str {
        Frequency::noun_for(self.advisor.specification().problem.periods_per_year)
    }

    fn floor(&self) -> Option<f64> {
        Some(self.floor)
    }

    fn names(&self) -> Vec<String> {
        vec!["wealth".to_owned()]
    }

    fn figures(&self, state: &State) -> Vec<f64> {
        vec![state.wealth]
    }

    fn decide(&self, step: usize, state: &State, world: World) -> Result<GameMove, FieldError> {
        let allocation = self.advisor.advise(step, state, AdviceMode::Surrogate).allocation;
        let worst = (world == World::Worst).then(|| {
            let found = self.price(step, state, allocation);
            let worth = self.advisor.problem.floor(step, state) * found.floor_gain.exp();
            (found.adversary, self.of_amount(worth))
        });
        Ok(GameMove { actions: vec![allocation], worst })
    }

    fn next(&self, step: usize, state: &State, decision: &GameMove, noise: f64) -> Result<State, FieldError> {
        Ok(self.advisor.advance(step, state, &PeriodOutcome::of(decision.actions[0], noise)))
    }

    fn utility(&self, step: usize, state: &State) -> f64 {
        match step == self.horizon() {
            true => self.of_amount(state.wealth),
            false => {
                let (_, gain) = self.advisor.surrogate(step, state);
                self.of_amount(self.advisor.problem.floor(step, state) * gain.exp())
            }
        }
    }

    fn promise(&self, step: usize, state: &State, _: &GameMove) -> Promise {
        let advice = self.advisor.advise(step, state, AdviceMode::Surrogate);
        let (worth, deviation) = (advice.certainty_equivalent, advice.surrogate_sd);
        // Without an accuracy nothing is known of the error of later steps.
        let states_it =
            self.advisor.policy().steps()[step].diagnostics.expected_error.is_some() && deviation.is_finite();
        Promise { worth, stated_error: states_it.then_some(worth * deviation) }
    }

    fn certain(&self, utility: f64) -> f64 {
        self.floor * self.utility.inverse(utility).exp()
    }
}
