//! The uncertainty set C of a state: the laws of the coming return that the investor is robust against.
//!
//!   C = { F : W1(F, centre) <= radius }        paper (2.5)
//!
//! or, if returns are assumed normal, the joint confidence region of mean and variance.

mod calibration;
pub mod centre;
mod correction;
pub mod joint;
pub mod laws;
pub mod radius;
pub mod shared_summaries;

use self::centre::Centre;
use crate::control::request::support::{Interval, Support};
use crate::numerics::law::confidence_region::{ConfidenceRegion, NormalLaw};

/// Log-returns closer than this count as equal.
pub const COINCIDENT: f64 = 1e-12;
/// Exact returns across the atoms of a centre: intervals of a sixteenth, between which local cubics are good to 3e-7.
const CORE_RETURNS: usize = 16;
/// Least distance of exact returns, a hundredth of a percent, because atoms may almost coincide.
const SMALLEST_SPACING: f64 = 1e-4;
/// Spacing of exact returns around an estimated mean, in estimated standard deviations, and the range of that spacing.
const CORE_SPACING: f64 = 0.25;
const CORE_REACH: f64 = 5.0;
/// Ratio by which the spacing grows outside, where the field is smoother and weighs less.
const TAIL_RATIO: f64 = 1.4;

/// The laws that the investor is robust against in one state.
#[derive(Debug, Clone, PartialEq)]
pub enum UncertaintySet {
    /// One law, assumed to be true.
    Point(Centre),
    /// The laws within a Wasserstein distance of the centre.
    Ball {
        /// The law in the middle.
        centre: Centre,
        /// In log-return, positive.
        radius: f64,
        /// Log-returns that laws may give mass to; `None` allows all.
        support: Option<Interval>,
    },
    /// The normal laws that the estimates do not reject.
    Region(ConfidenceRegion),
}

/// How far the window of returns reaches below and above the atoms, in log-return.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    below: f64,
    above: f64,
}

impl Reach {
    /// Enough for monthly returns; the certificate of the step shows if it is not.
    pub const FIRST: Reach = Reach { below: 0.6, above: 0.3 };

    /// Returns twice the reach both ways.
    pub fn doubled(self) -> Self {
        Reach { below: 2.0 * self.below, above: 2.0 * self.above }
    }
}

impl UncertaintySet {
    /// Returns the ball around `centre` on the support that the rule has there; the centre alone without a radius.
    pub fn around(centre: Centre, radius: f64, support: Support) -> Self {
        if radius > 0.0 {
            let support = support.around(|| centre.extent());
            UncertaintySet::Ball { centre, radius, support }
        } else {
            UncertaintySet::Point(centre)
        }
    }

    /// Returns the set of the same centre with another radius, in the same unit.
    pub fn with_radius(self, radius: f64, support: Support) -> Self {
        match self {
            UncertaintySet::Point(centre) | UncertaintySet::Ball { centre, .. } => {
                UncertaintySet::around(centre, radius, support)
            }
            UncertaintySet::Region(region) => UncertaintySet::Region(ConfidenceRegion { radius, ..region }),
        }
    }

    /// Returns the variance of the law in the middle, per step.
    pub fn variance(&self) -> f64 {
        match self {
            UncertaintySet::Point(centre) | UncertaintySet::Ball { centre, .. } => centre.variance(),
            UncertaintySet::Region(region) => region.estimate.variance,
        }
    }

    /// Returns the best log-return of the law in the middle; of a normal law, the log of the mean of e^Z.
    pub fn best_return(&self) -> f64 {
        match self {
            UncertaintySet::Point(centre) | UncertaintySet::Ball { centre, .. } => centre.highest(),
            UncertaintySet::Region(region) => region.estimate.mean + 0.5 * region.estimate.variance,
        }
    }

    /// Returns true if the window of returns is a choice: for a ball on the whole line.
    pub fn has_window(&self) -> bool {
        matches!(self, UncertaintySet::Ball { support: None, .. })
    }

    /// Returns the returns at which the value of the next state must be exact, ascending and distinct: evenly over the
    /// likely range, then with growing gaps as far as the adversary goes.
    pub fn exact_returns(&self, reach: Reach) -> Vec<f64> {
        match self {
            UncertaintySet::Point(centre) => core_returns(centre.lowest(), centre.highest()).0,
            UncertaintySet::Ball { centre, support, .. } => ball_returns(centre, *support, reach),
            UncertaintySet::Region(region) => region_returns(region),
        }
    }
}

/// Returns even points from the lowest to the highest atom, and their spacing.
fn core_returns(lowest: f64, highest: f64) -> (Vec<f64>, f64) {
    let gap = ((highest - lowest) / CORE_RETURNS as f64).max(SMALLEST_SPACING);
    ((0..=CORE_RETURNS).map(|index| lowest + index as f64 * gap).collect(), gap)
}

/// Returns the returns after `start`, as long as `next` gives one for the return before and the gap, which grows.
fn tail(start: f64, mut gap: f64, next: impl Fn(f64, f64) -> Option<f64>) -> Vec<f64> {
    let mut returns = Vec::new();
    let mut at = start;
    while let Some(further) = next(at, gap) {
        returns.push(further);
        at = further;
        gap *= TAIL_RATIO;
    }
    returns
}

fn ball_returns(centre: &Centre, support: Option<Interval>, reach: Reach) -> Vec<f64> {
    let (lowest, highest) = (centre.lowest(), centre.highest());
    let (mut returns, gap) = core_returns(lowest, highest);
    let (low, high) = match support {
        Some(Interval { min, max }) => (min, max),
        None => (lowest - reach.below, highest + reach.above),
    };
    for (start, limit, sign) in [(lowest, low, -1.0), (returns[CORE_RETURNS], high, 1.0)] {
        returns.extend(tail(start, gap, |at, gap| {
            let left = sign * (limit - at);
            (left > COINCIDENT).then_some(if left > 1.5 * gap { at + sign * gap } else { limit })
        }));
    }
    returns.retain(|&z| z >= low && z <= high);
    returns.sort_by(f64::total_cmp);
    returns.dedup();
    returns
}

/// Returns exact returns as far as any law of the region has nodes.
fn region_returns(region: &ConfidenceRegion) -> Vec<f64> {
    let NormalLaw { mean, variance } = region.estimate;
    let gap = CORE_SPACING * variance.sqrt();
    let core = (CORE_REACH / CORE_SPACING) as i32;
    let mut returns: Vec<f64> = (-core..=core).map(|index| mean + f64::from(index) * gap).collect();
    let (low, high) = region.window();
    for (start, limit, sign) in [(returns[0], low, -1.0), (returns[returns.len() - 1], high, 1.0)] {
        let next = |at: f64, gap: f64| (sign * (limit - at) > 0.0).then_some(at + sign * gap);
        returns.extend(tail(start, TAIL_RATIO * gap, next));
    }
    returns.sort_by(f64::total_cmp);
    returns
}
