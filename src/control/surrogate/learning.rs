//! Fits the surrogates of a step from its states. Some states are solved as drawn, the rest of the design are the
//! candidates that lie farthest apart, and both surrogates are fitted to all of them (paper, section 3.1, steps 2 to
//! 5). If an accuracy is asked for instead of a number of points, the design begins small, and grows until fresh states
//! show that it is reached.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::accuracy::{Aim, Checks};
use super::counts::{Counts, LEAPING, LEAPING_CHECKS, LEAPS};
use super::features::Features;
use super::fitting::{DesignPoint, Fitting, SurrogateFit};
use super::scaling::Scaling;
use super::stored::{Solution, StepSurrogates};
use super::value_surrogate::ValueSurrogate;
use crate::control::error::TrainError;
use crate::control::progress::{Phase, StepProgress, Watch};
use crate::control::request::specification::Specification;
use crate::control::solved_step::{StepDiagnostics, StepSolution};
use crate::numerics::gp::farthest::farthest_points;

/// Largest number of states whose features are computed together, to share their common work.
const MOST_TOGETHER: usize = 256;
/// Largest number of bytes of these states on a thread, unless one alone takes more.
const BYTES_TOGETHER: usize = 8 << 20;
/// Bytes of a value of a law in such a state.
pub const LAW_BYTES: usize = 40;
/// Sets of fresh states that must each confirm that a design is accurate enough; the larger error is reported. A design
/// that stopped at the first favourable set reported too small an error, by a factor of 1.3 in the geometric mean. A
/// design that has all the points it may have stops in any case, and reports the root mean square of both.
pub const SETS: usize = 2;
/// Progress is reported about this often in a step.
const REPORTS_PER_STEP: usize = 100;

/// States of a step that surrogates may learn from, by number.
pub trait Candidates: Sync {
    /// Returns the features of some states, unscaled.
    fn features(&self, some: Range<usize>) -> Vec<Features>;

    /// Solves the robust step at a state.
    ///
    /// # Errors
    /// The stop signal; a solution that is not finite.
    fn solve(&self, index: usize, features: Features) -> Result<DesignPoint, TrainError>;

    /// Solves the robust step at a state by which a fit is judged, between the holdings also.
    ///
    /// # Errors
    /// As [`Self::solve`].
    fn solve_to_judge(&self, index: usize, features: Features) -> Result<DesignPoint, TrainError> {
        self.solve(index, features)
    }
}

/// Returns how many states have their features computed together, if laws have `values` values and their radii `paths`
/// simulated paths.
pub fn together(values: usize, paths: usize) -> usize {
    (BYTES_TOGETHER / (LAW_BYTES * values + size_of::<f64>() * paths).max(1)).clamp(1, MOST_TOGETHER)
}

/// The fitting of the surrogates of one step.
pub struct DesignFitting<'a> {
    /// The completed specification.
    pub specification: &'a Specification,
    /// Names of all features.
    pub names: &'a [String],
    /// The step.
    pub step: usize,
    /// Counts of its states.
    pub counts: Counts,
    /// The error allowed; `None` if all design points are solved.
    pub aim: Option<Aim>,
    /// The least gain that there can be: 0 if there is a floor.
    pub least_gain: f64,
    /// Sets of fresh states that judge a design.
    pub sets: usize,
    /// True if states beyond the limit of the deviations are served without the surrogate.
    pub is_guarded: bool,
    /// The stop signal and the callback for progress.
    pub watch: &'a Watch<'a>,
}

/// The data of a step as its design grows.
#[derive(Default)]
struct StepData {
    /// Features of the candidates so far.
    features: Vec<Features>,
    /// Candidates that are design points.
    chosen: Vec<usize>,
    /// How many leaping states are design points.
    leaping: usize,
    /// The solved candidates, and the states that earlier fits were judged by.
    solved: Vec<DesignPoint>,
}

/// The parts of a fit that are judged.
struct JudgedFit {
    served: ValueSurrogate,
    /// Deviations predicted at the fresh states, and the largest at which the surrogate is used.
    deviations: Vec<f64>,
    limit: f64,
    /// Points solved before.
    before: usize,
}

impl DesignFitting<'_> {
    /// Solves the design, and fits both surrogates to it; the search for their scales is warm-started from those of the
    /// step after.
    ///
    /// # Errors
    /// [`TrainError::Stopped`] soon after the stop signal; a robust step that is not finite; a covariance matrix that
    /// stays singular.
    pub fn run(&self, states: &impl Candidates, after: Option<&Solution>) -> Result<StepSolution, TrainError> {
        let (step, most) = (self.step, self.counts.design);
        let mut wanted = self.aim.as_ref().map_or(most, |aim| aim.first.min(most));
        let (mut known, mut round) = (StepData::default(), 0);
        let after = after.and_then(Solution::surrogates);
        let mut last: Option<StepSurrogates> = None;
        loop {
            let fresh = self.counts.guards(round);
            let guards = self.features(states, fresh.clone())?;
            let SurrogateFit { stored, deviations, value, policy } =
                self.round(states, &mut known, wanted, last.as_ref().or(after), &guards)?;
            let mut diagnostics =
                StepDiagnostics { value: Some(value), policy: Some(policy), ..diagnostics(step, &known.solved) };
            if let Some(aim) = &self.aim {
                let served = ValueSurrogate::new(self.specification, step, &stored);
                let limit = if self.is_guarded { stored.deviation_limit } else { f64::INFINITY };
                let found = JudgedFit { served, deviations, limit, before: known.solved.len() };
                let (own, checked) = self.judge(states, aim, &found, (fresh, &guards), round)?;
                if !aim.is_met_by(own) && known.solved.len() < most {
                    wanted = aim.next(known.solved.len(), own).min(most);
                    known.solved.extend(checked.into_iter().take(most - known.solved.len()));
                    (last, round) = (Some(stored), round + 1);
                    continue;
                }
                diagnostics.expected_error = Some(aim.expected_error(own));
            }
            return Ok(StepSolution { step, solution: Solution::Surrogates(Box::new(stored)), diagnostics });
        }
    }

    /// Returns the error reported for a fit, and the fresh states solved for it. It goes through sets of fresh states
    /// until one gives too large an error.
    fn judge(
        &self,
        states: &impl Candidates,
        aim: &Aim,
        found: &JudgedFit,
        (fresh, guards): (Range<usize>, &[Features]),
        round: usize,
    ) -> Result<(f64, Vec<DesignPoint>), TrainError> {
        let JudgedFit { served, deviations, limit, before } = found;
        let (mut errors, mut numbers, mut solved) = (Vec::with_capacity(SETS), Vec::new(), Vec::new());
        let mut leaping = Vec::new();
        let last = *before >= self.counts.design;
        for set in 0..self.sets {
            let checks = Checks::of(deviations, *limit, self.specification.seed, self.step, self.sets * round + set);
            let drawn: Vec<usize> = checks.weighted.iter().map(|&(state, _)| state).collect();
            // A state that an earlier set holds is solved already.
            let new: Vec<usize> = drawn.iter().copied().filter(|state| !numbers.contains(state)).collect();
            let some = new.iter().map(|&state| (fresh.start + state, guards[state].clone())).collect();
            let done = before + solved.len();
            solved.extend(self.judges(states, some, done)?);
            numbers.extend(new);
            let place = |state: &usize| numbers.iter().position(|number| number == state);
            let points = drawn.iter().filter_map(place).map(|place| &solved[place]);
            let error = checks.error(served, self.judging(), points);
            let error = self.with_leaps(states, served, error, self.sets * round + set, &mut leaping)?;
            errors.push(error);
            if !last && !aim.is_met_by(error) {
                break;
            }
        }
        let mean_square = || errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
        let own = if last { mean_square().sqrt() } else { errors.iter().copied().fold(0.0, f64::max) };
        solved.extend(leaping);
        Ok((own, solved))
    }

    /// Returns what errors are judged by.
    fn judging(&self) -> (&Specification, usize, f64) {
        (self.specification, self.step, self.least_gain)
    }

    /// Returns the error over all states, given that over those that do not leap: one state in [`LEAPS`] does. Solves
    /// the leaping states of a set, and adds them to `solved`.
    fn with_leaps(
        &self,
        states: &impl Candidates,
        served: &ValueSurrogate,
        error: f64,
        set: usize,
        solved: &mut Vec<DesignPoint>,
    ) -> Result<f64, TrainError> {
        if !self.counts.leaps {
            return Ok(error);
        }
        let some = self.numbered(states, self.counts.leaping_checks(set))?;
        let points = self.judges(states, some, 0)?;
        let leaping = Checks::evenly(LEAPING_CHECKS).error(served, self.judging(), points.iter());
        solved.extend(points);
        let share = 1.0 / LEAPS as f64;
        Ok(((1.0 - share) * error * error + share * leaping * leaping).sqrt())
    }

    /// Solves as many more design points as are wanted, and fits both surrogates to all. `before` are surrogates for a
    /// warm start of the scales, `guards` the fresh states at which deviations are predicted.
    fn round(
        &self,
        states: &impl Candidates,
        known: &mut StepData,
        wanted: usize,
        before: Option<&StepSurrogates>,
        guards: &[Features],
    ) -> Result<SurrogateFit, TrainError> {
        let StepData { features, chosen, leaping, solved } = known;
        features.extend(self.features(states, features.len()..self.counts.candidates(wanted))?);
        let scaling = Scaling::of(features);
        let (specification, names, step, watch) = (self.specification, self.names, self.step, self.watch);
        let fitting = Fitting { specification, names, step, scaling: &scaling, watch };
        let named = |index: &usize| (*index, features[*index].clone());
        let leaps = wanted.saturating_sub(solved.len()).min(self.counts.leaping(wanted).saturating_sub(*leaping));
        let some = self.numbered(states, LEAPING + *leaping..LEAPING + *leaping + leaps)?;
        solved.extend(self.solve(states, some, solved.len(), wanted)?);
        *leaping += leaps;
        let left = wanted.saturating_sub(solved.len());
        let drawn = (0..self.counts.as_drawn(wanted)).filter(|index| !chosen.contains(index)).take(left);
        let drawn: Vec<usize> = drawn.collect();
        solved.extend(self.solve(states, drawn.iter().map(named).collect(), solved.len(), wanted)?);
        chosen.extend(drawn);
        let start = match before.and_then(|before| fitting.start_from(before)) {
            Some(start) => start,
            None => fitting.coarse(solved)?,
        };
        if solved.len() < wanted {
            let mut inputs: Vec<Vec<f64>> = features.iter().map(|features| scaling.apply(features)).collect();
            let weights = fitting.weights(solved, &start.value, &inputs)?;
            // The states that earlier fits were judged by are no candidates, but count as solved.
            let known = inputs.len()..inputs.len() + solved.len();
            inputs.extend(solved.iter().map(|point| scaling.apply(&point.features)));
            let given: Vec<usize> = chosen.iter().copied().chain(known).collect();
            let count = given.len() + wanted - solved.len();
            let more = &farthest_points(&inputs, &start.value.lengthscales, &weights, &given, count)[given.len()..];
            solved.extend(self.solve(states, more.iter().map(named).collect(), solved.len(), wanted)?);
            chosen.extend(more);
        }
        fitting.surrogates(solved, &start, guards)
    }

    /// Returns states with their numbers and features.
    fn numbered(&self, states: &impl Candidates, some: Range<usize>) -> Result<Vec<(usize, Features)>, TrainError> {
        Ok(some.clone().zip(self.features(states, some)?).collect())
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

    /// Solves the robust step at design points by number, with their features, if `before` of `total` are solved
    /// already.
    fn solve(
        &self,
        states: &impl Candidates,
        some: Vec<(usize, Features)>,
        before: usize,
        total: usize,
    ) -> Result<Vec<DesignPoint>, TrainError> {
        self.solve_by(|index, features| states.solve(index, features), some, before, total)
    }

    /// Solves the robust step at states by which a fit is judged, if `before` are solved already.
    fn judges(
        &self,
        states: &impl Candidates,
        some: Vec<(usize, Features)>,
        before: usize,
    ) -> Result<Vec<DesignPoint>, TrainError> {
        let total = before + some.len();
        self.solve_by(|index, features| states.solve_to_judge(index, features), some, before, total)
    }

    fn solve_by(
        &self,
        solve: impl Fn(usize, Features) -> Result<DesignPoint, TrainError> + Sync,
        some: Vec<(usize, Features)>,
        before: usize,
        total: usize,
    ) -> Result<Vec<DesignPoint>, TrainError> {
        let every = (total / REPORTS_PER_STEP).max(1);
        let done = AtomicUsize::new(before);
        self.report(before, total);
        let solve = |(index, features): (usize, Features)| {
            self.watch.go_on()?;
            let solved = solve(index, features)?;
            let finished = done.fetch_add(1, Ordering::Relaxed) + 1;
            if finished.is_multiple_of(every) || finished == total {
                self.report(finished, total);
            }
            Ok(solved)
        };
        some.into_par_iter().map(solve).collect()
    }

    fn report(&self, done: usize, total: usize) {
        (self.watch.progress)(StepProgress { step: self.step, phase: Phase::Solving, done, total });
    }
}

/// Returns how well a step was solved at its design points, before anything is fitted.
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
        expected_error: None,
        value: None,
        policy: None,
    }
}
