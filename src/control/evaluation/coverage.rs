//! How often a ball holds the law that a record was drawn from, how wide the ball is, and how much its robust advice
//! loses.
//!
//! Records of n log-returns are drawn from a known law. Each record serves as a history: it gives the centre, and the
//! rule gives the radius. The ball holds the law if the Wasserstein distance from the centre to it is at most the
//! radius. The law scores the one-step advice of the ball:
//!
//!   lost(a) = 1e4 (ln CE(a*) - ln CE(a)),   CE(a) = U^-1( E[ U(w(a, Z)) ] ),   a* the best for the law itself,
//!
//! in basis points per period. All centres and rules see the same records.

use std::ops::RangeInclusive;

use rand::RngExt;
use rayon::prelude::*;

use crate::control::error::FieldError;
use crate::control::kept::Cache;
use crate::control::policy::one_period::OnePeriod;
use crate::control::problem::utility::RelativeUtility;
use crate::control::request::centre::CentreSpecification;
use crate::control::request::radius_rule::RadiusRule;
use crate::control::request::rules::LOG_RETURN;
use crate::control::request::specification::{ProblemSpecification, Specification, UtilitySpecification};
use crate::control::uncertainty::centre::Centre;
use crate::numerics::law::ContinuousLaw;
use crate::numerics::law::law_distance::{LawDistance, Placed, distance_of_masses};
use crate::numerics::machine::streams::stream;
use crate::numerics::search::minimise::maximise_concave_scalar;
use crate::numerics::statistics::block_bootstrap::circular_blocks;
use crate::numerics::statistics::summary::{Clustered, Estimate};

/// Basis points in one.
const BASIS_POINTS: f64 = 1e4;
/// Tolerance of the best allocation for a law.
const ALLOCATION_TOLERANCE: f64 = 1e-6;
/// Range for the number of groups of records; the largest divisor of the number of records is used.
const GROUPS: RangeInclusive<usize> = 10..=25;
/// Most draws of a record: one whose returns are all equal has no ball and is drawn again.
const DRAWS: usize = 100;

/// A law that records are drawn from.
#[derive(Debug, Clone)]
pub enum DrawnLaw {
    /// Independent draws.
    Continuous(ContinuousLaw),
    /// Blocks of consecutive past returns, oldest first, which keep the dependence of a return on earlier ones.
    Blocks {
        /// Log-returns.
        returns: Vec<f64>,
        /// Periods in a block.
        length: usize,
    },
}

/// The settings of a coverage study.
#[derive(Debug, Clone)]
pub struct CoverageQuestion {
    /// Returns in a record.
    pub size: usize,
    /// Records drawn.
    pub records: usize,
    /// Interest rate of the bank per period.
    pub rate_per_step: f64,
    /// Utility of the investor, whose initial wealth is 100.
    pub utility: UtilitySpecification,
    /// Centres of the balls; none of them uses the law.
    pub centres: Vec<CentreSpecification>,
    /// Radius rules of the balls.
    pub rules: Vec<RadiusRule>,
    /// Seed of all draws.
    pub seed: u64,
    /// Confidence level of the intervals.
    pub level: f64,
}

/// Coverage, radius and loss of a centre and a rule under a law.
#[derive(Debug, Clone, PartialEq)]
pub struct BallCoverage {
    /// Share of records whose ball holds the law.
    pub covered: Estimate,
    /// The mean radius, in log-return.
    pub radius: Estimate,
    /// Mean loss of certainty equivalent, in basis points per period.
    pub lost: Estimate,
    /// Mean share of wealth in the asset.
    pub allocation: f64,
}

/// A law prepared for drawing records.
struct Prepared<'a> {
    law: &'a DrawnLaw,
    distance: Option<LawDistance>,
    /// Atoms of the law, ascending, and their masses; a continuous law is discretised by quadrature.
    atoms: Vec<f64>,
    masses: Vec<f64>,
}

impl<'a> Prepared<'a> {
    fn of(law: &'a DrawnLaw) -> Self {
        match law {
            DrawnLaw::Continuous(continuous) => {
                let (mut atoms, masses) = continuous.quadrature();
                atoms.iter_mut().for_each(|atom| *atom = accepted(*atom));
                Prepared { law, distance: Some(LawDistance::new(continuous.clone(), 1.0, [])), atoms, masses }
            }
            DrawnLaw::Blocks { returns, .. } => {
                let mut atoms = returns.clone();
                atoms.sort_by(f64::total_cmp);
                let masses = vec![1.0 / atoms.len() as f64; atoms.len()];
                Prepared { law, distance: None, atoms, masses }
            }
        }
    }

    /// Draws one record. Stream: (seed, "coverage", n, index).
    fn record(&self, question: &CoverageQuestion, index: usize) -> Vec<f64> {
        let mut generator = stream(question.seed, "coverage", question.size, index);
        let mut draw = || match self.law {
            DrawnLaw::Continuous(law) => {
                (0..question.size).map(|_| accepted(law.draw(&mut generator))).collect::<Vec<f64>>()
            }
            DrawnLaw::Blocks { returns, length } => {
                let mut record: Vec<f64> = Vec::new();
                while record.len() < question.size {
                    let indices = circular_blocks(returns.len(), *length, &mut generator);
                    record.extend(indices.into_iter().map(|at| returns[at]));
                }
                record.truncate(question.size);
                record
            }
        };
        let varies = |record: &Vec<f64>| record.iter().any(|value| *value != record[0]);
        (0..DRAWS).map(|_| draw()).find(varies).unwrap_or_default()
    }

    /// Returns the distance from a centre to the law itself.
    fn distance(&self, centre: &Centre) -> f64 {
        let weighed = centre.atoms.iter().copied().zip(centre.masses.iter().copied());
        if let Some(distance) = &self.distance {
            let placed: Vec<Placed> = weighed.map(|(atom, mass)| distance.place(atom, mass)).collect();
            return distance.distance(&placed);
        }
        let own = self.atoms.iter().copied().zip(self.masses.iter().map(|mass| -mass));
        let mut apart: Vec<(f64, f64)> = weighed.chain(own).collect();
        apart.sort_by(|left, right| left.0.total_cmp(&right.0));
        let (atoms, apart): (Vec<f64>, Vec<f64>) = apart.into_iter().unzip();
        distance_of_masses(&atoms, &apart)
    }

    /// Returns the log certainty equivalent of an allocation, relative to the bank.
    fn worth(&self, allocation: f64, bank: f64, utility: RelativeUtility) -> f64 {
        let of_atom = |(z, mass): (&f64, &f64)| mass * utility.value((allocation * (z.exp() / bank - 1.0)).ln_1p());
        utility.inverse(self.atoms.iter().zip(&self.masses).map(of_atom).sum())
    }
}

/// Returns the nearest log-return that a history accepts.
fn accepted(log_return: f64) -> f64 {
    log_return.clamp(-LOG_RETURN, LOG_RETURN)
}

/// Scores every ball of the question under `law`, centre by centre and rule by rule. Cost: a robust step for each
/// record and ball.
///
/// Checked by: `tests/solver/coverage.rs`.
///
/// # Errors
/// A centre or a rule that a training would also reject.
pub fn coverage(law: &DrawnLaw, question: &CoverageQuestion) -> Result<Vec<BallCoverage>, FieldError> {
    let prepared = Prepared::of(law);
    let utility = RelativeUtility::new(question.utility, 100.0 * (1.0 + question.rate_per_step));
    let bank = 1.0 + question.rate_per_step;
    let worth = |allocation: f64| prepared.worth(allocation, bank, utility);
    let (_, best) = maximise_concave_scalar(worth, 0.0, 1.0, ALLOCATION_TOLERANCE);
    // Each group of records has its own bridges and is the unit of the intervals. If all records shared one set, all
    // radii would err alike, and no interval over records would show it.
    let groups = GROUPS.rev().find(|count| question.records.is_multiple_of(*count)).unwrap_or(question.records);
    let kept = Cache::default();
    let of_record = |index: usize| -> Result<Vec<[f64; 4]>, FieldError> {
        let record = prepared.record(question, index);
        // Stream: (seed, "coverage radius", n, group).
        let seed = stream(question.seed, "coverage radius", question.size, index * groups / question.records).random();
        let of_centre = |centre: &CentreSpecification| {
            let problem = ProblemSpecification {
                horizon: 1,
                utility: question.utility,
                centre: centre.clone(),
                ..ProblemSpecification::of(record.clone(), question.rate_per_step)
            }
            .as_in_the_paper();
            let distance = prepared.distance(&Centre::frozen(&problem));
            let of_rule = |rule: &RadiusRule| {
                let problem = ProblemSpecification { radius: Some(*rule), ..problem.clone() };
                let specification = Specification::of(problem, seed).completed()?;
                let (advice, _) = OnePeriod::new(&specification, kept.clone()).advise(0.0)?;
                let lost = BASIS_POINTS * (best - worth(advice.allocation));
                Ok([f64::from(u8::from(distance <= advice.radius)), advice.radius, lost, advice.allocation])
            };
            question.rules.iter().map(of_rule).collect::<Result<Vec<_>, FieldError>>()
        };
        let balls: Result<Vec<_>, FieldError> = question.centres.iter().map(of_centre).collect();
        Ok(balls?.concat())
    };
    let found = (0..question.records).into_par_iter().map(of_record).collect::<Result<Vec<_>, FieldError>>()?;
    let sample = Clustered::new(groups, question.records / groups, question.level);
    let of_ball = |ball: usize| {
        let figure = |figure: usize| found.iter().map(|record| record[ball][figure]).collect::<Vec<f64>>();
        BallCoverage {
            covered: sample.share(&figure(0), |covered| *covered > 0.0),
            radius: sample.mean(&figure(1)),
            lost: sample.mean(&figure(2)),
            allocation: sample.mean(&figure(3)).value,
        }
    };
    Ok((0..question.centres.len() * question.rules.len()).map(of_ball).collect())
}
