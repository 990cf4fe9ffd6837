//! A policy made ready to answer: what to hold in a state, what the law and the radius are, where the next return leads.
//! Live sessions and the simulator call these same functions.

use std::sync::OnceLock;

pub use super::advice::{Advice, AdviceSource, Uncertainty};
use super::bellman::RobustSolution;
use super::context::ProblemContext;
use super::error::FieldError;
use super::policy::Policy;
use super::solved_step::StepSolution;
use super::specification::{Specification, UtilitySpecification};
use super::state::{State, next_state};
use super::surrogate::{NextValue, SingleSolution, Solution, StepSurrogates, TargetMap, ValueSurrogate};
use super::uncertainty::Measure;
use super::utility::depends_on_wealth;
use super::worst_case::WorstCase;
use crate::numerics::empirical::EmpiricalDistribution;
use crate::numerics::gp::{GaussianProcess, GpMean};

/// Numbers read in some hundreds of microseconds.
const PROMPT_COST: usize = 1 << 20;

/// How an allocation is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdviceMode {
    /// From the policy surrogate; by re-solving where the state lies outside the design.
    Surrogate,
    /// By solving the robust step at the exact state with the value surrogate of the step after.
    Resolve,
}

/// A policy with what its evaluation needs prepared. Cheap to share behind an `Arc`; all methods are pure.
pub struct Advisor {
    policy: Policy,
    context: ProblemContext,
    steps: Vec<PreparedStep>,
}

/// One step ready for evaluation. The factor behind the predicted deviation is built on first use.
enum PreparedStep {
    Single(SingleSolution),
    Surrogates { value: Box<ValueSurrogate>, policy: Box<GpMean>, deviation: Box<OnceLock<Option<GaussianProcess>>> },
}

/// What an advice is for.
struct Asked<'a> {
    step: usize,
    state: &'a State,
    radius: f64,
    source: AdviceSource,
}

/// What the surrogates say of a state.
struct Prediction {
    action: f64,
    floor_gain: f64,
    deviation: f64,
    in_design: bool,
}

/// The process behind the predicted deviation, which does not depend on the targets.
fn stored_process(stored: &StepSurrogates) -> Option<GaussianProcess> {
    let zeros = vec![0.0; stored.value.weights.len()];
    GaussianProcess::condition(&stored.matrix(), &zeros, &stored.value.hyperparameters).ok()
}

impl Advisor {
    pub fn new(policy: Policy) -> Self {
        let context = policy.context();
        let prepare = |step: &StepSolution| match &step.solution {
            Solution::Single(single) => PreparedStep::Single(*single),
            Solution::Surrogates(stored) => {
                let policy =
                    Box::new(GpMean::new(&stored.matrix(), &stored.policy.weights, &stored.policy.hyperparameters));
                let target = TargetMap::new(&context.specification, step.step);
                let value = Box::new(ValueSurrogate::new(stored, target));
                PreparedStep::Surrogates { value, policy, deviation: Box::default() }
            }
        };
        let steps = policy.steps().iter().map(prepare).collect();
        Advisor { policy, context, steps }
    }

    pub fn policy(&self) -> &Policy {
        &self.policy
    }

    pub fn specification(&self) -> &Specification {
        self.policy.specification()
    }

    /// The state a session starts from: `history` and `wealth` default to the specification's.
    ///
    /// # Errors
    /// A history or wealth that breaks a rule; a history other than the policy's own under a static framework, whose
    /// uncertainty set is frozen at it.
    pub fn initial_state(&self, history: Option<&[f64]>, wealth: Option<f64>) -> Result<State, FieldError> {
        let problem = &self.specification().problem;
        let own = &problem.history;
        let history = history.unwrap_or(own);
        if problem.framework.is_frozen() && history != own {
            let value = format!("{} values", history.len());
            return Err(FieldError::new("history", value, "must be the policy's own under a static framework"));
        }
        State::new(history, wealth.unwrap_or(problem.initial_wealth))
    }

    /// The advice for the period after `step` observed periods. `step` must be below the horizon.
    /// Cost: two kernel sums and one triangular solve; a robust step where it re-solves.
    pub fn advise(&self, step: usize, state: &State, mode: AdviceMode) -> Advice {
        let radius = self.radius(state);
        let predicted = self.predict(step, state, radius);
        let source = match mode {
            AdviceMode::Resolve => AdviceSource::Resolved,
            AdviceMode::Surrogate if predicted.in_design => return self.predicted(step, state, radius, &predicted),
            AdviceMode::Surrogate => AdviceSource::ResolvedOutsideDesign,
        };
        self.resolved(&Asked { step, state, radius, source }, &predicted).0
    }

    /// [`Self::advise`] from the policy surrogate where the radius of the state is known; `None` outside the design.
    pub fn advise_from_surrogate(&self, step: usize, state: &State, radius: f64) -> Option<Advice> {
        let predicted = self.predict(step, state, radius);
        predicted.in_design.then(|| self.predicted(step, state, radius, &predicted))
    }

    /// Whether [`Self::advise_from_surrogate`] and [`Self::uncertainty`] take well below a millisecond: what they need is
    /// prepared, and small.
    pub fn is_prompt(&self, step: usize, state: &State) -> bool {
        let points = match self.policy.steps().get(step).map(|step| &step.solution) {
            Some(Solution::Surrogates(stored)) => stored.value.weights.len(),
            _ => 0,
        };
        let prepared = match self.steps.get(step) {
            Some(PreparedStep::Surrogates { deviation, .. }) => deviation.get().is_some(),
            _ => true,
        };
        let cost = self.context.sets.cost(self.context.learned_size(state));
        prepared && cost.is_some_and(|cost| cost + points * points / 2 <= PROMPT_COST)
    }

    /// Makes what [`Self::is_prompt`] asks for.
    pub fn prepare(&self, step: usize, state: &State) {
        self.context.sets.prepare(self.context.learned_size(state));
        if let Some(PreparedStep::Surrogates { deviation, .. }) = self.steps.get(step)
            && let Some(Solution::Surrogates(stored)) = self.policy.steps().get(step).map(|step| &step.solution)
        {
            deviation.get_or_init(|| stored_process(stored));
        }
    }

    fn predicted(&self, step: usize, state: &State, radius: f64, predicted: &Prediction) -> Advice {
        let asked = Asked { step, state, radius, source: AdviceSource::PolicySurrogate };
        self.advice(&asked, predicted.action, predicted.floor_gain, predicted)
    }

    /// The re-solved advice and the worst-case law behind it.
    pub fn explain(&self, step: usize, state: &State) -> (Advice, WorstCase) {
        self.explain_within(step, state, self.radius(state))
    }

    /// The same were the radius of the coming period `radius`, whatever the law says; later periods keep their own.
    pub fn explain_within(&self, step: usize, state: &State, radius: f64) -> (Advice, WorstCase) {
        let own = self.radius(state);
        let source = if radius == own { AdviceSource::Resolved } else { AdviceSource::ResolvedOtherRadius };
        let predicted = self.predict(step, state, own);
        let (advice, solution) = self.resolved(&Asked { step, state, radius, source }, &predicted);
        let worst = match solution {
            Some(solution) => WorstCase::of(&solution, &advice, self.utility_per_radius(step, state)),
            None => WorstCase::unknown(),
        };
        (advice, worst)
    }

    /// Radius of the uncertainty set at a state, as in an advice.
    pub fn radius(&self, state: &State) -> f64 {
        self.context.radius(state)
    }

    /// The floor gain that the value surrogate predicts, wherever the state lies.
    pub fn surrogate_gain(&self, step: usize, state: &State) -> f64 {
        self.predict(step, state, self.radius(state)).floor_gain
    }

    fn resolved(&self, asked: &Asked, predicted: &Prediction) -> (Advice, Option<RobustSolution>) {
        let after = self.policy.steps().get(asked.step + 1).map(|after| &after.solution);
        let next = NextValue::new(self.specification(), asked.step + 1, after);
        match self.context.solve_within(asked.step, asked.state, &next, asked.radius) {
            Ok(solution) if solution.action.is_finite() && solution.floor_gain.is_finite() => {
                (self.advice(asked, solution.action, solution.floor_gain, predicted), Some(solution))
            }
            // All-bank is feasible and no law can hurt it.
            _ => (self.advice(asked, 0.0, 0.0, predicted), None),
        }
    }

    fn advice(&self, asked: &Asked, allocation: f64, floor_gain: f64, predicted: &Prediction) -> Advice {
        let floor = self.context.floor(asked.step, asked.state);
        Advice {
            allocation,
            certainty_equivalent: floor * floor_gain.exp(),
            floor,
            radius: asked.radius,
            sample_size: asked.state.law.sample_size(),
            surrogate_sd: predicted.deviation,
            in_design: predicted.in_design,
            source: asked.source,
        }
    }

    /// `radius` is that of the state.
    fn predict(&self, step: usize, state: &State, radius: f64) -> Prediction {
        match &self.steps[step] {
            PreparedStep::Single(single) => {
                let in_design = self.is_single_state(step, state);
                Prediction { action: single.action, floor_gain: single.floor_gain, deviation: 0.0, in_design }
            }
            PreparedStep::Surrogates { value, policy, deviation } => {
                let input = value.scaling.apply(&self.context.features_within(state, radius));
                let Solution::Surrogates(stored) = &self.policy.steps()[step].solution else {
                    return Prediction { action: 0.0, floor_gain: 0.0, deviation: f64::INFINITY, in_design: false };
                };
                let process = deviation.get_or_init(|| stored_process(stored));
                let deviation = process.as_ref().map_or(f64::INFINITY, |found| found.latent_variance(&input).sqrt());
                let highest = self.specification().problem.action_interval[1];
                let action = stored.policy.offset + stored.policy.scale * policy.mean(&input);
                let prediction = value.offset + value.scale * value.mean.mean(&input);
                Prediction {
                    action: action.clamp(0.0, highest),
                    floor_gain: value.clamped_gain(prediction, state.wealth),
                    deviation: value.gain_spread(prediction, deviation * value.scale, state.wealth),
                    in_design: deviation <= stored.deviation_limit && action.is_finite(),
                }
            }
        }
    }

    /// Whether `state` is the one state that a single-state step was solved at.
    fn is_single_state(&self, step: usize, state: &State) -> bool {
        let problem = &self.specification().problem;
        let start = EmpiricalDistribution::new(&problem.history);
        let same_law = !problem.framework.learns() || (step == 0 && state.law == start);
        let trained = self.specification().design.wealth.map_or(problem.initial_wealth, |wealth| wealth.min);
        let same_wealth = !depends_on_wealth(problem.utility) || state.wealth == trained;
        same_law && same_wealth
    }

    /// Relative utility to utility: the derivative of U at the floor times the floor.
    fn utility_per_radius(&self, step: usize, state: &State) -> f64 {
        let floor = self.context.floor(step, state);
        match self.specification().problem.utility {
            UtilitySpecification::Exponential { risk_aversion } => floor * (-risk_aversion * floor).exp(),
            UtilitySpecification::Power { risk_aversion } => floor.powf(1.0 - risk_aversion),
            UtilitySpecification::Log {} => 1.0,
        }
    }

    /// Sample size, moments, quantile and radius of a state.
    pub fn uncertainty(&self, state: &State) -> Uncertainty {
        let Measure { radius, quantile } = self.context.measure(state);
        Uncertainty {
            sample_size: state.law.sample_size(),
            moments: state.law.raw_moments(self.specification().surrogate.moment_count),
            quantile: quantile.map(|found| found.value),
            quantile_standard_error: quantile.map(|found| found.standard_error),
            radius,
        }
    }

    /// The state after holding `allocation` through `log_return`.
    pub fn advance(&self, state: &State, allocation: f64, log_return: f64) -> State {
        next_state(state, allocation, log_return, self.specification().problem.rate_per_step)
    }

    /// Follows the policy through `returns` from `start`: the advice before each return, and the state after the last.
    /// At most `horizon` returns are used.
    pub fn simulate(&self, start: State, returns: &[f64]) -> (Vec<Advice>, State) {
        let mut state = start;
        let mut advices = Vec::with_capacity(returns.len());
        for (step, &log_return) in returns.iter().take(self.specification().problem.horizon).enumerate() {
            let advice = self.advise(step, &state, AdviceMode::Surrogate);
            state = self.advance(&state, advice.allocation, log_return);
            advices.push(advice);
        }
        (advices, state)
    }
}
