//! The worst case behind an advice, in figures and in one sentence.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::bellman::solution::{Adversary, RobustSolution};
use crate::control::policy::advice::Advice;
use crate::control::request::centre::CentreSpecification;
use crate::numerics::law::confidence_region::NormalLaw;
use crate::numerics::transport::wasserstein::Move;

/// Radius, in log-return, for which the sentence gives the price.
const RADIUS_UNIT: f64 = 0.001;
/// Basis points in one.
const BASIS_POINTS: f64 = 1e4;

/// The law that is worst for the advised allocation: a transport of the ball's centre or, in the parametric frameworks,
/// a normal law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorstCase {
    /// Lagrange multiplier of the uncertainty set: utility lost per unit of extra radius.
    pub multiplier: f64,
    /// Loss of log certainty equivalent per unit of extra radius: the slope at this radius, for this period's ball
    /// alone. A wider ball costs at most this slope times the extra radius. It never costs more than the whole worth of
    /// the advice above the floor.
    pub radius_cost: f64,
    /// The transport of mass; empty in the parametric frameworks.
    pub transport: Vec<TransportedMass>,
    /// The worst normal law and the estimated one; absent in the other frameworks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<WorstNormalLaw>,
    /// Difference between primal and dual value, in log certainty equivalent; 0 in the parametric frameworks.
    pub duality_gap: f64,
    /// The worst case in one plain sentence.
    pub sentence: String,
}

/// The worst mean and variance of the log-return of one period, within the confidence region of the estimates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorstNormalLaw {
    /// Worst mean of the log-return, per step.
    pub mean: f64,
    /// Worst variance of the log-return, per step.
    pub variance: f64,
    /// Mean estimated from the returns, per step.
    pub estimated_mean: f64,
    /// Variance estimated from the returns, per step.
    pub estimated_variance: f64,
}

/// Mass of one atom and the adversary's destination for it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TransportedMass {
    /// Log-return of the centre; an observed one, unless `problem.centre` says otherwise.
    pub atom: f64,
    /// Log-return in the worst case; equal to `atom` if the mass stays.
    pub moved_to: f64,
    /// The mass, a probability.
    pub mass: f64,
}

/// The figures of the worst-case law of log-returns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorstLawSummary {
    /// Mean per step.
    pub mean: f64,
    /// Standard deviation per square root of a step.
    pub standard_deviation: f64,
    /// Share of the probability that moves; absent if laws are normal, because none is a transport of the observed
    /// returns.
    pub share_moved: Option<f64>,
    /// Lowest log-return that mass moves to; absent if none moves.
    pub lowest_destination: Option<f64>,
}

impl WorstCase {
    /// Returns the figures of the worst law; `None` if the robust step has no solution.
    pub fn summary(&self) -> Option<WorstLawSummary> {
        if let Some(normal) = self.normal {
            let (mean, standard_deviation) = (normal.mean, normal.variance.sqrt());
            return Some(WorstLawSummary { mean, standard_deviation, share_moved: None, lowest_destination: None });
        }
        if self.transport.is_empty() {
            return None;
        }
        let expectation =
            |of: &dyn Fn(f64) -> f64| self.transport.iter().map(|mass| mass.mass * of(mass.moved_to)).sum::<f64>();
        let mean = expectation(&|z| z);
        let (share_moved, lowest_destination) = moved(&self.transport);
        Some(WorstLawSummary {
            mean,
            standard_deviation: expectation(&|z| (z - mean).powi(2)).sqrt(),
            share_moved: Some(share_moved),
            lowest_destination,
        })
    }

    /// Returns the result for a robust step without a finite solution.
    pub fn unknown() -> Self {
        let sentence =
            "The robust step has no finite solution at this state, or its wealth does not cover the withdrawals, so all wealth stays in the bank.".to_owned();
        WorstCase { multiplier: 0.0, radius_cost: 0.0, transport: Vec::new(), normal: None, duality_gap: 0.0, sentence }
    }

    /// Returns the worst law of a solved step. `utility_scale` turns relative utility into utility.
    pub fn of(
        solution: &RobustSolution,
        advice: &Advice,
        centre: &CentreSpecification,
        utility_scale: f64,
    ) -> WorstCase {
        let (transport, normal, sentence) = match &solution.adversary {
            Adversary::Transport { support, moves } => {
                let mass = |m: &Move| TransportedMass { atom: support[m.from], moved_to: support[m.to], mass: m.mass };
                let transport: Vec<TransportedMass> = moves.iter().map(mass).collect();
                let sentence = transport_sentence(&transport, advice, centre, solution.radius_cost);
                (transport, None, sentence)
            }
            Adversary::Normal { worst, estimate } => {
                let normal = WorstNormalLaw {
                    mean: worst.mean,
                    variance: worst.variance,
                    estimated_mean: estimate.mean,
                    estimated_variance: estimate.variance,
                };
                (Vec::new(), Some(normal), normal_sentence(*worst, *estimate, advice))
            }
        };
        let multiplier = solution.multiplier * utility_scale;
        let RobustSolution { radius_cost, duality_gap, .. } = *solution;
        WorstCase { multiplier, radius_cost, transport, normal, duality_gap, sentence }
    }
}

/// Returns the probability that a transport moves, and the lowest return that any of it moves to.
fn moved(transport: &[TransportedMass]) -> (f64, Option<f64>) {
    let moved = || transport.iter().filter(|mass| mass.atom != mass.moved_to);
    (moved().map(|mass| mass.mass).sum(), moved().map(|mass| mass.moved_to).reduce(f64::min))
}

/// Returns the basis points of the certainty equivalent that a ball of this period alone, wider by `wider`, costs at
/// most. The worth is convex in the radius, so it falls by no more than its slope, and never below the floor.
/// Checked by: `tests/solver/bellman.rs::a_wider_ball_costs_at_most_what_is_said`.
pub fn most_cost(wider: f64, radius_cost: f64, advice: &Advice) -> f64 {
    let above = (advice.certainty_equivalent / advice.floor).ln();
    BASIS_POINTS * (wider * radius_cost).min(above).max(0.0)
}

fn transport_sentence(
    transport: &[TransportedMass],
    advice: &Advice,
    centre: &CentreSpecification,
    radius_cost: f64,
) -> String {
    let middle = centre.in_words(advice.sample_size);
    if let (share, Some(lowest)) = moved(transport)
        && share > 0.0
    {
        let moves = if lowest >= 0.0 {
            format!("counts the best {:.1} % of the periods as only {:.1} %", 100.0 * share, 100.0 * lowest.exp_m1())
        } else {
            let lowest = 100.0 * lowest.exp_m1();
            format!("moves {:.1} % of the probability, down to a return of {lowest:.1} % in one period", 100.0 * share)
        };
        format!(
            "Against an allocation of {:.1} %, the worst law within distance {:.4} of {middle} {moves}. Against the \
             worst laws \
             of this period and of any later ones, the allocation is still worth {:.2} for certain {}; the bank \
             alone pays {:.2}. A ball of this period alone wider by {RADIUS_UNIT} would cost at most {:.2} basis points of that worth.",
            100.0 * advice.allocation,
            advice.radius,
            advice.certainty_equivalent,
            when(advice),
            advice.floor,
            most_cost(RADIUS_UNIT, radius_cost, advice)
        )
    } else {
        format!(
            "At an allocation of {:.1} % no law within distance {:.4} of {middle} does worse than the one in the middle.",
            100.0 * advice.allocation,
            advice.radius
        )
    }
}

/// Says when the certainty equivalent of an advice is had: with spending in every period.
fn when(advice: &Advice) -> &'static str {
    advice.spending.map_or("at the horizon", |_| "in every period, in money of now")
}

fn normal_sentence(worst: NormalLaw, estimate: NormalLaw, advice: &Advice) -> String {
    if worst == estimate {
        return format!(
            "At an allocation of {:.1} % no normal law in the confidence region does worse than the estimated one, of mean \
             log-return {:.2} % and variance {:.2e} a period.",
            100.0 * advice.allocation,
            100.0 * estimate.mean,
            estimate.variance
        );
    }
    format!(
        "Against an allocation of {:.1} %, the worst normal law in the confidence region has a mean log-return of {:.2} % \
         and a variance of {:.2e} a period; the estimates are {:.2} % and {:.2e}. Against the worst laws of this \
         period and of any \
         later ones, the allocation is still worth {:.2} for certain {}; the bank alone pays {:.2}.",
        100.0 * advice.allocation,
        100.0 * worst.mean,
        worst.variance,
        100.0 * estimate.mean,
        estimate.variance,
        advice.certainty_equivalent,
        when(advice),
        advice.floor
    )
}
