//! How often the balls of all steps of a horizon hold the law together, on records that go on growing by its draws.

use ballast::control::cache::Cache;
use ballast::control::error::FieldError;
use ballast::control::pool;
use ballast::control::request::radius_rule::RadiusRule;
use ballast::control::request::specification::{ProblemSpecification, Specification};
use ballast::control::uncertainty::centre::Centre;
use ballast::control::uncertainty::radius::RadiusEstimator;
use ballast::numerics::law::empirical::EmpiricalDistribution;
use ballast::numerics::statistics::summary::{Clustered, Estimate};

use super::balls::{CoverageQuestion, DrawnLaw, Prepared};

/// Coverage of a rule over a horizon.
#[derive(Debug, Clone, PartialEq)]
pub struct HorizonCoverage {
    /// Share of records whose first ball does not hold the law.
    pub left_at_first: Estimate,
    /// Share of records on which the ball of some step does not hold the law.
    pub ever_left: Estimate,
    /// The mean radius of the first step, in log-return.
    pub radius: Estimate,
}

/// Measures every rule of the question over `horizon` steps, the first of which knows `question.size` returns. Balls
/// are centred on the returns seen. Cost: a radius and a distance for each record, step and rule.
///
/// # Errors
/// A rule that a training would also reject.
pub fn horizon_coverage(
    law: &DrawnLaw,
    question: &CoverageQuestion,
    horizon: usize,
) -> Result<Vec<HorizonCoverage>, FieldError> {
    let prepared = Prepared::of(law);
    let (size, groups, kept) = (question.size, question.groups(), Cache::default());
    let whole = CoverageQuestion { size: size + horizon - 1, ..question.clone() };
    let of_record = |index: usize| -> Result<Vec<[f64; 3]>, FieldError> {
        let record = prepared.record(&whole, index);
        let at = |count: usize| ProblemSpecification {
            horizon,
            ..ProblemSpecification::of(record[..count].to_vec(), question.rate_per_step).as_in_the_paper()
        };
        let distances = (size..size + horizon).map(|count| prepared.distance(&Centre::frozen(&at(count))));
        let distances: Vec<f64> = distances.collect();
        let of_rule = |rule: &RadiusRule| {
            let problem = ProblemSpecification { radius: Some(*rule), ..at(size) };
            let specification =
                Specification::of(problem, question.seed_of(index, groups)).completed()?.resolved(&kept);
            let radii = RadiusEstimator::new(&specification, kept.clone());
            let radius = |count: usize| radii.radius(&EmpiricalDistribution::new(&record[..count]));
            let left = |(step, distance): (usize, &f64)| *distance > radius(size + step);
            let share = |left: bool| f64::from(u8::from(left));
            let first = radius(size);
            Ok([share(distances[0] > first), share(distances.iter().enumerate().any(left)), first])
        };
        question.rules.iter().map(of_rule).collect()
    };
    let records = pool::map((0..question.records).collect(), of_record);
    let found = records.into_iter().collect::<Result<Vec<_>, FieldError>>()?;
    let sample = Clustered::new(groups, question.records / groups, question.level);
    let of_rule = |rule: usize| {
        let figure = |figure: usize| found.iter().map(|record| record[rule][figure]).collect::<Vec<f64>>();
        HorizonCoverage {
            left_at_first: sample.share(&figure(0), |left| *left > 0.0),
            ever_left: sample.share(&figure(1), |left| *left > 0.0),
            radius: sample.mean(&figure(2)),
        }
    };
    Ok((0..question.rules.len()).map(of_rule).collect())
}

#[cfg(test)]
mod tests {
    use ballast::control::request::centre::CentreSpecification;
    use ballast::control::request::specification::UtilitySpecification;
    use ballast::numerics::law::ContinuousLaw;

    use super::*;

    #[test]
    fn two_draws_leave_a_ball_as_often_as_the_binomial_law_says() {
        // If k of n draws are the upper return, the distance to the law is |k / n - 1/2| times 0.32. It must be at most
        // 0.034 at n = 20, and again at n = 21.
        let chances = |count: usize| {
            let mut chances = vec![1.0_f64];
            for _ in 0..count {
                let halved = |at: usize| chances.get(at).copied().unwrap_or_default() / 2.0;
                chances = (0..=chances.len()).map(|at| halved(at) + at.checked_sub(1).map_or(0.0, halved)).collect();
            }
            chances
        };
        let holds = |k: usize, n: usize| (k as f64 / n as f64 - 0.5).abs() * 0.32 <= 0.034;
        let at_first = chances(20);
        let held = at_first.iter().enumerate().filter(|(k, _)| holds(*k, 20));
        let first: f64 = held.clone().map(|(_, chance)| chance).sum();
        let goes_on = |k: usize| [k, k + 1].iter().filter(|k| holds(**k, 21)).count() as f64 / 2.0;
        let both: f64 = held.map(|(k, chance)| chance * goes_on(k)).sum();
        let law = DrawnLaw::Blocks { returns: vec![-0.15, 0.17], length: 1 };
        let question = CoverageQuestion {
            size: 20,
            records: 4000,
            rate_per_step: 0.002,
            utility: UtilitySpecification::Log {},
            centres: vec![CentreSpecification::Empirical {}],
            rules: vec![RadiusRule::Fixed { radius: 0.034 }],
            seed: 1,
            level: 0.9,
        };
        let found = &horizon_coverage(&law, &question, 2).unwrap()[0];
        assert!(both < first, "{both} {first}");
        for (left, held) in [(found.left_at_first, first), (found.ever_left, both)] {
            // Four standard errors of a share of 4000 records.
            let tolerance = 4.0 * (held * (1.0 - held) / 4000.0_f64).sqrt();
            assert!((1.0 - left.value - held).abs() < tolerance, "{left:?} {held}");
        }
    }

    #[test]
    fn joint_balls_hold_the_law_through_a_horizon_that_those_of_single_steps_leave() {
        let normal = ContinuousLaw::mixture(vec![(1.0, 0.01, 0.1)]);
        let student = ContinuousLaw::StudentT { location: 0.0, scale: 0.07, degrees_of_freedom: 4.0 };
        let (alpha, paths, records) = (0.1, 500, 500);
        for law in [normal, student] {
            let question = CoverageQuestion {
                size: 120,
                records,
                rate_per_step: 0.002,
                utility: UtilitySpecification::Log {},
                centres: Vec::new(),
                rules: vec![
                    RadiusRule::Bridge { alpha, paths, scale: 1.0, correction: None },
                    RadiusRule::Joint { alpha, paths },
                ],
                seed: 1,
                level: 0.9,
            };
            let found = horizon_coverage(&DrawnLaw::Continuous(law), &question, 36).unwrap();
            let [bridge, joint] = [&found[0], &found[1]];
            println!("{bridge:?} {joint:?}");
            // Four standard errors of the difference of two shares of 500 records. The record shows too little of its
            // law's spread, by which a first ball of the bridge is left more often than alpha; the rule removes only
            // the excess of later steps.
            let tolerance = 4.0 * (2.0 * 0.12 * 0.88 / records as f64).sqrt();
            assert!((joint.ever_left.value - bridge.left_at_first.value).abs() < tolerance, "{bridge:?} {joint:?}");
            assert!(bridge.ever_left.value > joint.ever_left.value + 0.06, "{bridge:?} {joint:?}");
        }
    }
}
