//! Minimisation in a box from a start with known curvature, for functions that are costly to evaluate.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::numerics::search::minimise::{Minimum, SearchOutcome};

/// The share of the predicted decrease that a step must achieve (Armijo).
const SUFFICIENT_SHARE: f64 = 1e-4;
/// The farthest that a coordinate moves in one step, because the quadratic model is not trusted beyond it.
const LONGEST_MOVE: f64 = 1.0;
/// Curvatures are bounded below by this share of the largest, so that no step runs far along a flat direction.
const LEAST_CURVATURE_SHARE: f64 = 1e-4;
/// The most shortenings of a step before the search gives up, and the least share of it that one shortening leaves.
const SHORTENINGS: usize = 10;
const LEAST_SHORTENING: f64 = 0.1;
/// The step of the differences in [`curvature_at`].
const DIFFERENCE: f64 = 1e-3;

/// Returns the second derivatives at `point`, from differences of `gradient` towards the inside of the box,
/// symmetrised.
///
/// `None` if a gradient is `None` or not finite. Cost: one gradient more than there are coordinates.
pub fn curvature_at(
    mut gradient: impl FnMut(&[f64]) -> Option<Vec<f64>>,
    point: &[f64],
    lower: &[f64],
    upper: &[f64],
) -> Option<DMatrix<f64>> {
    let here = DVector::from_vec(gradient(point)?);
    let mut curvature = DMatrix::zeros(point.len(), point.len());
    for (j, mut column) in curvature.column_iter_mut().enumerate() {
        let mut moved = point.to_vec();
        moved[j] += if point[j] + DIFFERENCE <= upper[j] { DIFFERENCE } else { -DIFFERENCE };
        moved[j] = moved[j].max(lower[j]);
        let there = DVector::from_vec(gradient(&moved)?);
        column.copy_from(&((there - &here) / (moved[j] - point[j])));
    }
    let curvature = 0.5 * (&curvature + curvature.transpose());
    curvature.iter().all(|entry| entry.is_finite()).then_some(curvature)
}

/// Minimises a smooth function over lower <= x <= upper by projected quasi-Newton steps from `start`. `curvature` is
/// symmetric and approximates its second derivative near `start`.
///
/// A coordinate that the gradient presses against its bound is held. The others take the Newton step, clamped to the
/// box and shortened until the value falls (Armijo). BFGS then corrects the curvature. The search ends if the quadratic
/// model predicts a decrease of less than `tolerance` (absolute, > 0). `objective_and_gradient` returns the value and
/// its gradient. The search steps back from a value that is not finite; at the start such a value gives `Stalled`.
/// Source: Bertsekas 1982, Projected Newton methods, section 2; Nocedal and Wright 2006, eqs. (3.4), (3.58), (6.19).
pub fn minimise_from(
    mut objective_and_gradient: impl FnMut(&[f64]) -> (f64, Vec<f64>),
    start: &[f64],
    mut curvature: DMatrix<f64>,
    lower: &[f64],
    upper: &[f64],
    tolerance: f64,
    iteration_limit: usize,
) -> Minimum {
    let mut evaluations = 0;
    let mut evaluate = |point: DVector<f64>| {
        evaluations += 1;
        let (value, gradient) = objective_and_gradient(point.as_slice());
        Iterate { point, value, gradient: DVector::from_vec(gradient) }
    };
    let (lower, upper) = (DVector::from_column_slice(lower), DVector::from_column_slice(upper));
    let into_box = |point: DVector<f64>| point.sup(&lower).inf(&upper);
    let mut here = evaluate(into_box(DVector::from_column_slice(start)));
    let outcome = 'search: {
        for _ in 0..iteration_limit {
            if !here.value.is_finite() {
                break 'search SearchOutcome::Stalled;
            }
            let step = newton_step(&curvature, &here, &lower, &upper);
            let mut share = 1.0;
            let mut next = None;
            for _ in 0..SHORTENINGS {
                let trial = into_box(&here.point + share * &step);
                // For a whole step this is twice the decrease that the model predicts.
                let slope = here.gradient.dot(&(&trial - &here.point));
                if -slope <= 2.0 * tolerance * share {
                    break 'search SearchOutcome::Converged;
                }
                let there = evaluate(trial);
                if there.value <= here.value + SUFFICIENT_SHARE * slope {
                    next = Some(there);
                    break;
                }
                // The vertex of the parabola through both values and the slope.
                let vertex = -0.5 * slope / (there.value - here.value - slope);
                share *= if vertex.is_finite() { vertex.clamp(LEAST_SHORTENING, 0.5) } else { LEAST_SHORTENING };
            }
            let Some(there) = next else { break 'search SearchOutcome::Stalled };
            correct(&mut curvature, &(&there.point - &here.point), &(&there.gradient - &here.gradient));
            here = there;
        }
        SearchOutcome::IterationLimit
    };
    Minimum { point: here.point.as_slice().to_vec(), value: here.value, evaluations, outcome }
}

/// A point of the search, with the function's value and gradient there.
struct Iterate {
    point: DVector<f64>,
    value: f64,
    gradient: DVector<f64>,
}

/// Returns -H^-1 g for the free coordinates, H with its eigenvalues made positive, and 0 for those held at a bound.
fn newton_step(curvature: &DMatrix<f64>, here: &Iterate, lower: &DVector<f64>, upper: &DVector<f64>) -> DVector<f64> {
    let Iterate { point, gradient, .. } = here;
    let held = |i: usize| point[i] <= lower[i] && gradient[i] > 0.0 || point[i] >= upper[i] && gradient[i] < 0.0;
    let free: Vec<usize> = (0..point.len()).filter(|&i| !held(i)).collect();
    let mut step = DVector::zeros(point.len());
    if free.is_empty() {
        return step;
    }
    let eigen = SymmetricEigen::new(curvature.select_rows(&free).select_columns(&free));
    let least = LEAST_CURVATURE_SHARE * eigen.eigenvalues.amax().max(f64::MIN_POSITIVE);
    let slopes = eigen.eigenvectors.tr_mul(&gradient.select_rows(&free));
    let lengths = slopes.zip_map(&eigen.eigenvalues, |slope, curvature| -slope / curvature.abs().max(least));
    let moves = eigen.eigenvectors * lengths;
    let shrink = (LONGEST_MOVE / moves.amax()).min(1.0);
    free.iter().zip(&moves).for_each(|(&i, length)| step[i] = shrink * length);
    step
}

/// Applies the BFGS correction after a move along which the gradient `turned`; skips it if the function is not convex
/// there.
fn correct(curvature: &mut DMatrix<f64>, moved: &DVector<f64>, turned: &DVector<f64>) {
    let along = moved.dot(turned);
    let image = &*curvature * moved;
    let expected = moved.dot(&image);
    if along > 0.0 && expected > 0.0 {
        *curvature += turned * turned.transpose() / along - &image * image.transpose() / expected;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a test function with two wells in x, and a bent valley along them.
    fn valley(x: &[f64]) -> (f64, Vec<f64>) {
        let (a, b) = (x[0] * x[0] - 1.0, x[1] - 0.5 * x[0]);
        (a * a + 3.0 * b * b, vec![4.0 * x[0] * a - 3.0 * b, 6.0 * b])
    }

    fn curvature_of_valley(x: &[f64]) -> DMatrix<f64> {
        DMatrix::from_row_slice(2, 2, &[12.0 * x[0] * x[0] - 4.0 + 1.5, -3.0, -3.0, 6.0])
    }

    const WIDE: ([f64; 2], [f64; 2]) = ([-5.0, -5.0], [5.0, 5.0]);

    #[test]
    fn differences_of_the_gradient_are_the_second_derivatives() {
        // The gradient is cubic, so a forward difference errs by half the third derivative times its step.
        for point in [[1.2, 0.3], [5.0, -5.0]] {
            let found = curvature_at(|x| Some(valley(x).1), &point, &WIDE.0, &WIDE.1).unwrap();
            let error = (found - curvature_of_valley(&point)).amax();
            assert!(error < 0.5 * 24.0 * point[0] * DIFFERENCE * 1.01, "{error} at {point:?}");
        }
        assert_eq!(curvature_at(|_| Some(vec![f64::NAN; 2]), &[0.0; 2], &WIDE.0, &WIDE.1), None);
        assert_eq!(curvature_at(|_| None, &[0.0; 2], &WIDE.0, &WIDE.1), None);
    }

    #[test]
    fn a_quadratic_takes_one_step_and_a_bound_holds_its_coordinate() {
        let centre = [1.0, -2.0];
        let matrix = [[4.0, 1.0], [1.0, 2.0]];
        let quadratic = |x: &[f64]| {
            let d = [x[0] - centre[0], x[1] - centre[1]];
            let slope = [matrix[0][0] * d[0] + matrix[0][1] * d[1], matrix[1][0] * d[0] + matrix[1][1] * d[1]];
            (0.5 * (d[0] * slope[0] + d[1] * slope[1]), slope.to_vec())
        };
        let curvature = DMatrix::from_row_slice(2, 2, &matrix.concat());
        let free = minimise_from(quadratic, &[0.5, -1.5], curvature.clone(), &WIDE.0, &WIDE.1, 1e-9, 20);
        assert_eq!((free.outcome, free.evaluations), (SearchOutcome::Converged, 2));
        assert!((free.point[0] - 1.0).abs() < 1e-12 && (free.point[1] + 2.0).abs() < 1e-12, "{free:?}");
        // With x_0 <= 0: 2 (x_1 + 2) = 1 at x_0 = 0.
        let walled = minimise_from(quadratic, &[-0.5, -1.5], curvature, &WIDE.0, &[0.0, 5.0], 1e-12, 20);
        assert_eq!(walled.outcome, SearchOutcome::Converged);
        assert!(walled.point[0] == 0.0 && (walled.point[1] + 1.5).abs() < 1e-6, "{walled:?}");
    }

    #[test]
    fn a_curvature_that_is_wrong_or_indefinite_still_leads_down_to_the_minimum() {
        for (start, curvature) in [
            ([1.5, 0.0], curvature_of_valley(&[1.5, 0.0])),
            ([0.1, 2.0], curvature_of_valley(&[0.1, 2.0])),
            ([1.5, 0.0], DMatrix::identity(2, 2) * 0.01),
            ([1.5, 0.0], DMatrix::identity(2, 2) * 1e4),
        ] {
            let found = minimise_from(valley, &start, curvature, &WIDE.0, &WIDE.1, 1e-10, 200);
            assert!(found.value < 1e-8 && found.outcome == SearchOutcome::Converged, "{found:?} from {start:?}");
            assert!((found.point[0] - 1.0).abs() < 1e-4 && (found.point[1] - 0.5).abs() < 1e-4, "{found:?}");
        }
    }

    #[test]
    fn outside_the_domain_it_steps_back_and_at_the_start_it_gives_up() {
        let objective = |x: &[f64]| {
            if x[0] < 0.1 { (f64::INFINITY, vec![f64::NAN]) } else { (x[0] - x[0].ln(), vec![1.0 - 1.0 / x[0]]) }
        };
        let flat = DMatrix::from_element(1, 1, 0.5);
        let found = minimise_from(objective, &[2.0], flat.clone(), &[-50.0], &[50.0], 1e-12, 100);
        assert!((found.point[0] - 1.0).abs() < 1e-5, "{found:?}");
        let hopeless = minimise_from(objective, &[-3.0], flat.clone(), &[-50.0], &[50.0], 1e-12, 100);
        assert_eq!((hopeless.outcome, hopeless.evaluations), (SearchOutcome::Stalled, 1));
        let short = minimise_from(objective, &[9.0], flat, &[-50.0], &[50.0], 1e-12, 1);
        assert_eq!(short.outcome, SearchOutcome::IterationLimit);
    }
}
