//! The Newton step of the interior point search: everything but the shares and the price is eliminated atom by atom.

use nalgebra::DMatrix;

use super::Interior;
use crate::control::assets::cuts::dot;
use crate::control::request::assets::MOST_ASSETS;
use crate::numerics::gp::cholesky::{Cholesky, add_squares};
use crate::numerics::machine::dispatch::dispatched;

/// Steps keep this share of the distance to a bound.
const TO_BOUND: f64 = 0.95;
/// A move with a smaller share of its atom's mass is left out of the matrix.
const NO_MASS: f64 = 1e-13;
/// Multipliers are kept within this factor of the central path.
const OFF_CENTRE: f64 = 100.0;
/// Squares that are added to the matrix together.
const TOGETHER: usize = 128;
/// Shares of the diagonal that are added to it until all pivots are above rounding. A damped step is still uphill.
const DAMPINGS: [f64; 4] = [1e-11, 1e-8, 1e-5, 1e-2];

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

/// A symmetric matrix that is a sum of squares, with a right-hand side. Each row is kept from the diagonal on.
struct System {
    size: usize,
    matrix: Vec<f64>,
    right: Vec<f64>,
    /// Vectors whose squares are yet to be added, one after the other.
    waiting: Vec<f64>,
}

impl System {
    fn of(size: usize) -> Self {
        let waiting = Vec::with_capacity(TOGETHER * size);
        System { size, matrix: vec![0.0; size * size], right: vec![0.0; size], waiting }
    }

    /// Adds `weight v v'`. Squares wait until there are enough for a product of matrices.
    #[inline(always)]
    fn add(&mut self, weight: f64, vector: &[f64]) {
        let root = weight.sqrt();
        self.waiting.extend(vector.iter().map(|entry| root * entry));
        if self.waiting.len() >= TOGETHER * self.size {
            self.add_waiting();
        }
    }

    fn add_waiting(&mut self) {
        add_squares(&mut self.matrix, self.size, &self.waiting);
        self.waiting.clear();
    }

    /// Returns the solution with its diagonal raised by a share; `None` if it is not positive definite even then.
    fn solve(&self, damping: f64) -> Option<Vec<f64>> {
        let mut matrix = DMatrix::from_column_slice(self.size, self.size, &self.matrix);
        for index in 0..self.size {
            matrix[(index, index)] *= 1.0 + damping;
        }
        Some(Cholesky::factor(matrix)?.solve(&self.right))
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
    /// `None` if the matrix is not positive definite even if damped. Cost O(n d^2) for n moves.
    pub(super) fn direction(&self) -> Option<Direction> {
        let size = self.step.assets() + 1;
        let mut system = System::of(size);
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
        system.add_waiting();
        system.right[size - 1] -= self.radius();
        let mut system = self.with_trades(system);
        for bound in &self.bounds {
            let slack = bound.slack(&self.point);
            let target = self.barrier * self.bound_weight / slack;
            system.right.iter_mut().zip(&bound.direction).for_each(|(sum, part)| *sum += target * part);
            system.add(bound.multiplier / slack, &bound.direction);
        }
        system.add_waiting();
        let point = DAMPINGS.iter().find_map(|damping| system.solve(*damping))?;
        let gain = dot(&system.right, &point);
        let atoms = stiffnesses.iter().zip(gradients.chunks_exact(size));
        let tops: Vec<f64> = atoms.map(|(stiffness, gradient)| dot(gradient, &point) / stiffness).collect();
        Some(self.with_multipliers(point, &tops, gain))
    }

    /// Extends the system of shares and price by the trade in each asset, of which every unit costs the price of
    /// trading, and by the moves of a limited turnover, which cost nothing.
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
        right.resize(size + self.step.trading.holdings.len(), -self.step.trading.price);
        right.resize(whole, 0.0);
        System { size: whole, matrix, right, waiting: system.waiting }
    }

    /// Adds the contribution of the moves of an atom, with its t eliminated. Returns the sum of theta, and puts that of
    /// theta g into `whole`.
    ///
    /// The bracket is summed as `sum theta (g - m)(g - m)'`, m the mean of the g weighted by theta: a difference of two
    /// sums would be rounding alone where the slopes of the moves differ by orders of magnitude. Two moves give
    /// `theta_1 theta_2 / (theta_1 + theta_2) (g_1 - g_2)(g_1 - g_2)'`.
    #[inline(always)]
    fn add_atom(&self, atom: usize, whole: &mut [f64], system: &mut System) -> f64 {
        let (mass, of) = (self.step.masses[atom], self.cuts.of(atom));
        let theta = |cut: usize| self.cuts.all[cut].multiplier / self.cuts.all[cut].slack;
        let mut stiffness = 0.0;
        for cut in of.clone() {
            let (theta, target) = (theta(cut), self.barrier * mass / self.cuts.all[cut].slack);
            stiffness += theta;
            for ((entry, sum), right) in self.cuts.gradient(cut).iter().zip(whole.iter_mut()).zip(&mut system.right) {
                *sum += theta * entry;
                *right += target * entry;
            }
        }
        let mut difference = [0.0; MOST_ASSETS + 1];
        let difference = &mut difference[..whole.len()];
        if of.len() == 2 {
            let gradients = self.cuts.gradient(of.start).iter().zip(self.cuts.gradient(of.start + 1));
            difference.iter_mut().zip(gradients).for_each(|(entry, (left, right))| *entry = left - right);
            system.add(theta(of.start) * theta(of.start + 1) / stiffness, difference);
        }
        for cut in of.clone() {
            let found = &self.cuts.all[cut];
            if found.multiplier < NO_MASS * mass {
                continue;
            }
            if of.len() > 2 {
                let gradients = difference.iter_mut().zip(self.cuts.gradient(cut)).zip(whole.iter());
                gradients.for_each(|((entry, gradient), sum)| *entry = gradient - sum / stiffness);
                system.add(theta(cut), difference);
            }
            system.add(found.multiplier * found.curvature, self.cuts.still(cut));
            if let Some(following) = found.follows {
                self.add_moving(found.multiplier * following.slope, self.cuts.moving(cut), system);
            }
        }
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

    /// Clamps multipliers that are far off the central path to within a factor of it.
    pub(super) fn tame(&mut self) {
        let near = |multiplier: f64, central: f64| multiplier.max(central / OFF_CENTRE).min(central * OFF_CENTRE);
        for (atom, mass) in self.step.masses.iter().enumerate() {
            let of = self.cuts.of(atom);
            for cut in &mut self.cuts.all[of] {
                cut.multiplier = near(cut.multiplier, self.barrier * mass / cut.slack);
            }
        }
        for bound in &mut self.bounds {
            let central = self.barrier * self.bound_weight / bound.slack(&self.point);
            bound.multiplier = near(bound.multiplier, central);
        }
    }
}
