//! Backward induction: one robust Bellman step after another, from the horizon to the start.
//!
//! optimise (the robust step at every design point), train (both surrogates), go one step back. A step depends only on
//! the specification and the step after it, so a checkpoint per step resumes to the same bits.

use std::cell::LazyCell;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use crate::control::bellman::next_value::NextValue;
use crate::control::bellman::problem::Problem;
use crate::control::bellman::solution::RobustSolution;
use crate::control::bellman::{BellmanStep, DesignSolution};
use crate::control::cache::Cache;
use crate::control::error::TrainError;
use crate::control::policy::Policy;
use crate::control::problem::holdings::{HOLDINGS, HOLDINGS_OF_ONE_LAW, Holdings};
use crate::control::problem::state::State;
use crate::control::progress::{Phase, StepProgress, Watch};
use crate::control::request::specification::Specification;
use crate::control::solved_step::{ExpectedError, StepSolution};
use crate::control::surrogate::accuracy::Aim;
use crate::control::surrogate::counts::LEAPING;
use crate::control::surrogate::design::Design;
use crate::control::surrogate::features::Features;
use crate::control::surrogate::fitting::DesignPoint;
use crate::control::surrogate::learning::{Candidates, DesignFitting, SETS, diagnostics};
use crate::control::surrogate::stored::{SingleSolution, Solution};
use crate::control::uncertainty::laws::LawSummary;
use crate::control::uncertainty::shared_summaries::SharedSummaries;

/// Summaries of the laws of a design.
pub type LawSummaryCache = SharedSummaries<LawSummary>;

/// A prepared training job: the completed specification and its simulated design.
pub struct Training {
    problem: Problem,
    design: Design,
    measured: Arc<LawSummaryCache>,
}

impl Training {
    /// Completes and checks the specification.
    ///
    /// # Errors
    /// A specification that breaks a rule.
    pub fn new(specification: &Specification) -> Result<Self, TrainError> {
        Training::with(specification, Cache::default())
    }

    /// Completes and checks the specification, with `kept` as the cache of recomputable results.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with(specification: &Specification, kept: Cache) -> Result<Self, TrainError> {
        Training::among(specification, kept, Arc::default())
    }

    /// Completes and checks the specification, and shares law summaries with other trainings; `measured` changes no
    /// bit.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn among(
        specification: &Specification,
        kept: Cache,
        measured: Arc<LawSummaryCache>,
    ) -> Result<Self, TrainError> {
        let specification = specification.clone().completed()?.resolved(&kept);
        let design = Design::new(&specification);
        Ok(Training { design, problem: Problem::with(&specification, kept), measured })
    }

    /// Returns the number of steps to solve: steps `horizon - 1` down to 0.
    pub fn horizon(&self) -> usize {
        self.problem.specification.problem.horizon
    }

    /// Solves one step given the step after it (`None` at `horizon - 1`), on the current rayon pool.
    /// The result depends on nothing but the specification and `after`.
    ///
    /// # Errors
    /// [`TrainError::Stopped`] soon after the stop signal; a robust step that is not finite; a covariance matrix that
    /// stays singular.
    pub fn solve_step(
        &self,
        step: usize,
        after: Option<&StepSolution>,
        watch: &Watch,
    ) -> Result<StepSolution, TrainError> {
        let next = NextValue::new(&self.problem.specification, step + 1, after.map(|after| &after.solution));
        let bellman = BellmanStep { problem: &self.problem, step, next: &next };
        let counts = self.design.counts(step);
        let radii =
            [counts.candidates(counts.design), counts.leaping(counts.design)].map(|count| vec![OnceLock::new(); count]);
        let solver = DesignSolver { bellman, design: &self.design, measured: &self.measured, radii };
        if counts.design == 1 {
            watch.go_on()?;
            let mut solved = solver.solve_the_only()?;
            // The step itself is solved without a surrogate.
            let later = after.and_then(|after| after.diagnostics.expected_error);
            solved.diagnostics.expected_error = later.map(|later| ExpectedError { own: 0.0, total: later.total });
            (watch.progress)(StepProgress { step, phase: Phase::Solving, done: 1, total: 1 });
            return Ok(solved);
        }
        // The first step has one state if all sessions start alike.
        let erring = step + usize::from(self.design.count(0) > 1);
        let design = Some(&self.problem.specification.design).filter(|_| counts.chosen);
        let aim = design.and_then(|design| Aim::of(design, step, erring, after.map(|after| &after.diagnostics)));
        let (specification, names) = (&self.problem.specification, &self.problem.selection.names());
        let fitting = DesignFitting {
            specification,
            names,
            step,
            counts,
            aim,
            least_gain: 0.0,
            sets: SETS,
            is_guarded: true,
            watch,
        };
        fitting.run(&solver, after.map(|after| &after.solution))
    }

    /// Builds the policy from all steps, in ascending order of step.
    pub fn into_policy(self, steps: Vec<StepSolution>) -> Policy {
        Policy::new(self.problem.specification, steps)
    }

    /// Solves every step on the current rayon pool.
    ///
    /// # Errors
    /// As [`Self::solve_step`].
    pub fn run(self, watch: &Watch) -> Result<Policy, TrainError> {
        self.run_by_steps(watch, &|| ())
    }

    /// Solves every step as [`Self::run`] does, and calls `solved` after each.
    ///
    /// # Errors
    /// As [`Self::solve_step`].
    pub fn run_by_steps(self, watch: &Watch, solved: &(dyn Fn() + Sync)) -> Result<Policy, TrainError> {
        let mut steps: Vec<StepSolution> = Vec::with_capacity(self.horizon());
        for step in (0..self.horizon()).rev() {
            let solution = self.solve_step(step, steps.last(), watch)?;
            steps.push(solution);
            solved();
        }
        steps.reverse();
        Ok(self.into_policy(steps))
    }
}

/// The context for solving design points of one step.
struct DesignSolver<'a> {
    bellman: BellmanStep<'a>,
    design: &'a Design,
    measured: &'a LawSummaryCache,
    /// Radii of the candidates and of the design points that leap, if their features were computed with them.
    radii: [Vec<OnceLock<f64>>; 2],
}

impl Candidates for DesignSolver<'_> {
    fn features(&self, some: Range<usize>) -> Vec<Features> {
        let (problem, step) = (self.bellman.problem, self.bellman.step);
        let Some(alpha) = problem.laws.radii.alpha().filter(|_| problem.laws.summarises_ball()) else {
            return some.map(|index| problem.features(step, &self.state(index))).collect();
        };
        let states = LazyCell::new(|| some.clone().map(|index| self.state(index)).collect::<Vec<State>>());
        let laws = self.measured.level(alpha, (step, some.clone()), |alphas| {
            problem.laws.summaries_of(&states.iter().map(|state| &state.law).collect::<Vec<_>>(), alphas)
        });
        let features = |(index, law): (usize, LawSummary)| {
            if let Some(known) = self.radius(index) {
                known.get_or_init(|| law.radii.radius);
            }
            // Laws do not depend on the holdings: states are only needed if wealth is a feature.
            match problem.selection.has_wealth() {
                true => problem.features_of(step, states[index - some.start].wealth, &law),
                false => problem.selection.of_law(&law),
            }
        };
        some.clone().zip(laws).map(features).collect()
    }

    fn solve(&self, index: usize, features: Features) -> Result<DesignPoint, TrainError> {
        let state = self.state(index);
        let found = self.solved(index, &state, self.bellman.problem.holdings(HOLDINGS))?;
        Ok(self.design_point(&state, features, found))
    }

    fn solve_to_judge(&self, index: usize, features: Features) -> Result<DesignPoint, TrainError> {
        let (state, holdings) = (self.state(index), self.bellman.problem.holdings(HOLDINGS));
        let mut point = self.design_point(&state, features, self.solved(index, &state, holdings.halved())?);
        if holdings.matter() {
            let (nodes, between) = point.floor_gains.iter().enumerate().partition(|(place, _)| place.is_multiple_of(2));
            let gains = |some: Vec<(usize, &f64)>| some.into_iter().map(|(_, gain)| *gain).collect();
            (point.floor_gains, point.between) = (gains(nodes), gains(between));
        }
        Ok(point)
    }
}

impl DesignSolver<'_> {
    /// Solves the robust step if all states are the same up to the holding, which allows many holdings.
    fn solve_the_only(&self) -> Result<StepSolution, TrainError> {
        let (step, problem) = (self.bellman.step, self.bellman.problem);
        let only = self.state(0);
        let found = self.solved(0, &only, problem.holdings(HOLDINGS_OF_ONE_LAW))?;
        let single = SingleSolution { floor_gains: found.floor_gains.clone(), band: found.solution.band };
        let point = self.design_point(&only, problem.features(step, &only), found);
        Ok(StepSolution { step, solution: Solution::Single(single), diagnostics: diagnostics(step, &[point]) })
    }

    fn solved(&self, point: usize, state: &State, holdings: Holdings) -> Result<DesignSolution, TrainError> {
        let found = self.bellman.solve_for_design(state, self.radius(point).and_then(OnceLock::get).copied(), holdings);
        let worst = |values: &[f64]| values.iter().copied().find(|value| !value.is_finite());
        let (gain, action) = (worst(&found.floor_gains), worst(&found.policy_targets));
        if gain.is_none() && action.is_none() && found.solution.floor_gain.is_finite() {
            return Ok(found);
        }
        let gain = gain.unwrap_or(found.solution.floor_gain);
        let action = action.unwrap_or(found.solution.action);
        Err(TrainError::NotFinite { step: self.bellman.step, point, gain, action })
    }

    /// Converts a solved state to a design point of the surrogates.
    fn design_point(&self, state: &State, features: Features, found: DesignSolution) -> DesignPoint {
        let DesignSolution { solution, floor_gains, policy_targets } = found;
        let RobustSolution { band, floor_gain, duality_gap, certified, .. } = solution;
        let empty = State { holding: 0.0, ..state.clone() };
        DesignPoint {
            wealth: state.wealth,
            features,
            action: band.low,
            floor_gain,
            largest_gain: self.bellman.problem.largest_gain(self.bellman.step, &empty),
            floor_gains,
            between: Vec::new(),
            policy_targets,
            duality_gap,
            certified,
        }
    }

    /// Returns the place of a state's radius, if it may become a design point: those that leap come after the others.
    fn radius(&self, index: usize) -> Option<&OnceLock<f64>> {
        let [still, leaping] = &self.radii;
        index.checked_sub(LEAPING).map_or_else(|| still.get(index), |leap| leaping.get(leap))
    }

    fn state(&self, index: usize) -> State {
        self.design.state(self.bellman.step, index)
    }
}
