//! The worst case behind an advice, in figures and in one sentence.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::advisor::Advice;
use super::bellman::RobustSolution;

/// The law that is worst for the advised allocation, as a transport of the empirical law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorstCase {
    /// Lagrange multiplier of the ball: utility lost per unit of extra radius.
    pub multiplier: f64,
    pub transport: Vec<TransportedMass>,
    /// Difference between primal and dual value, in log certainty equivalent.
    pub duality_gap: f64,
    /// The worst case in one plain sentence.
    pub sentence: String,
}

/// Mass of one atom and where the adversary puts it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TransportedMass {
    /// Observed log-return.
    pub atom: f64,
    /// Log-return in the worst case; equal to `atom` where the mass stays.
    pub moved_to: f64,
    pub mass: f64,
}

/// The worst-case law in figures, of log-returns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorstLawSummary {
    pub mean: f64,
    pub standard_deviation: f64,
    /// Share of the probability that moves.
    pub share_moved: f64,
    /// Lowest log-return that mass moves to; absent where none moves.
    pub lowest_destination: Option<f64>,
}

impl WorstCase {
    /// The worst law in figures; `None` where the robust step has no solution.
    pub fn summary(&self) -> Option<WorstLawSummary> {
        if self.transport.is_empty() {
            return None;
        }
        let expectation =
            |of: &dyn Fn(f64) -> f64| self.transport.iter().map(|mass| mass.mass * of(mass.moved_to)).sum::<f64>();
        let mean = expectation(&|z| z);
        let moved = || self.transport.iter().filter(|mass| mass.atom != mass.moved_to);
        Some(WorstLawSummary {
            mean,
            standard_deviation: expectation(&|z| (z - mean).powi(2)).sqrt(),
            share_moved: moved().map(|mass| mass.mass).sum(),
            lowest_destination: moved().map(|mass| mass.moved_to).reduce(f64::min),
        })
    }

    /// Where the robust step has no finite solution.
    pub fn unknown() -> Self {
        let sentence =
            "The robust step has no finite solution at this state, so all wealth stays in the bank.".to_owned();
        WorstCase { multiplier: 0.0, transport: Vec::new(), duality_gap: 0.0, sentence }
    }

    /// The worst law of a solved step. `utility_scale` turns relative utility into utility.
    pub fn of(solution: &RobustSolution, advice: &Advice, utility_scale: f64) -> WorstCase {
        let transport: Vec<TransportedMass> = solution
            .worst
            .moves
            .iter()
            .map(|m| TransportedMass { atom: solution.support[m.from], moved_to: solution.support[m.to], mass: m.mass })
            .collect();
        let moved = transport.iter().filter(|mass| mass.atom != mass.moved_to);
        let share: f64 = moved.clone().map(|mass| mass.mass).sum();
        let lowest = moved.clone().map(|mass| mass.moved_to).fold(f64::INFINITY, f64::min);
        let sentence = if share > 0.0 {
            format!(
                "Against an allocation of {:.1} %, the worst law within distance {:.4} of the {} returns seen moves {:.1} % of \
             the probability, down to a return of {:.1} % in one period; against that law the allocation is still worth \
             {:.2} for certain at the horizon, and all-bank {:.2}.",
                100.0 * advice.allocation,
                advice.radius,
                advice.sample_size,
                100.0 * share,
                100.0 * lowest.exp_m1(),
                advice.certainty_equivalent,
                advice.floor
            )
        } else {
            format!(
                "At an allocation of {:.1} % no law within distance {:.4} of the {} returns seen does worse than the empirical one.",
                100.0 * advice.allocation,
                advice.radius,
                advice.sample_size
            )
        };
        WorstCase {
            multiplier: solution.multiplier * utility_scale,
            transport,
            duality_gap: solution.duality_gap,
            sentence,
        }
    }
}
