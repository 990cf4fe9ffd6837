//! From the states of a step to its surrogates: some are solved as drawn, the rest of the design where candidates lie farthest
//! apart, and both surrogates are fitted to all of them (paper, section 3.1, steps 2 to 5).

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::features::Features;
use super::fitting::{DesignPoint, Fitting};
use super::scaling::Scaling;
use super::stored::Solution;
use crate::control::error::TrainError;
use crate::control::progress::{Phase, StepProgress, Watch};
use crate::control::request::specification::Specification;
use crate::control::solved_step::{StepDiagnostics, StepSolution};
use crate::numerics::farthest::farthest_points;

/// States whose features are found together, for what they have in common, at most.
const MOST_TOGETHER: usize = 256;
/// Bytes that these take on a thread, at most, unless one alone takes more.
const BYTES_TOGETHER: usize = 8 << 20;
/// Bytes of a value of a law in such a state.
pub const LAW_BYTES: usize = 40;
/// Progress is reported about this often a step.
const REPORTS_PER_STEP: usize = 100;

/// States of a step that surrogates may learn from, by number.
pub trait Candidates: Sync {
    /// What the surrogates see of some states, unscaled.
    fn features(&self, some: Range<usize>) -> Vec<Features>;

    /// The robust step there.
    ///
    /// # Errors
    /// The stop signal; a solution that is not finite.
    fn solve(&self, index: usize, features: Features) -> Result<DesignPoint, TrainError>;
}

/// States whose features are found together, where laws have so many values and their radii so many simulated paths.
pub fn together(values: usize, paths: usize) -> usize {
    (BYTES_TOGETHER / (LAW_BYTES * values + size_of::<f64>() * paths).max(1)).clamp(1, MOST_TOGETHER)
}

/// How many states there are of each kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Counts {
    /// Design points, N.
    pub design: usize,
    /// The first so many candidates are design points as they are.
    pub as_drawn: usize,
    /// From which the rest of the design is chosen.
    pub candidates: usize,
    /// Fresh states that set the guard.
    pub guards: Range<usize>,
}

/// How the surrogates of one step are learned.
pub struct Learning<'a> {
    /// As completed.
    pub specification: &'a Specification,
    /// Names of all features.
    pub names: &'a [String],
    /// The step.
    pub step: usize,
    /// Of its states.
    pub counts: Counts,
    /// Told of progress, asked whether to stop.
    pub watch: &'a Watch<'a>,
}

impl Learning<'_> {
    /// Solves the design, and fits both surrogates to it; the search for their scales starts from those of the step after.
    ///
    /// # Errors
    /// [`TrainError::Stopped`] soon after the stop signal; a robust step that is not finite; a covariance matrix that stays
    /// singular.
    pub fn run(&self, states: &impl Candidates, after: Option<&Solution>) -> Result<StepSolution, TrainError> {
        let Counts { design, as_drawn, candidates, ref guards } = self.counts;
        let features = self.features(states, 0..candidates)?;
        let scaling = Scaling::of(&features);
        let (specification, names, step, watch) = (self.specification, self.names, self.step, self.watch);
        let fitting = Fitting { specification, names, step, scaling: &scaling, watch };
        let drawn: Vec<usize> = (0..as_drawn).collect();
        let mut solved = self.solve(states, &drawn, &features, Vec::new())?;
        let start = match after.and_then(|after| fitting.start_from(after)) {
            Some(start) => start,
            None => fitting.coarse(&solved)?,
        };
        if design > as_drawn {
            let inputs: Vec<Vec<f64>> = features.iter().map(|features| scaling.apply(features)).collect();
            let weights = fitting.weights(&solved, &start.value, &inputs)?;
            let chosen = farthest_points(&inputs, &start.value.lengthscales, &weights, as_drawn, design);
            solved = self.solve(states, &chosen[as_drawn..], &features, solved)?;
        }
        let guards = self.features(states, guards.clone())?;
        let mut diagnostics = diagnostics(step, &solved);
        let solution = fitting.surrogates(&solved, &start, &guards, &mut diagnostics)?;
        Ok(StepSolution { step, solution, diagnostics })
    }

    fn features(&self, states: &impl Candidates, some: Range<usize>) -> Result<Vec<Features>, TrainError> {
        let problem = &self.specification.problem;
        let together = together(problem.history.len() + self.step, problem.radius_rule().paths());
        let parts: Vec<usize> = some.clone().step_by(together).collect();
        let features = |start: usize| {
            self.watch.go_on()?;
            Ok(states.features(start..some.end.min(start + together)))
        };
        let found: Result<Vec<Vec<Features>>, TrainError> = parts.into_par_iter().map(features).collect();
        Ok(found?.concat())
    }

    /// Solves the robust step at the states named, after those solved before. `features` are those of all candidates.
    fn solve(
        &self,
        states: &impl Candidates,
        points: &[usize],
        features: &[Features],
        before: Vec<DesignPoint>,
    ) -> Result<Vec<DesignPoint>, TrainError> {
        let (total, first) = (self.counts.design, before.len());
        let every = (total / REPORTS_PER_STEP).max(1);
        let done = AtomicUsize::new(first);
        self.report(first, total);
        let solve = |&point: &usize| {
            self.watch.go_on()?;
            let solved = states.solve(point, features[point].clone())?;
            let finished = done.fetch_add(1, Ordering::Relaxed) + 1;
            if finished.is_multiple_of(every) || finished == total {
                self.report(finished, total);
            }
            Ok(solved)
        };
        let found: Result<Vec<DesignPoint>, TrainError> = points.par_iter().map(solve).collect();
        let mut solved = before;
        solved.extend(found?);
        Ok(solved)
    }

    fn report(&self, done: usize, total: usize) {
        (self.watch.progress)(StepProgress { step: self.step, phase: Phase::Solving, done, total });
    }
}

/// How well a step was solved at its design points, before anything is fitted.
pub fn diagnostics(step: usize, solved: &[DesignPoint]) -> StepDiagnostics {
    let share = |holds: &dyn Fn(&DesignPoint) -> bool| {
        solved.iter().filter(|point| holds(point)).count() as f64 / solved.len() as f64
    };
    StepDiagnostics {
        step,
        design_count: solved.len(),
        all_bank_share: share(&|point| point.action <= 0.0),
        uncertified_share: share(&|point| !point.certified),
        duality_gap: solved.iter().map(|point| point.duality_gap.abs()).fold(0.0, f64::max),
        value: None,
        policy: None,
    }
}
