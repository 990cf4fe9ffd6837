//! A policy prepared for answering: the allocation in a state, the law and the radius there, and the state after the
//! next return. Live sessions and the simulator call the same functions.

use std::sync::OnceLock;

use super::advice::{Advice, AdviceSource, SpendingAdvice, Uncertainty};
use super::document::Policy;
use super::prepared_step::{PreparedStep, prepared_bytes};
use crate::control::bellman::BellmanStep;
use crate::control::bellman::next_value::NextValue;
use crate::control::bellman::problem::Problem;
use crate::control::bellman::solution::RobustSolution;
use crate::control::cache::Cache;
use crate::control::error::FieldError;
use crate::control::policy::worst_case::WorstCase;
use crate::control::problem::actions::Band;
use crate::control::problem::state::{PeriodOutcome, State};
use crate::control::request::specification::Specification;
use crate::control::surrogate::stored::{Solution, StepSurrogates};
use crate::control::uncertainty::laws::Laws;
use crate::control::uncertainty::radius::Measure;

/// Count of numbers that takes some hundreds of microseconds to read.
const PROMPT_COST: usize = 1 << 20;

/// How an allocation is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdviceMode {
    /// Read from the policy surrogate, or re-solved if the state lies outside the design.
    Surrogate,
    /// Solved as the robust step at the exact state with the value surrogate of the next step.
    Resolve,
}

/// A policy with everything prepared for its evaluation. Cheap to share behind an `Arc`; all methods are pure.
pub struct Advisor {
    policy: Policy,
    pub(super) problem: Problem,
    prepared: Vec<OnceLock<PreparedStep>>,
    kept: Cache,
}

struct AdviceInputs<'a> {
    step: usize,
    state: &'a State,
    radius: f64,
    source: AdviceSource,
}

/// A state outside the design, for which the surrogate gives no advice, with the intermediate results.
pub struct OutsideDesign {
    radius: f64,
    predicted: Prediction,
}

/// The predictions of the surrogates for a state.
pub(super) struct Prediction {
    pub(super) band: Band,
    floor_gain: f64,
    deviation: f64,
    pub(super) in_design: bool,
}

impl Advisor {
    /// Prepares a policy, with the process-wide cache.
    pub fn new(policy: Policy) -> Self {
        Advisor::with(policy, Cache::default())
    }

    /// Prepares a policy, with the cache `kept`.
    pub fn with(policy: Policy, kept: Cache) -> Self {
        let problem = policy.problem(kept.clone());
        let prepared = policy.steps().iter().map(|_| OnceLock::new()).collect();
        let advisor = Advisor { policy, problem, prepared, kept };
        for step in 0..advisor.prepared.len() {
            advisor.surrogates(step);
        }
        advisor
    }

    /// Returns the highest allocation of the period after `step`.
    pub(super) fn highest_action(&self, step: usize, state: &State) -> f64 {
        self.problem.actions(step, state).highest
    }

    /// Returns the uncertainty sets of laws.
    pub fn laws(&self) -> &Laws {
        &self.problem.laws
    }

    /// Returns the bytes it holds, without bridges and factors.
    pub fn bytes(&self) -> usize {
        prepared_bytes(&self.policy)
    }

    /// Returns the policy.
    pub fn policy(&self) -> &Policy {
        &self.policy
    }

    /// Returns the completed specification of the policy.
    pub fn specification(&self) -> &Specification {
        self.policy.specification()
    }

    /// Returns the state at the start of a session: `history` and `wealth` default to the specification's, and all
    /// wealth is in the bank.
    ///
    /// # Errors
    /// A history or a wealth that breaks a rule; a history other than the policy's own if the uncertainty set is frozen
    /// at it.
    pub fn initial_state(&self, history: Option<&[f64]>, wealth: Option<f64>) -> Result<State, FieldError> {
        let problem = &self.specification().problem;
        let history = history.unwrap_or(&problem.history);
        if (problem.framework.is_frozen() || problem.centre.takes_order()) && history != problem.history {
            let value = format!("{} values", history.len());
            return Err(FieldError::new(
                "history",
                value,
                "must be the policy's own history, because its ball is fixed on it; leave history out",
            ));
        }
        State::new(history, wealth.unwrap_or(problem.initial_wealth), problem.learning)
    }

    /// Checks that a state at the start can pay for every later withdrawal.
    ///
    /// # Errors
    /// Wealth in the bank alone runs out, under the name `wealth`.
    pub fn check_withdrawals(&self, state: &State) -> Result<(), FieldError> {
        self.problem.check_withdrawals(state)
    }

    /// Returns the advice for the period after `step` observed periods. `step` must be below the horizon. Cost: two
    /// kernel sums and one triangular solve, or a robust step if it re-solves.
    pub fn advise(&self, step: usize, state: &State, mode: AdviceMode) -> Advice {
        let radius = self.radius(state);
        match mode {
            AdviceMode::Resolve => {
                let inputs = AdviceInputs { step, state, radius, source: AdviceSource::Resolved };
                self.resolved(&inputs, &self.predict(step, state, radius)).0
            }
            AdviceMode::Surrogate => self
                .advise_from_surrogate(step, state, radius)
                .unwrap_or_else(|outside| self.advise_outside(step, state, &outside)),
        }
    }

    /// Returns the advice of [`Self::advise`] from the policy surrogate, given the radius of the state.
    ///
    /// # Errors
    /// The state lies outside the design: [`Self::advise_outside`] continues from the returned value.
    pub fn advise_from_surrogate(&self, step: usize, state: &State, radius: f64) -> Result<Advice, OutsideDesign> {
        let predicted = self.predict(step, state, radius);
        if predicted.in_design {
            Ok(self.predicted(step, state, radius, &predicted))
        } else {
            Err(OutsideDesign { radius, predicted })
        }
    }

    /// Returns the advice of [`Self::advise`] by re-solving, if [`Self::advise_from_surrogate`] could not answer.
    pub fn advise_outside(&self, step: usize, state: &State, outside: &OutsideDesign) -> Advice {
        let OutsideDesign { radius, predicted } = outside;
        let inputs = AdviceInputs { step, state, radius: *radius, source: AdviceSource::ResolvedOutsideDesign };
        self.resolved(&inputs, predicted).0
    }

    /// Returns true if an advice by surrogate takes well below a millisecond: what it needs is prepared, and small.
    pub fn is_prompt(&self, step: usize, state: &State) -> bool {
        let (points, is_ready) = match self.surrogates(step) {
            Some((stored, prepared)) => (stored.count(), prepared.factor.is_in(&self.kept)),
            None => (0, true),
        };
        let cost = self.problem.laws.cost(&state.law);
        is_ready && cost.is_some_and(|cost| cost + points * points / 2 <= PROMPT_COST)
    }

    /// Prepares what [`Self::is_prompt`] checks for.
    pub fn prepare(&self, step: usize, state: &State) {
        self.problem.laws.prepare(&state.law);
        if let Some((stored, prepared)) = self.surrogates(step) {
            prepared.factor.process(&self.kept, stored);
        }
    }

    /// Returns the surrogates of a step, stored and prepared; `None` for a single state or past the horizon.
    fn surrogates(&self, step: usize) -> Option<(&StepSurrogates, &PreparedStep)> {
        match &self.policy.steps().get(step)?.solution {
            Solution::Single(_) => None,
            Solution::Surrogates(stored) => Some((stored, self.prepared_from(step, stored))),
        }
    }

    fn prepared_from(&self, step: usize, stored: &StepSurrogates) -> &PreparedStep {
        self.prepared[step].get_or_init(|| PreparedStep::new(self.specification(), step, stored))
    }

    fn predicted(&self, step: usize, state: &State, radius: f64, predicted: &Prediction) -> Advice {
        let inputs = AdviceInputs { step, state, radius, source: AdviceSource::PolicySurrogate };
        self.advice(&inputs, predicted.band, predicted.floor_gain, predicted)
    }

    /// Returns the re-solved advice and the worst-case law behind it.
    pub fn explain(&self, step: usize, state: &State) -> (Advice, WorstCase) {
        let own = self.radius(state);
        self.explain_knowing(step, state, own, own)
    }

    /// Returns the re-solved advice if the radius of the coming period were `radius`; later periods keep their own.
    pub fn explain_within(&self, step: usize, state: &State, radius: f64) -> (Advice, WorstCase) {
        self.explain_knowing(step, state, self.radius(state), radius)
    }

    /// Returns the result of [`Self::explain_within`], given the radius of the state, `own`.
    pub(super) fn explain_knowing(&self, step: usize, state: &State, own: f64, radius: f64) -> (Advice, WorstCase) {
        let source = if radius == own { AdviceSource::Resolved } else { AdviceSource::ResolvedOtherRadius };
        let predicted = self.predict(step, state, own);
        let (advice, solution) = self.resolved(&AdviceInputs { step, state, radius, source }, &predicted);
        let (centre, scale) = (&self.specification().problem.centre, self.problem.utility_at_floor(step, state));
        let worst =
            solution.map_or_else(WorstCase::unknown, |solution| WorstCase::of(&solution, &advice, centre, scale));
        (advice, worst)
    }

    /// Returns the radius of the uncertainty set at a state, as in an advice.
    pub fn radius(&self, state: &State) -> f64 {
        self.problem.laws.radius(&state.law)
    }

    /// Returns the allocation and the floor gain that the surrogates predict, for any state.
    pub fn surrogate(&self, step: usize, state: &State) -> (f64, f64) {
        let Prediction { band, floor_gain, .. } = self.predict(step, state, self.radius(state));
        (band.nearest(state.holding), floor_gain)
    }

    fn resolved(&self, inputs: &AdviceInputs, predicted: &Prediction) -> (Advice, Option<RobustSolution>) {
        if self.pays(inputs.step, inputs.state) {
            let after = self.policy.steps().get(inputs.step + 1).map(|after| &after.solution);
            let next = NextValue::new(self.specification(), inputs.step + 1, after);
            let step = BellmanStep { problem: &self.problem, step: inputs.step, next: &next };
            let solution = step.solve_within(inputs.state, inputs.radius);
            if solution.action.is_finite() && solution.floor_gain.is_finite() {
                return (self.advice(inputs, solution.band, solution.floor_gain, predicted), Some(solution));
            }
        }
        // Keeping all wealth in the bank is feasible, and no law can hurt it.
        let unsolved = AdviceInputs { source: AdviceSource::Unsolved, ..*inputs };
        (self.advice(&unsolved, Band::of(&[0.0]), 0.0, predicted), None)
    }

    /// Returns true if the state's wealth and later contributions pay for every withdrawal.
    fn pays(&self, step: usize, state: &State) -> bool {
        self.problem.floor(step, state) > 0.0
    }

    fn advice(&self, inputs: &AdviceInputs, band: Band, floor_gain: f64, predicted: &Prediction) -> Advice {
        let (dynamics, floor) = (self.problem.dynamics(inputs.step), self.problem.floor(inputs.step, inputs.state));
        let (holding, wealth) = (inputs.state.holding, inputs.state.wealth);
        let spending = dynamics.spending.map(|own| SpendingAdvice::of(&own, floor_gain, wealth));
        let (band, secured) = SpendingAdvice::of_wealth(spending, band, wealth);
        let allocation = band.nearest(holding);
        Advice {
            allocation,
            holding,
            band,
            trade: allocation * (1.0 - SpendingAdvice::share_of(spending)) - holding,
            spending,
            contribution: dynamics.contribution,
            certainty_equivalent: secured + floor * floor_gain.exp(),
            floor: secured + floor,
            radius: inputs.radius,
            sample_size: inputs.state.law.sample_size(),
            effective_size: self.problem.laws.effective_size(&inputs.state.law),
            surrogate_sd: predicted.deviation,
            in_design: predicted.in_design,
            source: inputs.source,
        }
    }

    pub(super) fn predict(&self, step: usize, state: &State, radius: f64) -> Prediction {
        // An imported policy may contain any number.
        let largest = self.problem.largest_gain(step, state);
        let (dynamics, highest) = (self.problem.dynamics(step), self.problem.actions(step, state).highest);
        let in_hand = dynamics.in_hand(state.wealth, state.holding);
        let solved = &self.policy.steps()[step];
        let later = |in_design: bool| solved.diagnostics.expected_error.map_or(0.0, |error| error.later(in_design));
        match &solved.solution {
            Solution::Single(single) => {
                let in_design = self.is_single_state(step, state) && self.pays(step, state);
                let holdings = self.problem.holdings(single.floor_gains.len());
                let gain = holdings.gain(&single.floor_gains, dynamics, state.holding, in_hand);
                let band = Band { low: single.band.low.min(highest), high: single.band.high.min(highest) };
                Prediction { band, floor_gain: gain.min(largest), deviation: later(in_design), in_design }
            }
            Solution::Surrogates(stored) => {
                let PreparedStep { value, policy, factor } = self.prepared_from(step, stored);
                let features = self.problem.features_within(step, state, radius);
                let input = value.scaling.apply(&features);
                let process = factor.process(&self.kept, stored);
                let deviation =
                    process.as_ref().as_ref().map_or(f64::INFINITY, |found| found.latent_variance(&input).sqrt());
                let (ends, predictions, holdings) = (policy.at(&input), value.prediction(&features), value.holdings());
                let is_finite = ends.iter().all(|end| end.is_finite());
                let unit = self.problem.unit_of_action(step, state);
                let ends: Vec<f64> = ends.into_iter().map(|end| (end / unit).clamp(0.0, highest)).collect();
                let prediction = holdings.at(&predictions, state.holding);
                let total = dynamics.total(state.wealth, holdings.within(state.holding));
                let gain = value.clamped_gain(prediction, total, [0.0, largest])
                    + holdings.beyond(dynamics, state.holding, in_hand);
                let ruins = ends.iter().any(|end| self.problem.is_ruined(radius, *end));
                let in_design = deviation <= stored.deviation_limit && is_finite && !ruins && self.pays(step, state);
                let own = value.gain_spread(prediction, deviation * stored.value.scale, total);
                let deviation = own.hypot(later(in_design)).min(largest);
                Prediction { band: Band::of(&ends), floor_gain: gain.min(largest), deviation, in_design }
            }
        }
    }

    /// Returns true if `state` is the state at which a single-state step was solved.
    fn is_single_state(&self, step: usize, state: &State) -> bool {
        let problem = &self.specification().problem;
        let same_law =
            !problem.framework.learns() || (step == 0 && state.law == problem.learning.law(&problem.history));
        let trained = self.specification().design.wealth.map_or(problem.initial_wealth, |wealth| wealth.min);
        let same_wealth = !problem.depends_on_wealth() || state.wealth == trained;
        same_law && same_wealth
    }

    /// Returns sample size, moments, quantile and radius of a state.
    pub fn uncertainty(&self, state: &State) -> Uncertainty {
        let Measure { radius, quantile } = self.problem.laws.measure(&state.law);
        Uncertainty {
            sample_size: state.law.sample_size(),
            effective_size: self.problem.laws.effective_size(&state.law),
            moments: state.law.raw_moments(self.specification().surrogate.moment_count),
            quantile,
            radius,
        }
    }

    /// Returns the state after the period that follows `step` observed periods.
    pub fn advance(&self, step: usize, state: &State, realised: &PeriodOutcome) -> State {
        state.next_state(self.problem.dynamics(step), realised)
    }
}
