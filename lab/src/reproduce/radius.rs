//! The radius: how far it must shrink before static holds stocks, and how its smallness at the start acts as t0 and T
//! grow.

use std::error::Error;

use ballast::control::evaluation::paths::{Evaluation, Outcomes};
use ballast::control::evaluation::report::EvaluationReport;
use ballast::control::pool;
use ballast::control::problem::sampling_law::continuous_law;
use ballast::control::request::caution::CautionLevel;
use ballast::control::request::evaluation::EvaluationRequest;
use ballast::control::request::framework::Framework;
use ballast::control::uncertainty::laws::Laws;
use ballast::numerics::law::empirical::EmpiricalDistribution;
use ballast::numerics::machine::streams::stream;
use ballast::numerics::statistics::summary::{Clustered, Estimate};
use ballast::report::Csv;
use serde::Serialize;

use super::ReproductionPlan;
use super::requests::{self, sized};
use crate::compare::ComparisonRun;
use crate::{paper, tables};

/// Shares of the radius, from the whole one down.
const SHARES: [f64; 6] = [1.0, 0.75, 0.5, 0.25, 0.1, 0.05];
/// A share in stocks below this counts as none: half a basis point of wealth, which is far above rounding.
const NOTHING: f64 = 5e-5;

/// Static and adaptive at one share of the radius, over the histories of the paper's first table.
#[derive(Debug, Clone, Serialize)]
pub struct ShrunkRow {
    pub radius_share: f64,
    pub framework: Framework,
    /// Share of the histories after which no path ever holds stocks.
    pub trivial: Estimate,
    /// Mean share in stocks in the first period.
    pub first: Estimate,
    /// Variance over histories of the share in stocks in the first period.
    pub first_variance: Estimate,
    pub mean: Estimate,
    pub variance: Estimate,
}

/// Follows static and adaptive from `histories` at every share of the radius.
///
/// # Errors
/// As the trainings and simulations.
pub fn shrunk(
    plan: &ReproductionPlan,
    workshop: &ComparisonRun,
    histories: &[Vec<f64>],
) -> Result<Vec<ShrunkRow>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for radius_share in SHARES {
        for (framework, count) in [(Framework::Static, plan.ladder), (Framework::Adaptive, plan.study_count)] {
            let mut request = sized(plan, requests::SAMPLE_SIZE, plan.horizon, &[framework], count)?;
            request.problem.caution = Some(CautionLevel::Scale(radius_share));
            let stage = format!("{} with {radius_share} of the radius", framework.name());
            let (outcomes, report) = followed(workshop, &stage, request, histories.to_vec())?;
            rows.push(shrunk_row(radius_share, framework, &outcomes, &report));
        }
    }
    Ok(rows)
}

fn shrunk_row(radius_share: f64, framework: Framework, outcomes: &Outcomes, report: &EvaluationReport) -> ShrunkRow {
    let paths = report.request.paths;
    let of_histories = outcomes.outcomes.chunks(paths);
    let never = of_histories
        .clone()
        .map(|paths| paths.iter().flat_map(|path| &path.lived).all(|lived| lived.allocation < NOTHING));
    let first: Vec<f64> = of_histories.map(|paths| paths[0].lived[0].allocation).collect();
    let sample = Clustered::new(1, first.len(), requests::LEVEL);
    let utility = &report.strategies[0].utility;
    ShrunkRow {
        radius_share,
        framework,
        trivial: sample.share(&never.collect::<Vec<bool>>(), |never| *never),
        first: sample.mean(&first),
        first_variance: sample.variance(&first),
        mean: utility.mean,
        variance: utility.variance,
    }
}

/// Adaptive after histories with an average Q and with a small one, at one length of history and horizon.
#[derive(Debug, Clone, Serialize)]
pub struct ChangeRow {
    pub sample_size: usize,
    pub horizon: usize,
    /// Mean Q of the histories with an average one, and of those with the smallest.
    pub quantiles: [f64; 2],
    /// Mean terminal utility after either.
    pub means: [Estimate; 2],
    /// Variance of terminal utility after either.
    pub variances: [Estimate; 2],
    /// The second mean less the first.
    pub change_of_mean: Estimate,
    /// The second variance less the first.
    pub change_of_variance: Estimate,
}

/// Follows adaptive from histories with an average Q and from those with the smallest, at every length of history and
/// horizon of the plan.
///
/// # Errors
/// As the trainings and simulations.
pub fn changes(plan: &ReproductionPlan, workshop: &ComparisonRun) -> Result<Vec<ChangeRow>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for &sample_size in &plan.change_sizes {
        for &horizon in &plan.change_horizons {
            rows.push(change(plan, workshop, sample_size, horizon)?);
        }
    }
    Ok(rows)
}

fn change(
    plan: &ReproductionPlan,
    workshop: &ComparisonRun,
    sample_size: usize,
    horizon: usize,
) -> Result<ChangeRow, Box<dyn Error>> {
    let mut request = sized(plan, sample_size, horizon, &[Framework::Adaptive], plan.long_count)?;
    request.problem.radius = Some(requests::bridge(plan.long_bridges));
    let stage = format!("histories of {sample_size} returns by their Q");
    let by_quantile = workshop.run(&stage, horizon, |_| by_quantile(plan, &request));
    let count = plan.study_histories;
    let mean = by_quantile.iter().map(|(quantile, _)| quantile).sum::<f64>() / by_quantile.len() as f64;
    let above = by_quantile.partition_point(|(quantile, _)| *quantile < mean);
    let average = above.saturating_sub(count / 2).min(by_quantile.len() - count);
    let mut quantiles = [0.0; 2];
    let mut utilities = Vec::new();
    for (index, from) in [average, 0].into_iter().enumerate() {
        let chosen = &by_quantile[from..from + count];
        quantiles[index] = chosen.iter().map(|(quantile, _)| quantile).sum::<f64>() / count as f64;
        let histories = chosen.iter().map(|(_, history)| history.clone()).collect();
        let stage = format!("adaptive from {sample_size} returns over {horizon} periods");
        utilities.push(followed(workshop, &stage, request.clone(), histories)?.1.strategies.remove(0).utility);
    }
    let means = [utilities[0].mean, utilities[1].mean];
    let variances = [utilities[0].variance, utilities[1].variance];
    Ok(ChangeRow {
        sample_size,
        horizon,
        quantiles,
        means,
        variances,
        change_of_mean: apart(means),
        change_of_variance: apart(variances),
    })
}

/// Returns the second of two independent estimates less the first: the squares of their half-widths add.
pub fn apart([first, second]: [Estimate; 2]) -> Estimate {
    let value = second.value - first.value;
    let reach = |one: Estimate| 0.5 * (one.high - one.low);
    let reach = reach(first).hypot(reach(second));
    Estimate { value, low: value - reach, high: value + reach }
}

/// Draws histories of the true law and sorts them by the bridge quantile Q of their law.
fn by_quantile(plan: &ReproductionPlan, request: &EvaluationRequest) -> Vec<(f64, Vec<f64>)> {
    let radii = Laws::new(&request.specification(Framework::Adaptive, None)).radii;
    let law = continuous_law(&paper::mixture(), &request.problem);
    let draw = |index: usize| {
        let mut generator = stream(request.seed, "reproduce-change", index, request.problem.history.len());
        let history: Vec<f64> = request.problem.history.iter().map(|_| law.draw(&mut generator)).collect();
        (radii.measure(&EmpiricalDistribution::new(&history)).quantile.unwrap_or(f64::NAN), history)
    };
    let mut drawn = pool::map((0..plan.change_drawn).collect(), draw);
    drawn.sort_by(|one, other| one.0.total_cmp(&other.0));
    drawn
}

fn followed(
    workshop: &ComparisonRun,
    stage: &str,
    request: EvaluationRequest,
    histories: Vec<Vec<f64>>,
) -> Result<(Outcomes, EvaluationReport), Box<dyn Error>> {
    let evaluation = Evaluation::starting_at(request, histories)?;
    let followers = workshop.train(&evaluation)?;
    let (outcomes, report) = workshop.compare(stage, &evaluation, &followers, 0.0)?;
    Ok((outcomes, report.in_utility()))
}

/// Returns a row for each share, framework and statistic.
pub fn shrunk_csv(rows: &[ShrunkRow]) -> String {
    let mut csv = Csv::new(&["radius_share", "framework", "statistic", "value", "low", "high"]);
    for row in rows {
        let found = [
            ("trivial", row.trivial),
            ("first", row.first),
            ("first_variance", row.first_variance),
            ("mean", row.mean),
            ("variance", row.variance),
        ];
        for (name, estimate) in found {
            let names = [row.radius_share.to_string(), row.framework.name().to_owned(), name.to_owned()];
            csv.row(names.into_iter().chain(tables::ends(estimate)));
        }
    }
    csv.into_text()
}

/// Returns a row for each length of history, horizon and statistic: after an average Q, a small one, and the change.
pub fn changes_csv(rows: &[ChangeRow]) -> String {
    let mut csv = Csv::new(&["sample_size", "horizon", "histories", "quantile", "statistic", "value", "low", "high"]);
    for row in rows {
        let [average, small] = row.quantiles.map(|quantile| quantile.to_string());
        let found = [
            ("average", average.as_str(), "mean", row.means[0]),
            ("average", &average, "variance", row.variances[0]),
            ("small", &small, "mean", row.means[1]),
            ("small", &small, "variance", row.variances[1]),
            ("change", "", "mean", row.change_of_mean),
            ("change", "", "variance", row.change_of_variance),
        ];
        for (histories, quantile, name, estimate) in found {
            let names = [&row.sample_size.to_string(), &row.horizon.to_string(), histories, quantile, name];
            csv.row(names.map(str::to_owned).into_iter().chain(tables::ends(estimate)));
        }
    }
    csv.into_text()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reaches of 3 and 4 give 5.
    #[test]
    fn independent_reaches_add_as_squares() {
        let at = |value: f64, reach: f64| Estimate { value, low: value - reach, high: value + reach };
        let found = apart([at(1.0, 3.0), at(11.0, 4.0)]);
        assert_eq!([found.value, found.low, found.high], [10.0, 5.0, 15.0]);
    }
}
