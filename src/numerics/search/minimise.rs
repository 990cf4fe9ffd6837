//! Smooth minimisation in a box, and concave maximisation on an interval.

use std::cell::RefCell;
use std::convert::Infallible;

use basin::{
    BoxBounds, ConstraintDescription, ConstraintSet, Constraints, CostFunction, Executor, FirstOrderState, Gradient,
    Lbfgsb, Termination,
};

/// Largest component of the projected gradient at a point that counts as a minimum.
const GRADIENT_TOLERANCE: f64 = 1e-6;
/// The search ends if an accepted step lowers the value by less than this share of it.
const REDUCTION_TOLERANCE: f64 = 1e-9;
/// Inverse of the squared golden ratio: the share of an interval at which Brent's method probes it.
const GOLDEN_SHARE: f64 = 0.381_966_011_250_105_1;
/// Limit on probes: golden sections alone shrink any interval by 1e-20 in this many.
const PROBE_LIMIT: usize = 100;

/// The reason why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchOutcome {
    /// The projected gradient vanished, or the value stopped falling.
    Converged,
    /// The iterations ran out first.
    IterationLimit,
    /// No step lowers the value, although the gradient says that one should.
    Stalled,
}

/// The best point that a search evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// The best point found.
    pub point: Vec<f64>,
    /// The value of the function at this point.
    pub value: f64,
    /// Number of calls of the objective.
    pub evaluations: usize,
    /// The reason why the search ended.
    pub outcome: SearchOutcome,
}

/// A point that a line search tried.
struct Trial {
    point: Vec<f64>,
    value: f64,
    gradient: Vec<f64>,
}

/// State of the search: the last evaluation, so that none is repeated, and the best.
struct SearchState<F> {
    objective: F,
    last: Option<Trial>,
    best: Option<(Vec<f64>, f64)>,
    worst: f64,
    evaluations: usize,
}

impl<F: FnMut(&[f64]) -> (f64, Vec<f64>)> SearchState<F> {
    fn evaluate(&mut self, point: &[f64]) -> &Trial {
        if self.last.as_ref().is_none_or(|last| last.point != point) {
            self.evaluations += 1;
            let (value, gradient) = (self.objective)(point);
            let finite = value.is_finite() && gradient.iter().all(|slope| slope.is_finite());
            let trial = if finite {
                if self.best.as_ref().is_none_or(|best| value < best.1) {
                    self.best = Some((point.to_vec(), value));
                }
                self.worst = self.worst.max(value);
                Trial { point: point.to_vec(), value, gradient }
            } else {
                // The line search needs a finite number to interpolate, so it gets one that it must reject.
                let value = if self.worst.is_finite() { self.worst + 1.0 + self.worst.abs() } else { f64::MAX };
                Trial { point: point.to_vec(), value, gradient: vec![0.0; point.len()] }
            };
            self.last = Some(trial);
        }
        self.last.as_ref().expect("evaluated above")
    }
}

struct BoxProblem<'a, F> {
    record: &'a RefCell<SearchState<F>>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl<F> Constraints for BoxProblem<'_, F> {
    type Set = ConstraintSet<BoxBounds<Vec<f64>>>;

    fn constraints(&self) -> <Self::Set as ConstraintDescription>::Borrowed<'_> {
        ConstraintSet::new().with_bounds(BoxBounds::new(Some(&self.lower), Some(&self.upper)))
    }
}

impl<F: FnMut(&[f64]) -> (f64, Vec<f64>)> CostFunction for BoxProblem<'_, F> {
    type Param = Vec<f64>;
    type Output = f64;
    type Error = Infallible;

    fn cost(&self, point: &Vec<f64>) -> Result<f64, Infallible> {
        Ok(self.record.borrow_mut().evaluate(point).value)
    }
}

impl<F: FnMut(&[f64]) -> (f64, Vec<f64>)> Gradient for BoxProblem<'_, F> {
    type Gradient = Vec<f64>;

    fn gradient(&self, point: &Vec<f64>) -> Result<Vec<f64>, Infallible> {
        Ok(self.record.borrow_mut().evaluate(point).gradient.clone())
    }
}

/// Minimises a smooth function over lower <= x <= upper by L-BFGS-B.
///
/// `objective_and_gradient` returns the value and its gradient, and is called once for each point. A value or slope
/// that is not finite marks a point outside the domain, and the line search retreats from it. `start` is clamped to the
/// box. Returns the best point evaluated, whatever the outcome. An infinite value at the start gives `Stalled` and an
/// infinite `value`.
/// Source: Byrd, Lu, Nocedal and Zhu 1995; Morales and Nocedal 2011, as in the crate basin.
pub fn minimise_bounded(
    objective_and_gradient: impl FnMut(&[f64]) -> (f64, Vec<f64>),
    start: &[f64],
    lower: &[f64],
    upper: &[f64],
    iteration_limit: usize,
) -> Minimum {
    assert!(start.len() == lower.len() && start.len() == upper.len(), "start and bounds differ in length");
    let start: Vec<f64> = start.iter().zip(lower).zip(upper).map(|((x, l), u)| x.max(*l).min(*u)).collect();
    let record = RefCell::new(SearchState {
        objective: objective_and_gradient,
        last: None,
        best: None,
        worst: f64::NEG_INFINITY,
        evaluations: 0,
    });
    record.borrow_mut().evaluate(&start);
    let outcome = if record.borrow().best.is_some() {
        search(&record, &start, lower, upper, iteration_limit)
    } else {
        SearchOutcome::Stalled
    };
    let record = record.into_inner();
    let (point, value) = record.best.unwrap_or((start, f64::INFINITY));
    Minimum { point, value, evaluations: record.evaluations, outcome }
}

fn search<F: FnMut(&[f64]) -> (f64, Vec<f64>)>(
    record: &RefCell<SearchState<F>>,
    start: &[f64],
    lower: &[f64],
    upper: &[f64],
    iteration_limit: usize,
) -> SearchOutcome {
    let problem = BoxProblem { record, lower: lower.to_vec(), upper: upper.to_vec() };
    let solver = Lbfgsb::new()
        .with_absolute_projected_gradient_tolerance(GRADIENT_TOLERANCE)
        .with_relative_cost_reduction_tolerance(REDUCTION_TOLERANCE);
    let run =
        Executor::new(problem, solver, FirstOrderState::new(start.to_vec())).max_iter(iteration_limit as u64).run();
    match run.map(|result| result.report.termination) {
        Ok(Termination::Converged(_)) => SearchOutcome::Converged,
        Ok(Termination::Limit(_)) => SearchOutcome::IterationLimit,
        _ => SearchOutcome::Stalled,
    }
}

/// Maximises a concave function over [low, high] and returns (argmax, maximum).
///
/// Brent's parabolic steps, safeguarded by golden sections, run until the argument is known to within `tolerance`
/// (absolute, > 0). Both ends are also compared, so a maximum at an end is exact. A function that is not concave gets a
/// local maximum no worse than its ends. Needs 3 evaluations at an end, about 10 to 40 inside. Source: Brent 1973,
/// chapter 5.
pub fn maximise_concave_scalar(mut f: impl FnMut(f64) -> f64, low: f64, high: f64, tolerance: f64) -> (f64, f64) {
    let ends = [(low, f(low)), (high, f(high))];
    // If a concave function falls from the better end inwards, that end is the maximum.
    let (best, inward) = if ends[0].1 >= ends[1].1 { (ends[0], tolerance) } else { (ends[1], -tolerance) };
    if high - low <= tolerance || f(best.0 + inward) <= best.1 {
        return best;
    }
    let inner = brent(&mut f, low, high, tolerance);
    ends.into_iter().fold(inner, |best, end| if end.1 >= best.1 || best.1.is_nan() { end } else { best })
}

/// Runs Brent's search on the open interval; `x` is the best probe, `w` the second, `v` the third.
fn brent(f: &mut impl FnMut(f64) -> f64, low: f64, high: f64, tolerance: f64) -> (f64, f64) {
    let (mut a, mut b) = (low, high);
    let mut x = (a + GOLDEN_SHARE * (b - a), 0.0);
    x.1 = f(x.0);
    let (mut w, mut v) = (x, x);
    let (mut step, mut earlier_step) = (0.0_f64, 0.0_f64);
    for _ in 0..PROBE_LIMIT {
        let middle = 0.5 * (a + b);
        let least = 0.5 * tolerance + f64::EPSILON * x.0.abs();
        if (x.0 - middle).abs() <= 2.0 * least - 0.5 * (b - a) {
            break;
        }
        let parabolic = vertex_step(x, w, v);
        let target = x.0 + parabolic;
        let trusted = parabolic.abs() < 0.5 * earlier_step.abs() && target > a && target < b;
        if trusted {
            earlier_step = step;
            step = parabolic;
            if target - a < 2.0 * least || b - target < 2.0 * least {
                step = least.copysign(middle - x.0);
            }
        } else {
            earlier_step = if x.0 < middle { b - x.0 } else { a - x.0 };
            step = GOLDEN_SHARE * earlier_step;
        }
        let at = if step.abs() >= least { x.0 + step } else { x.0 + least.copysign(step) };
        let u = (at, f(at));
        if u.1 >= x.1 {
            if u.0 < x.0 {
                b = x.0
            } else {
                a = x.0
            }
            (v, w, x) = (w, x, u);
        } else {
            if u.0 < x.0 {
                a = u.0
            } else {
                b = u.0
            }
            if u.1 >= w.1 || w.0 == x.0 {
                (v, w) = (w, u);
            } else if u.1 >= v.1 || v.0 == x.0 || v.0 == w.0 {
                v = u;
            }
        }
    }
    x
}

/// Returns the step from x to the vertex of the parabola through three probes; NaN or infinite if there is none.
fn vertex_step(x: (f64, f64), w: (f64, f64), v: (f64, f64)) -> f64 {
    let r = (x.0 - w.0) * (x.1 - v.1);
    let q = (x.0 - v.0) * (x.1 - w.1);
    let p = (x.0 - v.0) * q - (x.0 - w.0) * r;
    -p / (2.0 * (q - r))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rosenbrock(x: &[f64]) -> (f64, Vec<f64>) {
        let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
        (a * a + 100.0 * b * b, vec![-2.0 * a - 400.0 * x[0] * b, 200.0 * b])
    }

    #[test]
    fn rosenbrock_in_a_box_is_solved_inside_and_at_the_wall() {
        let free = minimise_bounded(rosenbrock, &[-1.2, 1.0], &[-2.0, -2.0], &[2.0, 2.0], 200);
        assert_eq!(free.outcome, SearchOutcome::Converged);
        assert!((free.point[0] - 1.0).abs() < 1e-5 && (free.point[1] - 1.0).abs() < 1e-5, "{free:?}");
        let walled = minimise_bounded(rosenbrock, &[-1.2, 1.0], &[-2.0, -2.0], &[0.5, 2.0], 200);
        assert_eq!(walled.outcome, SearchOutcome::Converged);
        assert!((walled.point[0] - 0.5).abs() < 1e-9 && (walled.point[1] - 0.25).abs() < 1e-5, "{walled:?}");
    }

    #[test]
    fn no_point_is_evaluated_twice_and_the_limit_is_reported() {
        let mut seen: Vec<Vec<f64>> = Vec::new();
        let minimum = minimise_bounded(
            |x| {
                assert!(!seen.contains(&x.to_vec()), "{x:?} evaluated twice");
                seen.push(x.to_vec());
                rosenbrock(x)
            },
            &[-1.2, 1.0],
            &[-2.0, -2.0],
            &[2.0, 2.0],
            3,
        );
        assert_eq!(minimum.outcome, SearchOutcome::IterationLimit);
        assert_eq!(minimum.evaluations, seen.len());
    }

    #[test]
    fn an_infinite_value_is_retreated_from() {
        let objective = |x: &[f64]| {
            if x[0] < 0.1 { (f64::INFINITY, vec![f64::NAN]) } else { (x[0] - x[0].ln(), vec![1.0 - 1.0 / x[0]]) }
        };
        let minimum = minimise_bounded(objective, &[9.0], &[-50.0], &[50.0], 100);
        assert!((minimum.point[0] - 1.0).abs() < 1e-4, "{minimum:?}");
        let hopeless = minimise_bounded(objective, &[-3.0], &[-50.0], &[50.0], 100);
        assert_eq!((hopeless.outcome, hopeless.evaluations), (SearchOutcome::Stalled, 1));
    }

    #[test]
    fn a_concave_maximum_is_found_inside_and_at_either_end() {
        let (at, value) = maximise_concave_scalar(|x| -(x - 0.3).powi(2) + 2.0, -1.0, 4.0, 1e-9);
        assert!((at - 0.3).abs() < 1e-7 && (value - 2.0).abs() < 1e-14);
        assert_eq!(maximise_concave_scalar(|x| x, 0.0, 1.0, 1e-9), (1.0, 1.0));
        assert_eq!(maximise_concave_scalar(|x| -x, 0.0, 1.0, 1e-9), (0.0, 0.0));
        assert_eq!(maximise_concave_scalar(|x| x, 2.0, 2.0, 1e-9), (2.0, 2.0));
        let (kink, _) = maximise_concave_scalar(|x| -(x - 0.7_f64).abs(), 0.0, 1.0, 1e-9);
        assert!((kink - 0.7).abs() < 1e-8);
    }
}
