//! The problem with everything that does not change from step to step, and the robust step at one state of it.

use std::borrow::Cow;

use super::bellman::{RobustSolution, RobustStep};
use super::design::{centre, known_law};
use super::error::TrainError;
use super::features::{FeatureSelection, LawSummary};
use super::framework::Framework;
use super::gain_field::FieldContext;
use super::kept::Kept;
use super::parametric::ParametricStep;
use super::rules;
use super::specification::{ProblemSpecification, Specification};
use super::state::{State, floor};
use super::surrogate::NextValue;
use super::uncertainty::{Measure, Radii, UncertaintySets};
use super::utility::RelativeUtility;
use crate::numerics::confidence_region::{ConfidenceRegion, NormalLaw};
use crate::numerics::empirical::EmpiricalDistribution;
use crate::numerics::exponential_mean::{ExponentialMean, WorstExponential};
use crate::numerics::moments::CentralMoments;

/// Where the features do not depend on the ball.
const NO_BALL: Radii = Radii { radius: 0.0, radius_ahead: 0.0 };

/// The problem with everything that does not change from step to step.
pub struct ProblemContext {
    pub specification: Specification,
    pub sets: UncertaintySets,
    pub selection: FeatureSelection,
    /// The best return of the known law; the best that is accepted where there is none.
    best_known_return: f64,
}

impl ProblemContext {
    pub fn new(specification: &Specification) -> Self {
        ProblemContext::with(specification, Kept::default())
    }

    /// The same with what can be made again in `kept`.
    pub fn with(specification: &Specification, kept: Kept) -> Self {
        let sets = UncertaintySets::new(specification, kept);
        let selection = FeatureSelection::new(specification, sets.varies());
        let best_known_return = best_known_return(&specification.problem);
        ProblemContext { specification: specification.clone(), sets, selection, best_known_return }
    }

    /// Radius of the uncertainty set at a state: of the history's law where that is frozen.
    pub fn radius(&self, state: &State) -> f64 {
        self.sets.radius(&self.learned_law(state))
    }

    /// The law that the uncertainty set is built on.
    pub fn learned_law<'s>(&self, state: &'s State) -> Cow<'s, EmpiricalDistribution> {
        let problem = &self.specification.problem;
        if problem.framework.is_frozen() {
            Cow::Owned(EmpiricalDistribution::new(&problem.history))
        } else {
            Cow::Borrowed(&state.law)
        }
    }

    /// Its sample size.
    pub fn learned_size(&self, state: &State) -> usize {
        let problem = &self.specification.problem;
        if problem.framework.is_frozen() { problem.history.len() } else { state.law.sample_size() }
    }

    /// The confidence region of the parametric frameworks at a state, were its radius `radius`.
    fn region(&self, state: &State, radius: f64) -> ConfidenceRegion {
        let moments = CentralMoments::of(&self.learned_law(state));
        ConfidenceRegion { estimate: NormalLaw { mean: moments.mean(), variance: moments.variance() }, radius }
    }

    /// Terminal all-bank wealth from a state at `step`.
    pub fn floor(&self, step: usize, state: &State) -> f64 {
        let problem = &self.specification.problem;
        floor(state.wealth, problem.rate_per_step, problem.horizon - step)
    }

    /// The most that the floor gain of a state at `step` can be:
    ///
    ///   (T - t) ln(1 + a ((e^z / (1 + r)) - 1)),   a the highest allocation, z the best return of the centre
    ///
    /// The worst law of a ball is no better than its centre, which is worth at most its best return in every period, and
    /// learning one of its own returns leaves the best as it is. Of a normal law that is not learned further, e^z is its mean.
    pub fn largest_gain(&self, step: usize, state: &State) -> f64 {
        let problem = &self.specification.problem;
        let best = match problem.framework {
            Framework::KnownLaw => self.best_known_return,
            Framework::ParametricAdaptive => rules::LOG_RETURN,
            Framework::ParametricStatic => {
                let moments = CentralMoments::of(&self.learned_law(state));
                moments.mean() + 0.5 * moments.variance()
            }
            _ => self.learned_law(state).atoms().last().copied().unwrap_or(rules::LOG_RETURN),
        };
        largest_gain(problem, step, best)
    }

    /// The radius of a state and what it is made of.
    pub fn measure(&self, state: &State) -> Measure {
        self.sets.measure(&self.learned_law(state))
    }

    /// The features of a state, unscaled.
    pub fn features(&self, state: &State) -> Vec<f64> {
        self.features_within(state, if self.selection.has_ball() { self.radius(state) } else { 0.0 })
    }

    /// The same where the radius of the state is known already.
    pub fn features_within(&self, state: &State, radius: f64) -> Vec<f64> {
        let moments = CentralMoments::of(&state.law);
        if !self.selection.has_ball() {
            return self.selection.of(state.wealth, &without_ball(moments));
        }
        let radii = self.sets.radii(&state.law, radius);
        let worst = ExponentialMean::of(&state.law, self.lowest_return()).worst(radii.radius);
        self.selection.of(state.wealth, &self.summary(moments, radii, worst))
    }

    /// Features of the laws that follow from `law` when each of `returns` (ascending) is learned, for one wealth.
    pub fn features_with(&self, law: &EmpiricalDistribution, wealth: f64, returns: &[f64]) -> Vec<Vec<f64>> {
        let before = CentralMoments::of(law);
        if !self.specification.problem.framework.learns() {
            return vec![self.selection.of(wealth, &without_ball(before)); returns.len()];
        }
        if !self.selection.has_ball() {
            let features = |&log_return: &f64| self.selection.of(wealth, &without_ball(before.with(log_return)));
            return returns.iter().map(features).collect();
        }
        let mean = ExponentialMean::of(law, self.lowest_return());
        let features = |(&log_return, radii): (&f64, Radii)| {
            let worst = mean.worst_with(log_return, radii.radius);
            self.selection.of(wealth, &self.summary(before.with(log_return), radii, worst))
        };
        returns.iter().zip(self.sets.radii_with(law, returns)).map(features).collect()
    }

    fn summary(&self, moments: CentralMoments, radii: Radii, worst: WorstExponential) -> LawSummary {
        let bank = 1.0 + self.specification.problem.rate_per_step;
        let WorstExponential { mean, variance } = worst;
        LawSummary { moments, radii, robust_excess: mean / bank - 1.0, robust_variance: variance / (bank * bank) }
    }

    fn lowest_return(&self) -> f64 {
        self.specification.problem.support.map_or(f64::NEG_INFINITY, |support| support.min)
    }

    /// Solves the robust step at one state exactly, given the value of the step after.
    ///
    /// # Errors
    /// A centre that the specification does not define.
    pub fn solve(&self, step: usize, state: &State, next: &NextValue) -> Result<RobustSolution, TrainError> {
        self.solve_within(step, state, next, self.radius(state))
    }

    /// The same were the ball of this step alone of another radius; the value of the step after stays what it is.
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub fn solve_within(
        &self,
        step: usize,
        state: &State,
        next: &NextValue,
        radius: f64,
    ) -> Result<RobustSolution, TrainError> {
        let [lowest, highest] = self.specification.problem.action_interval;
        let solution = self.priced(step, state, next, (lowest, highest), radius)?;
        // All-bank is feasible and no law can hurt it.
        let floor_gain = solution.floor_gain.max(0.0).min(self.largest_gain(step, state));
        Ok(RobustSolution { floor_gain, ..solution })
    }

    /// The same with actions in `[lowest, highest]` alone: a single action is priced where they are equal.
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub fn solve_between(
        &self,
        step: usize,
        state: &State,
        next: &NextValue,
        actions: (f64, f64),
    ) -> Result<RobustSolution, TrainError> {
        self.priced(step, state, next, actions, self.radius(state))
    }

    fn priced(
        &self,
        step: usize,
        state: &State,
        next: &NextValue,
        actions: (f64, f64),
        radius: f64,
    ) -> Result<RobustSolution, TrainError> {
        let problem = &self.specification.problem;
        let field = FieldContext {
            problem: self,
            next,
            rate_per_step: problem.rate_per_step,
            highest_action: problem.action_interval[1],
        };
        let utility = RelativeUtility::new(problem.utility, self.floor(step, state));
        if problem.framework.is_parametric() {
            return Ok(ParametricStep { field, utility, region: self.region(state, radius) }.solve(state, actions));
        }
        let (atoms, masses) = centre(problem, state)?;
        let mean: f64 = atoms.iter().zip(&masses).map(|(atom, mass)| atom * mass).sum();
        let variance = atoms.iter().zip(&masses).map(|(atom, mass)| mass * (atom - mean).powi(2)).sum();
        let robust =
            RobustStep { field, utility, support: problem.support, atoms: &atoms, masses: &masses, radius, variance };
        Ok(robust.solve(state, actions))
    }
}

/// The floor gain from `step` of the highest allocation where every period earns `best_return`.
pub fn largest_gain(problem: &ProblemSpecification, step: usize, best_return: f64) -> f64 {
    let bank = problem.rate_per_step.ln_1p();
    let excess = (best_return - bank).exp_m1().max(0.0);
    (problem.horizon - step) as f64 * (problem.action_interval[1] * excess).ln_1p()
}

fn best_known_return(problem: &ProblemSpecification) -> f64 {
    match (&problem.law, problem.framework) {
        (Some(law), Framework::KnownLaw) => known_law(problem, law).0.last().copied(),
        _ => None,
    }
    .unwrap_or(rules::LOG_RETURN)
}

fn without_ball(moments: CentralMoments) -> LawSummary {
    LawSummary { moments, radii: NO_BALL, robust_excess: 0.0, robust_variance: 0.0 }
}
