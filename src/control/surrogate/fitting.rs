//! Fitting the surrogates of one step to its solved design points.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::features::Features;
use super::scaling::Scaling;
use super::stored::{StepSurrogates, StoredSurrogate};
use super::target::TargetMap;
use crate::control::error::TrainError;
use crate::control::problem::dynamics::Dynamics;
use crate::control::problem::holdings::Holdings;
use crate::control::progress::{Phase, StepProgress, Watch};
use crate::control::request::specification::Specification;
use crate::control::solved_step::SurrogateDiagnostics;
use crate::numerics::gp::fit::{self, Bounds, Fit, FitError};
use crate::numerics::gp::{GaussianProcess, Hyperparameters, LeaveOneOut};
use crate::numerics::statistics::summary::quantile;

/// Share of the states of the design's own law that lie within the guard. The limit is itself the quantile of few
/// states beyond. Over six seeds 98.8 to 99.6 % of fresh states pass; with a share of 0.99, 97.7 to 99.4 % passed, with
/// errors as small.
const GUARDED_SHARE: f64 = 0.995;

/// Weight that a candidate gains if its expected error equals the root mean square. At 1,000 points of the paper's
/// problem with alpha 0.5, weights of 2 to 6 leave 0.10 basis points of error at the last step; weights by the floor
/// gain left 0.15.
const WEIGHT_OF_ERROR: f64 = 3.0;
/// Share of the signal variance that counts as noise when errors are smoothed: single errors are noisy, their size is
/// not.
const NOISE_OF_ERRORS: f64 = 0.3;

/// The most design points that are predicted from the others. Predicting all of them would cost as much as the fit.
const LEFT_OUT: usize = 500;

/// Guards whose deviations are computed together: a block that stays in the second-level cache with the factor's.
const GUARDS_AT_A_TIME: usize = 64;

/// A state of the design with the solution of the robust step there: y^i and the targets of the surrogates.
pub struct DesignPoint {
    /// x.
    pub wealth: f64,
    /// y-check.
    pub features: Features,
    /// The best action without holdings.
    pub action: f64,
    /// Log certainty equivalent over the all-bank floor, at the state's own holding.
    pub floor_gain: f64,
    /// An upper bound on the floor gain with nothing held.
    pub largest_gain: f64,
    /// The floor gain at every holding at which the value is needed; one if the holding does not matter.
    pub floor_gains: Vec<f64>,
    /// The floor gains halfway between these holdings, if a fit is judged by the state.
    pub between: Vec<f64>,
    /// The action, or either end of the band, continued past the bounds of the interval.
    pub policy_targets: Vec<f64>,
    /// The duality gap of the robust step, in log certainty equivalent.
    pub duality_gap: f64,
    /// True if the robust step was certified.
    pub certified: bool,
}

/// Hyperparameters from which the search for both surrogates starts.
pub struct StartingScales {
    /// Hyperparameters of the value surrogate.
    pub value: Hyperparameters,
    /// Hyperparameters of the policy surrogate.
    pub policy: Hyperparameters,
}

/// The context that a fit needs.
pub struct Fitting<'a> {
    /// The completed specification.
    pub specification: &'a Specification,
    /// Names of all features.
    pub names: &'a [String],
    /// The step being fitted.
    pub step: usize,
    /// The scaling of the candidates.
    pub scaling: &'a Scaling,
    /// The stop signal and the callback for progress.
    pub watch: &'a Watch<'a>,
}

/// Both surrogates of a design, with the figures that describe them.
pub struct SurrogateFit {
    /// The surrogates in the form stored.
    pub stored: StepSurrogates,
    /// Deviations of the value target, predicted at each state that set the guard, in units of the value's `scale`.
    pub deviations: Vec<f64>,
    /// Diagnostics of the value surrogate.
    pub value: SurrogateDiagnostics,
    /// Diagnostics of the policy surrogate.
    pub policy: SurrogateDiagnostics,
}

/// A regression problem: functions of zero prior mean and, together, of unit size.
struct Targets {
    scaled: Vec<Vec<f64>>,
    offset: f64,
    scale: f64,
}

impl Targets {
    /// Divides by the root mean square about the offset, which is the mean of the values or 0.
    fn new(functions: &[Vec<f64>], prior_mean: PriorMean) -> Self {
        let all = || functions.iter().flatten();
        let count = all().count() as f64;
        let offset = match prior_mean {
            PriorMean::Zero => 0.0,
            PriorMean::OfTargets => all().sum::<f64>() / count,
        };
        let size = (all().map(|value| (value - offset).powi(2)).sum::<f64>() / count).sqrt();
        let scale = if size > 1e-12 { size } else { 1.0 };
        let scaled = |values: &Vec<f64>| values.iter().map(|value| (value - offset) / scale).collect();
        Targets { scaled: functions.iter().map(scaled).collect(), offset, scale }
    }

    fn of_one(values: Vec<f64>, prior_mean: PriorMean) -> Self {
        Targets::new(&[values], prior_mean)
    }
}

/// The prior mean of a surrogate.
#[derive(Clone, Copy)]
enum PriorMean {
    Zero,
    OfTargets,
}

impl Fitting<'_> {
    /// Returns the hyperparameters of surrogates fitted before, if they have the same inputs.
    pub fn start_from(&self, before: &StepSurrogates) -> Option<StartingScales> {
        (before.scaling.active == self.scaling.active).then(|| StartingScales {
            value: before.value.hyperparameters.clone(),
            policy: before.policy.hyperparameters.clone(),
        })
    }

    /// Fits coarsely to few design points.
    ///
    /// # Errors
    /// A covariance matrix that stays singular.
    pub fn coarse(&self, solved: &[DesignPoint]) -> Result<StartingScales, TrainError> {
        let inputs = self.inputs(solved);
        let [value, policy] = self.targets(solved);
        Ok(StartingScales {
            value: self.search("value", &inputs, &value.scaled, None)?.process.hyperparameters().clone(),
            policy: self.search("policy", &inputs, &policy.scaled, None)?.process.hyperparameters().clone(),
        })
    }

    /// Returns the weight of each candidate's distance to the design: 1 if no error of the value is expected, 4 if the
    /// expected error equals the root mean square. The expected error is that of the design points solved so far, each
    /// predicted from the others, smoothed over the inputs.
    ///
    /// # Errors
    /// A covariance matrix that stays singular.
    pub fn weights(
        &self,
        solved: &[DesignPoint],
        hyper: &Hyperparameters,
        inputs: &[Vec<f64>],
    ) -> Result<Vec<f64>, TrainError> {
        let drawn = self.inputs(solved);
        let condition = |targets: &[Vec<f64>], hyper: &Hyperparameters| {
            let process = GaussianProcess::condition(&drawn, &targets[0], hyper);
            process.map_err(|error| self.singular("value", error.jitter))
        };
        let gains = solved.iter().map(|point| point.floor_gain).collect();
        let gains = Targets::of_one(gains, PriorMean::Zero).scaled;
        let all: Vec<usize> = (0..solved.len()).collect();
        let errors = condition(&gains, hyper)?.leave_one_out(&gains, &all).errors;
        let errors = errors.iter().flatten().map(|error| error.abs()).collect();
        let errors = Targets::of_one(errors, PriorMean::Zero).scaled;
        let smooth = Hyperparameters { noise_variance: NOISE_OF_ERRORS * hyper.signal_variance, ..hyper.clone() };
        let expected = condition(&errors, &smooth)?;
        let weight = |input: &Vec<f64>| 1.0 + WEIGHT_OF_ERROR * expected.mean(input).max(0.0).sqrt();
        Ok(inputs.par_iter().map(weight).collect())
    }

    /// Fits both surrogates by maximum likelihood, and computes the deviations of the value that set the guard.
    /// `guards` are features of independent states of the design's own law: the share `GUARDED_SHARE` of them passes.
    /// If there are none, the design points are used instead, each predicted from the others.
    ///
    /// # Errors
    /// A covariance matrix that stays singular; the stop signal.
    pub fn surrogates(
        &self,
        solved: &[DesignPoint],
        start: &StartingScales,
        guards: &[Features],
    ) -> Result<SurrogateFit, TrainError> {
        let total = solved.len();
        (self.watch.progress)(StepProgress { step: self.step, phase: Phase::Fitting, done: total, total });
        self.watch.go_on()?;
        let inputs = self.inputs(solved);
        let [value, policy] = self.targets(solved);
        let (value, policy) = rayon::join(
            || self.fitted("value", &inputs, &value, &start.value),
            || self.fitted("policy", &inputs, &policy, &start.policy),
        );
        let (value, policy) = (value?, policy?);
        let deviations: Vec<f64> = if guards.is_empty() {
            value.left_out.latent_sd.clone()
        } else {
            let guards: Vec<Vec<f64>> = guards.iter().map(|guard| self.scaling.apply(guard)).collect();
            let variances = guards.par_chunks(GUARDS_AT_A_TIME).flat_map(|some| value.process.latent_variances(some));
            variances.map(f64::sqrt).collect()
        };
        let names: Vec<String> = self.scaling.active.iter().map(|&feature| self.names[feature].clone()).collect();
        let [of_value, of_policy] = [&value, &policy].map(|fitted| fitted.diagnostics(&names));
        let stored = StepSurrogates {
            inputs: inputs.column_iter().map(|column| column.iter().copied().collect()).collect(),
            scaling: self.scaling.clone(),
            deviation_limit: quantile(&deviations, GUARDED_SHARE),
            value: value.stored,
            policy: policy.stored,
        };
        Ok(SurrogateFit { stored, deviations, value: of_value, policy: of_policy })
    }

    fn inputs(&self, solved: &[DesignPoint]) -> DMatrix<f64> {
        let rows: Vec<Features> = solved.iter().map(|point| point.features.clone()).collect();
        self.scaling.matrix(&rows)
    }

    /// Returns the value's targets, then the policy's.
    fn targets(&self, solved: &[DesignPoint]) -> [Targets; 2] {
        let map = TargetMap::new(self.specification, self.step);
        let problem = &self.specification.problem;
        let dynamics = Dynamics::of(problem)[self.step];
        let gains = |point: &DesignPoint| -> Vec<f64> {
            let holdings = Holdings::new(point.floor_gains.len(), problem.action_interval[1]);
            let totals = holdings.nodes().map(|holding| dynamics.total(point.wealth, holding));
            point.floor_gains.iter().zip(totals).map(|(&gain, total)| map.target(gain, total)).collect()
        };
        let gains = by_function(solved, gains);
        let actions = by_function(solved, |point| point.policy_targets.clone());
        let prior_mean = if map.is_value() { PriorMean::OfTargets } else { PriorMean::Zero };
        [Targets::new(&gains, prior_mean), Targets::new(&actions, PriorMean::OfTargets)]
    }

    fn search(
        &self,
        surrogate: &'static str,
        inputs: &DMatrix<f64>,
        targets: &[Vec<f64>],
        start: Option<&Hyperparameters>,
    ) -> Result<Fit, TrainError> {
        let bounds = self.specification.surrogate.bounds;
        let bounds = Bounds {
            lengthscale: bounds.lengthscale,
            signal_variance: bounds.signal_variance,
            noise_variance: bounds.noise_variance,
        };
        fit::fit(inputs, targets, &bounds, start, self.watch.stop).map_err(|error| match error {
            FitError::Singular(singular) => self.singular(surrogate, singular.jitter),
            FitError::Stopped => TrainError::Stopped,
        })
    }

    fn singular(&self, surrogate: &'static str, jitter: f64) -> TrainError {
        TrainError::Singular { step: self.step, surrogate, jitter }
    }

    fn fitted(
        &self,
        surrogate: &'static str,
        inputs: &DMatrix<f64>,
        targets: &Targets,
        start: &Hyperparameters,
    ) -> Result<Fitted, TrainError> {
        let Fit { process, log_likelihood, outcome, .. } =
            self.search(surrogate, inputs, &targets.scaled, Some(start))?;
        let left_out = fit::evenly_spaced(LEFT_OUT, inputs.nrows());
        Ok(Fitted {
            left_out: process.leave_one_out(&targets.scaled, &left_out),
            log_likelihood_per_point: log_likelihood / targets.scaled.iter().map(Vec::len).sum::<usize>() as f64,
            search: format!("{outcome:?}"),
            stored: StoredSurrogate {
                hyperparameters: process.hyperparameters().clone(),
                weights: targets.scaled.iter().map(|values| process.weights_of(values)).collect(),
                offset: targets.offset,
                scale: targets.scale,
            },
            process,
        })
    }
}

/// Transposes the rows that `of` gives for the design points: one function of the design points for each entry.
fn by_function(solved: &[DesignPoint], of: impl Fn(&DesignPoint) -> Vec<f64>) -> Vec<Vec<f64>> {
    let rows: Vec<Vec<f64>> = solved.iter().map(of).collect();
    let functions = rows.first().map_or(0, Vec::len);
    (0..functions).map(|function| rows.iter().map(|row| row[function]).collect()).collect()
}

/// A fitted surrogate with the figures that describe the fit.
struct Fitted {
    stored: StoredSurrogate,
    left_out: LeaveOneOut,
    log_likelihood_per_point: f64,
    process: GaussianProcess,
    search: String,
}

impl Fitted {
    fn diagnostics(&self, features: &[String]) -> SurrogateDiagnostics {
        let errors = || self.left_out.errors.iter().flatten();
        let squares: f64 = errors().map(|error| error * error).sum();
        SurrogateDiagnostics {
            features: features.to_vec(),
            lengthscales: self.stored.hyperparameters.lengthscales.clone(),
            signal_variance: self.stored.hyperparameters.signal_variance,
            noise_variance: self.stored.hyperparameters.noise_variance,
            log_likelihood_per_point: self.log_likelihood_per_point,
            leave_one_out_error: self.stored.scale * (squares / errors().count() as f64).sqrt(),
            jitter: self.process.jitter(),
            search: self.search.clone(),
        }
    }
}
