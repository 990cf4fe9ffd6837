//! The steps of a policy prepared for evaluation, and the memory they need.

use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::document::Policy;
use crate::control::cache::{Cache, Key};
use crate::control::request::specification::Specification;
use crate::control::solved_step::StepSolution;
use crate::control::surrogate::stored::{Solution, StepSurrogates};
use crate::control::surrogate::value_surrogate::{Surrogate, ValueSurrogate};
use crate::numerics::gp::GaussianProcess;

/// Bytes of a prepared policy without its numbers, and of each of its steps: names, diagnostics, scales.
const POLICY_BYTES: usize = 4096;
const STEP_BYTES: usize = 4096;

/// The surrogates of one step, prepared for evaluation.
pub struct PreparedStep {
    /// Surrogate of the value.
    pub value: ValueSurrogate,
    /// Surrogate of the action, not yet clamped to its interval.
    pub policy: Surrogate,
    /// Factor for the predicted deviation of the value; computed on first use, and cached elsewhere.
    pub factor: Factor,
}

/// Cache key of the Gaussian process behind the predicted deviation, which does not depend on the targets.
pub struct Factor(Key);

impl PreparedStep {
    /// Prepares a step of a policy trained from `specification`.
    pub fn new(specification: &Specification, step: usize, stored: &StepSurrogates) -> Self {
        PreparedStep {
            value: ValueSurrogate::new(specification, step, stored),
            policy: Surrogate::new(stored, &stored.policy),
            factor: Factor::of(stored),
        }
    }
}

impl Factor {
    /// Returns the key: the hash of all inputs of the factor.
    pub fn of(stored: &StepSurrogates) -> Self {
        let scales = &stored.value.hyperparameters;
        let numbers = stored.inputs.iter().flatten().chain(&scales.lengthscales);
        let mut hash = Sha256::new_with_prefix((stored.count() as u64).to_le_bytes());
        for number in numbers.chain([&scales.signal_variance, &scales.noise_variance]) {
            hash.update(number.to_le_bytes());
        }
        Factor(Key::Factor(hash.finalize().into()))
    }

    /// Returns true if the factor is in the cache.
    pub fn is_in(&self, kept: &Cache) -> bool {
        kept.has(&self.0)
    }

    /// Returns the Gaussian process; `None` if the matrix does not factor.
    pub fn process(&self, kept: &Cache, stored: &StepSurrogates) -> Arc<Option<GaussianProcess>> {
        kept.get_or_make(&self.0, factor_bytes(stored), || {
            let zeros = vec![0.0; stored.count()];
            GaussianProcess::condition(&stored.matrix(), &zeros, &stored.value.hyperparameters).ok()
        })
    }
}

/// Returns the bytes of the Gaussian process of a step.
pub fn factor_bytes(stored: &StepSurrogates) -> usize {
    GaussianProcess::bytes_of(stored.count(), stored.inputs.len())
}

/// Returns the bytes of a prepared policy, without bridges and factors.
pub fn prepared_bytes(policy: &Policy) -> usize {
    let rows = policy.specification().fund.as_ref().map_or(0, |fund| fund.history.len() * fund.assets.len());
    steps_bytes(policy.steps()) + 2 * rows * size_of::<f64>()
}

/// Returns the number of design points of the largest step, and the bytes of its Gaussian process.
pub fn largest_design(steps: &[StepSolution]) -> (usize, usize) {
    let design = |step: &StepSolution| match &step.solution {
        Solution::Single(_) => (1, 0),
        Solution::Surrogates(stored) => (stored.count(), factor_bytes(stored)),
    };
    steps.iter().map(design).max_by_key(|(_, bytes)| *bytes).unwrap_or_default()
}

/// Returns the bytes of prepared steps.
pub fn steps_bytes(steps: &[StepSolution]) -> usize {
    let designs = steps.iter().map(|step| match &step.solution {
        Solution::Single(single) => (1, 0, single.floor_gains.len()),
        Solution::Surrogates(stored) => {
            let functions = stored.value.weights.len() + stored.policy.weights.len();
            (stored.count(), stored.inputs.len(), functions)
        }
    });
    let (points, inputs, functions) = designs.fold((0, 0, 0), |(sum, inputs, most), (points, own, functions)| {
        (sum + points, inputs.max(own), most.max(functions))
    });
    bytes_ready(steps.len(), points, inputs, functions)
}

/// Returns the bytes for `steps` steps with `points` design points in all. They count the inputs, as stored and for
/// both surrogates, and the weights of every function, as stored and as prepared.
pub fn bytes_ready(steps: usize, points: usize, inputs: usize, functions: usize) -> usize {
    let numbers = points.saturating_mul(3 * inputs + 2 * functions);
    numbers.saturating_mul(size_of::<f64>()).saturating_add(POLICY_BYTES + STEP_BYTES * steps)
}
