//! Memory for declared problems.

use super::{Footprint, LEAST, Sizes, advising_of, footprint, product};
use crate::control::declared_training::DeclaredTraining;
use crate::control::policy::declared::DeclaredPolicy;
use crate::control::policy::prepared_step::{largest_design, steps_bytes};
use crate::control::request::completion::DEFAULT_COUNT;

/// Bytes of a path for each strategy and each period: its state, its noises, its actions and its worth.
const PATH_BYTES: usize = 512;
/// Bytes of a period that was walked, with the names of its states and actions, in memory and as JSON.
const WALKED_BYTES: usize = 4096;
/// Bytes of a table of gains over the states.
const TABLE_BYTES: usize = 4 << 20;

/// Returns the footprint of the training of a declared problem on so many threads, and of advice by its policy.
pub fn training(training: &DeclaredTraining, threads: usize) -> (Footprint, [Footprint; 3]) {
    let sizes = sizes(training);
    let solving = sizes.solving(threads).saturating_add(product(&[threads, TABLE_BYTES])).saturating_add(LEAST);
    (footprint(&sizes, solving, threads), advising_of(&sizes))
}

fn sizes(training: &DeclaredTraining) -> Sizes {
    let problem = &training.declared().problem;
    let mut sizes = Sizes::of(training.specification());
    sizes.count = training.declared().design.count.unwrap_or(DEFAULT_COUNT);
    sizes.inputs += problem.states.len();
    sizes.functions = 1 + problem.actions.len();
    sizes
}

/// Returns the footprint of a comparison of strategies on so many paths of a horizon. The policies trained before take
/// `policies` bytes, and those of `trainings` what they take when they advise.
pub fn comparison(
    paths: usize,
    strategies: usize,
    horizon: usize,
    policies: usize,
    trainings: &[&DeclaredTraining],
) -> Footprint {
    let path = product(&[strategies + horizon, PATH_BYTES]);
    let trained = trainings.iter().map(|training| {
        let advising = advising_of(&sizes(training));
        advising.iter().fold(0, |sum: usize, part| sum.saturating_add(part.bytes()))
    });
    let policies = trained.fold(policies, usize::saturating_add);
    let simulated = product(&[paths, path]).saturating_add(LEAST);
    Footprint::of("paths", paths, simulated).and("policies", strategies, policies)
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

/// Returns the footprint of a walk-forward of so many decisions, whose `trainings` run side by side, on so many threads.
pub fn walk(trainings: &[DeclaredTraining], decisions: usize, threads: usize) -> Footprint {
    let trained = trainings.iter().map(|first| training(first, threads).0.bytes()).fold(0, usize::saturating_add);
    let walked = product(&[decisions, WALKED_BYTES]).saturating_add(LEAST);
    Footprint::of("frameworks", trainings.len(), trained).and("problem.history", decisions, walked)
}
