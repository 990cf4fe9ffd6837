//! Backward induction: one robust Bellman step after another, from the horizon to the start.
//!
//! optimise (the robust step at every design point), train (both surrogates), go one step back. A step depends on
//! the specification and the step after it alone, so a checkpoint per step resumes to the same bits.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::bellman::RobustSolution;
use super::context::ProblemContext;
use super::design::Design;
use super::error::TrainError;
use super::features::Scaling;
use super::policy::{Policy, StepDiagnostics, SurrogateDiagnostics};
use super::specification::Specification;
use super::surrogate::{NextValue, SingleSolution, Solution, StepSurrogates, StoredSurrogate, TargetMap};
use crate::numerics::gp::{GaussianProcess, Hyperparameters, LeaveOneOut};
use crate::numerics::gp_fit::{self, Bounds};

/// Share of the design whose leave-one-out deviation lies below the guard.
const GUARDED_SHARE: f64 = 0.99;
/// Progress is reported about this often a step.
const REPORTS_PER_STEP: usize = 100;

/// What a running step may be asked and told: the stop signal, and a callback for progress.
pub struct Watch<'a> {
    pub stop: &'a AtomicBool,
    pub progress: &'a (dyn Fn(StepProgress) + Sync),
}

/// How far one backward step is. Reported from worker threads, possibly concurrently, about a hundred times a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepProgress {
    pub step: usize,
    pub phase: Phase,
    /// Design points solved so far in this step, of `total`.
    pub done: usize,
    pub total: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Solving the robust Bellman step at the design points.
    Solving,
    /// Fitting the surrogates.
    Fitting,
}

/// Everything kept of one solved step; a checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepSolution {
    pub step: usize,
    pub solution: Solution,
    pub diagnostics: StepDiagnostics,
}

/// A prepared training job: the completed specification and its simulated design.
pub struct Training {
    context: ProblemContext,
    design: Design,
}

/// One solved design point.
struct Solved {
    wealth: f64,
    features: Vec<f64>,
    solution: RobustSolution,
}

impl Training {
    /// As [`Self::prepare`], without a way to stop.
    ///
    /// # Errors
    /// A specification that breaks a rule.
    pub fn new(specification: &Specification) -> Result<Self, TrainError> {
        Self::prepare(specification, &AtomicBool::new(false))
    }

    /// Completes and checks the specification. Cost: simulating the design, seconds at the largest counts.
    ///
    /// # Errors
    /// A specification that breaks a rule; [`TrainError::Stopped`] soon after the stop signal.
    pub fn prepare(specification: &Specification, stop: &AtomicBool) -> Result<Self, TrainError> {
        let specification = specification.clone().completed()?;
        let design = Design::simulate(&specification, stop)?;
        Ok(Training { context: ProblemContext::new(&specification), design })
    }

    /// Number of steps to solve: steps `horizon - 1` down to 0.
    pub fn horizon(&self) -> usize {
        self.context.specification.problem.horizon
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
        let next = NextValue::new(&self.context.specification, step + 1, after.map(|after| &after.solution));
        let solved = self.solve_design(step, &next, watch)?;
        let gaps = solved.iter().map(|point| point.solution.duality_gap.abs());
        let mut diagnostics = StepDiagnostics {
            step,
            design_count: solved.len(),
            all_bank_share: share(&solved, |point| point.solution.action <= 0.0),
            uncertified_share: share(&solved, |point| !point.solution.certified),
            duality_gap: gaps.fold(0.0, f64::max),
            value: None,
            policy: None,
        };
        let solution = if let [only] = &solved[..] {
            Solution::Single(SingleSolution { floor_gain: only.solution.floor_gain, action: only.solution.action })
        } else {
            self.fit(step, &solved, after, watch, &mut diagnostics)?
        };
        Ok(StepSolution { step, solution, diagnostics })
    }

    fn solve_design(&self, step: usize, next: &NextValue, watch: &Watch) -> Result<Vec<Solved>, TrainError> {
        let total = self.design.count(step);
        let every = (total / REPORTS_PER_STEP).max(1);
        let done = AtomicUsize::new(0);
        (watch.progress)(StepProgress { step, phase: Phase::Solving, done: 0, total });
        let solve = |point: usize| {
            if watch.stop.load(Ordering::Relaxed) {
                return Err(TrainError::Stopped);
            }
            let state = self.design.state(step, point);
            let solution = self.context.solve(step, &state, next)?;
            if !solution.floor_gain.is_finite() || !solution.extended_action.is_finite() {
                return Err(TrainError::NotFinite { step, point, value: solution.floor_gain });
            }
            let finished = done.fetch_add(1, Ordering::Relaxed) + 1;
            if finished.is_multiple_of(every) || finished == total {
                (watch.progress)(StepProgress { step, phase: Phase::Solving, done: finished, total });
            }
            Ok(Solved { wealth: state.wealth, features: self.context.features(&state), solution })
        };
        (0..total).into_par_iter().map(solve).collect()
    }

    /// Fits both surrogates of a step, the hyperparameters started from the step after.
    fn fit(
        &self,
        step: usize,
        solved: &[Solved],
        after: Option<&StepSolution>,
        watch: &Watch,
        diagnostics: &mut StepDiagnostics,
    ) -> Result<Solution, TrainError> {
        let total = solved.len();
        (watch.progress)(StepProgress { step, phase: Phase::Fitting, done: total, total });
        if watch.stop.load(Ordering::Relaxed) {
            return Err(TrainError::Stopped);
        }
        let rows: Vec<Vec<f64>> = solved.iter().map(|point| point.features.clone()).collect();
        let scaling = Scaling::of(&rows);
        let inputs = scaling.matrix(&rows);
        let target = TargetMap::new(&self.context.specification, step);
        let gain = |point: &Solved| target.target(point.solution.floor_gain, point.wealth);
        let values: Vec<f64> = solved.iter().map(gain).collect();
        let actions: Vec<f64> = solved.iter().map(|point| point.solution.extended_action).collect();
        let earlier = match after.map(|after| &after.solution) {
            Some(Solution::Surrogates(stored)) if stored.scaling.active == scaling.active => Some(stored),
            _ => None,
        };
        let fit = |surrogate, values: &[f64], centred, start: Option<&Hyperparameters>| {
            self.fit_one(step, surrogate, &inputs, values, centred, start)
        };
        let (value, policy) = rayon::join(
            || fit("value", &values, target.is_value(), earlier.map(|stored| &stored.value.hyperparameters)),
            || fit("policy", &actions, true, earlier.map(|stored| &stored.policy.hyperparameters)),
        );
        let (value, policy) = (value?, policy?);
        let names = self.context.selection.names();
        let names: Vec<String> = scaling.active.iter().map(|&feature| names[feature].clone()).collect();
        diagnostics.value = Some(value.diagnostics(&names));
        diagnostics.policy = Some(policy.diagnostics(&names));
        Ok(Solution::Surrogates(Box::new(StepSurrogates {
            inputs: inputs.column_iter().map(|column| column.iter().copied().collect()).collect(),
            scaling,
            deviation_limit: quantile(&value.left_out.latent_sd, GUARDED_SHARE),
            largest_gain: solved.iter().map(|point| point.solution.floor_gain).fold(0.0, f64::max),
            value: value.stored,
            policy: policy.stored,
        })))
    }

    /// Fits one surrogate by maximum likelihood. Targets are divided by their root mean square about the offset,
    /// which is their mean where `centred`, else 0: the prior mean.
    fn fit_one(
        &self,
        step: usize,
        surrogate: &'static str,
        inputs: &DMatrix<f64>,
        values: &[f64],
        centred: bool,
        start: Option<&Hyperparameters>,
    ) -> Result<Fitted, TrainError> {
        let count = values.len() as f64;
        let offset = if centred { values.iter().sum::<f64>() / count } else { 0.0 };
        let size = (values.iter().map(|value| (value - offset).powi(2)).sum::<f64>() / count).sqrt();
        let scale = if size > 1e-12 { size } else { 1.0 };
        let targets: Vec<f64> = values.iter().map(|value| (value - offset) / scale).collect();
        let bounds = self.context.specification.surrogate.bounds;
        let bounds = Bounds {
            lengthscale: bounds.lengthscale,
            signal_variance: bounds.signal_variance,
            noise_variance: bounds.noise_variance,
        };
        let singular =
            |error: crate::numerics::cholesky::Singular| TrainError::Singular { step, surrogate, jitter: error.jitter };
        let found = gp_fit::fit(inputs, &targets, &bounds, start).map_err(singular)?;
        let process = GaussianProcess::condition(inputs, &targets, &found.hyperparameters).map_err(singular)?;
        Ok(Fitted {
            left_out: process.leave_one_out(&targets),
            log_likelihood_per_point: found.log_likelihood / count,
            jitter: process.jitter(),
            search: format!("{:?}", found.outcome),
            stored: StoredSurrogate {
                hyperparameters: found.hyperparameters,
                weights: process.weights().to_vec(),
                offset,
                scale,
            },
        })
    }

    /// The policy made of all steps, in ascending order of step.
    pub fn into_policy(self, steps: Vec<StepSolution>) -> Policy {
        Policy::new(self.context.specification, steps)
    }

    /// Solves every step on the current rayon pool.
    ///
    /// # Errors
    /// As [`Self::solve_step`].
    pub fn run(self, watch: &Watch) -> Result<Policy, TrainError> {
        let mut steps: Vec<StepSolution> = Vec::with_capacity(self.horizon());
        for step in (0..self.horizon()).rev() {
            let solution = self.solve_step(step, steps.last(), watch)?;
            steps.push(solution);
        }
        steps.reverse();
        Ok(self.into_policy(steps))
    }
}

/// A fitted surrogate with the figures that describe the fit.
struct Fitted {
    stored: StoredSurrogate,
    left_out: LeaveOneOut,
    log_likelihood_per_point: f64,
    jitter: f64,
    search: String,
}

impl Fitted {
    fn diagnostics(&self, features: &[String]) -> SurrogateDiagnostics {
        let squares: f64 = self.left_out.errors.iter().map(|error| error * error).sum();
        SurrogateDiagnostics {
            features: features.to_vec(),
            lengthscales: self.stored.hyperparameters.lengthscales.clone(),
            signal_variance: self.stored.hyperparameters.signal_variance,
            noise_variance: self.stored.hyperparameters.noise_variance,
            log_likelihood_per_point: self.log_likelihood_per_point,
            leave_one_out_error: self.stored.scale * (squares / self.left_out.errors.len() as f64).sqrt(),
            jitter: self.jitter,
            search: self.search.clone(),
        }
    }
}

fn share(solved: &[Solved], holds: impl Fn(&Solved) -> bool) -> f64 {
    solved.iter().filter(|point| holds(point)).count() as f64 / solved.len() as f64
}

/// The order statistic below which a share of `values` lies.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let index = (share * sorted.len() as f64) as usize;
    sorted.get(index.min(sorted.len().saturating_sub(1))).copied().unwrap_or(0.0)
}
