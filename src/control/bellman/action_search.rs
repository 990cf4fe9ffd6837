//! The search of several actions, of which some may have a finite number of values.
//!
//! Each choice of the finite ones is searched by itself. The others are searched along lines: along each action's own,
//! along the way that the last round of these went, and, if nothing is gained, along the diagonals of pairs, because a
//! kink can hold up a search along the actions themselves. The search starts from the best of even points. Where worths
//! need not be concave it also starts from the next best that is no neighbour of that one.

use crate::control::problem::actions::{ActionInterval, ActionSet};
use crate::numerics::search::chebyshev::even;

/// Even values of each action among which a search starts: of two actions, and of more.
const STARTS: [usize; 2] = [5, 4];
/// Even values of each action over which a description of one number is followed: of one action, of two, and of more.
const SPREAD: [usize; 3] = [33, 9, 5];
/// Rounds of searches along lines.
const MOST_ROUNDS: usize = 20;
/// Worths that differ by less are one, as a gain: so exactly is the mass of a worst law placed.
const EQUAL: f64 = 1e-7;

/// The actions from one point to another, by shares from 1 to 2.
#[derive(Debug, Clone, PartialEq)]
pub struct ActionLine {
    from: Vec<f64>,
    to: Vec<f64>,
}

/// The best actions of a line are found.
pub trait LineSearch {
    /// The actions found, and more.
    type Found: SearchedActions;

    /// Returns true if the worth is concave in the actions.
    fn is_concave(&self) -> bool;

    /// Returns the best actions of a line.
    fn on_line(&self, line: &ActionLine) -> Self::Found;

    /// Returns the worth of some actions, well enough to compare places far apart.
    fn roughly(&self, actions: &[f64]) -> f64;
}

/// Actions with their gain, by which they are compared.
pub trait SearchedActions {
    /// Returns the actions.
    fn actions(&self) -> &[f64];

    /// Returns their gain.
    fn gain(&self) -> f64;
}

/// All that may be chosen: intervals, of which those of a finite action are single points.
pub struct ActionChoices {
    intervals: Vec<Vec<ActionInterval>>,
}

impl ActionLine {
    /// Returns the line of one point.
    pub fn point(actions: &[f64]) -> Self {
        ActionLine { from: actions.to_vec(), to: actions.to_vec() }
    }

    /// Returns the actions at a share.
    pub fn at(&self, share: f64) -> Vec<f64> {
        self.from.iter().zip(&self.to).map(|(from, to)| from + (share - 1.0) * (to - from)).collect()
    }

    /// Returns true if there is one point alone.
    pub fn is_point(&self) -> bool {
        self.from == self.to
    }

    /// Returns the line through a point, in both directions as far as the intervals go.
    fn through(point: &[f64], direction: &[f64], intervals: &[ActionInterval]) -> Self {
        let (mut back, mut forth) = (f64::NEG_INFINITY, f64::INFINITY);
        for ((at, along), ActionInterval { lowest, highest }) in point.iter().zip(direction).zip(intervals) {
            if *along != 0.0 {
                let [first, last] = [(lowest - at) / along, (highest - at) / along];
                (back, forth) = (back.max(first.min(last)), forth.min(first.max(last)));
            }
        }
        let end = |steps: f64| -> Vec<f64> {
            let moved = point.iter().zip(direction).zip(intervals);
            moved.map(|((at, along), within)| (at + steps * along).max(within.lowest).min(within.highest)).collect()
        };
        if back < forth { ActionLine { from: end(back), to: end(forth) } } else { ActionLine::point(point) }
    }
}

impl ActionChoices {
    /// Builds the choices of some sets of actions.
    pub fn of(sets: Vec<ActionSet>) -> Self {
        let intervals = |set: ActionSet| match set {
            ActionSet::Interval(ActionInterval { lowest, highest }) => {
                vec![ActionInterval { lowest, highest: highest.max(lowest) }]
            }
            ActionSet::Values(values) => {
                values.into_iter().map(|value| ActionInterval { lowest: value, highest: value }).collect()
            }
        };
        ActionChoices { intervals: sets.into_iter().map(intervals).collect() }
    }

    /// Returns the line of one action over its interval, the others as they are given; `None` if it has none.
    pub fn axis(&self, actions: &[f64], place: usize) -> Option<ActionLine> {
        let of = self.intervals[place].iter().find(|of| of.is_open())?;
        let [from, to] = [of.lowest, of.highest].map(|end| {
            let mut actions = actions.to_vec();
            actions[place] = end;
            actions
        });
        Some(ActionLine { from, to })
    }

    /// Returns actions spread over all that may be chosen.
    pub fn spread(&self) -> Vec<Vec<f64>> {
        let count = SPREAD[self.intervals.len().clamp(1, SPREAD.len()) - 1];
        product(self.intervals.iter().map(|of| of.iter().flat_map(|of| of.even(count)).collect::<Vec<f64>>()))
    }

    /// Returns the intervals of each choice of the finite actions.
    fn each(&self) -> Vec<Vec<ActionInterval>> {
        product(self.intervals.iter().cloned())
    }
}

impl ActionInterval {
    /// Returns even actions with both ends; one if they are one.
    fn even(self, count: usize) -> Vec<f64> {
        if self.is_open() { even(self.lowest, self.highest, count) } else { vec![self.lowest] }
    }

    fn is_open(self) -> bool {
        self.highest > self.lowest
    }
}

/// Returns all lists with one element of each of `sets`.
fn product<T: Clone>(sets: impl Iterator<Item = Vec<T>>) -> Vec<Vec<T>> {
    sets.fold(vec![Vec::new()], |lists, set| {
        let with = |list: &Vec<T>| -> Vec<Vec<T>> {
            set.iter().map(|next| list.iter().chain([next]).cloned().collect()).collect()
        };
        lists.iter().flat_map(with).collect()
    })
}

/// Returns the better of two, the first if they are equal.
fn better<T: SearchedActions>(first: T, second: T) -> T {
    if second.gain() > first.gain() { second } else { first }
}

/// Returns the best of all actions.
pub fn best_of_all<L: LineSearch>(choices: &ActionChoices, lines: &L) -> L::Found {
    let each = choices.each();
    let (first, others) = (best_of(&each[0], lines), &each[1..]);
    others.iter().fold(first, |best, intervals| better(best, best_of(intervals, lines)))
}

fn best_of<L: LineSearch>(intervals: &[ActionInterval], lines: &L) -> L::Found {
    let open: Vec<usize> = (0..intervals.len()).filter(|place| intervals[*place].is_open()).collect();
    if open.len() < 2 {
        let [from, to] = [|of: &ActionInterval| of.lowest, |of: &ActionInterval| of.highest]
            .map(|end| intervals.iter().map(end).collect());
        return lines.on_line(&ActionLine { from, to });
    }
    let (first, next) = starts(intervals, open.len(), lines);
    let best = climbed(&first, (intervals, &open), lines);
    match next {
        Some(next) => better(best, climbed(&next, (intervals, &open), lines)),
        None => best,
    }
}

/// Returns the points from which a search starts: the best of even ones, and the next that is no neighbour of it.
fn starts(intervals: &[ActionInterval], open: usize, lines: &impl LineSearch) -> (Vec<f64>, Option<Vec<f64>>) {
    let count = STARTS[usize::from(open > 2)];
    let points = product(intervals.iter().map(|of| of.even(count)));
    let mut worths: Vec<(f64, Vec<f64>)> = points.into_iter().map(|point| (lines.roughly(&point), point)).collect();
    worths.sort_by(|left, right| right.0.total_cmp(&left.0));
    let best = worths.remove(0).1;
    let apart = |point: &Vec<f64>| {
        let distances = point.iter().zip(&best).zip(intervals);
        distances
            .filter(|(_, of)| of.is_open())
            .any(|((at, best), of)| (at - best).abs() * (count - 1) as f64 > 1.5 * (of.highest - of.lowest))
    };
    let next = worths.into_iter().filter(|_| !lines.is_concave()).map(|(_, point)| point).find(|point| apart(point));
    (best, next)
}

/// Climbs from a start along lines.
fn climbed<L: LineSearch>(start: &[f64], (intervals, open): (&[ActionInterval], &[usize]), lines: &L) -> L::Found {
    let climb = |best: L::Found, direction: &[f64]| {
        let line = ActionLine::through(best.actions(), direction, intervals);
        if line.is_point() { best } else { better(best, lines.on_line(&line)) }
    };
    let (axes, diagonals) = (axes(intervals, open), diagonals(intervals, open));
    let mut best = lines.on_line(&ActionLine::point(start));
    for _ in 0..MOST_ROUNDS {
        let (before, gain) = (best.actions().to_vec(), best.gain());
        best = axes.iter().fold(best, |best, axis| climb(best, axis));
        let way: Vec<f64> = best.actions().iter().zip(&before).map(|(now, then)| now - then).collect();
        if way.iter().filter(|along| **along != 0.0).count() > 1 {
            best = climb(best, &way);
        }
        if best.gain() - gain <= EQUAL {
            best = diagonals.iter().fold(best, |best, diagonal| climb(best, diagonal));
        }
        if best.gain() - gain <= EQUAL {
            break;
        }
    }
    best
}

/// Returns the direction of each open interval, as long as the interval.
fn axes(intervals: &[ActionInterval], open: &[usize]) -> Vec<Vec<f64>> {
    let axis = |place: &usize| {
        let mut axis = vec![0.0; intervals.len()];
        axis[*place] = intervals[*place].highest - intervals[*place].lowest;
        axis
    };
    open.iter().map(axis).collect()
}

/// Returns both diagonals of each pair of open intervals.
fn diagonals(intervals: &[ActionInterval], open: &[usize]) -> Vec<Vec<f64>> {
    let axes = axes(intervals, open);
    let mut all = Vec::new();
    for (place, first) in axes.iter().enumerate() {
        for second in &axes[place + 1..] {
            for sign in [1.0, -1.0] {
                all.push(first.iter().zip(second).map(|(along, across)| along + sign * across).collect());
            }
        }
    }
    all
}
