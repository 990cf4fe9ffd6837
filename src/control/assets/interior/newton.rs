//! The Newton step of the interior point search: everything but the shares and the price is eliminated atom by atom.

use nalgebra::DMatrix;

use super::{Bound, Interior, dot};
use crate::control::assets::MOST_ASSETS;
use crate::numerics::cholesky::Cholesky;
use crate::numerics::dispatch::dispatched;

/// Steps keep this share of the way to a bound.
const TO_BOUND: f64 = 0.95;
/// A branch of less of its atom's mass weighs nothing in the step of the others.
const NO_MASS: f64 = 1e-13;
/// What rounding may take of a pivot, as a share of the diagonal.
const ROUNDING: f64 = 1e-11;

/// A step of everything, and how much of it keeps slacks and multipliers positive.
pub(super) struct Direction {
    pub point: Vec<f64>,
    pub tops: Vec<f64>,
    pub multipliers: Vec<f64>,
    pub bounds: Vec<f64>,
    /// For the point and the slacks, and for the multipliers.
    pub length: f64,
    pub dual_length: f64,
}

/// A symmetric matrix of a sum of squares, and a right-hand side.
struct System {
    size: usize,
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl System {
    fn add(&mut self, weight: f64, vector: &[f64]) {
        add_square(&mut self.matrix, weight, vector);
    }
}

/// Adds `weight v v'`, whole rows: they are short, and a triangle's are no multiple of a register.
#[inline(always)]
fn add_square(matrix: &mut [f64], weight: f64, vector: &[f64]) {
    for (row, &entry) in matrix.chunks_exact_mut(vector.len()).zip(vector) {
        let scaled = weight * entry;
        row.iter_mut().zip(vector).for_each(|(sum, value)| *sum += scaled * value);
    }
}

/// What an atom leaves behind when its t is eliminated: sums of `multiplier / slack`, and of `barrier p / slack`.
#[derive(Clone, Copy, Default)]
struct Eliminated {
    stiffness: f64,
    target: f64,
}

impl Interior<'_> {
    /// The Newton step towards `slack x multiplier = barrier` (times the mass of the atom, or the weight of a bound).
    ///
    /// With theta = multiplier / slack and g the gradient of a branch, the step of (a, gamma) solves
    ///
    ///   ( sum m (-hess f) + sum_j [ sum theta g g' - (sum theta g)(sum theta g)' / sum theta ] + bounds ) dx
    ///     = sum_j [ sum q g + (p_j - sum q) (sum theta g) / sum theta ] - radius e_gamma + bounds,   q = barrier p_j / slack.
    ///
    /// `None` where the matrix is not positive definite to working precision. Cost O(branches d^2).
    pub(super) fn direction(&self) -> Option<Direction> {
        let size = self.step.assets() + 1;
        let mut system = System { size, matrix: vec![0.0; size * size], right: vec![0.0; size] };
        let mut eliminated = vec![Eliminated::default(); self.tops.len()];
        // Sums of `multiplier / slack` times gradients, atom by atom.
        let mut gradients = vec![0.0; self.tops.len() * size];
        dispatched!({
            for (atom, (left, gradient)) in eliminated.iter_mut().zip(gradients.chunks_exact_mut(size)).enumerate() {
                *left = self.add_atom(atom, gradient, &mut system);
            }
        });
        system.right[size - 1] -= self.step.radius;
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
        let atoms = eliminated.iter().zip(gradients.chunks_exact(size)).zip(&self.step.masses);
        let top = |((left, gradient), mass): ((&Eliminated, &[f64]), &f64)| {
            (mass - left.target + dot(gradient, &point[..size])) / left.stiffness
        };
        let tops: Vec<f64> = atoms.map(top).collect();
        Some(self.with_multipliers(point, tops))
    }

    /// The system of shares and price with what is traded of each asset, of which every unit takes the price of trading.
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

    #[inline(always)]
    fn add_atom(&self, atom: usize, whole: &mut [f64], system: &mut System) -> Eliminated {
        let (size, mass, price) = (system.size, self.step.masses[atom], self.point[system.size - 1]);
        let mut gradient = [0.0; MOST_ASSETS + 1];
        let mut left = Eliminated::default();
        for branch in self.branches.of(atom) {
            let (found, pair) = (&self.branches.all[branch], self.pairs[branch]);
            let (stiffness, target) = (pair.multiplier / pair.slack, self.barrier * mass / pair.slack);
            left.stiffness += stiffness;
            left.target += target;
            let excess = self.branches.excess(branch);
            for (entry, excess) in gradient.iter_mut().zip(excess) {
                *entry = found.slope * excess;
            }
            gradient[size - 1] = found.cost;
            for ((entry, sum), right) in gradient.iter().zip(whole.iter_mut()).zip(&mut system.right) {
                *sum += stiffness * entry;
                *right += target * entry;
            }
            if pair.multiplier < NO_MASS * mass {
                continue;
            }
            add_square(&mut system.matrix, stiffness, &gradient[..size]);
            let weight = pair.multiplier * found.slope;
            let still = self.branches.still(branch);
            add_square(&mut system.matrix, weight * found.bend, still);
            if found.follows {
                self.add_moving(weight, excess, still, price, system);
            }
        }
        let left_over = (mass - left.target) / left.stiffness;
        for (right, sum) in system.right.iter_mut().zip(whole.iter()) {
            *right += left_over * sum;
        }
        add_square(&mut system.matrix, -1.0 / left.stiffness, whole);
        left
    }

    /// `weight sum_i p_i v_i v_i'`, v_i = e_i / a_i - e_gamma / gamma over what moves by itself; where all move together, what
    /// moves counts as one position, whose v is their mean.
    #[inline(always)]
    fn add_moving(&self, weight: f64, excess: &[f64], still: &[f64], price: f64, system: &mut System) {
        let last = system.size - 1;
        let moving = |index: &usize| still[*index] == -1.0;
        if self.step.ground.is_sup() {
            let whole = still[last] * price;
            let mut direction = [0.0; MOST_ASSETS + 1];
            for index in (0..last).filter(moving) {
                direction[index] = (excess[index] + 1.0) / whole;
            }
            direction[last] = -1.0 / price;
            add_square(&mut system.matrix, weight * whole, &direction[..=last]);
            return;
        }
        for index in (0..last).filter(moving) {
            let (growth, share) = (weight * (excess[index] + 1.0), self.point[index]);
            system.matrix[index * system.size + index] += growth / share;
            // Of the two entries that mirror each other the lower one, which alone is read.
            system.matrix[index * system.size + last] -= growth / price;
            system.matrix[last * system.size + last] += growth * share / (price * price);
        }
    }

    /// The steps of the multipliers, and the lengths that keep everything positive.
    fn with_multipliers(&self, point: Vec<f64>, tops: Vec<f64>) -> Direction {
        let last = self.step.assets();
        let (mut length, mut dual_length): (f64, f64) = (1.0, 1.0);
        let mut pair = |slack: f64, step: f64, multiplier: f64, target: f64| {
            let change = target / slack - multiplier - multiplier / slack * step;
            if step < 0.0 {
                length = length.min(-TO_BOUND * slack / step);
            }
            if change < 0.0 {
                dual_length = dual_length.min(-TO_BOUND * multiplier / change);
            }
            change
        };
        let mut multipliers = Vec::with_capacity(self.pairs.len());
        for (atom, mass) in self.step.masses.iter().enumerate() {
            for branch in self.branches.of(atom) {
                let found = &self.branches.all[branch];
                let risen = found.slope * dot(self.branches.excess(branch), &point[..last]) + found.cost * point[last];
                let known = self.pairs[branch];
                multipliers.push(pair(known.slack, risen - tops[atom], known.multiplier, self.barrier * mass));
            }
        }
        let target = self.barrier * self.bound_weight;
        let bound =
            |bound: &Bound| pair(bound.slack(&self.point), dot(&bound.direction, &point), bound.multiplier, target);
        let bounds = self.bounds.iter().map(bound).collect();
        Direction { point, tops, multipliers, bounds, length, dual_length }
    }
}
