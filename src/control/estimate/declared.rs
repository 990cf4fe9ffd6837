//! Memory for declared problems.

use super::{Footprint, LEAST, Sizes, advising_of, footprint, product};
use crate::control::declared_training::DeclaredTraining;
use crate::control::policy::declared::DeclaredPolicy;
use crate::control::policy::prepared_step::{largest_design, steps_bytes};
use crate::control::request::completion::DEFAULT_COUNT;
use crate::control::request::declared_comparison::DeclaredComparison;

/// Bytes of a path for each strategy and each period: its state, its noises, its actions and its worth.
const PATH_BYTES: usize = 512;
/// Bytes of a table of gains over the states.
const TABLE_BYTES: usize = 4 << 20;

/// Returns the footprint of the training of a declared problem on so many threads, and of advice by its policy.
pub fn training(training: &DeclaredTraining, threads: usize) -> (Footprint, [Footprint; 3]) {
    let problem = &training.declared().problem;
    let mut sizes = Sizes::of(training.specification());
    sizes.count = training.declared().design.count.unwrap_or(DEFAULT_COUNT);
    sizes.inputs += problem.states.len();
    sizes.functions = 1 + problem.actions.len();
    let solving = sizes.solving(threads).saturating_add(product(&[threads, TABLE_BYTES])).saturating_add(LEAST);
    (footprint(&sizes, solving, threads), advising_of(&sizes))
}

/// Returns the footprint of a comparison on so many paths of a horizon, whose policies take `policies` bytes.
pub fn comparison(request: &DeclaredComparison, horizon: usize, policies: usize) -> Footprint {
    let strategies = request.policies.len() + request.rules.len();
    let path = product(&[strategies + horizon, PATH_BYTES]);
    Footprint::of("paths", request.paths, product(&[request.paths, path]).saturating_add(LEAST)).and(
        "policies",
        request.policies.len(),
        policies,
    )
}

/// Returns the memory that decisions by the policy of a declared problem take, including the policy itself. `read` is its
/// declaration.
pub fn advising_by(policy: &DeclaredPolicy, read: &DeclaredTraining) -> [Footprint; 3] {
    let sizes = Sizes::of(read.specification());
    let (points, factor) = largest_design(policy.steps());
    [
        Footprint::of("steps", points, factor),
        Footprint::of("specification.problem.radius.paths", sizes.paths, sizes.bridges),
        Footprint::of("specification.problem.horizon", sizes.horizon, steps_bytes(policy.steps())),
    ]
}
