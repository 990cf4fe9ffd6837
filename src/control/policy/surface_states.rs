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

/// Numbers of columns and rows. They are odd, so that the middle of the design is among the points.
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
    names: &'a [String],
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

    /// Returns even values of a quantity over the design.
    fn spread(&self, quantity: &Quantity, count: usize) -> Option<Vec<f64>> {
        let (low, high) = (self.at(quantity, -WIDE)?, self.at(quantity, WIDE)?);
        Some((0..count).map(|index| low + (high - low) * index as f64 / (count - 1) as f64).collect())
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
        let solved = &self.policy().steps()[step];
        if let (Some(stored), Some(policy)) = (solved.solution.surrogates(), &solved.diagnostics.policy) {
            states.cover(&DesignFeatures { names: &policy.features, stored }, across);
        }
        states
    }

    /// Returns the allocations of a column of `states`, row by row, and whether each lies in the design. Cost: that of an
    /// advice by surrogate for each row.
    pub fn surface_column(&self, states: &SurfaceStates, column: usize) -> Vec<(f64, bool)> {
        let of_row = |&mean: &f64| {
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
        let (count, [wealth, deviation]) = (design.stored.count(), AXES.map(Quantity::of));
        self.grid.middle = SurfacePoint {
            wealth: design.at(&wealth, 0.0).map_or(self.grid.own.wealth, |total| self.without_contributions(total)),
            mean: design.at(&MEAN, 0.0).unwrap_or(self.grid.own.mean),
            deviation: design.at(&deviation, 0.0).unwrap_or(self.grid.own.deviation),
        };
        let is_axis = |axis: &SurfaceAxis| {
            design.feature(&Quantity::of(*axis)).is_some() && (*axis == SurfaceAxis::Wealth || self.record.is_free())
        };
        self.grid.axes = AXES.into_iter().filter(is_axis).collect();
        self.grid.across =
            across.filter(|axis| self.grid.axes.contains(axis)).or_else(|| self.grid.axes.first().copied());
        let [columns, rows] = if count.max(self.record.returns.len()) > MANY { FEWER_POINTS } else { POINTS };
        self.grid.means = design.spread(&MEAN, rows).unwrap_or_else(|| vec![self.grid.middle.mean]);
        let observed = |means: &Vec<f64>| means.iter().map(|&mean| self.record.observed(mean)).collect();
        let is_observed = self.grid.means.len() > 1 && !self.record.is_free();
        self.grid.observed_means = is_observed.then_some(&self.grid.means).map(observed);
        let shown = |values: Vec<f64>| -> Vec<f64> {
            if self.grid.across == Some(SurfaceAxis::Wealth) {
                values.into_iter().map(|total| self.without_contributions(total)).collect()
            } else {
                values
            }
        };
        let columns = self.grid.across.and_then(|axis| design.spread(&Quantity::of(axis), columns));
        let columns = columns.map_or_else(|| vec![self.grid.middle.deviation], &shown);
        let points = self.grid.across.map_or_else(Vec::new, |axis| shown(design.points(&Quantity::of(axis))));
        let stride = count.div_ceil(MOST_DESIGN_POINTS).max(1);
        self.grid.design = points.into_iter().zip(design.points(&MEAN)).map(<[f64; 2]>::from).step_by(stride).collect();
        self.grid.columns = columns;
    }

    /// Returns the wealth behind total wealth, which includes the present value of the contributions still to come.
    fn without_contributions(&self, total: f64) -> f64 {
        (total - self.to_come).max(LEAST_WEALTH * self.grid.own.wealth)
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
        let (grid, rows) = (self.grid.clone(), 0..self.grid.means.len());
        let allocations = rows.clone().map(|row| columns.iter().map(|column| column[row].0).collect()).collect();
        let in_design = rows.map(|row| columns.iter().map(|column| column[row].1).collect()).collect();
        Surface { grid, allocations, in_design, advice }
    }
}
