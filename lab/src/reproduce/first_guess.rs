//! A wrong first guess: histories drawn from one law, and paths from another.
//!
//! The paper argues that an investor who does not learn stays biased if the initial law is far from the true one, and
//! that learning mends it. Each strategy here starts at histories of the guessed law and lives through paths of the
//! true law. All strategies of a guess have the same histories and the same paths.

use std::error::Error;

use ballast::control::evaluation::paths::{Evaluation, drawn_history};
use ballast::control::evaluation::report::{Spread, StrategyReport};
use ballast::control::problem::sampling_law::continuous_law;
use ballast::control::request::caution::CautionLevel;
use ballast::control::request::framework::Framework;
use ballast::control::request::sampling_law::{MixtureComponent, SamplingLaw};
use ballast::numerics::statistics::summary::{Clustered, Estimate};
use ballast::report::Csv;
use serde::Serialize;

use super::{ReproductionPlan, requests};
use crate::compare::ComparisonRun;
use crate::{paper, tables};

/// The share of the radius at which the ball is small: the paper's argument is about small sets.
pub const SMALL: f64 = 0.1;
/// The name of the guess that is not wrong.
pub const RIGHT: &str = "right";
/// Distance between the means of a wrong law and the true one, in log-return a period: a fifth of the true deviation.
const SHIFT: f64 = 0.02;
/// Factor between the variances of the wide law and the true one.
const WIDER: f64 = 4.0;

/// A law that histories are drawn from, and the law of the returns that follow.
#[derive(Debug, Clone, Serialize)]
pub struct FirstGuess {
    pub name: &'static str,
    pub guessed: SamplingLaw,
    pub truth: SamplingLaw,
}

/// The results of one strategy after one guess.
#[derive(Debug, Clone, Serialize)]
pub struct GuessRow {
    pub guess: &'static str,
    pub sample_size: usize,
    pub horizon: usize,
    pub framework: Framework,
    /// The share of the paper's radius that is used; absent without a ball.
    pub radius_share: Option<f64>,
    /// Bias: the strategy's mean terminal utility less the known law's, on the same returns.
    pub bias: Estimate,
    /// Spread: the variance of terminal utility.
    pub variance: Estimate,
    pub quantile_20: Estimate,
    /// Share in stocks, period by period.
    pub held: Vec<Spread>,
    /// Mean distance of the share in stocks from the known law's on the same path, period by period.
    pub distance: Vec<Estimate>,
    /// Mean terminal utility less that of static with the same share of the radius; for adaptive alone.
    pub beyond_static: Option<Estimate>,
    /// The distance of static in the last period less that of this strategy; for adaptive alone.
    pub nearer_than_static: Option<Estimate>,
}

impl GuessRow {
    /// Returns the fields that name the row, for CSV.
    fn names(&self) -> [String; 5] {
        let share = self.radius_share.map_or_else(String::new, |share| share.to_string());
        let framework = self.framework.name().to_owned();
        [self.guess.to_owned(), self.sample_size.to_string(), self.horizon.to_string(), framework, share]
    }

    /// Returns true if the row is of this framework with this share of the radius.
    pub fn follows(&self, framework: Framework, radius_share: Option<f64>) -> bool {
        self.framework == framework && self.radius_share == radius_share
    }
}

/// Returns the guesses: the right one, and four that are wrong. Of those, two have another mean, one another variance,
/// and one another shape.
pub fn guesses() -> Vec<FirstGuess> {
    let paper = components();
    let shifted = |by: f64| mixture(paper.iter().map(|one| MixtureComponent { mean: one.mean + by, ..*one }).collect());
    let (mean, _) = moments(&paper);
    // Both the variances within components and the distances of their means from the common one grow.
    let widened = |one: &MixtureComponent| MixtureComponent {
        mean: mean + WIDER.sqrt() * (one.mean - mean),
        variance: WIDER * one.variance,
        ..*one
    };
    let truth = paper::mixture();
    let guess = |name, guessed, truth| FirstGuess { name, guessed, truth };
    vec![
        guess(RIGHT, truth.clone(), truth.clone()),
        guess("mean too low", shifted(-SHIFT), truth.clone()),
        guess("mean too high", truth.clone(), shifted(-SHIFT)),
        guess("variance too large", mixture(paper.iter().map(widened).collect()), truth.clone()),
        guess("shape: rare crashes", crashes(), truth),
    ]
}

fn components() -> Vec<MixtureComponent> {
    match paper::mixture() {
        SamplingLaw::GaussianMixture { components } => components,
        _ => Vec::new(),
    }
}

fn mixture(components: Vec<MixtureComponent>) -> SamplingLaw {
    SamplingLaw::GaussianMixture { components }
}

/// Returns a law with the mean and variance of the paper's mixture, in which one return in twenty is a crash.
fn crashes() -> SamplingLaw {
    const CHANCE: f64 = 0.05;
    const CRASH: f64 = -0.18;
    let (mean, variance) = moments(&components());
    let usual = (mean - CHANCE * CRASH) / (1.0 - CHANCE);
    let between = CHANCE * (CRASH - mean).powi(2) + (1.0 - CHANCE) * (usual - mean).powi(2);
    let within = variance - between;
    mixture(vec![
        MixtureComponent { weight: CHANCE, mean: CRASH, variance: within },
        MixtureComponent { weight: 1.0 - CHANCE, mean: usual, variance: within },
    ])
}

/// Returns the mean and the variance of a mixture.
fn moments(components: &[MixtureComponent]) -> (f64, f64) {
    let mean: f64 = components.iter().map(|one| one.weight * one.mean).sum();
    let spread = |one: &MixtureComponent| one.weight * (one.variance + (one.mean - mean).powi(2));
    (mean, components.iter().map(spread).sum())
}

/// Returns the mixture of both laws in equal parts: the design of a policy that starts under one and lives under the
/// other.
fn blend(one: &SamplingLaw, other: &SamplingLaw) -> SamplingLaw {
    let parts = [one, other].into_iter().flat_map(|law| match law {
        SamplingLaw::GaussianMixture { components } => components.clone(),
        _ => Vec::new(),
    });
    mixture(parts.map(|part| MixtureComponent { weight: 0.5 * part.weight, ..part }).collect())
}

/// Computes every guess, length of history and horizon of the plan.
///
/// # Errors
/// As the trainings and simulations.
pub fn study(plan: &ReproductionPlan, workshop: &ComparisonRun) -> Result<Vec<GuessRow>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for guess in guesses() {
        for &sample_size in &plan.guess_sizes {
            for &horizon in &plan.guess_horizons {
                rows.extend(cell(plan, workshop, &GuessCell { guess: &guess, sample_size, horizon })?);
            }
        }
    }
    Ok(rows)
}

/// A guess, a length of history and a horizon.
struct GuessCell<'a> {
    guess: &'a FirstGuess,
    sample_size: usize,
    horizon: usize,
}

/// One strategy followed over all paths of a cell.
struct FollowedStrategy {
    report: StrategyReport,
    framework: Framework,
    radius_share: Option<f64>,
    /// Mean terminal utility of each history.
    utility: Vec<f64>,
    /// Distance of the share in stocks from the known law's: a list of paths for each period.
    distance: Vec<Vec<f64>>,
}

fn cell(plan: &ReproductionPlan, workshop: &ComparisonRun, cell: &GuessCell) -> Result<Vec<GuessRow>, Box<dyn Error>> {
    use Framework::{Adaptive, KnownLaw, ParametricStatic, PlugIn, Static};
    let mut followed = follow(plan, workshop, cell, &[KnownLaw, Adaptive, Static, PlugIn, ParametricStatic], 1.0)?;
    // A small radius changes the frameworks with a ball alone. Differences from the known law need it on the same paths.
    followed.extend(follow(plan, workshop, cell, &[KnownLaw, Adaptive, Static], SMALL)?.into_iter().skip(1));
    let known = followed[0].utility.clone();
    let histories = Clustered::new(1, plan.study_histories, requests::LEVEL);
    let paths = Clustered::new(plan.study_histories, plan.study_paths, requests::LEVEL);
    let less = |one: &[f64], other: &[f64]| one.iter().zip(other).map(|(one, other)| one - other).collect::<Vec<f64>>();
    let row = |own: &FollowedStrategy| {
        let beside = followed.iter().find(|other| {
            own.framework == Adaptive && other.framework == Static && other.radius_share == own.radius_share
        });
        let last = cell.horizon - 1;
        GuessRow {
            guess: cell.guess.name,
            sample_size: cell.sample_size,
            horizon: cell.horizon,
            framework: own.framework,
            radius_share: own.radius_share,
            bias: histories.mean(&less(&own.utility, &known)),
            variance: own.report.utility.variance,
            quantile_20: own.report.utility.quantile_20,
            held: own.report.periods.iter().flatten().map(|period| period.allocation).collect(),
            distance: own.distance.iter().map(|distance| paths.mean(distance)).collect(),
            beyond_static: beside.map(|other| histories.mean(&less(&own.utility, &other.utility))),
            nearer_than_static: beside.map(|other| paths.mean(&less(&other.distance[last], &own.distance[last]))),
        }
    };
    Ok(followed.iter().map(row).collect())
}

/// Follows frameworks over the paths of a cell. The first of them is the known law.
fn follow(
    plan: &ReproductionPlan,
    workshop: &ComparisonRun,
    cell: &GuessCell,
    frameworks: &[Framework],
    radius_share: f64,
) -> Result<Vec<FollowedStrategy>, Box<dyn Error>> {
    let FirstGuess { name, guessed, truth } = cell.guess;
    let mut request = requests::sized(plan, cell.sample_size, cell.horizon, frameworks, plan.long_count)?;
    request.problem.law = Some(truth.clone());
    request.problem.caution = Some(CautionLevel::Scale(radius_share));
    request.problem.radius = Some(requests::bridge(plan.long_bridges));
    request.design.sampling_law = Some(blend(guessed, truth));
    let law = continuous_law(guessed, &request.problem);
    let histories = (0..plan.study_histories).map(|index| drawn_history(&request, &law, index)).collect();
    let mut evaluation = Evaluation::starting_at(request, histories)?;
    let followers = workshop.train(&evaluation)?;
    evaluation.request.design.count = Some(plan.long_ladder);
    let stage = format!("{name}: {} returns, {} periods", cell.sample_size, cell.horizon);
    let (outcomes, report) = workshop.compare(&stage, &evaluation, &followers, 0.0)?;
    let report = report.in_utility();
    let distance = |strategy: usize, period: usize| {
        let apart = |outcome: &ballast::control::evaluation::paths::Outcome| {
            let held = |strategy: usize| outcome.lived[strategy * cell.horizon + period].allocation;
            (held(strategy) - held(0)).abs()
        };
        outcomes.outcomes.iter().map(apart).collect::<Vec<f64>>()
    };
    let followed = |(index, (framework, strategy)): (usize, (&Framework, &StrategyReport))| FollowedStrategy {
        report: strategy.clone(),
        framework: *framework,
        radius_share: framework.has_ball().then_some(radius_share),
        utility: report.histories.iter().map(|history| history.mean_utility[index]).collect(),
        distance: (0..cell.horizon).map(|period| distance(index, period)).collect(),
    };
    Ok(frameworks.iter().zip(&report.strategies).enumerate().map(followed).collect())
}

/// The first columns of both tables.
const NAMES: [&str; 5] = ["guess", "sample_size", "horizon", "framework", "radius_share"];

/// Returns a row for each strategy and statistic.
pub fn csv(rows: &[GuessRow]) -> String {
    let mut csv = Csv::new(&[&NAMES[..], &["statistic", "value", "low", "high"]].concat());
    for row in rows {
        let found = [
            ("bias", Some(row.bias)),
            ("variance", Some(row.variance)),
            ("quantile_20", Some(row.quantile_20)),
            ("beyond_static", row.beyond_static),
            ("nearer_than_static", row.nearer_than_static),
        ];
        for (name, estimate) in found.into_iter().filter_map(|(name, found)| Some((name, found?))) {
            csv.row(row.names().into_iter().chain([name.to_owned()]).chain(tables::ends(estimate)));
        }
    }
    csv.into_text()
}

/// Returns a row for each strategy and period.
pub fn periods_csv(rows: &[GuessRow]) -> String {
    let periods = ["period", "held_mean", "held_10", "held_90", "distance", "distance_low", "distance_high"];
    let mut csv = Csv::new(&[&NAMES[..], &periods[..]].concat());
    for row in rows {
        for (period, (held, distance)) in row.held.iter().zip(&row.distance).enumerate() {
            let held = [held.mean, held.quantile_10, held.quantile_90].map(|share| share.to_string());
            let period = (period + 1).to_string();
            csv.row(row.names().into_iter().chain([period]).chain(held).chain(tables::ends(*distance)));
        }
    }
    csv.into_text()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(law: &SamplingLaw) -> (f64, f64) {
        match law {
            SamplingLaw::GaussianMixture { components } => moments(components),
            _ => unreachable!("every guess is a mixture"),
        }
    }

    /// The mean and variance of the paper's mixture by hand: 0.4 0.006 + 0.6 0.016 = 0.012, and
    /// 0.4 0.016 + 0.6 0.00625 + 0.24 0.01^2 = 0.010174. The tolerance is rounding.
    #[test]
    fn every_wrong_law_differs_in_one_thing() {
        let (mean, variance) = (0.012, 0.010_174);
        let expected =
            [(mean, variance), (mean - SHIFT, variance), (mean, variance), (mean, WIDER * variance), (mean, variance)];
        for (guess, expected) in guesses().iter().zip(expected) {
            let found = of(&guess.guessed);
            assert!((found.0 - expected.0).abs() < 1e-15 && (found.1 - expected.1).abs() < 1e-15, "{}", guess.name);
            assert!(guess.guessed.check("guessed").is_ok() && guess.truth.check("truth").is_ok(), "{}", guess.name);
        }
        // The third central moment of a sum over components: w ((m - mean)^3 + 3 (m - mean) v).
        let skewness = |law: &SamplingLaw| match law {
            SamplingLaw::GaussianMixture { components } => {
                let third = |one: &MixtureComponent| {
                    let apart = one.mean - mean;
                    one.weight * (apart.powi(3) + 3.0 * apart * one.variance)
                };
                components.iter().map(third).sum::<f64>() / variance.powf(1.5)
            }
            _ => unreachable!("every guess is a mixture"),
        };
        assert!(skewness(&crashes()) < -0.3 && skewness(&paper::mixture()).abs() < 0.1);
    }
}
