//! What a robust step answers.

use crate::control::problem::actions::Band;
use crate::numerics::confidence_region::NormalLaw;
use crate::numerics::wasserstein::Move;

/// Relative utility that sums of a few hundred roundings may lose: a law that takes no more is not reported as worse.
pub(super) const LOSS_OF_ROUNDING: f64 = 1e-14;

/// The solution of the robust step at one state.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustSolution {
    /// The best action, a share of wealth: where the band brings the holding to.
    pub action: f64,
    /// The holdings that are best kept; where trading costs nothing both ends are the action.
    pub band: Band,
    /// Log certainty equivalent over the all-bank floor.
    pub floor_gain: f64,
    /// Primal minus dual value, in log certainty equivalent; 0 over normal laws, which are searched without a dual.
    pub duality_gap: f64,
    /// Lost relative utility per unit of radius.
    pub multiplier: f64,
    /// The same in log certainty equivalent.
    pub radius_cost: f64,
    /// The worst law for the action.
    pub adversary: Adversary,
    /// True where the multiplier proves that no mass wants to leave the window, and over normal laws, which have none.
    pub certified: bool,
}

/// The law that is worst for an action: psi* of the paper.
#[derive(Debug, Clone, PartialEq)]
pub enum Adversary {
    /// Of a ball: the centre's masses moved about a support of log-returns, ascending.
    Transport {
        /// Log-returns, ascending.
        support: Vec<f64>,
        /// By indices into the support.
        moves: Vec<Move>,
    },
    /// Of a confidence region, around its estimate.
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
