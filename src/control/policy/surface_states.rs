//! The states of a policy's surface, and the allocations there.
//!
//! Each is a state that a session may reach: radius and features follow from its law, as in a session. The policy's own
//! record goes on with its own returns from the oldest on. If all sessions start from that record, the returns after it
//! are shifted to another mean. Otherwise the whole is, and it is stretched to another standard deviation as well.
//! Checked by: `tests/service/surface.rs`.

use super::advice::Advice;
use super::advisor::{AdviceMode, Advisor};
use super::surface::{Surface, SurfaceAxis, SurfaceGrid, SurfacePoint};
use crate::control::problem::state::State;
use crate::control::request::learning::SMALLEST_DEVIATION;
use crate::control::request::rules::{LOG_RETURN, WEALTH};
use crate::control::request::specification::{InitialLaws, ProblemSpecification, Specification};
use crate::control::surrogate::stored::StepSurrogates;
use crate::numerics::law::moments::CentralMoments;
use crate::numerics::machine::interruption;
use crate::numerics::search::chebyshev;

/// Numbers of columns and rows.
const POINTS: [usize; 2] = [21, 31];
/// With more design points or returns than this a state takes milliseconds, so fewer are shown.
const MANY: usize = 2000;
const FEWER_POINTS: [usize; 2] = [11, 11];
/// Standard deviations of the design on either side of its middle.
const WIDE: f64 = 2.5;
/// Design points shown; more would hide the surface.
const MOST_DESIGN_POINTS: usize = 300;
/// The least wealth shown, as a share of the initial one.
const LEAST_WEALTH: f64 = 0.01;

/// The policy's record, continued with its own returns.
#[derive(Debug, Clone, PartialEq)]
struct ContinuedRecord {
    /// All log-returns, oldest first.
    returns: Vec<f64>,
    /// How many of the newest are shifted, and their share of the weight.
    moved: usize,
    share: f64,
    /// Mean and standard deviation of all, and mean of those that stay.
    mean: f64,
    deviation: f64,
    kept_mean: f64,
}

impl ContinuedRecord {
    fn of(problem: &ProblemSpecification, step: usize, initial_laws: InitialLaws) -> Self {
        let history = &problem.history;
        let returns: Vec<f64> = history.iter().copied().cycle().take(history.len() + step).collect();
        let law = |values: &[f64]| problem.learning.law(values);
        let moved = if initial_laws == InitialLaws::Given && step > 0 { step } else { returns.len() };
        let (kept, new) = returns.split_at(returns.len() - moved);
        let all = law(&returns);
        let moments = CentralMoments::of(&all);
        ContinuedRecord {
            moved,
            share: law(new).total_weight() / all.total_weight(),
            mean: moments.mean(),
            deviation: moments.variance().sqrt(),
            kept_mean: if kept.is_empty() { 0.0 } else { CentralMoments::of(&law(kept)).mean() },
            returns,
        }
    }

    /// Returns true if all returns are shifted.
    fn is_free(&self) -> bool {
        self.moved == self.returns.len()
    }

    /// Returns the mean of the shifted returns if that of all is `mean`.
    fn observed(&self, mean: f64) -> f64 {
        (mean - (1.0 - self.share) * self.kept_mean) / self.share
    }

    /// Returns the record with this mean and, if all are shifted, this standard deviation.
    fn at(&self, mean: f64, deviation: f64) -> Vec<f64> {
        let stretch = if self.is_free() { deviation / self.deviation } else { 1.0 };
        let (own, new) = (self.observed(self.mean), self.observed(mean));
        let (kept, moved) = self.returns.split_at(self.returns.len() - self.moved);
        let shifted = moved.iter().map(|value| (new + stretch * (value - own)).clamp(-LOG_RETURN, LOG_RETURN));
        kept.iter().copied().chain(shifted).collect()
    }
}

/// A quantity of a state among the features of a design: the names that its feature may have, and the range of values
/// shown.
struct Quantity {
    names: &'static [&'static str],
    range: (f64, f64),
}

const MEAN: Quantity = Quantity { names: &["mean", "moment_1"], range: (-LOG_RETURN, LOG_RETURN) };

/// The features of a design in their own units.
struct DesignFeatures<'a> {
    /// The names of its features, in the order of the inputs.
    names: Vec<String>,
    stored: &'a StepSurrogates,
}

const AXES: [SurfaceAxis; 2] = [SurfaceAxis::Wealth, SurfaceAxis::Deviation];

impl Quantity {
    fn of(axis: SurfaceAxis) -> Self {
        match axis {
            SurfaceAxis::Wealth => Quantity { names: &["log_wealth", "wealth"], range: WEALTH },
            SurfaceAxis::Deviation => {
                Quantity { names: &["log_standard_deviation"], range: (SMALLEST_DEVIATION, LOG_RETURN) }
            }
        }
    }
}

/// The states of a surface.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceStates {
    grid: SurfaceGrid,
    record: ContinuedRecord,
    /// Present value of the contributions still to come, which the surrogates count as wealth.
    to_come: f64,
}

impl DesignFeatures<'_> {
    /// Returns the index of the feature that gives a quantity.
    fn feature(&self, quantity: &Quantity) -> Option<usize> {
        self.names.iter().position(|name| quantity.names.contains(&name.as_str()))
    }

    /// Returns a quantity so many standard deviations from the middle of the design.
    fn at(&self, quantity: &Quantity, deviations: f64) -> Option<f64> {
        let index = self.feature(quantity)?;
        let value = self.stored.scaling.centre[index] + deviations * self.stored.scaling.spread[index];
        let value = if self.names[index].starts_with("log_") { value.exp() } else { value };
        // An imported policy may contain any number.
        Some(value.clamp(quantity.range.0, quantity.range.1))
    }

    /// Returns the ends of a quantity over the design.
    fn ends(&self, quantity: &Quantity) -> Option<[f64; 2]> {
        Some([self.at(quantity, -WIDE)?, self.at(quantity, WIDE)?])
    }

    /// Returns a quantity at every design point.
    fn points(&self, quantity: &Quantity) -> Vec<f64> {
        let Some(index) = self.feature(quantity) else { return Vec::new() };
        self.stored.inputs[index].iter().filter_map(|&input| self.at(quantity, input)).collect()
    }
}

impl Advisor {
    /// Returns the states of a surface after `step` observed periods, which must be below the horizon. Its rows differ in
    /// the mean, its columns in `across`, or in the first of the axes if it is none of them.
    pub fn surface_states(&self, step: usize, across: Option<SurfaceAxis>) -> SurfaceStates {
        let Specification { problem, design, .. } = self.specification();
        let record = ContinuedRecord::of(problem, step, design.initial_laws);
        let own = SurfacePoint { wealth: problem.initial_wealth, mean: record.mean, deviation: record.deviation };
        let grid = SurfaceGrid {
            step,
            axes: Vec::new(),
            across: None,
            columns: vec![own.deviation],
            means: vec![own.mean],
            observed_means: None,
            design: Vec::new(),
            middle: own,
            own,
        };
        let mut states = SurfaceStates { grid, record, to_come: self.problem.dynamics(step).to_come };
        if let Some(stored) = self.policy().steps()[step].solution.surrogates() {
            let names = self.problem.selection.names();
            let names = stored.scaling.active.iter().map(|&feature| names[feature].clone()).collect();
            states.cover(&DesignFeatures { names, stored }, across);
        }
        states
    }

    /// Returns the allocations of a column of `states`, row by row, and whether each lies in the design. Cost: that of an
    /// advice by surrogate for each row, and once for each step the factor that the predicted deviations need.
    pub fn surface_column(&self, states: &SurfaceStates, column: usize) -> Vec<(f64, bool)> {
        let of_row = |&mean: &f64| {
            interruption::checkpoint();
            let point = states.point(column, mean);
            let law = self.specification().problem.learning.law(&states.record.at(point.mean, point.deviation));
            let state = State { wealth: point.wealth, holding: 0.0, law };
            let predicted = self.predict(states.grid.step, &state, self.radius(&state));
            (predicted.band.nearest(state.holding), predicted.in_design)
        };
        states.grid.means.iter().map(of_row).collect()
    }

    /// Returns the advice after the policy's own record went on with its own returns and wealth did not change.
    pub fn own_advice(&self, states: &SurfaceStates) -> Advice {
        let problem = &self.specification().problem;
        let law = problem.learning.law(&states.record.returns);
        let state = State { wealth: problem.initial_wealth, holding: 0.0, law };
        self.advise(states.grid.step, &state, AdviceMode::Surrogate)
    }
}

impl SurfaceStates {
    /// Returns the number of columns.
    pub fn columns(&self) -> usize {
        self.grid.columns.len()
    }

    fn cover(&mut self, design: &DesignFeatures<'_>, across: Option<SurfaceAxis>) {
        let (own, count) = (self.grid.own, design.stored.count());
        let middle = |axis, own: f64| design.at(&Quantity::of(axis), 0.0).map_or(own, |value| self.shown(axis, value));
        self.grid.middle = SurfacePoint {
            wealth: middle(SurfaceAxis::Wealth, own.wealth),
            mean: design.at(&MEAN, 0.0).unwrap_or(own.mean),
            deviation: middle(SurfaceAxis::Deviation, own.deviation),
        };
        let is_axis = |axis: &SurfaceAxis| {
            design.feature(&Quantity::of(*axis)).is_some() && (*axis == SurfaceAxis::Wealth || self.record.is_free())
        };
        self.grid.axes = AXES.into_iter().filter(is_axis).collect();
        let [columns, rows] = if count.max(self.record.returns.len()) > MANY { FEWER_POINTS } else { POINTS };
        let means = design.ends(&MEAN).and_then(|ends| even(ends, rows));
        self.grid.means = means.unwrap_or_else(|| vec![self.grid.middle.mean]);
        let is_observed = self.grid.means.len() > 1 && !self.record.is_free();
        let observed = |means: &Vec<f64>| means.iter().map(|&mean| self.record.observed(mean)).collect();
        self.grid.observed_means = is_observed.then_some(&self.grid.means).map(observed);
        let across = across.filter(|axis| self.grid.axes.contains(axis)).or_else(|| self.grid.axes.first().copied());
        let ends = |axis| design.ends(&Quantity::of(axis)).map(|ends| ends.map(|end| self.shown(axis, end)));
        let values = across.and_then(|axis| even(ends(axis)?, columns));
        self.grid.across = across.filter(|_| values.is_some());
        self.grid.columns = values.unwrap_or_else(|| vec![self.grid.middle.deviation]);
        let points = |axis| design.points(&Quantity::of(axis)).into_iter().map(move |value| (axis, value));
        let points = self.grid.across.into_iter().flat_map(points).map(|(axis, value)| self.shown(axis, value));
        let stride = count.div_ceil(MOST_DESIGN_POINTS).max(1);
        self.grid.design = points.zip(design.points(&MEAN)).map(<[f64; 2]>::from).step_by(stride).collect();
    }

    /// Returns a value of an axis as it is shown: wealth without the present value of the contributions still to come.
    fn shown(&self, axis: SurfaceAxis, value: f64) -> f64 {
        match axis {
            SurfaceAxis::Wealth => (value - self.to_come).max(LEAST_WEALTH * self.grid.own.wealth),
            SurfaceAxis::Deviation => value,
        }
    }

    fn point(&self, column: usize, mean: f64) -> SurfacePoint {
        let value = self.grid.columns[column];
        match self.grid.across {
            Some(SurfaceAxis::Wealth) => SurfacePoint { wealth: value, mean, ..self.grid.middle },
            Some(SurfaceAxis::Deviation) => SurfacePoint { deviation: value, mean, ..self.grid.middle },
            None => SurfacePoint { mean, ..self.grid.middle },
        }
    }

    /// Returns the surface of these columns, each as from [`Advisor::surface_column`].
    pub fn surface(self, columns: &[Vec<(f64, bool)>], advice: Advice) -> Surface {
        let rows = 0..self.grid.means.len();
        let allocations = rows.clone().map(|row| columns.iter().map(|column| column[row].0).collect()).collect();
        let in_design = rows.map(|row| columns.iter().map(|column| column[row].1).collect()).collect();
        Surface { grid: self.grid, allocations, in_design, advice }
    }
}

/// Returns even values between two ends; `None` if they are no interval.
fn even([low, high]: [f64; 2], count: usize) -> Option<Vec<f64>> {
    (high > low).then(|| chebyshev::even(low, high, count))
}
