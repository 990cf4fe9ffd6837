//! Prices of actions against a Wasserstein ball: the worst law moves the centre's masses about a support.

use std::cell::Cell;

use super::Pricing;
use super::field::{Field, Payoffs};
use super::solution::{Adversary, LOSS_OF_ROUNDING, WorstExpectation};
use crate::control::problem::dynamics::Trade;
use crate::control::uncertainty::COINCIDENT;
use crate::control::uncertainty::centre::Centre;
use crate::numerics::transport::wasserstein::{WassersteinBall, WorstLaw};

/// The floor gain is flat at the best action: an action off by this costs less than rounding.
const ACTION_TOLERANCE: f64 = 1e-7;
/// Until the support is refined the action only has to locate the mass of the worst law.
const PLACING_TOLERANCE: f64 = 1e-4;
/// Parts into which each interval between exact returns is cut for the support, and again around destinations. Local
/// cubics are good to far less than a part, and two cuts into eight parts locate a destination to 1/256 of an interval.
const SUPPORT_PARTS: usize = 4;
const REFINED_PARTS: usize = 8;
const REFINEMENTS: usize = 2;

/// How far past the window the certificate looks, in log-return: e^-40 of the wealth held is nothing.
const PROOF_REACH: f64 = 40.0;
/// Width of its first interval, and the share of the distance to the window by which intervals widen.
const PROOF_INTERVAL: f64 = 0.02;
const PROOF_GROWTH: f64 = 0.1;
/// Rounding of the envelope, in relative utility.
const PROOF_SLACK: f64 = 1e-12;

/// A ball around `centre`, with the field at the current support.
pub(super) struct TransportPricing<'f> {
    centre: &'f Centre,
    radius: f64,
    field: &'f dyn Field,
    grid: Grid,
    rows: Box<dyn Payoffs<'f> + 'f>,
    refined: bool,
    /// The last multiplier found, over its action: those of similar actions hardly differ.
    steepness: Cell<f64>,
}

/// The support with the centre's masses on it.
struct Grid {
    support: Vec<f64>,
    masses: Vec<f64>,
}

impl<'f> TransportPricing<'f> {
    /// Builds the pricing. Without a radius the centre's atoms alone are the support.
    pub fn new(centre: &'f Centre, radius: f64, field: &'f dyn Field) -> Self {
        let grid = grid(centre, radius, subdivided(field.returns(), SUPPORT_PARTS, |_| true));
        let rows = field.at(&grid.support);
        TransportPricing { centre, radius, field, grid, rows, refined: false, steepness: Cell::new(0.0) }
    }

    fn ball(&self) -> WassersteinBall<'_> {
        WassersteinBall { support: &self.grid.support, masses: &self.grid.masses, radius: self.radius }
    }

    /// Returns a warm start for the multiplier.
    fn guess(&self, trade: Trade) -> f64 {
        self.steepness.get() * trade.action
    }

    /// Returns the worst law; the centre itself if no law loses more than rounding, so that no moves made by rounding
    /// are reported.
    fn worst_law(&self, payoff: &[f64], trade: Trade) -> WorstLaw {
        let worst = self.ball().worst_law_near(payoff, self.guess(trade));
        let centre = WassersteinBall { radius: 0.0, ..self.ball() }.worst_law(payoff);
        if centre.expectation - worst.expectation > LOSS_OF_ROUNDING { worst } else { centre }
    }

    /// Marks the support points that receive mass from elsewhere.
    fn destinations(&self, trades: &[Trade]) -> Vec<bool> {
        let mut near = vec![false; self.grid.support.len()];
        let worst = |trade: &Trade| self.ball().worst_law_near(&self.rows.payoff(*trade), self.guess(*trade));
        for moved in trades.iter().flat_map(|trade| worst(trade).moves) {
            near[moved.to] |= moved.to != moved.from;
        }
        near
    }

    /// Proves from the multiplier that no law with mass outside the window does worse.
    ///
    /// Outside, the payoff is at least u0, the relative utility at zero gain of the step after, which increases with z.
    /// The mass of atom j stays inside if, for every z outside,
    ///
    ///   u0(z) + gamma |z - z_j| >= E_j,   E the envelope inf_z' { v(z') + gamma |z' - z_j| } over the window.
    ///
    /// Below the window, an interval [first - far, first - near] passes if
    ///
    ///   u0(first - far) + gamma near >= max_j { E_j - gamma (z_j - first) },
    ///
    /// because |z - z_j| = (first - z) + (z_j - first). Above it, the window's own edge decides.
    fn certified(&self, payoff: &[f64], worst: &WorstLaw, trade: Trade) -> bool {
        // A ball of radius 0 holds its centre alone, all of whose returns are in the window.
        if self.radius <= 0.0 {
            return true;
        }
        let Grid { support, masses } = &self.grid;
        let (Some(&first), Some(&last)) = (support.first(), support.last()) else { return true };
        let lowest = |z: f64| self.field.least_payoff(trade, z);
        let gamma = worst.multiplier;
        let envelope = self.ball().envelope(payoff, gamma);
        let (mut below, mut above) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        for ((&point, &mass), &value) in support.iter().zip(masses).zip(&envelope) {
            if mass > 0.0 {
                below = below.max(value - gamma * (point - first));
                above = above.max(value - gamma * (last - point));
            }
        }
        let mut near = 0.0;
        while near < PROOF_REACH {
            let far = near + PROOF_INTERVAL + PROOF_GROWTH * near;
            let proved = lowest(first - far) + gamma * near >= below - PROOF_SLACK;
            if !proved {
                return false;
            }
            near = far;
        }
        lowest(last) >= above - PROOF_SLACK
    }
}

impl Pricing for TransportPricing<'_> {
    fn value(&self, trade: Trade) -> f64 {
        let payoff = self.rows.payoff(trade);
        if self.radius <= 0.0 {
            return self.ball().mean(&payoff);
        }
        let (value, multiplier) = self.ball().worst_expectation_near(&payoff, self.guess(trade));
        if trade.action > 0.0 {
            self.steepness.set(multiplier / trade.action);
        }
        value
    }

    fn tolerance(&self) -> f64 {
        if self.radius > 0.0 && !self.refined { PLACING_TOLERANCE } else { ACTION_TOLERANCE }
    }

    fn refine(&mut self, trades: &[Trade]) -> bool {
        // No law can hurt all-bank: its mass need not be located.
        let is_bank = trades.iter().all(|trade| trade.action <= 0.0);
        if self.radius <= 0.0 || self.refined || is_bank {
            return false;
        }
        for _ in 0..REFINEMENTS {
            let near = self.destinations(trades);
            let support =
                subdivided(&self.grid.support, REFINED_PARTS, |interval| near[interval] || near[interval + 1]);
            self.grid = grid(self.centre, self.radius, support);
            self.rows = self.rows.moved_to(&self.grid.support);
        }
        self.refined = true;
        true
    }

    fn worst(&self, trade: Trade) -> WorstExpectation {
        let payoff = self.rows.payoff(trade);
        let worst = self.worst_law(&payoff, trade);
        WorstExpectation {
            value: worst.expectation,
            dual: worst.dual,
            multiplier: worst.multiplier,
            certified: self.certified(&payoff, &worst, trade),
            adversary: Adversary::Transport { support: self.grid.support.clone(), moves: worst.moves },
        }
    }
}

/// Merges the atoms into `points`. A point that almost coincides with an atom is dropped, because mass that moves by a
/// rounding would count as moved.
fn grid(centre: &Centre, radius: f64, points: Vec<f64>) -> Grid {
    let Centre { atoms, masses } = centre;
    if radius <= 0.0 {
        return Grid { support: atoms.clone(), masses: masses.clone() };
    }
    let mut all: Vec<(f64, f64)> = atoms.iter().copied().zip(masses.iter().copied()).collect();
    let apart = |point: &f64| {
        let above = atoms.partition_point(|atom| atom < point);
        let mut near = atoms.iter().take(above + 1).skip(above.saturating_sub(1));
        near.all(|atom| (atom - point).abs() > COINCIDENT)
    };
    all.extend(points.into_iter().filter(apart).map(|point| (point, 0.0)));
    all.sort_by(|left, right| left.0.total_cmp(&right.0));
    all.dedup_by(|next, kept| next.0 == kept.0);
    let (support, masses) = all.into_iter().unzip();
    Grid { support, masses }
}

/// Returns `points` with the chosen intervals cut into equal parts.
fn subdivided(points: &[f64], parts: usize, chosen: impl Fn(usize) -> bool) -> Vec<f64> {
    let mut all = Vec::with_capacity(points.len() * parts);
    for (interval, pair) in points.windows(2).enumerate() {
        all.push(pair[0]);
        if chosen(interval) {
            all.extend((1..parts).map(|part| pair[0] + (pair[1] - pair[0]) * part as f64 / parts as f64));
        }
    }
    all.extend(points.last());
    all
}
