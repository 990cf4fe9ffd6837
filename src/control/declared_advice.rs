//! The first advice of a declared problem: it is read, trained and solved at its start.

use std::collections::BTreeMap;

use serde::Serialize;

use super::bellman::solution::Adversary;
use super::controlled_training::ControlledPolicy;
use super::error::TrainError;
use super::problem::declared::Declared;
use super::progress::Watch;
use super::request::declared::DeclaredSpecification;
use crate::numerics::statistics::summary::range;

/// Least share of the mass that is reported as moved.
const LEAST_MOVED: f64 = 1e-9;

/// The worth falls between two peaks by at least this share of how much it varies. The errors of surrogates are smaller.
const DENT: f64 = 0.01;

/// The first actions, their worth, and the law that is worst for them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeclaredAdvice {
    /// The best actions, by name.
    pub actions: BTreeMap<String, f64>,
    /// Actions along which the worth has several peaks, the others as advised. Many even ones were tried
    /// before a search around the best.
    pub several_peaks: Vec<String>,
    /// V at the start: what all periods earn against the worst law. With a utility its certainty equivalent.
    pub value: f64,
    /// Radius of the ball, in the unit of the noise.
    pub radius: f64,
    /// The worst law of the first period: where the mass of the noises seen goes, ascending. Shares add up to 1.
    pub worst_law: Vec<NoiseMove>,
    /// Value less its lower bound by duality, both of the first step.
    pub duality_gap: f64,
}

/// Mass of the law that is moved from one noise to another, or kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NoiseMove {
    /// The noise seen.
    pub from: f64,
    /// The noise in its place.
    pub to: f64,
    /// Share of the whole mass.
    pub share: f64,
}

impl DeclaredAdvice {
    /// Solves a declared problem on the current rayon pool. Cost: that of a training, in which every design point
    /// prices some hundred actions. Checked by: `tests/solver/declared.rs`.
    ///
    /// # Errors
    /// A field that breaks a rule, a formula among them; a state that leaves its range; those of
    /// [`ControlledPolicy::train`].
    pub fn solve(declared: &DeclaredSpecification, watch: &Watch) -> Result<DeclaredAdvice, TrainError> {
        let problem = Declared::new(&declared.problem)?;
        let specification = problem.specification(declared)?;
        let start = problem.start();
        let policy = ControlledPolicy::train(&problem, &start, &specification, watch);
        // What left its range may have spoilt what was fitted.
        let reached = || problem.fault().map_or(Ok(()), |fault| Err(TrainError::from(fault.clone())));
        reached()?;
        let policy = policy?;
        let law = specification.problem.learning.law(&specification.problem.history);
        let found = policy.solve(0, &start, &law);
        reached()?;
        let found = found.finite(0, 0)?;
        let [low, high] = [-0.5, 0.5].map(|end| problem.noise(end));
        let names = problem.actions_named();
        let along = |place: usize| policy.along(0, (&start, &law), &found.actions, place);
        let has_several = |place: &usize| along(*place).is_some_and(|worths| has_several_peaks(&worths));
        Ok(DeclaredAdvice {
            actions: names.iter().cloned().zip(found.actions.iter().copied()).collect(),
            several_peaks: (0..names.len()).filter(has_several).map(|place| names[place].clone()).collect(),
            value: found.certainty_equivalent,
            radius: policy.radius(&law) * (high - low),
            worst_law: moves(&found.adversary, &problem),
            duality_gap: found.duality_gap,
        })
    }
}

/// Returns true if values rise again after they fell.
fn has_several_peaks(values: &[f64]) -> bool {
    let [least, most] = range(values.iter().copied());
    // The lower of the highest values on both sides, less the value.
    let mut highest_before = f64::NEG_INFINITY;
    (0..values.len()).any(|place| {
        highest_before = highest_before.max(values[place]);
        let highest_after = values[place..].iter().copied().fold(f64::NEG_INFINITY, f64::max);
        highest_before.min(highest_after) - values[place] > DENT * (most - least)
    })
}

fn moves(adversary: &Adversary, problem: &Declared) -> Vec<NoiseMove> {
    let Adversary::Transport { support, moves } = adversary else { return Vec::new() };
    let moved = moves.iter().filter(|moved| moved.mass > LEAST_MOVED);
    let named = moved.map(|moved| NoiseMove {
        from: problem.noise(support[moved.from]),
        to: problem.noise(support[moved.to]),
        share: moved.mass,
    });
    named.collect()
}
