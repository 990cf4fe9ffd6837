//! The computations that reproduce the paper's section 3.

use std::error::Error;

use ballast::control::cache::Cache;
use ballast::control::evaluation::paths::{Evaluation, Follower};
use ballast::control::evaluation::report::{EvaluationReport, HistoryReport};
use ballast::control::pool;
use ballast::control::problem::sampling_law::continuous_law;
use ballast::control::problem::utility::utility;
use ballast::control::request::evaluation::{EvaluationRequest, InitialHistories};
use ballast::control::request::framework::Framework;
use ballast::control::request::specification::Specification;
use ballast::control::uncertainty::laws::Laws;
use ballast::control::uncertainty::radius::RadiusEstimator;
use ballast::numerics::law::empirical::EmpiricalDistribution;
use ballast::numerics::machine::streams::stream;
use ballast::numerics::statistics::summary::{Clustered, Estimate};
use rand::RngExt;
use serde::Serialize;

use super::ReproductionPlan;
use super::printed::{QUANTILES, TABLES};
use super::radius::{self, ShrunkRow};
use super::requests::{self, SAMPLE_SIZE};
use crate::compare::ComparisonRun;
use crate::paper;

/// Relative distance within which a history's quantile must lie from a table's for the history to belong to it.
pub const CLOSENESS: f64 = 0.02;
/// Number of histories that share bridges; it divides a batch.
const GROUP: usize = 50;
/// Number of histories drawn between checks for having enough.
const BATCH: usize = 2000;

/// The simulated quantiles.
#[derive(Debug, Serialize)]
pub struct Quantiles {
    pub mean: Estimate,
    /// 1 % quantile.
    pub low: Estimate,
    /// The first quantiles, as many as the paper shows.
    pub shown: Vec<f64>,
    pub drawn: usize,
}

/// One of the paper's two cases.
#[derive(Debug, Serialize)]
pub struct Case {
    pub quantile: f64,
    /// Number of drawn histories that are as close as [`CLOSENESS`].
    pub found: usize,
    /// The comparison over the first of them; absent if fewer than two were found.
    pub report: Option<EvaluationReport>,
}

/// Results for the paper's tables and figures.
#[derive(Debug, Serialize)]
pub struct Section {
    pub quantiles: Quantiles,
    /// Results over histories drawn from the true law.
    pub all: EvaluationReport,
    pub cases: Vec<Case>,
    /// Results with ever smaller radii, over the histories of the first case; empty if fewer than two were found.
    pub shrunk: Vec<ShrunkRow>,
}

pub fn section(plan: &ReproductionPlan, workshop: &ComparisonRun) -> Result<Section, Box<dyn Error>> {
    use Framework::{Adaptive, KnownLaw, ParametricStatic, Static};
    let mut request = requests::request(plan, SAMPLE_SIZE, &[Adaptive, KnownLaw, Static, ParametricStatic])?;
    let mut evaluation = Evaluation::new(request.clone())?;
    let (quantiles, close) =
        workshop.run("looking for the paper's histories", plan.horizon, |_| seek(plan, &evaluation));
    let started = workshop.seconds();
    let followers = workshop.train(&evaluation)?;
    let trained = workshop.seconds() - started;
    // The frozen frameworks are trained for each history, within the simulation.
    (evaluation.request.design.count, request.design.count) = (Some(plan.ladder), Some(plan.ladder));
    let (_, all) = workshop.compare("simulating all histories", &evaluation, &followers, trained)?;
    let mut cases = Vec::new();
    for (table, histories) in TABLES.iter().zip(&close) {
        cases.push(case(plan, workshop, &request, &followers, table.quantile, histories)?);
    }
    let nearest: Vec<Vec<f64>> = close[0].iter().take(plan.close_histories).cloned().collect();
    let shrunk = if nearest.len() < 2 { Vec::new() } else { radius::shrunk(plan, workshop, &nearest)? };
    Ok(Section { quantiles, all: all.in_utility(), cases, shrunk })
}

/// Draws histories until each table has enough of its own or the limit is reached. Returns the quantiles of all, and
/// the histories.
fn seek(plan: &ReproductionPlan, evaluation: &Evaluation) -> (Quantiles, [Vec<Vec<f64>>; 2]) {
    let request = &evaluation.request;
    let specification = request.specification(Framework::Adaptive, None);
    let radii = Laws::new(&specification).radii;
    let law = continuous_law(&paper::mixture(), &request.problem);
    // A history belongs to a table by the bridges of its policy. For the law of Q each group of histories has its own
    // bridges, and is the unit of the intervals.
    let kept = Cache::default();
    let draw = |index: usize| {
        let mut generator = stream(request.seed, "reproduce-seek", index, 0);
        let history: Vec<f64> = (0..SAMPLE_SIZE).map(|_| law.draw(&mut generator)).collect();
        let seen = EmpiricalDistribution::new(&history);
        let quantile = |radii: &RadiusEstimator| radii.measure(&seen).quantile.unwrap_or(f64::NAN);
        let seed = stream(request.seed, "reproduce-seek", index / GROUP, 1).random();
        let own = Specification { seed, ..specification.clone() };
        (quantile(&radii), quantile(&RadiusEstimator::new(&own, kept.clone())), history)
    };
    let mut quantiles: Vec<f64> = Vec::new();
    let mut close: [Vec<Vec<f64>>; 2] = Default::default();
    while quantiles.len() < plan.most_drawn && close.iter().any(|found| found.len() < plan.close_histories) {
        let batch = (quantiles.len()..quantiles.len() + BATCH).collect();
        for (found, own, history) in pool::map(batch, draw) {
            quantiles.push(own);
            for (table, close) in TABLES.iter().zip(&mut close) {
                if (found / table.quantile - 1.0).abs() <= CLOSENESS {
                    close.push(history.clone());
                }
            }
        }
    }
    let sample = Clustered::new(quantiles.len() / GROUP, GROUP, request.level);
    let mut sorted = quantiles.clone();
    sorted.sort_by(f64::total_cmp);
    let found = Quantiles {
        mean: sample.mean(&quantiles),
        low: sample.quantile(&quantiles, &sorted, 0.01),
        drawn: quantiles.len(),
        shown: quantiles.into_iter().take(QUANTILES).collect(),
    };
    (found, close)
}

fn case(
    plan: &ReproductionPlan,
    workshop: &ComparisonRun,
    request: &EvaluationRequest,
    followers: &[Follower],
    target: f64,
    histories: &[Vec<f64>],
) -> Result<Case, Box<dyn Error>> {
    let found = histories.len();
    let histories: Vec<Vec<f64>> = histories.iter().take(plan.close_histories).cloned().collect();
    if histories.len() < 2 {
        return Ok(Case { quantile: target, found, report: None });
    }
    let evaluation = Evaluation::starting_at(request.clone(), histories)?;
    let stage = format!("simulating the histories with Q near {target}");
    let (_, report) = workshop.compare(&stage, &evaluation, followers, 0.0)?;
    Ok(Case { quantile: target, found, report: Some(report.in_utility()) })
}

/// Returns the mean terminal utility of one framework less that of another, on the same returns.
pub fn mean_gap(report: &EvaluationReport, one: Framework, other: Framework) -> Option<Estimate> {
    let index = |wanted| report.strategies.iter().position(|strategy| strategy.framework == Some(wanted));
    let (one, other) = (index(one)?, index(other)?);
    let gap = |history: &HistoryReport| history.mean_utility[one] - history.mean_utility[other];
    let gaps: Vec<f64> = report.histories.iter().map(gap).collect();
    Some(Clustered::new(1, gaps.len(), report.request.level).mean(&gaps))
}

/// How the gap to the known law closes as histories grow.
#[derive(Debug, Serialize)]
pub struct Study {
    pub rows: Vec<StudyRow>,
    pub slopes: Vec<Slope>,
}

/// The results at one length of history.
#[derive(Debug, Serialize)]
pub struct StudyRow {
    pub sample_size: usize,
    pub framework: Framework,
    pub radius: f64,
    /// The known law's value less the framework's own robust value at the start, in utility: the paper's V - V*.
    pub value_gap: Estimate,
    /// The known law's mean terminal utility less the framework's, on the same returns.
    pub realised_gap: Estimate,
}

/// The slope of ln gap over ln t0, by least squares.
#[derive(Debug, Serialize)]
pub struct Slope {
    pub framework: Framework,
    pub gap: &'static str,
    pub all: f64,
    /// The slope between the two longest histories alone, with its interval.
    pub last: Estimate,
}

pub fn study(plan: &ReproductionPlan, workshop: &ComparisonRun) -> Result<Study, Box<dyn Error>> {
    let mut rows = Vec::new();
    for &sample_size in &plan.study_sizes {
        rows.extend(study_size(plan, workshop, sample_size)?);
    }
    let mut slopes = Vec::new();
    for framework in [Framework::Adaptive, Framework::Static] {
        let own = || rows.iter().filter(|row: &&StudyRow| row.framework == framework);
        for (gap, of) in [("value", value_gap as fn(&StudyRow) -> Estimate), ("realised", realised_gap)] {
            let gaps: Vec<(f64, Estimate)> = own().map(|row| ((row.sample_size as f64).ln(), of(row))).collect();
            let points: Vec<(f64, f64)> = gaps.iter().map(|(size, gap)| (*size, gap.value.ln())).collect();
            let last = last_slope(&gaps);
            slopes.push(Slope { framework, gap, all: slope(&points), last });
        }
    }
    Ok(Study { rows, slopes })
}

fn value_gap(row: &StudyRow) -> Estimate {
    row.value_gap
}

fn realised_gap(row: &StudyRow) -> Estimate {
    row.realised_gap
}

/// Returns the slope of ln gap between the two largest sizes. Their histories are independent, so the squared relative
/// half-widths of the gaps add.
fn last_slope(gaps: &[(f64, Estimate)]) -> Estimate {
    let last = &gaps[gaps.len().saturating_sub(2)..];
    let points: Vec<(f64, f64)> = last.iter().map(|(size, gap)| (*size, gap.value.ln())).collect();
    let value = slope(&points);
    let reaches = last.iter().map(|(_, gap)| (0.5 * (gap.high - gap.low) / gap.value).powi(2)).sum::<f64>().sqrt();
    let apart = points.last().map_or(0.0, |one| one.0) - points.first().map_or(0.0, |one| one.0);
    let reach = reaches / apart;
    Estimate { value, low: value - reach, high: value + reach }
}

fn study_size(
    plan: &ReproductionPlan,
    workshop: &ComparisonRun,
    sample_size: usize,
) -> Result<Vec<StudyRow>, Box<dyn Error>> {
    let sized = |frameworks: &[Framework], count: usize| -> Result<EvaluationReport, Box<dyn Error>> {
        let mut request = requests::sized(plan, sample_size, plan.horizon, frameworks, count)?;
        request.histories = InitialHistories::Drawn { count: plan.study_histories };
        let evaluation = Evaluation::new(request)?;
        let followers = workshop.train(&evaluation)?;
        let stage = format!("simulating histories of {sample_size} returns");
        Ok(workshop.compare(&stage, &evaluation, &followers, 0.0)?.1.in_utility())
    };
    let adaptive = sized(&[Framework::KnownLaw, Framework::Adaptive], plan.study_count)?;
    // A design over one input needs few points, and every history has its own.
    let fixed = sized(&[Framework::KnownLaw, Framework::Static], plan.ladder)?;
    let row = |report: &EvaluationReport, framework: Framework| {
        let sample = Clustered::new(1, report.histories.len(), report.request.level);
        let kind = report.request.problem.utility;
        let gap = |history: &HistoryReport| utility(kind, history.promised[0]) - utility(kind, history.promised[1]);
        let value: Vec<f64> = report.histories.iter().map(gap).collect();
        let realised: Vec<f64> =
            report.histories.iter().map(|history| history.mean_utility[0] - history.mean_utility[1]).collect();
        StudyRow {
            sample_size,
            framework,
            radius: report.histories.iter().map(|history| history.radius).sum::<f64>() / report.histories.len() as f64,
            value_gap: sample.mean(&value),
            realised_gap: sample.mean(&realised),
        }
    };
    Ok(vec![row(&adaptive, Framework::Adaptive), row(&fixed, Framework::Static)])
}

/// Returns the slope by least squares.
fn slope(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0 / count, y + point.1 / count));
    let (above, below) = points.iter().fold((0.0, 0.0), |(above, below), point| {
        (above + (point.0 - x) * (point.1 - y), below + (point.0 - x).powi(2))
    });
    above / below
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_power_law_has_its_slope() {
        let points: Vec<(f64, f64)> =
            [20.0, 80.0, 320.0_f64].iter().map(|n| (n.ln(), (3.0 * n.powf(-0.5)).ln())).collect();
        assert!((super::slope(&points) + 0.5).abs() < 1e-12);
        // Gaps of 2 and 1 at 80 and 320, each within a tenth: the reach is sqrt(0.01 + 0.01) / ln 4.
        let gap = |value: f64| super::Estimate { value, low: 0.9 * value, high: 1.1 * value };
        let last = super::last_slope(&[(80_f64.ln(), gap(2.0)), (320_f64.ln(), gap(1.0))]);
        assert!(
            (last.value + 0.5).abs() < 1e-12 && (last.high - last.value - 0.02_f64.sqrt() / 4_f64.ln()).abs() < 1e-12
        );
    }
}
