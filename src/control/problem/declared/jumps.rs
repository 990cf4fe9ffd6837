//! Formulas that jump as states or the noise move. The paper asks for continuity, and a surrogate is smooth.

use rand::RngExt;

use super::formula::Formula;
use super::{Controlled, Declared, EarnedState};
use crate::control::problem::actions::ActionSet;
use crate::control::request::warnings::{Warning, WarningCode};
use crate::numerics::machine::streams::stream;
use crate::numerics::statistics::summary::range;

/// Pairs of random paths along which jumps are looked for, and the most pairs of points.
const PATHS: usize = 64;
const PAIRS: usize = 400;
/// Halvings of the line between two points.
const HALVINGS: usize = 45;
/// Least jump, as a share of how much the formula varies. The cube root of the last line is smaller.
const LEAST_JUMP: f64 = 1e-4;

/// A place at which formulas are evaluated.
#[derive(Clone)]
struct Point {
    step: usize,
    state: Vec<f64>,
    actions: Vec<f64>,
    noise: f64,
}

impl Point {
    /// Returns the point on the way to another, with the actions of this one.
    fn towards(&self, other: &Point, share: f64) -> Point {
        let between = |from: f64, to: f64| from + share * (to - from);
        let state = self.state.iter().zip(&other.state).map(|(from, to)| between(*from, *to)).collect();
        Point { state, noise: between(self.noise, other.noise), ..self.clone() }
    }
}

impl Declared {
    /// Returns a warning for each formula that jumps between random points of the same period. Streams: ("jumps", 0,
    /// path). Checked by: `tests/solver/declared.rs::a_formula_that_jumps_is_warned_of`.
    pub fn jumps(&self) -> Vec<Warning> {
        let pairs = self.pairs();
        let states = self.states_named().iter().zip(&self.next);
        let mut formulas: Vec<(String, &Formula)> =
            states.map(|(name, formula)| (format!("problem.next.{name}"), formula)).collect();
        formulas.extend(self.reward.iter().map(|formula| ("problem.reward".to_owned(), formula)));
        let end = if self.utility.is_some() { "problem.utility.of" } else { "problem.end" };
        formulas.push((end.to_owned(), &self.end));
        formulas.into_iter().filter_map(|(field, formula)| self.jump(field, formula, &pairs)).collect()
    }

    fn jump(&self, field: String, formula: &Formula, pairs: &[(Point, Point)]) -> Option<Warning> {
        let value = |point: &Point| {
            let moved = Some((point.actions.as_slice(), point.noise));
            self.at(point.step, &point.state, moved, |value| value(formula))
        };
        let [least, most] = range(pairs.iter().map(|(from, _)| value(from)));
        let found = pairs.iter().find_map(|(from, to)| {
            let at = |share: f64| value(&from.towards(to, share));
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                let [before, between, after] = [low, middle, high].map(at);
                if (between - before).abs() > (after - between).abs() { high = middle } else { low = middle }
            }
            let (before, after) = (at(low), at(high));
            ((after - before).abs() > LEAST_JUMP * (most - least)).then(|| (before, after, from.towards(to, high)))
        })?;
        let (before, after, place) = found;
        let named = self.point(place.step, &place.state, Some((&place.actions, place.noise)));
        let message = format!(
            "{field} jumps from {before:.6} to {after:.6} at {named}. What comes later is learned as a smooth function, so near a jump it is less exact."
        );
        Some(Warning { code: WarningCode::Jumps, field: field.into(), message })
    }

    /// Simulates pairs of points of the same period, with random actions and noises.
    fn pairs(&self) -> Vec<(Point, Point)> {
        let mut paths: Vec<Vec<Point>> = (0..2 * PATHS).map(|path| self.path(path)).collect();
        let others = paths.split_off(PATHS);
        let pairs = paths.into_iter().flatten().zip(others.into_iter().flatten());
        pairs.take(PAIRS).collect()
    }

    fn path(&self, path: usize) -> Vec<Point> {
        let mut generator = stream(1, "jumps", 0, path);
        let (mut state, mut points) = (self.start(), Vec::new());
        for step in 0..self.horizon.min(PAIRS) {
            let draw = |set: ActionSet| set.at(generator.random::<f64>());
            let actions: Vec<f64> = Controlled::actions(self, step, &state).into_iter().map(draw).collect();
            let noise = self.noise(generator.random::<f64>() - 0.5);
            let moved = (actions.as_slice(), noise);
            let next: EarnedState = self.after((step, &state), moved, self.period(step, &state, moved));
            points.push(Point { step, state: state.values, actions, noise });
            state = next;
        }
        points
    }
}
