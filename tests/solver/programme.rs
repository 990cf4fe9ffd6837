//! Linear and quadratic programmes, against a simplex method and by their conditions of optimality.

use ballast::numerics::machine::streams::stream;
use ballast::numerics::search::programme::{LinearBound, QuadraticProgramme};
use microlp::{ComparisonOp, LinearExpr, OptimizationDirection, Problem, SolveOutcome};
use rand::{Rng, RngExt};

/// Bounds are kept up to this, even if they leave no interior; and what that changes of a value, in units of the slopes.
const ROUNDING: f64 = 1e-9;
const OFF: f64 = 1e-7;

/// Draws bounds that a random point of the simplex keeps, some of them as equations.
fn drawn(random: &mut impl Rng, size: usize) -> Vec<LinearBound> {
    let draws: Vec<f64> = (0..size).map(|_| random.random::<f64>().powi(2) + 1e-3).collect();
    let sum: f64 = draws.iter().sum();
    let inside: Vec<f64> = draws.iter().map(|share| share / sum).collect();
    let unit = |index: usize, sign: f64, limit: f64| LinearBound { terms: vec![(index, sign)], limit };
    let mut bounds: Vec<LinearBound> = (0..size).map(|index| unit(index, -1.0, 0.0)).collect();
    bounds.extend((0..size).map(|index| unit(index, 1.0, 1.0)));
    for _ in 0..random.random_range(0..6) {
        let mut terms: Vec<(usize, f64)> = (0..size).map(|index| (index, 1.0)).collect();
        terms.retain(|_| random.random::<f64>() < 0.5);
        let sign = [1.0, -1.0][random.random_range(0..2)];
        terms.iter_mut().for_each(|(_, coefficient)| *coefficient = sign);
        let mut bound = LinearBound { terms, limit: 0.0 };
        let kept = bound.at(&inside);
        bound.limit = kept + [0.0, 0.05 * random.random::<f64>()][random.random_range(0..2)];
        if random.random::<f64>() < 0.2 {
            let terms = bound.terms.iter().map(|(index, coefficient)| (*index, -coefficient)).collect();
            bounds.push(LinearBound { terms, limit: -kept });
        }
        bounds.push(bound);
    }
    bounds
}

/// All unknowns sum to 1.
fn whole(size: usize) -> LinearBound {
    LinearBound { terms: (0..size).map(|index| (index, 1.0)).collect(), limit: 1.0 }
}

#[test]
fn linear_programmes_have_the_values_of_a_simplex_method() {
    let mut random = stream(3, "linear", 0, 0);
    for case in 0..300 {
        let size = random.random_range(1..=30);
        let bounds = drawn(&mut random, size);
        let scale = 10f64.powf(6.0 * random.random::<f64>() - 3.0);
        let linear: Vec<f64> = (0..size).map(|_| scale * (random.random::<f64>() - 0.5)).collect();
        let equations = vec![whole(size)];
        let programme = QuadraticProgramme { quadratic: Vec::new(), linear: linear.clone(), bounds, equations };
        let solution = programme.solve();
        let found: f64 = solution.point.iter().zip(&linear).map(|(x, slope)| x * slope).sum();
        let bound = programme.least(&solution, &vec![[0.0, 1.0]; size]);
        let mut simplex = Problem::new(OptimizationDirection::Minimize);
        let unknowns: Vec<_> = linear.iter().map(|slope| simplex.add_var(*slope, (0.0, 1.0))).collect();
        let expression = |terms: &[(usize, f64)]| {
            let mut expression = LinearExpr::empty();
            terms.iter().for_each(|(index, coefficient)| expression.add(unknowns[*index], *coefficient));
            expression
        };
        simplex.add_constraint(expression(&whole(size).terms), ComparisonOp::Eq, 1.0);
        for bound in &programme.bounds[2 * size..] {
            simplex.add_constraint(expression(&bound.terms), ComparisonOp::Le, bound.limit + ROUNDING);
        }
        let SolveOutcome::Solution(best) = simplex.solve().unwrap() else { unreachable!("no limit is set") };
        let expected = best.objective();
        assert!((found - expected).abs() < OFF * scale, "{case}: {found} {expected}");
        assert!(bound < expected + OFF * scale && found - bound < OFF * scale, "{case}: {bound} {found}");
        for bound in &programme.bounds {
            assert!(bound.at(&solution.point) < bound.limit + ROUNDING, "{case}: {bound:?} {solution:?}");
        }
    }
}

/// At the nearest point of a convex set, no way into the set leads closer.
#[test]
fn nearest_points_have_no_way_that_leads_closer() {
    let mut random = stream(4, "nearest", 0, 0);
    for case in 0..200 {
        let size = random.random_range(2..=20);
        let bounds = drawn(&mut random, size);
        let from: Vec<f64> = (0..size).map(|_| random.random::<f64>()).collect();
        let mut quadratic = vec![0.0; size * size];
        (0..size).for_each(|index| quadratic[index * size + index] = 1.0);
        let linear: Vec<f64> = from.iter().map(|x| -x).collect();
        let equations = vec![whole(size)];
        let programme = QuadraticProgramme { quadratic, linear, bounds, equations };
        let nearest = programme.solve().point;
        for bound in &programme.bounds {
            assert!(bound.at(&nearest) < bound.limit + ROUNDING, "{case}: {bound:?} {nearest:?}");
        }
        let slopes: Vec<f64> = nearest.iter().zip(&from).map(|(x, from)| x - from).collect();
        let linear = QuadraticProgramme { quadratic: Vec::new(), linear: slopes.clone(), ..programme };
        let least = linear.least(&linear.solve(), &vec![[0.0, 1.0]; size]);
        let here: f64 = nearest.iter().zip(&slopes).map(|(x, slope)| x * slope).sum();
        assert!(here - least < OFF, "{case}: {here} {least}");
    }
}
