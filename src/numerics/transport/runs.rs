//! Maps points of a line to the points that receive their mass, as runs of adjacent points.
//!
//! Checked by: `src/numerics/transport/wasserstein.rs::primal_and_dual_meet_over_many_points`.

use std::ops::Range;

/// Adjacent points whose mass all goes to one point.
#[derive(Debug, Clone)]
pub(in crate::numerics) struct MassRun {
    pub points: Range<usize>,
    pub to: usize,
}

/// Returns the target of the run at a point, if there is one, and the end of that run or the start of the next. Drops
/// runs that end before the point.
pub(in crate::numerics) fn passed(runs: &mut &[MassRun], at: usize) -> (Option<usize>, usize) {
    let before = runs.iter().take_while(|run| run.points.end <= at).count();
    *runs = &runs[before..];
    match runs.first() {
        None => (None, usize::MAX),
        Some(MassRun { points, to }) if points.start <= at => (Some(*to), points.end),
        Some(MassRun { points, .. }) => (None, points.start),
    }
}

/// Levels `v - slope s` at every point. At a multiplier, mass that moves down goes to the least level below, with the
/// multiplier as slope. Mass that moves up goes to the least level above, with the negative multiplier as slope. Points
/// that rise from a least level form a run that goes to it, until another level is as low.
#[derive(Clone, Copy)]
pub(super) struct Levels<'a> {
    pub support: &'a [f64],
    pub payoff: &'a [f64],
    pub slope: f64,
}

impl Levels<'_> {
    #[inline(always)]
    fn of(self, points: Range<usize>) -> impl Iterator<Item = f64> {
        let Levels { support, payoff, slope } = self;
        support[points.clone()].iter().zip(&payoff[points]).map(move |(point, value)| value - slope * point)
    }

    /// Counts the adjacent pairs for which `is` holds, without branches.
    #[inline(always)]
    fn steps(self, pairs: Range<usize>, is: impl Fn(f64, f64) -> bool) -> usize {
        let next = self.of(pairs.start + 1..pairs.end + 1);
        self.of(pairs).zip(next).map(|(level, next)| usize::from(is(level, next))).sum()
    }

    #[inline(always)]
    fn as_low(self, point: usize) -> impl Fn(Range<usize>) -> usize {
        let least = self.payoff[point] - self.slope * self.support[point];
        move |points| self.of(points).map(|level| usize::from(level <= least)).sum()
    }

    /// Finds the runs of `from` that go down to a point of `between`.
    #[inline(always)]
    pub fn downs(self, between: &Range<usize>, from: &Range<usize>, downs: &mut Vec<MassRun>) {
        downs.clear();
        let (mut at, end) = (between.start, from.end);
        let rises = |pairs| self.steps(pairs, |level, next| next > level);
        while let Some(to) = first(at..end.saturating_sub(1), rises) {
            at = first(to + 2..end, self.as_low(to)).unwrap_or(end);
            let points = from.start.max(to + 1)..at;
            if !points.is_empty() {
                downs.push(MassRun { points, to });
            }
        }
    }

    /// Finds the runs of `from` that go up to a point of `between`, from the highest on.
    #[inline(always)]
    pub fn ups(self, between: &Range<usize>, from: &Range<usize>, ups: &mut Vec<MassRun>) {
        ups.clear();
        let (start, mut end) = (from.start, between.end);
        let falls = |pairs| self.steps(pairs, |level, next| level > next);
        while let Some(highest) = last(start..end.saturating_sub(1), falls) {
            let to = highest + 1;
            end = last(start..highest, self.as_low(to)).map_or(start, |low| low + 1);
            let points = end..from.end.min(to);
            if !points.is_empty() {
                ups.push(MassRun { points, to });
            }
        }
    }
}

/// The number of points that are counted together before one of them is searched for.
const BLOCK: usize = 64;

/// Returns the first of `points` that counts.
#[inline(always)]
fn first(points: Range<usize>, count: impl Fn(Range<usize>) -> usize) -> Option<usize> {
    let block = |start: usize| start..points.end.min(start + BLOCK);
    let mut found = points.clone().step_by(BLOCK).map(block).filter(|some| count(some.clone()) > 0);
    found.next().and_then(|mut some| some.find(|&point| count(point..point + 1) > 0))
}

/// Returns the last of `points` that counts.
#[inline(always)]
fn last(points: Range<usize>, count: impl Fn(Range<usize>) -> usize) -> Option<usize> {
    let block = |passed: usize| points.start.max((points.end - passed).saturating_sub(BLOCK))..points.end - passed;
    let mut found = (0..points.len()).step_by(BLOCK).map(block).filter(|some| count(some.clone()) > 0);
    found.next().and_then(|some| some.rev().find(|&point| count(point..point + 1) > 0))
}
