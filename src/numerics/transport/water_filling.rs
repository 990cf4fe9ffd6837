//! Water filling: the least sum of positions for a given cost of moving their logarithms.
//!
//! Positions h_i > 0 fall to h_i e^(-delta_i), and none falls below its floor. The cost of a move is the largest
//! delta_i, or the sum of k_i delta_i. The least sums for all costs lie on one path:
//!
//!   max_i delta_i    all positions fall by the same share, each until it reaches its floor;
//!   sum k_i delta_i  positions of largest h_i / k_i fall first, to a common level: h_i -> min(h_i, k_i level).
//!
//! The second rule holds because the sum is convex in the moves, so costly moves have equal gains, h_i e^(-delta_i) =
//! k_i level. Both rules follow a falling level. A position with speed s_i is clamped between its floor and its
//! original value, `clamp(s_i level)`. Here s_i = k_i, or s_i = h_i with a level that starts at 1. Between two levels
//! at which a position starts or ends to move, the moving ones are one number y that falls, and y to y' costs
//! `rate ln(y / y')`.

/// The cost of moving logarithms of positions.
#[derive(Debug, Clone, PartialEq)]
pub enum GroundMetric {
    /// The largest move.
    Sup,
    /// The weighted sum of the moves, with positive weights.
    Weighted(Vec<f64>),
}

impl GroundMetric {
    /// Returns true if the cost is the largest move.
    pub fn is_sup(&self) -> bool {
        matches!(self, GroundMetric::Sup)
    }

    /// Returns the movement of a position per unit of level.
    fn speed(&self, index: usize, position: f64) -> f64 {
        match self {
            GroundMetric::Sup => position,
            GroundMetric::Weighted(weights) => weights[index],
        }
    }

    /// Returns the weight of its move in the sum of costs; 0 if the cost is the largest move.
    fn weight(&self, index: usize) -> f64 {
        if let GroundMetric::Weighted(weights) = self { weights[index] } else { 0.0 }
    }

    /// Returns a position once the level is reached.
    pub fn lowered(&self, index: usize, position: f64, floor: f64, level: f64) -> f64 {
        (self.speed(index, position) * level).max(floor).min(position)
    }

    /// Returns the cost of the positions at this level; `ratio(i)` is the original position divided by the lowered one.
    pub fn cost(&self, count: usize, level: f64, ratio: impl Fn(usize) -> f64) -> f64 {
        match self {
            GroundMetric::Sup => -level.min(1.0).ln(),
            GroundMetric::Weighted(weights) => {
                let moved = (0..count).map(|index| (weights[index], ratio(index))).filter(|(_, ratio)| *ratio > 1.0);
                moved.map(|(weight, ratio)| weight * ratio.ln()).sum()
            }
        }
    }
}

/// A part of the path along which the same positions move: the sum is `fixed + speed * level`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FillingPhase {
    /// The sum of the positions that do not move, and of anything that is not a position.
    pub fixed: f64,
    /// The sum of the moving positions per unit of level.
    pub speed: f64,
    /// Cost factor: the moving sum falls from y to y' at the cost `rate * ln(y / y')`.
    pub rate: f64,
    /// The level at which the phase starts.
    pub high: f64,
    /// The lower level at which the phase ends; 0 for a phase without an end.
    pub low: f64,
}

/// The path of one set of positions, with memory that is reused for the next.
#[derive(Debug, Clone, Default)]
pub struct Levelling {
    /// Levels at which a position ends (true) or starts (false) to move, ascending.
    turns: Vec<(f64, bool, usize)>,
    /// Phases, from the lowest level up.
    phases: Vec<FillingPhase>,
}

impl Levelling {
    /// Returns the phases of the path from the lowest level up. `rest` is the part of the sum besides the positions. A
    /// position at or below its floor, or of 0, does not move. Cost O(d ln d) for d positions.
    ///
    /// Sums run from the lowest level up, so that large terms do not round away small ones, whose logarithm is needed.
    pub fn phases(&mut self, rest: f64, positions: &[f64], floors: &[f64], ground: &GroundMetric) -> &[FillingPhase] {
        self.turns.clear();
        self.phases.clear();
        if ground.is_sup() && floors.iter().all(|floor| *floor <= 0.0) {
            // All positions fall together, without an end.
            let speed = positions.iter().sum();
            let whole = FillingPhase { fixed: rest, speed, rate: 1.0, high: 1.0, low: 0.0 };
            self.phases.extend((speed > 0.0).then_some(whole));
            return &self.phases;
        }
        let (mut fixed, mut speed, mut rate, mut moving, mut low) = (rest, 0.0, 0.0, 0_usize, 0.0);
        for (index, (&position, &floor)) in positions.iter().zip(floors).enumerate() {
            if position <= floor || position <= 0.0 {
                fixed += position;
                continue;
            }
            let own = ground.speed(index, position);
            self.turns.push((position / own, false, index));
            if floor > 0.0 {
                fixed += floor;
                self.turns.push((floor / own, true, index));
            } else {
                (speed, rate, moving) = (speed + own, rate + ground.weight(index), moving + 1);
            }
        }
        self.turns.sort_unstable_by(|left, right| left.0.total_cmp(&right.0));
        for &(level, ends, index) in &self.turns {
            if level > low && moving > 0 {
                let rate = if ground.is_sup() { 1.0 } else { rate };
                self.phases.push(FillingPhase { fixed, speed, rate, high: level, low });
            }
            low = level;
            let own = ground.speed(index, positions[index]);
            let weight = ground.weight(index);
            if ends {
                (fixed, speed, rate, moving) = (fixed - floors[index], speed + own, rate + weight, moving + 1);
            } else {
                (fixed, speed, rate, moving) = (fixed + positions[index], speed - own, rate - weight, moving - 1);
            }
        }
        &self.phases
    }
}

/// Returns `(1 / sigma_i) / sum_l (1 / sigma_l)` for a sample, row by row; with these weights, moving every coordinate
/// by s costs s. Deviations are the sample's own. A column that does not vary counts as the one with the smallest
/// deviation; if none varies, all count equally.
pub fn inverse_volatility(rows: &[Vec<f64>]) -> Vec<f64> {
    let (count, width) = (rows.len().max(1) as f64, rows.first().map_or(0, Vec::len));
    let deviation = |column: usize| {
        let mean = rows.iter().map(|row| row[column]).sum::<f64>() / count;
        let deviation = (rows.iter().map(|row| (row[column] - mean).powi(2)).sum::<f64>() / count).sqrt();
        // The rounding error in summing one number repeatedly does not count as deviation.
        let largest = rows.iter().map(|row| row[column].abs()).fold(0.0, f64::max);
        if deviation > count * f64::EPSILON * largest { deviation } else { 0.0 }
    };
    let deviations: Vec<f64> = (0..width).map(deviation).collect();
    let least = deviations.iter().copied().filter(|deviation| *deviation > 0.0).fold(f64::INFINITY, f64::min);
    let inverse = |deviation: &f64| if least.is_finite() { 1.0 / deviation.max(least) } else { 1.0 };
    let whole: f64 = deviations.iter().map(inverse).sum();
    deviations.iter().map(|deviation| inverse(deviation) / whole).collect()
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::numerics::machine::streams::stream;

    /// Returns the sum at a cost, along the phases from the top down.
    fn least(phases: &[FillingPhase], whole: f64, mut cost: f64) -> f64 {
        let mut sum = whole;
        for phase in phases.iter().rev() {
            let whole = phase.rate * (phase.high / phase.low).ln();
            let level = if whole <= cost { phase.low } else { phase.high * (-cost / phase.rate).exp() };
            sum = phase.fixed + phase.speed * level;
            cost -= whole;
            if cost <= 0.0 {
                break;
            }
        }
        sum
    }

    #[test]
    fn a_column_that_does_not_vary_weighs_as_the_one_that_varies_least() {
        // For some counts the rounded mean of equal values 0.004 differs from 0.004.
        for count in 2..300 {
            let rows: Vec<Vec<f64>> =
                (0..count).map(|row| vec![0.004, 0.02 * f64::from(row % 2), 0.01 * f64::from(row % 2)]).collect();
            let weights = inverse_volatility(&rows);
            let expected = [0.4, 0.2, 0.4];
            assert!(
                weights.iter().zip(expected).all(|(weight, expected)| (weight - expected).abs() < 1e-12),
                "{weights:?}"
            );
        }
    }

    #[test]
    fn no_move_of_the_same_cost_lowers_the_sum_further() {
        let mut random = stream(5, "levelling", 0, 0);
        for case in 0..40 {
            let draw = |low: f64, high: f64, random: &mut _| low + (high - low) * RngExt::random::<f64>(random);
            let positions: Vec<f64> = (0..3).map(|_| draw(0.0, 1.0, &mut random)).collect();
            let share = if case % 2 == 0 { 0.0 } else { 0.6 };
            let floors: Vec<f64> = positions.iter().map(|position| position * draw(0.0, share, &mut random)).collect();
            let weights: Vec<f64> = (0..3).map(|_| draw(0.1, 1.0, &mut random)).collect();
            let (rest, cost) = (draw(0.0, 0.5, &mut random), draw(0.0, 1.5, &mut random));
            for ground in [GroundMetric::Sup, GroundMetric::Weighted(weights.clone())] {
                let whole = rest + positions.iter().sum::<f64>();
                let mut levelling = Levelling::default();
                let found = least(levelling.phases(rest, &positions, &floors, &ground), whole, cost);
                // All moves of this cost on a grid; for the weighted sum, the rest of the budget moves the third
                // position.
                let steps = 400;
                let mut best = f64::INFINITY;
                for (first, second) in (0..=steps).flat_map(|first| (0..=steps).map(move |second| (first, second))) {
                    let part = |index: usize, count: i32| match ground {
                        GroundMetric::Sup => cost,
                        GroundMetric::Weighted(_) => cost / weights[index] * f64::from(count) / f64::from(steps),
                    };
                    let spent = weights[0] * part(0, first) + weights[1] * part(1, second);
                    let third = if ground == GroundMetric::Sup { cost } else { (cost - spent) / weights[2] };
                    if third < -1e-12 {
                        continue;
                    }
                    let moves = [part(0, first), part(1, second), third];
                    let lowered = |index: usize| (positions[index] * (-moves[index]).exp()).max(floors[index]);
                    best = best.min(rest + (0..3).map(lowered).sum::<f64>());
                    if ground == GroundMetric::Sup {
                        break;
                    }
                }
                // A grid of a 400th of the budget is off by its square, times the amount moved.
                assert!(found <= best + 1e-12 && found > best - 2e-3, "{ground:?}: {found} {best}");
            }
        }
    }
}
