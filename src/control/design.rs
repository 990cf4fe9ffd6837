//! The design: simulated states, step by step, under randomised actions and the sampling law.

use std::sync::atomic::{AtomicBool, Ordering};

use rand::RngExt;

use super::error::{FieldError, TrainError};
use super::specification::{Framework, InitialLaws, Interval, ProblemSpecification, SamplingLaw, Specification};
use super::state::{State, next_wealth};
use super::utility::depends_on_wealth;
use crate::numerics::empirical::EmpiricalDistribution;
use crate::numerics::law::ContinuousLaw;
use crate::numerics::streams::stream;

/// Simulated paths of wealth and returns; the design of step t is where the paths are after t steps.
pub struct Design {
    history: Vec<f64>,
    learns: bool,
    /// `initial[i]`: returns drawn as design point i's own history; empty where every point starts at the history.
    initial: Vec<Vec<f64>>,
    /// `returns[i][t]` and `wealth[i][t]`, t from 0.
    returns: Vec<Vec<f64>>,
    wealth: Vec<Vec<f64>>,
    /// True where all states of a step are one: no learning and no wealth in the state.
    constant: bool,
    start_is_single: bool,
}

/// The law behind a specification's name for it.
pub fn continuous_law(law: &SamplingLaw, history: &[f64]) -> ContinuousLaw {
    match law {
        SamplingLaw::Bootstrap {} => ContinuousLaw::smoothed_bootstrap(history),
        SamplingLaw::StudentT { location, scale, degrees_of_freedom } => {
            let (location, scale, degrees_of_freedom) = (*location, *scale, *degrees_of_freedom);
            ContinuousLaw::StudentT { location, scale, degrees_of_freedom }
        }
        SamplingLaw::GaussianMixture { components } => {
            let component = |c: &super::specification::MixtureComponent| (c.weight, c.mean, c.variance.sqrt());
            ContinuousLaw::GaussianMixture(components.iter().map(component).collect())
        }
    }
}

/// A return the rest of the project accepts: within the support and the limit on log-returns.
fn admissible(log_return: f64, problem: &ProblemSpecification) -> f64 {
    let limit = super::limits::LOG_RETURN;
    let Interval { min, max } = problem.support.unwrap_or(Interval { min: -limit, max: limit });
    log_return.clamp(min.max(-limit), max.min(limit))
}

impl Design {
    /// Simulates the design of a completed specification. Streams: ("design", t, i) for the steps of point i,
    /// ("initial", 0, i) for its start.
    ///
    /// # Errors
    /// [`TrainError::Stopped`] soon after the stop signal.
    pub fn simulate(specification: &Specification, stop: &AtomicBool) -> Result<Self, TrainError> {
        let problem = &specification.problem;
        let design = &specification.design;
        let count = design.count.unwrap_or(super::limits::DEFAULT_COUNT);
        let bootstrap = SamplingLaw::Bootstrap {};
        let law = continuous_law(design.sampling_law.as_ref().unwrap_or(&bootstrap), &problem.history);
        let start = design.wealth.unwrap_or(Interval { min: problem.initial_wealth, max: problem.initial_wealth });
        let learns = problem.framework.learns();
        let resampled = learns && design.initial_laws == InitialLaws::Resampled;
        let wealth_matters = depends_on_wealth(problem.utility);
        let mut made = Design {
            history: problem.history.clone(),
            learns,
            initial: Vec::new(),
            returns: Vec::new(),
            wealth: Vec::new(),
            constant: !learns && !wealth_matters,
            start_is_single: !resampled && (start.min == start.max || !wealth_matters),
        };
        if !learns {
            made.wealth = wealth_ladders(problem, start, count);
            return Ok(made);
        }
        for point in 0..count {
            if stop.load(Ordering::Relaxed) {
                return Err(TrainError::Stopped);
            }
            let mut generator = stream(specification.seed, "initial", 0, point);
            let mut wealth = start.min * (start.max / start.min).powf(generator.random::<f64>());
            if resampled {
                let draw = |_| admissible(law.draw(&mut generator), problem);
                made.initial.push((0..problem.history.len()).map(draw).collect());
            }
            let (mut returns, mut path) = (Vec::with_capacity(problem.horizon), vec![wealth]);
            for step in 0..problem.horizon.saturating_sub(1) {
                let mut generator = stream(specification.seed, "design", step, point);
                let action = problem.action_interval[1] * generator.random::<f64>();
                let log_return = admissible(law.draw(&mut generator), problem);
                wealth = next_wealth(wealth, action, log_return, problem.rate_per_step);
                returns.push(log_return);
                path.push(wealth);
            }
            made.returns.push(returns);
            made.wealth.push(path);
        }
        Ok(made)
    }

    /// Number of distinct design points of a step: 1 where they are all the same state.
    pub fn count(&self, step: usize) -> usize {
        if self.constant || (step == 0 && self.start_is_single) { 1 } else { self.wealth.len() }
    }

    /// Design point `point` of `step`.
    pub fn state(&self, step: usize, point: usize) -> State {
        let mut sample = self.initial.get(point).unwrap_or(&self.history).clone();
        if self.learns {
            sample.extend_from_slice(&self.returns[point][..step]);
        }
        State { wealth: self.wealth[point][step], law: EmpiricalDistribution::new(&sample) }
    }
}

/// Wealths of a design whose state is wealth alone: evenly in log wealth, over what holding any allocation can reach
/// within [`REACHED_DEVIATIONS`] of the centre. A simulated design would leave its edges, which the robust step visits,
/// to extrapolation.
fn wealth_ladders(problem: &ProblemSpecification, start: Interval, count: usize) -> Vec<Vec<f64>> {
    let law = match (&problem.law, problem.framework) {
        (Some(law), Framework::KnownLaw) => continuous_law(law, &problem.history).quadrature(),
        _ => merged(EmpiricalDistribution::new(&problem.history).atoms()),
    };
    let mean: f64 = law.0.iter().zip(&law.1).map(|(atom, mass)| atom * mass).sum();
    let variance: f64 = law.0.iter().zip(&law.1).map(|(atom, mass)| mass * (atom - mean).powi(2)).sum();
    let ladder = |point: usize, step: usize| {
        let elapsed = step as f64;
        let spread = REACHED_DEVIATIONS * problem.action_interval[1] * (elapsed * variance).sqrt();
        let bank = elapsed * problem.rate_per_step.ln_1p();
        let low = start.min.ln() + bank.min(elapsed * mean) - spread;
        let high = start.max.ln() + bank.max(elapsed * mean) + spread;
        (low + (high - low) * point as f64 / (count - 1) as f64).exp()
    };
    (0..count).map(|point| (0..problem.horizon).map(|step| ladder(point, step)).collect()).collect()
}

/// Standard deviations of log wealth that the design covers where the state is wealth alone.
const REACHED_DEVIATIONS: f64 = 5.0;

/// The discrete law a framework centres on at a state: ascending distinct atoms and their masses.
pub fn centre(problem: &ProblemSpecification, state: &State) -> Result<(Vec<f64>, Vec<f64>), FieldError> {
    match (problem.framework, &problem.law) {
        (Framework::KnownLaw, Some(law)) => Ok(continuous_law(law, &problem.history).quadrature()),
        (Framework::KnownLaw, None) => {
            Err(FieldError::new("problem.law", "null", "must be given in the known_law framework"))
        }
        (Framework::Static, _) => Ok(merged(EmpiricalDistribution::new(&problem.history).atoms())),
        (Framework::Adaptive | Framework::PlugIn, _) => Ok(merged(state.law.atoms())),
    }
}

/// Ascending atoms without repetition, each with its share of the sample.
fn merged(sorted: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mass = 1.0 / sorted.len() as f64;
    let (mut atoms, mut masses): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for &atom in sorted {
        match (atoms.last(), masses.last_mut()) {
            (Some(&last), Some(total)) if last == atom => *total += mass,
            _ => {
                atoms.push(atom);
                masses.push(mass);
            }
        }
    }
    (atoms, masses)
}
