//! Backward induction for a controlled problem whose states one number describes, and whose uncertainty set stands still: on a
//! grid of that number, with cubics between.
//!
//! Checked by: `tests/solver/aims.rs`.

use crate::control::bellman::controlled::{ControlledSolution, ControlledStep};
use crate::control::bellman::controlled_value::ControlledValue;
use crate::control::error::TrainError;
use crate::control::pool;
use crate::control::problem::controlled::Gridded;
use crate::control::request::specification::Specification;
use crate::control::surrogate::features::FeatureSelection;
use crate::control::uncertainty::laws::Laws;

/// The solutions of a step.
pub struct GridStep {
    /// The numbers of the states, ascending.
    pub nodes: Vec<f64>,
    /// One for each.
    pub found: Vec<ControlledSolution>,
}

/// Solves every step, the first at its one state, on the current pool. Cost: a robust step for each node.
///
/// # Errors
/// A robust step that is not finite.
pub fn solve_on_grid<P: Gridded>(
    problem: &P,
    specification: &Specification,
    laws: &Laws,
) -> Result<Vec<GridStep>, TrainError> {
    let selection = FeatureSelection::new(specification, laws);
    let law = specification.problem.learning.law(&specification.problem.history);
    let mut next: Option<ControlledValue> = None;
    let mut steps = Vec::new();
    for step in (0..specification.problem.horizon).rev() {
        let bellman =
            ControlledStep { problem, laws, selection: &selection, step, next: next.as_ref(), radius_scale: 1.0 };
        let nodes = problem.nodes(step);
        let solve =
            |(point, number): (usize, &f64)| bellman.solve(&problem.at(step, *number), &law).finite(step, point);
        let found: Result<Vec<ControlledSolution>, TrainError> =
            pool::map(nodes.iter().enumerate().collect(), solve).into_iter().collect();
        let found = found?;
        let gains = found.iter().map(|found| problem.gain_before(step, found.gain)).collect();
        next = Some(ControlledValue::Tabulated { at: nodes.clone(), gains });
        steps.push(GridStep { nodes, found });
    }
    steps.reverse();
    Ok(steps)
}
