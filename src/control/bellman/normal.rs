//! Prices of actions against a confidence region of normal laws: the worst mean and variance of its boundary.
//!
//! If returns are learned, the estimates (m, v) of n returns become, with z in them,
//!
//!   m' = m + (z - m)/(n+1),  v' = n v/(n+1) + n (z - m)^2/(n+1)^2.
//!
//! Source: Bielecki, Chen, Cialenco, Cousin and Jeanblanc (2019), Adaptive robust control under model uncertainty, SIAM
//! J. Control Optim. 57.

use super::Pricing;
use super::field::{Field, Payoffs};
use super::solution::{Adversary, LOSS_OF_ROUNDING, WorstExpectation};
use crate::control::problem::dynamics::Trade;
use crate::numerics::law::confidence_region::{ConfidenceRegion, NormalLaw, Quadrature, WorstNormal};

/// The worst law of every action is itself computed to 1e-6 of an angle: a finer action would be noise.
const ACTION_TOLERANCE: f64 = 1e-6;

/// A region, with the field at the nodes of the laws that every action is tried against.
pub(super) struct NormalPricing<'f> {
    region: ConfidenceRegion,
    field: &'f dyn Field,
    rows: Box<dyn Payoffs<'f> + 'f>,
    quadrature: Quadrature,
}

impl<'f> NormalPricing<'f> {
    pub fn new(region: ConfidenceRegion, field: &'f dyn Field) -> Self {
        let nodes: Vec<f64> = region.angles().flat_map(|angle| region.at(angle).nodes()).collect();
        NormalPricing { region, field, rows: field.at(&nodes), quadrature: Quadrature::default() }
    }

    fn expectation(&self, law: NormalLaw, trade: Trade) -> f64 {
        let nodes: Vec<f64> = law.nodes().collect();
        self.quadrature.expectation(&self.field.at(&nodes).payoff(trade))
    }

    /// Returns the expected relative utility under the laws that every action is tried against.
    fn tried(&self, trade: Trade) -> Vec<f64> {
        let payoff = self.rows.payoff(trade);
        payoff.chunks_exact(self.quadrature.count()).map(|payoff| self.quadrature.expectation(payoff)).collect()
    }

    fn worst_normal(&self, trade: Trade) -> WorstNormal {
        self.region.worst(&self.tried(trade), |law| self.expectation(law, trade))
    }
}

impl Pricing for NormalPricing<'_> {
    fn value(&self, trade: Trade) -> f64 {
        self.worst_normal(trade).expectation
    }

    fn rough_value(&self, trade: Trade) -> f64 {
        self.tried(trade).into_iter().fold(f64::INFINITY, f64::min)
    }

    fn tolerance(&self) -> f64 {
        ACTION_TOLERANCE
    }

    fn refine(&mut self, _: &[Trade]) -> bool {
        false
    }

    fn worst(&self, trade: Trade) -> WorstExpectation {
        let (worst, estimate) = (self.worst_normal(trade), self.region.estimate);
        let loss = self.expectation(estimate, trade) - worst.expectation;
        let reported = if loss > LOSS_OF_ROUNDING { worst.law } else { estimate };
        WorstExpectation {
            value: worst.expectation,
            dual: worst.expectation,
            multiplier: self.region.multiplier(&worst, |law| self.expectation(law, trade)),
            adversary: Adversary::Normal { worst: reported, estimate },
            certified: true,
        }
    }
}
