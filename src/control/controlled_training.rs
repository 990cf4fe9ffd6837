//! Backward induction for any controlled problem: the method of `training`, without the parts that only the investor's
//! problem allows.

use std::ops::Range;

use rand::RngExt;

use crate::control::bellman::controlled::{ControlledSolution, ControlledStep};
use crate::control::bellman::controlled_value::ControlledValue;
use crate::control::error::{FieldError, TrainError};
use crate::control::problem::actions::ActionSet;
use crate::control::problem::controlled::Controlled;
use crate::control::problem::sampling_law::{admissible, continuous_law};
use crate::control::progress::Watch;
use crate::control::request::caution::CautionLevel;
use crate::control::request::completion::DEFAULT_COUNT;
use crate::control::request::contributions::Contributions;
use crate::control::request::sampling_law::SamplingLaw;
use crate::control::request::specification::{InitialLaws, Specification, SurrogateTarget, UtilitySpecification};
use crate::control::request::support::{Interval, Support};
use crate::control::surrogate::counts::Counts;
use crate::control::surrogate::design::GUARDS;
use crate::control::surrogate::features::{FeatureSelection, Features};
use crate::control::surrogate::fitting::DesignPoint;
use crate::control::surrogate::learning::{Candidates, DesignFitting};
use crate::control::surrogate::stored::Solution;
use crate::control::surrogate::value_surrogate::ValueSurrogate;
use crate::control::uncertainty::laws::Laws;
use crate::numerics::law::ContinuousLaw;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::numerics::machine::streams::stream;

/// Share of the noises of the design that are drawn evenly from the support.
const FAR: f64 = 0.25;

/// A controlled problem with the value of every step but the first, which is solved on request.
pub struct ControlledPolicy<'a, P> {
    problem: &'a P,
    laws: Laws,
    selection: FeatureSelection,
    /// Values of steps 1, 2 and so on.
    values: Vec<ControlledValue>,
}

impl<'a, P: Controlled> ControlledPolicy<'a, P> {
    /// Trains from `start` on the current rayon pool. The specification gives the information on the noise (framework,
    /// horizon, history, radius, support, known law), the design and the surrogates; its fields about an investor are
    /// ignored.
    ///
    /// # Errors
    /// A specification that breaks a rule, no support for a problem without a floor, a design of resampled laws; a
    /// robust step that is not finite; a covariance matrix that stays singular; [`TrainError::Stopped`] soon after the
    /// stop signal.
    pub fn train(
        problem: &'a P,
        start: &P::State,
        specification: &Specification,
        watch: &Watch,
    ) -> Result<Self, TrainError> {
        let mut specification = specification.clone();
        let sampling_is_given = specification.design.sampling_law.is_some();
        specification.problem.utility = UtilitySpecification::Log {};
        specification.problem.trading_cost = 0.0;
        specification.problem.caution = Some(CautionLevel::Paper);
        specification.problem.contributions = Contributions::default();
        specification.surrogate.target = SurrogateTarget::FloorGain;
        let specification = specification.completed()?;
        if specification.design.initial_laws == InitialLaws::Resampled {
            return Err(FieldError::new(
                "design.initial_laws",
                "resampled",
                "must be `given` for a controlled problem",
            )
            .into());
        }
        if !problem.has_floor() && specification.problem.support_rule() == (Support::None {}) {
            let rule = "must be given for a problem without a floor";
            return Err(FieldError::new("problem.support", "none", rule).into());
        }
        let laws = Laws::new(&specification);
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
        let design = specification.design.count.unwrap_or(DEFAULT_COUNT);
        let counts = Counts::new(design, true, GUARDS);
        let (mut values, mut after): (Vec<ControlledValue>, Option<Solution>) = (Vec::new(), None);
        for step in (1..specification.problem.horizon).rev() {
            let bellman = ControlledStep { problem, laws: &laws, selection: &selection, step, next: values.last() };
            let states =
                SimulatedStates { bellman, specification: &specification, start, history: &history, law: &law, far };
            if names.is_empty() {
                values.push(ControlledValue::Constant(states.solve(0, states.features_at(0))?.floor_gain));
                continue;
            }
            let (specification, names, counts) = (&specification, &names, counts.clone());
            let learned =
                DesignFitting { specification, names, step, counts, aim: None, watch }.run(&states, after.as_ref())?;
            if let Solution::Surrogates(stored) = &learned.solution {
                let surrogate = ValueSurrogate::new(specification, step, stored);
                values.push(ControlledValue::Surrogate(Box::new(surrogate)));
            }
            after = Some(learned.solution);
        }
        values.reverse();
        Ok(ControlledPolicy { problem, laws, selection, values })
    }

    /// Returns the radius of the ball around a law, in the unit of the noise.
    pub fn radius(&self, law: &EmpiricalDistribution) -> f64 {
        self.laws.radius(law)
    }

    /// Solves the robust step at a state with the law of the noise known by then, against the value of the step after.
    /// `step` must be below the horizon.
    pub fn solve(&self, step: usize, state: &P::State, law: &EmpiricalDistribution) -> ControlledSolution {
        self.step(step).solve(state, law)
    }

    /// Returns the worths of even actions, as [`ControlledStep::along`] does.
    pub fn along(
        &self,
        step: usize,
        (state, law): (&P::State, &EmpiricalDistribution),
        actions: &[f64],
        place: usize,
    ) -> Option<Vec<f64>> {
        self.step(step).along(state, law, actions, place)
    }

    fn step(&self, step: usize) -> ControlledStep<'_, P> {
        let ControlledPolicy { problem, laws, selection, values } = self;
        ControlledStep { problem: *problem, laws, selection, step, next: values.get(step) }
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
