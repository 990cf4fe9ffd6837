//! How many states of each kind a step has, and their numbers.

use std::ops::Range;

/// Number of the first state that leaps, after all others. A leaping state is numbered from here.
pub const LEAPING: usize = 1 << 32;
/// Candidates simulated for each design point.
pub const CANDIDATES_PER_POINT: usize = 3;
/// One design point in this many is used as drawn.
const AS_DRAWN: usize = 4;
/// One design point in this many leaps beyond the record.
pub const LEAPS: usize = 8;
/// Fresh states that leap, for each set of fresh states that do not.
pub const LEAPING_CHECKS: usize = 50;

/// The number of states of each kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Counts {
    /// Design points, N; the largest number if an accuracy is asked for.
    pub design: usize,
    /// True if they are chosen among candidates; otherwise they are all the candidates.
    pub chosen: bool,
    /// True if some of them leap beyond the record.
    pub leaps: bool,
    /// Fresh states that set the guard.
    pub guards: Range<usize>,
}

impl Counts {
    /// Counts the states with `guards` fresh states, which come after the candidates.
    pub fn new(design: usize, chosen: bool, guards: usize) -> Self {
        let counts = Counts { design, chosen, leaps: false, guards: 0..0 };
        let first = counts.candidates(design);
        Counts { guards: first..first + guards, ..counts }
    }

    /// Returns how many of `design` points are the first candidates as drawn.
    pub fn as_drawn(&self, design: usize) -> usize {
        if self.chosen { design.div_ceil(AS_DRAWN) - self.leaping(design) } else { design }
    }

    /// Returns how many of `design` points leap beyond the record.
    pub fn leaping(&self, design: usize) -> usize {
        if self.leaps { design / LEAPS } else { 0 }
    }

    /// Returns the leaping states that judge a round; each round has its own.
    pub fn leaping_checks(&self, set: usize) -> Range<usize> {
        let start = LEAPING + self.leaping(self.design) + set * LEAPING_CHECKS;
        start..start + LEAPING_CHECKS
    }

    /// Returns the number of candidates for `design` points.
    pub fn candidates(&self, design: usize) -> usize {
        if self.chosen { CANDIDATES_PER_POINT * design } else { design }
    }

    /// Returns the fresh states of a round; each round has its own.
    pub fn guards(&self, round: usize) -> Range<usize> {
        let start = self.guards.start + round * self.guards.len();
        start..start + self.guards.len()
    }
}
