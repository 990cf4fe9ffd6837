//! Backward induction for any controlled problem: the method of `training`, without the parts that only the investor's
//! problem allows.

use std::ops::Range;

use rand::RngExt;

use crate::control::bellman::controlled::{ControlledSolution, ControlledStep};
use crate::control::bellman::controlled_value::ControlledValue;
use crate::control::cache::Cache;
use crate::control::error::{FieldError, TrainError};
use crate::control::problem::actions::{ActionSet, Band};
use crate::control::problem::controlled::Controlled;
use crate::control::problem::sampling_law::{admissible, continuous_law};
use crate::control::progress::Watch;
use crate::control::request::caution::CautionLevel;
use crate::control::request::completion::DEFAULT_COUNT;
use crate::control::request::contributions::Contributions;
use crate::control::request::sampling_law::SamplingLaw;
use crate::control::request::specification::{InitialLaws, Specification, SurrogateTarget, UtilitySpecification};
use crate::control::request::support::{Interval, Support};
use crate::control::solved_step::StepSolution;
use crate::control::surrogate::accuracy::Aim;
use crate::control::surrogate::counts::Counts;
use crate::control::surrogate::design::GUARDS;
use crate::control::surrogate::features::{FeatureSelection, Features};
use crate::control::surrogate::fitting::DesignPoint;
use crate::control::surrogate::learning::{Candidates, DesignFitting, diagnostics};
use crate::control::surrogate::stored::{SingleSolution, Solution};
use crate::control::uncertainty::laws::Laws;
use crate::control::uncertainty::radius::Measure;
use crate::numerics::law::ContinuousLaw;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::machine::streams::stream;

/// Share of the noises of the design that are drawn evenly from the support.
const FAR: f64 = 0.25;
/// Sets of fresh states that judge a design. Values with kinks err most at few states, which two sets of a hundred may miss:
/// of *goal* two gave errors too small by a factor of 1.6.
const JUDGING: usize = 4;

/// A prepared training of a controlled problem from one start.
pub struct ControlledTraining<'a, P: Controlled> {
    problem: &'a P,
    start: &'a P::State,
    /// The completed specification.
    specification: Specification,
    laws: Laws,
    selection: FeatureSelection,
    history: EmpiricalDistribution,
    law: ContinuousLaw,
    /// The support, if some noises are drawn from all of it.
    far: Option<Interval>,
    /// Names of the features: those of the state, then those of the law.
    names: Vec<String>,
}

/// The trained values of every step of a controlled problem but the first, which is solved on request.
pub struct ControlledPolicy {
    laws: Laws,
    selection: FeatureSelection,
    /// Values of steps 1, 2 and so on.
    values: Vec<ControlledValue>,
}

impl<'a, P: Controlled> ControlledTraining<'a, P> {
    /// Prepares a training from `start`. The specification gives the information on the noise (framework, horizon,
    /// history, radius, support, known law), the design and the surrogates; its fields about an investor are ignored.
    ///
    /// # Errors
    /// A specification that breaks a rule, no support for a problem without a floor, a design of resampled laws.
    pub fn new(problem: &'a P, start: &'a P::State, specification: &Specification) -> Result<Self, FieldError> {
        ControlledTraining::with(problem, start, specification, Cache::default())
    }

    /// Prepares a training with `kept` as the cache of recomputable results.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with(
        problem: &'a P,
        start: &'a P::State,
        specification: &Specification,
        kept: Cache,
    ) -> Result<Self, FieldError> {
        let sampling_is_given = specification.design.sampling_law.is_some();
        let specification = completed(problem, specification)?;
        let laws = Laws::with(&specification, kept);
        let selection = FeatureSelection::new(&specification, &laws);
        let sampling_law = specification.design.sampling_law.as_ref().unwrap_or(&SamplingLaw::Bootstrap {});
        let law = continuous_law(sampling_law, &specification.problem);
        // The adversary goes to the ends of the support. A sampling law that is given says itself how far states go.
        let far = match specification.problem.support_rule() {
            Support::Between { min, max } if !sampling_is_given && !problem.has_floor() => Some(Interval { min, max }),
            _ => None,
        };
        let history = specification.problem.learning.law(&specification.problem.history);
        let described = problem.describe(0, start).len();
        let mut names: Vec<String> = (0..described).map(|index| format!("state_{index}")).collect();
        names.extend(selection.names());
        Ok(ControlledTraining { problem, start, specification, laws, selection, history, law, far, names })
    }

    /// Names the numbers that describe a state, in their order.
    #[must_use]
    pub fn naming(mut self, described: &[String]) -> Self {
        self.names.iter_mut().zip(described).for_each(|(name, given)| name.clone_from(given));
        self
    }

    /// Returns the number of periods. The steps after the first are trained.
    pub fn horizon(&self) -> usize {
        self.specification.problem.horizon
    }

    /// Returns the number of features of a state and its law.
    pub fn feature_count(&self) -> usize {
        self.names.len()
    }

    /// Trains a step, at least 1, given the step after it (`None` at the last), on the current rayon pool. The result
    /// depends on nothing but the problem, the specification and `after`.
    ///
    /// # Errors
    /// A robust step that is not finite; a covariance matrix that stays singular; [`TrainError::Stopped`] soon after the
    /// stop signal.
    pub fn solve_step(
        &self,
        step: usize,
        after: Option<&StepSolution>,
        watch: &Watch,
    ) -> Result<StepSolution, TrainError> {
        let ControlledTraining { problem, start, specification, laws, selection, history, law, far, names } = self;
        let next = after.map(|after| ControlledValue::of(specification, after));
        let bellman =
            ControlledStep { problem: *problem, laws, selection, step, next: next.as_ref(), radius_scale: 1.0 };
        let states = SimulatedStates { bellman, specification, start, history, law, far: *far };
        if names.is_empty() {
            let only = states.solve(0, states.features_at(0))?;
            let single = SingleSolution { floor_gains: only.floor_gains.clone(), band: Band::of(&[only.action]) };
            return Ok(StepSolution {
                step,
                solution: Solution::Single(single),
                diagnostics: diagnostics(step, &[only]),
            });
        }
        let design = specification.design.count.unwrap_or(DEFAULT_COUNT);
        let counts = Counts::new(design, true, GUARDS);
        // The first step has no surrogate that could err.
        let aim = Aim::of(&specification.design, step, step, after.map(|after| &after.diagnostics));
        let least_gain = if problem.has_floor() { 0.0 } else { f64::NEG_INFINITY };
        let (sets, is_guarded) = (JUDGING, false);
        let fitting = DesignFitting { specification, names, step, counts, aim, least_gain, sets, is_guarded, watch };
        fitting.run(&states, after.map(|after| &after.solution))
    }

    /// Trains every step, from the last to the second.
    ///
    /// # Errors
    /// As [`Self::solve_step`].
    pub fn run(&self, watch: &Watch) -> Result<Vec<StepSolution>, TrainError> {
        let mut steps: Vec<StepSolution> = Vec::new();
        for step in (1..self.horizon()).rev() {
            steps.push(self.solve_step(step, steps.last(), watch)?);
        }
        steps.reverse();
        Ok(steps)
    }
}

/// Completes the specification of a controlled problem.
fn completed<P: Controlled>(problem: &P, specification: &Specification) -> Result<Specification, FieldError> {
    let mut specification = specification.clone();
    specification.problem.utility = UtilitySpecification::Log {};
    specification.problem.trading_cost = 0.0;
    specification.problem.caution = Some(CautionLevel::Paper);
    specification.problem.contributions = Contributions::default();
    specification.surrogate.target = SurrogateTarget::FloorGain;
    let specification = specification.completed()?;
    if specification.design.initial_laws == InitialLaws::Resampled {
        return Err(FieldError::new("design.initial_laws", "resampled", "must be `given` for a controlled problem"));
    }
    if !problem.has_floor() && specification.problem.support_rule() == (Support::None {}) {
        let rule = "must be given for a problem without a floor";
        return Err(FieldError::new("problem.support", "none", rule));
    }
    Ok(specification)
}

impl ControlledPolicy {
    /// Trains from `start` on the current rayon pool, as [`ControlledTraining`] does.
    ///
    /// # Errors
    /// The errors of [`ControlledTraining::new`] and [`ControlledTraining::solve_step`].
    pub fn train<P: Controlled>(
        problem: &P,
        start: &P::State,
        specification: &Specification,
        watch: &Watch,
    ) -> Result<Self, TrainError> {
        let training = ControlledTraining::new(problem, start, specification)?;
        let steps = training.run(watch)?;
        Ok(ControlledPolicy::new(training.laws, training.selection, &training.specification, &steps))
    }

    /// Prepares the trained `steps`, ascending from the second, of a problem with a specification.
    ///
    /// # Errors
    /// A specification that breaks a rule.
    pub fn prepared<P: Controlled>(
        problem: &P,
        specification: &Specification,
        steps: &[StepSolution],
        kept: Cache,
    ) -> Result<Self, FieldError> {
        let specification = completed(problem, specification)?;
        let laws = Laws::with(&specification, kept);
        let selection = FeatureSelection::new(&specification, &laws);
        Ok(ControlledPolicy::new(laws, selection, &specification, steps))
    }

    fn new(laws: Laws, selection: FeatureSelection, specification: &Specification, steps: &[StepSolution]) -> Self {
        let values = steps.iter().map(|step| ControlledValue::of(specification, step)).collect();
        ControlledPolicy { laws, selection, values }
    }

    /// Returns the radius of the ball around a law, in the unit of the noise.
    pub fn radius(&self, law: &EmpiricalDistribution) -> f64 {
        self.laws.radius(law)
    }

    /// Returns the radius, and the quantile behind it if its rule has one.
    pub fn measure(&self, law: &EmpiricalDistribution) -> Measure {
        self.laws.measure(law)
    }

    /// Returns the gain that the surrogate of a trained step predicts from the features of a state; `None` for the first
    /// step.
    pub fn gain(&self, step: usize, features: &Features) -> Option<f64> {
        Some(self.values.get(step.checked_sub(1)?)?.gain(features))
    }

    /// Returns the robust step of the problem that was trained, against the value of the step after. `step` must be
    /// below the horizon.
    pub fn step<'a, P: Controlled>(&'a self, problem: &'a P, step: usize) -> ControlledStep<'a, P> {
        let ControlledPolicy { laws, selection, values } = self;
        ControlledStep { problem, laws, selection, step, next: values.get(step), radius_scale: 1.0 }
    }
}

/// States of one step under randomised actions and the sampling law.
struct SimulatedStates<'a, P: Controlled> {
    bellman: ControlledStep<'a, P>,
    specification: &'a Specification,
    start: &'a P::State,
    history: &'a EmpiricalDistribution,
    law: &'a ContinuousLaw,
    /// The support, if some noises are drawn from all of it.
    far: Option<Interval>,
}

impl<P: Controlled> SimulatedStates<'_, P> {
    /// Simulates a state and its law. Streams: ("controlled", t, index) for each step.
    fn state(&self, index: usize) -> (P::State, EmpiricalDistribution) {
        let (problem, specification, mut state) = (self.bellman.problem, self.specification, self.start.clone());
        let mut seen = Vec::with_capacity(self.bellman.step);
        for earlier in 0..self.bellman.step {
            let mut generator = stream(specification.seed, "controlled", earlier, index);
            let drawn = |set: ActionSet| set.at(generator.random::<f64>());
            let actions: Vec<f64> = problem.actions(earlier, &state).into_iter().map(drawn).collect();
            let log_return = match self.far {
                Some(Interval { min, max }) if generator.random::<f64>() < FAR => {
                    min + (max - min) * generator.random::<f64>()
                }
                _ => admissible(self.law.draw(&mut generator), &specification.problem),
            };
            state = problem.next(earlier, &state, &actions, log_return);
            seen.push(log_return);
        }
        let mut law = self.history.clone();
        if specification.problem.framework.learns() {
            law.extend(&seen);
        }
        (state, law)
    }
}

impl<P: Controlled> SimulatedStates<'_, P> {
    fn features_at(&self, index: usize) -> Features {
        let (state, law) = self.state(index);
        self.bellman.features(&state, &law)
    }
}

impl<P: Controlled> Candidates for SimulatedStates<'_, P> {
    fn features(&self, some: Range<usize>) -> Vec<Features> {
        some.map(|index| self.features_at(index)).collect()
    }

    fn solve(&self, index: usize, features: Features) -> Result<DesignPoint, TrainError> {
        let (state, law) = self.state(index);
        let found = self.bellman.solve(&state, &law).finite(self.bellman.step, index)?;
        let ControlledSolution { actions, gain, duality_gap, certified, .. } = found;
        Ok(DesignPoint {
            wealth: 1.0,
            features,
            action: actions[0],
            floor_gain: gain,
            largest_gain: f64::INFINITY,
            floor_gains: vec![gain],
            between: Vec::new(),
            policy_targets: actions,
            duality_gap,
            certified,
        })
    }
}
