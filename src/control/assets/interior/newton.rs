//! The Newton step of the interior point search: everything but the shares and the price is eliminated atom by atom.

use nalgebra::DMatrix;

use super::Interior;
use crate::control::assets::cuts::dot;
use crate::control::request::assets::MOST_ASSETS;
use crate::numerics::gp::cholesky::Cholesky;
use crate::numerics::machine::dispatch::dispatched;

/// Steps keep this share of the distance to a bound.
const TO_BOUND: f64 = 0.95;
/// A move with a smaller share of its atom's mass is left out of the matrix.
const NO_MASS: f64 = 1e-13;
/// Rows of the matrix start at multiples of this.
const ROW_START: usize = 4;
/// Largest rounding error of a pivot, as a share of the diagonal.
const ROUNDING: f64 = 1e-11;

/// A step of everything but the tops t_j, and how much of it keeps bounds and multipliers positive.
pub(super) struct Direction {
    pub point: Vec<f64>,
    pub multipliers: Vec<f64>,
    pub bounds: Vec<f64>,
    /// Step length of the point that stays within its bounds, and below that of the multipliers.
    pub length: f64,
    pub dual_length: f64,
    /// The slope of the barrier function along the step.
    pub gain: f64,
}

/// A symmetric matrix that is a sum of squares, with a right-hand side. Each row is kept from near the diagonal on.
struct System {
    size: usize,
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl System {
    /// Adds `weight v v'`.
    #[inline(always)]
    fn add(&mut self, weight: f64, vector: &[f64]) {
        self.add_rows(weight, vector, vector);
    }

    /// Adds `weight v w'` in the rows of v, from the diagonal on, or a little before it to fill whole registers.
    #[inline(always)]
    fn add_rows(&mut self, weight: f64, rows: &[f64], vector: &[f64]) {
        let size = vector.len();
        for (index, (row, entry)) in self.matrix.chunks_exact_mut(size).zip(rows).enumerate() {
            let from = index - index % ROW_START;
            let scaled = weight * entry;
            row[from..].iter_mut().zip(&vector[from..]).for_each(|(sum, value)| *sum += scaled * value);
        }
    }
}

impl Interior<'_> {
    /// Solves for the Newton step towards `slack x multiplier = barrier` (times the mass of the atom, or the weight of
    /// a bound).
    ///
    /// With theta = multiplier / slack, g and H the first and second derivatives of a move's payoff, the step of (a,
    /// gamma) solves
    ///
    ///   ( -sum m H + sum_j [ sum theta g g' - (sum theta g)(sum theta g)' / sum theta ] + bounds ) dx
    ///     = sum_j sum q g - radius e_gamma + bounds,   q = barrier p_j / slack,
    ///
    /// the right-hand side being the gradient of the barrier function: at the best t_j the sum of q is p_j.
    ///
    /// `None` if the matrix is not positive definite to working precision. Cost O(n d^2) for n moves.
    pub(super) fn direction(&self) -> Option<Direction> {
        let size = self.step.assets() + 1;
        let mut system = System { size, matrix: vec![0.0; size * size], right: vec![0.0; size] };
        let mut stiffnesses = vec![0.0; self.step.atoms()];
        // Sums of `multiplier / slack` times gradients, atom by atom.
        let mut gradients = vec![0.0; self.step.atoms() * size];
        dispatched!({
            for (atom, (stiffness, gradient)) in
                stiffnesses.iter_mut().zip(gradients.chunks_exact_mut(size)).enumerate()
            {
                *stiffness = self.add_atom(atom, gradient, &mut system);
            }
        });
        system.right[size - 1] -= self.radius();
        let mut system = self.with_trades(system);
        for bound in &self.bounds {
            let slack = bound.slack(&self.point);
            let target = self.barrier * self.bound_weight / slack;
            system.right.iter_mut().zip(&bound.direction).for_each(|(sum, part)| *sum += target * part);
            system.add(bound.multiplier / slack, &bound.direction);
        }
        for diagonal in system.matrix.iter_mut().step_by(system.size + 1) {
            *diagonal *= 1.0 + ROUNDING;
        }
        let matrix = DMatrix::from_vec(system.size, system.size, system.matrix);
        let point = Cholesky::factor(matrix)?.solve(&system.right);
        let gain = dot(&system.right, &point);
        let atoms = stiffnesses.iter().zip(gradients.chunks_exact(size));
        let tops: Vec<f64> = atoms.map(|(stiffness, gradient)| dot(gradient, &point) / stiffness).collect();
        Some(self.with_multipliers(point, &tops, gain))
    }

    /// Extends the system of shares and price by the trade in each asset, of which every unit costs the price of
    /// trading.
    fn with_trades(&self, system: System) -> System {
        let (size, whole) = (system.size, self.point.len());
        if whole == size {
            return system;
        }
        let mut matrix = vec![0.0; whole * whole];
        for (row, of) in matrix.chunks_exact_mut(whole).zip(system.matrix.chunks_exact(size)) {
            row[..size].copy_from_slice(of);
        }
        let mut right = system.right;
        right.resize(whole, -self.step.trading.price);
        System { size: whole, matrix, right }
    }

    /// Adds the contribution of the moves of an atom, with its t eliminated. Returns the sum of theta, and puts that of
    /// theta g into `whole`.
    #[inline(always)]
    fn add_atom(&self, atom: usize, whole: &mut [f64], system: &mut System) -> f64 {
        let (last, mass) = (system.size - 1, self.step.masses[atom]);
        let mut along = [0.0; MOST_ASSETS + 1];
        let mut stiffness = 0.0;
        for cut in self.cuts.of(atom) {
            let (found, gradient) = (&self.cuts.all[cut], self.cuts.gradient(cut));
            let (theta, target) = (found.multiplier / found.slack, self.barrier * mass / found.slack);
            stiffness += theta;
            for ((entry, sum), right) in gradient.iter().zip(whole.iter_mut()).zip(&mut system.right) {
                *sum += theta * entry;
                *right += target * entry;
            }
            if found.multiplier < NO_MASS * mass {
                continue;
            }
            let curvature = found.multiplier * found.curvature;
            if let Some(following) = found.follows {
                system.add(theta, gradient);
                system.add(curvature, self.cuts.still(cut));
                self.add_moving(found.multiplier * following.slope, self.cuts.moving(cut), system);
            } else {
                // Except for the price, the gradient is proportional to the excess growth of the fixed move.
                let both = theta * found.slope * found.slope + curvature;
                along[..last].copy_from_slice(self.cuts.excess(cut));
                along[last] = theta * found.slope * found.cost / both;
                system.add_rows(both, &along[..last], &along[..=last]);
                system.matrix[last * system.size + last] += theta * found.cost * found.cost;
            }
        }
        system.add(-1.0 / stiffness, whole);
        stiffness
    }

    /// Adds `weight sum_i p_i v_i v_i'`, v_i = e_i / a_i - e_gamma / gamma over positions that move by themselves. If
    /// all move together, the moving ones count as one position, whose v is their mean.
    #[inline(always)]
    fn add_moving(&self, weight: f64, moving: &[f64], system: &mut System) {
        let last = system.size - 1;
        let (shares, price) = (&self.point[..last], self.point[last]);
        if self.step.ground.is_sup() {
            let whole = dot(moving, shares);
            if whole > 0.0 {
                let mut direction = [0.0; MOST_ASSETS + 1];
                direction.iter_mut().zip(moving).for_each(|(entry, growth)| *entry = growth / whole);
                direction[last] = -1.0 / price;
                system.add(weight * whole, &direction[..=last]);
            }
            return;
        }
        for (index, (growth, share)) in moving.iter().zip(shares).enumerate() {
            let growth = weight * growth;
            system.matrix[index * system.size + index] += growth / share;
            system.matrix[index * system.size + last] -= growth / price;
            system.matrix[last * system.size + last] += growth * share / (price * price);
        }
    }

    /// Returns the steps of the multipliers, and the lengths that keep them and the bounds positive.
    fn with_multipliers(&self, point: Vec<f64>, tops: &[f64], gain: f64) -> Direction {
        let (mut length, mut dual_length): (f64, f64) = (1.0, 1.0);
        let mut change = |slack: f64, step: f64, multiplier: f64, target: f64| {
            let change = target / slack - multiplier - multiplier / slack * step;
            if change < 0.0 {
                dual_length = dual_length.min(-TO_BOUND * multiplier / change);
            }
            change
        };
        let mut multipliers = Vec::with_capacity(self.cuts.all.len());
        for (atom, mass) in self.step.masses.iter().enumerate() {
            for cut in self.cuts.of(atom) {
                let (known, risen) = (&self.cuts.all[cut], dot(self.cuts.gradient(cut), &point));
                multipliers.push(change(known.slack, risen - tops[atom], known.multiplier, self.barrier * mass));
            }
        }
        let target = self.barrier * self.bound_weight;
        let bounds = self.bounds.iter().map(|bound| {
            let (slack, step) = (bound.slack(&self.point), dot(&bound.direction, &point));
            if step < 0.0 {
                length = length.min(-TO_BOUND * slack / step);
            }
            change(slack, step, bound.multiplier, target)
        });
        let bounds = bounds.collect();
        Direction { point, multipliers, bounds, length, dual_length, gain }
    }
}
