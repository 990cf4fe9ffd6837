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

use ballast::control::cache::Cache;
use ballast::control::error::FieldError;
use ballast::control::policy::one_period::OnePeriod;
use ballast::control::pool;
use ballast::control::problem::utility::RelativeUtility;
use ballast::control::request::centre::CentreSpecification;
use ballast::control::request::radius_rule::RadiusRule;
use ballast::control::request::rules::LOG_RETURN;
use ballast::control::request::specification::{ProblemSpecification, Specification, UtilitySpecification};
use ballast::control::uncertainty::centre::Centre;
use ballast::numerics::law::ContinuousLaw;
use ballast::numerics::law::law_distance::{LawDistance, Placed, distance_of_laws};
use ballast::numerics::machine::streams::stream;
use ballast::numerics::search::minimise::maximise_concave_scalar;
use ballast::numerics::statistics::block_bootstrap::circular_blocks;
use ballast::numerics::statistics::summary::{Clustered, Estimate};
use rand::RngExt;

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

impl CoverageQuestion {
    /// Returns the number of groups of records. Each group has its own bridges and is the unit of the intervals. If all
    /// records shared one set, all radii would err alike, and no interval over records would show it.
    pub fn groups(&self) -> usize {
        GROUPS.rev().find(|count| self.records.is_multiple_of(*count)).unwrap_or(self.records)
    }

    /// Returns the seed of the bridges of a record's group. Stream: (seed, "coverage radius", n, group).
    pub fn seed_of(&self, index: usize, groups: usize) -> u64 {
        stream(self.seed, "coverage radius", self.size, index * groups / self.records).random()
    }
}

/// A law prepared for drawing records.
pub struct Prepared<'a> {
    law: &'a DrawnLaw,
    distance: Option<LawDistance>,
    /// Atoms of the law, ascending, and their masses; a continuous law is discretised by quadrature.
    atoms: Vec<f64>,
    masses: Vec<f64>,
}

impl<'a> Prepared<'a> {
    /// Prepares a law.
    pub fn of(law: &'a DrawnLaw) -> Self {
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
    pub fn record(&self, question: &CoverageQuestion, index: usize) -> Vec<f64> {
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
    pub fn distance(&self, centre: &Centre) -> f64 {
        let weighed = centre.atoms.iter().copied().zip(centre.masses.iter().copied());
        if let Some(distance) = &self.distance {
            let placed: Vec<Placed> = weighed.map(|(atom, mass)| distance.place(atom, mass)).collect();
            return distance.distance(&placed);
        }
        distance_of_laws(weighed, self.atoms.iter().copied().zip(self.masses.iter().copied()))
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
/// Checked by: the tests below, against closed forms.
///
/// # Errors
/// A centre or a rule that a training would also reject.
pub fn coverage(law: &DrawnLaw, question: &CoverageQuestion) -> Result<Vec<BallCoverage>, FieldError> {
    let prepared = Prepared::of(law);
    let utility = RelativeUtility::new(question.utility, 100.0 * (1.0 + question.rate_per_step));
    let bank = 1.0 + question.rate_per_step;
    let worth = |allocation: f64| prepared.worth(allocation, bank, utility);
    let (_, best) = maximise_concave_scalar(worth, 0.0, 1.0, ALLOCATION_TOLERANCE);
    let groups = question.groups();
    let kept = Cache::default();
    let of_record = |index: usize| -> Result<Vec<[f64; 4]>, FieldError> {
        let record = prepared.record(question, index);
        let seed = question.seed_of(index, groups);
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
    let records = pool::map((0..question.records).collect(), of_record);
    let found = records.into_iter().collect::<Result<Vec<_>, FieldError>>()?;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Independent draws of two returns, each with probability one half.
    const TWO: [f64; 2] = [-0.15, 0.17];

    fn question(rules: Vec<RadiusRule>) -> CoverageQuestion {
        CoverageQuestion {
            size: 20,
            records: 4000,
            rate_per_step: 0.002,
            utility: UtilitySpecification::Log {},
            centres: vec![CentreSpecification::Empirical {}],
            rules,
            seed: 1,
            level: 0.9,
        }
    }

    #[test]
    fn two_returns_are_held_as_often_as_the_binomial_law_says() {
        // k of 20 draws are the upper return; the distance is |k / 20 - 1/2| times 0.32, at most 0.034 where 8 <= k <= 12.
        let held = [125_970.0, 167_960.0, 184_756.0, 167_960.0, 125_970.0].iter().sum::<f64>() / 1_048_576.0;
        let rules = vec![RadiusRule::Fixed { radius: 0.034 }, RadiusRule::Fixed { radius: 1.0 }];
        let law = DrawnLaw::Blocks { returns: TWO.to_vec(), length: 1 };
        let found = coverage(&law, &question(rules)).unwrap();
        // Four standard errors of a share of 4000 records.
        assert!((found[0].covered.value - held).abs() < 4.0 * (held * (1.0 - held) / 4000.0_f64).sqrt(), "{found:?}");
        assert_eq!(found[1].covered.value, 1.0);

        // In a ball that wide all stays in the bank, and what is lost is all that the best allocation gains: with excess growths
        // u < 0 < v of even chances, a* = -(u + v) / (2 u v) under logarithmic utility.
        let [low, high] = TWO.map(|z| z.exp() / 1.002 - 1.0);
        let best = -(low + high) / (2.0 * low * high);
        assert!((0.0..1.0).contains(&best), "{best}");
        let gained = 0.5 * ((best * low).ln_1p() + (best * high).ln_1p());
        assert_eq!(found[1].allocation, 0.0);
        // The best allocation is searched to 1e-6, where growth is flat.
        assert!((found[1].lost.value - 1e4 * gained).abs() < 1e-6, "{} {}", found[1].lost.value, 1e4 * gained);
    }

    /// Twenty runs of 100 records whose radii rest on few bridges: what is covered differs between runs as the interval of each says.
    #[test]
    fn intervals_of_coverage_hold_for_other_seeds_too() {
        let law = DrawnLaw::Continuous(ContinuousLaw::mixture(vec![(1.0, 0.01, 0.1)]));
        let covered = |seed: u64| {
            let rules = vec![RadiusRule::Bridge { alpha: 0.1, paths: 100, scale: 1.0, correction: None }];
            let question = CoverageQuestion { records: 100, seed, ..question(rules) };
            coverage(&law, &question).unwrap()[0].covered.value
        };
        let shares: Vec<f64> = (1..=20).map(covered).collect();
        let mean = shares.iter().sum::<f64>() / 20.0;
        let variance = shares.iter().map(|share| (share - mean).powi(2)).sum::<f64>() / 19.0;
        // That of 100 independent records; 19 degrees of freedom exceed 1.9 times their mean once in a hundred.
        assert!(variance < 1.9 * mean * (1.0 - mean) / 100.0, "{variance} {mean}: {shares:?}");
    }

    #[test]
    fn a_centre_mixed_with_the_law_itself_is_nearer_by_the_share_that_was_seen() {
        // Mixed with twenty returns of the law, twenty draws are half as far from it: at most 0.034 where 6 <= k <= 14.
        let held = (6..=14).map(|k| (1..=k).map(|i| f64::from(21 - i) / f64::from(i)).product::<f64>()).sum::<f64>()
            / 1_048_576.0;
        let law = DrawnLaw::Blocks { returns: TWO.to_vec(), length: 1 };
        let itself = CentreSpecification::Mixed { law: None, history: Some(TWO.to_vec()), weight: 20.0 };
        let rules = vec![RadiusRule::Fixed { radius: 0.034 }];
        let centres = vec![CentreSpecification::Empirical {}, itself];
        let found = coverage(&law, &CoverageQuestion { centres, ..question(rules) }).unwrap();
        // Four standard errors of a share of 4000 records.
        assert!(
            (found[1].covered.value - held).abs() < 4.0 * (held * (1.0 - held) / 4000.0_f64).sqrt(),
            "{found:?} {held}"
        );
        assert!(found[0].covered.value < 0.8 && held > 0.95, "{found:?} {held}");
    }

    #[test]
    fn calibrated_balls_hold_a_law_that_no_record_was_smoothed_from() {
        let law = DrawnLaw::Continuous(ContinuousLaw::mixture(vec![(1.0, 0.01, 0.1)]));
        let (alpha, paths, scale) = (0.1, 500, 1.0);
        let rules = vec![
            RadiusRule::Bridge { alpha, paths, scale, correction: None },
            RadiusRule::Calibrated { alpha, paths, scale },
        ];
        let found = coverage(&law, &CoverageQuestion { records: 1000, ..question(rules) }).unwrap();
        let [bridge, calibrated] = [0, 1].map(|rule: usize| found[rule].covered.value);
        // Four standard errors of a share of 1000 records around 90 %; the bridge alone falls short by more than that.
        assert!((calibrated - 0.9).abs() < 0.038 && bridge < 0.862, "{bridge} {calibrated}");
    }
}
