//! The result of a robust step.

use crate::control::problem::actions::Band;
use crate::numerics::law::confidence_region::NormalLaw;
use crate::numerics::transport::wasserstein::Move;

/// Relative utility that sums of a few hundred roundings may lose: a law that loses no more is not reported as worse.
pub(super) const LOSS_OF_ROUNDING: f64 = 1e-14;

/// The solution of the robust step at one state.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustSolution {
    /// The best action, a share of wealth: the point of the band to which the holding trades.
    pub action: f64,
    /// The no-trade region of holdings; if trading costs nothing both ends are the action.
    pub band: Band,
    /// Log certainty equivalent over the all-bank floor.
    pub floor_gain: f64,
    /// Primal minus dual value, in log certainty equivalent; 0 over normal laws, which are searched without a dual.
    pub duality_gap: f64,
    /// Lost relative utility per unit of radius.
    pub multiplier: f64,
    /// Lost log certainty equivalent per unit of radius.
    pub radius_cost: f64,
    /// The worst law for the action.
    pub adversary: Adversary,
    /// True if the multiplier proves that no mass wants to leave the window, and for normal laws, which have no window.
    pub certified: bool,
}

/// The law that is worst for an action: psi* of the paper.
#[derive(Debug, Clone, PartialEq)]
pub enum Adversary {
    /// The worst law of a ball: the centre's masses moved about a support of log-returns, ascending.
    Transport {
        /// Log-returns, ascending.
        support: Vec<f64>,
        /// The moves, by indices into the support.
        moves: Vec<Move>,
    },
    /// The worst law of a confidence region, with its estimate.
    Normal {
        /// The law itself, of log-returns.
        worst: NormalLaw,
        /// The middle of the region.
        estimate: NormalLaw,
    },
}

/// The worst expectation of relative utility under one action, with its law.
pub(super) struct WorstExpectation {
    pub value: f64,
    /// Its lower bound by duality.
    pub dual: f64,
    pub multiplier: f64,
    pub adversary: Adversary,
    pub certified: bool,
}
