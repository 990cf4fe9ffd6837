//! Convex quadratic programmes of up to some hundred unknowns, and linear ones:
//!
//!   min  x' H x / 2 + c . x    over x,    G x <= h,  E x = b,
//!
//! by Mehrotra's predictor-corrector method, which starts outside the bounds. It keeps slacks `s = h - G x` and
//! multipliers z of the bounds positive and drives `s z` to 0. The bounds may leave no interior. Source: Nocedal and
//! Wright (2006), Numerical Optimization, chapter 14 and section 16.6. Checked by: `tests/solver/programme.rs`.

use nalgebra::DMatrix;

use crate::numerics::gp::cholesky::Cholesky;

/// Largest number of steps; most programmes need 8 to 20.
const STEPS: usize = 80;
/// Mean product of slack and multiplier, and residual, at which the search ends; the objective is scaled to slopes of 1.
const TOLERANCE: f64 = 1e-14;
/// Residuals of all equations at most this are solved.
const RESIDUAL: f64 = 1e-13;
/// A search that ends with more is repeated with bounds that are wider by this.
const SOLVED: f64 = 1e-10;
const WIDENED: f64 = 2e-10;
/// Steps keep this share of the distance to a bound.
const TO_BOUND: f64 = 0.995;
/// A shorter step makes no progress.
const LEAST_LENGTH: f64 = 1e-10;
/// Shares of the diagonal that are added to the matrix until all pivots are above rounding.
const DAMPINGS: [f64; 4] = [0.0, 1e-14, 1e-12, 1e-9];

/// `sum coefficient x[index] <= limit`, or its equation.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearBound {
    /// Index and coefficient of each unknown that counts.
    pub terms: Vec<(usize, f64)>,
    /// The right-hand side.
    pub limit: f64,
}

/// A programme.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadraticProgramme {
    /// H, row by row, positive semidefinite; empty for a linear programme.
    pub quadratic: Vec<f64>,
    /// c, one for each unknown.
    pub linear: Vec<f64>,
    /// G and h. Together they bound every unknown.
    pub bounds: Vec<LinearBound>,
    /// E and b: an equation that follows from others is allowed.
    pub equations: Vec<LinearBound>,
}

/// The solution of a programme, as far as the search came.
#[derive(Debug, Clone, PartialEq)]
pub struct ProgrammeSolution {
    /// x.
    pub point: Vec<f64>,
    /// z, one for each bound, at least 0.
    pub multipliers: Vec<f64>,
    /// The multipliers of the equations.
    pub equation_multipliers: Vec<f64>,
}

impl LinearBound {
    /// Returns the left-hand side at a point.
    pub fn at(&self, point: &[f64]) -> f64 {
        self.terms.iter().map(|(index, coefficient)| coefficient * point[*index]).sum()
    }
}

/// Adds the transposed rows times `values` to `sums`.
fn add_transposed(rows: &[LinearBound], values: &[f64], sums: &mut [f64]) {
    for (row, value) in rows.iter().zip(values) {
        row.terms.iter().for_each(|(index, coefficient)| sums[*index] += coefficient * value);
    }
}

/// Factors a symmetric matrix, damped until all pivots are above rounding.
fn factor(matrix: &DMatrix<f64>) -> Option<Cholesky> {
    DAMPINGS.iter().find_map(|damping| {
        let mut damped = matrix.clone();
        (0..damped.nrows()).for_each(|index| damped[(index, index)] *= 1.0 + damping);
        Cholesky::factor(damped)
    })
}

/// The factors of `K = H + G' (z / s) G` and of `E K^-1 E'`, whose columns `K^-1 E'` are kept.
struct Factors {
    whole: Cholesky,
    columns: Vec<Vec<f64>>,
    of_equations: Option<Cholesky>,
}

/// The iterate of the search, or a step of it.
#[derive(Debug, Clone)]
struct InteriorPoint {
    point: Vec<f64>,
    slacks: Vec<f64>,
    multipliers: Vec<f64>,
    equations: Vec<f64>,
}

/// How far the iterate is from solving the equations.
struct Residuals {
    slopes: Vec<f64>,
    bounds: Vec<f64>,
    equations: Vec<f64>,
    /// The mean product of slack and multiplier.
    product: f64,
}

impl Residuals {
    fn largest(&self) -> f64 {
        let all = self.slopes.iter().chain(&self.bounds).chain(&self.equations);
        all.fold(0.0, |largest: f64, residual| largest.max(residual.abs()))
    }

    fn is_solved(&self) -> bool {
        self.product < TOLERANCE && self.largest() < RESIDUAL
    }
}

impl QuadraticProgramme {
    /// Solves the programme. Bounds that leave no interior are widened a little if that is needed. Without a feasible point, or if rounding ends the search early, the point is the nearest
    /// one reached: bounds by [`Self::least`] hold in any case. Cost: O(n^3 + sum of squared terms) for each step.
    pub fn solve(&self) -> ProgrammeSolution {
        let steepest = self.linear.iter().chain(&self.quadratic).fold(0.0, |most: f64, entry| most.max(entry.abs()));
        let scale = if steepest > 0.0 { steepest.recip() } else { 1.0 };
        let scaled = QuadraticProgramme {
            quadratic: self.quadratic.iter().map(|entry| entry * scale).collect(),
            linear: self.linear.iter().map(|entry| entry * scale).collect(),
            ..self.clone()
        };
        let (merit, found) = scaled.search();
        let mut best = (merit, found);
        if merit > SOLVED {
            let widened = |bound: &LinearBound| LinearBound { limit: bound.limit + WIDENED, ..bound.clone() };
            let bounds = self.bounds.iter().map(widened).collect();
            let again = QuadraticProgramme { bounds, ..scaled }.search();
            best = if again.0 < merit { again } else { best };
        }
        let InteriorPoint { point, multipliers, equations, .. } = best.1;
        ProgrammeSolution {
            point,
            multipliers: multipliers.iter().map(|multiplier| multiplier / scale).collect(),
            equation_multipliers: equations.iter().map(|multiplier| multiplier / scale).collect(),
        }
    }

    /// Returns a lower bound on the value of a linear programme whose unknowns lie in these intervals, by weak duality:
    ///
    ///   c . x  >=  (c + G' z + E' y) . x - z . h - y . b   for every z >= 0, y and feasible x.
    ///
    /// It is the value up to rounding if the solution is one.
    pub fn least(&self, solution: &ProgrammeSolution, intervals: &[[f64; 2]]) -> f64 {
        let mut slopes = self.linear.clone();
        let mut value = 0.0;
        let bounds = self.bounds.iter().zip(&solution.multipliers);
        for (bound, multiplier) in bounds.chain(self.equations.iter().zip(&solution.equation_multipliers)) {
            bound.terms.iter().for_each(|(index, coefficient)| slopes[*index] += multiplier * coefficient);
            value -= multiplier * bound.limit;
        }
        let least = |(slope, [low, high]): (&f64, &[f64; 2])| (slope * low).min(slope * high);
        value + slopes.iter().zip(intervals).map(least).sum::<f64>()
    }

    /// Returns the end of the search, after what it misses: residuals and the product of slacks and multipliers.
    fn search(&self) -> (f64, InteriorPoint) {
        let start = vec![0.0; self.linear.len()];
        let slacks: Vec<f64> = self.bounds.iter().map(|bound| (bound.limit - bound.at(&start)).max(1.0)).collect();
        let multipliers = vec![1.0; slacks.len()];
        let equations = vec![0.0; self.equations.len()];
        let mut at = InteriorPoint { point: start, slacks, multipliers, equations };
        let mut best = (f64::INFINITY, at.clone());
        for _ in 0..STEPS {
            let residuals = self.residuals(&at);
            let merit = residuals.product + residuals.largest();
            if merit < best.0 {
                best = (merit, at.clone());
            }
            if residuals.is_solved() {
                break;
            }
            let Some(next) = self.next(&at, &residuals) else { break };
            at = next;
        }
        best
    }

    fn residuals(&self, at: &InteriorPoint) -> Residuals {
        let size = self.linear.len();
        let mut slopes = self.linear.clone();
        for (slope, row) in slopes.iter_mut().zip(self.quadratic.chunks_exact(size)) {
            *slope += row.iter().zip(&at.point).map(|(entry, x)| entry * x).sum::<f64>();
        }
        add_transposed(&self.bounds, &at.multipliers, &mut slopes);
        add_transposed(&self.equations, &at.equations, &mut slopes);
        let bounds = self.bounds.iter().zip(&at.slacks).map(|(bound, slack)| bound.at(&at.point) + slack - bound.limit);
        let equations = self.equations.iter().map(|equation| equation.at(&at.point) - equation.limit).collect();
        Residuals { slopes, bounds: bounds.collect(), equations, product: at.product() }
    }

    /// Takes the predictor and the corrector. `None` if no step can be computed, or the step is of no length.
    fn next(&self, at: &InteriorPoint, residuals: &Residuals) -> Option<InteriorPoint> {
        let factors = self.factors(at)?;
        let products = |corrected: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..at.slacks.len()).map(|index| at.slacks[index] * at.multipliers[index] + corrected(index)).collect()
        };
        let affine = self.step(at, residuals, &factors, &products(&|_| 0.0));
        let tried = at.along(&affine, at.lengths(&affine, 1.0, self.is_linear()));
        let centring = (tried.product() / residuals.product).powi(3);
        let target = centring * residuals.product;
        let corrected = products(&|index| affine.slacks[index] * affine.multipliers[index] - target);
        let step = self.step(at, residuals, &factors, &corrected);
        let lengths = at.lengths(&step, TO_BOUND, self.is_linear());
        let next = at.along(&step, lengths);
        (lengths.0.max(lengths.1) > LEAST_LENGTH && next.is_finite()).then_some(next)
    }

    fn is_linear(&self) -> bool {
        self.quadratic.is_empty()
    }

    fn factors(&self, at: &InteriorPoint) -> Option<Factors> {
        let size = self.linear.len();
        let mut matrix = match self.is_linear() {
            true => DMatrix::zeros(size, size),
            false => DMatrix::from_row_slice(size, size, &self.quadratic),
        };
        for (bound, (slack, multiplier)) in self.bounds.iter().zip(at.slacks.iter().zip(&at.multipliers)) {
            let weight = multiplier / slack;
            for (column, left) in &bound.terms {
                for (row, right) in &bound.terms {
                    matrix[(*row, *column)] += weight * left * right;
                }
            }
        }
        let whole = factor(&matrix)?;
        let column = |equation: &LinearBound| {
            let mut row = vec![0.0; size];
            equation.terms.iter().for_each(|(index, coefficient)| row[*index] = *coefficient);
            whole.solve(&row)
        };
        let columns: Vec<Vec<f64>> = self.equations.iter().map(column).collect();
        let count = columns.len();
        let between = DMatrix::from_fn(count, count, |row, column| self.equations[row].at(&columns[column]));
        let of_equations = if count > 0 { Some(factor(&between)?) } else { None };
        Some(Factors { whole, columns, of_equations })
    }

    /// Solves for the step that removes the residuals to first order, and of `s z` these `products`.
    fn step(&self, at: &InteriorPoint, residuals: &Residuals, factors: &Factors, products: &[f64]) -> InteriorPoint {
        let (slacks, multipliers) = (&at.slacks, &at.multipliers);
        let mut right: Vec<f64> = residuals.slopes.iter().map(|slope| -slope).collect();
        let of_bounds: Vec<f64> =
            (0..slacks.len()).map(|i| (products[i] - multipliers[i] * residuals.bounds[i]) / slacks[i]).collect();
        add_transposed(&self.bounds, &of_bounds, &mut right);
        let (mut point, mut equations) = (factors.whole.solve(&right), Vec::new());
        if let Some(of_equations) = &factors.of_equations {
            let missing = self.equations.iter().zip(&residuals.equations);
            let missing: Vec<f64> = missing.map(|(equation, residual)| equation.at(&point) + residual).collect();
            equations = of_equations.solve(&missing);
            for (column, multiplier) in factors.columns.iter().zip(&equations) {
                point.iter_mut().zip(column).for_each(|(x, entry)| *x -= multiplier * entry);
            }
        }
        let moved: Vec<f64> =
            self.bounds.iter().zip(&residuals.bounds).map(|(bound, residual)| -residual - bound.at(&point)).collect();
        let changed = (0..slacks.len()).map(|i| -(products[i] + multipliers[i] * moved[i]) / slacks[i]).collect();
        InteriorPoint { point, slacks: moved, multipliers: changed, equations }
    }
}

impl InteriorPoint {
    fn product(&self) -> f64 {
        let sum: f64 = self.slacks.iter().zip(&self.multipliers).map(|(slack, multiplier)| slack * multiplier).sum();
        sum / self.slacks.len().max(1) as f64
    }

    fn is_finite(&self) -> bool {
        self.point.iter().chain(&self.slacks).chain(&self.multipliers).all(|entry| entry.is_finite())
    }

    /// Returns the lengths of a step, of the point and of the multipliers, that keep `share` of the distance to 0; one
    /// length for both unless the programme is linear.
    fn lengths(&self, step: &InteriorPoint, share: f64, is_linear: bool) -> (f64, f64) {
        let of = |from: &[f64], step: &[f64]| {
            let reached = from.iter().zip(step).filter(|(_, step)| **step < 0.0).map(|(from, step)| -from / step);
            (share * reached.fold(f64::INFINITY, f64::min)).min(1.0)
        };
        let (point, multipliers) = (of(&self.slacks, &step.slacks), of(&self.multipliers, &step.multipliers));
        let least = point.min(multipliers);
        if is_linear { (point, multipliers) } else { (least, least) }
    }

    fn along(&self, step: &InteriorPoint, (point, multipliers): (f64, f64)) -> InteriorPoint {
        let of = |from: &[f64], step: &[f64], length: f64| -> Vec<f64> {
            from.iter().zip(step).map(|(from, step)| from + length * step).collect()
        };
        InteriorPoint {
            point: of(&self.point, &step.point, point),
            slacks: of(&self.slacks, &step.slacks, point),
            multipliers: of(&self.multipliers, &step.multipliers, multipliers),
            equations: of(&self.equations, &step.equations, multipliers),
        }
    }
}
