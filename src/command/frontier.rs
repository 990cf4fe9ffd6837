//! `ballast frontier`: the loss at multiples of the radius on records like the one in a file. No server runs; the
//! report is that of `POST /frontier`.

use std::error::Error;
use std::fmt::Write;

use ballast::control::cache::Cache;
use ballast::control::error::FieldError;
use ballast::control::evaluation::frontier::Frontier;
use ballast::control::evaluation::frontier::report::{Bootstrap, FrontierReport, ResampledFrontier};
use ballast::control::progress::Watch;
use ballast::control::request::frontier::{FrontierProblem, FrontierRequest, default_scales};
use ballast::control::request::radius_rule::RadiusRule;
use ballast::control::request::specification::{ProblemSpecification, default_seed};
use clap::Args;

use super::record::{RecordArguments, show};
use super::returns::AnyReturns;

#[derive(Debug, Clone, Args)]
pub struct FrontierArgs {
    #[command(flatten)]
    record: RecordArguments,
    /// Probability that the ball of scale 1 misses the true law
    #[arg(long, default_value_t = 0.1)]
    alpha: f64,
    /// Multiples of the radius, ascending
    #[arg(long, value_delimiter = ',', default_values_t = default_scales())]
    scales: Vec<f64>,
    /// Records drawn from each law; unless given, 400 for one asset and 60 for several
    #[arg(long)]
    resamples: Option<usize>,
    /// Consecutive periods that are drawn together; the cube root of the number of returns unless given
    #[arg(long)]
    block: Option<usize>,
    #[arg(long, default_value_t = default_seed())]
    seed: u64,
    /// Print the report of POST /frontier as JSON, and what was read on the standard error
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &FrontierArgs) -> Result<(), Box<dyn Error>> {
    let returns = arguments.record.read_any()?;
    let read = match &returns {
        AnyReturns::One(returns) => returns.sentence(),
        AnyReturns::Several(returns) => returns.sentence.clone(),
    };
    let question = arguments.request(&returns).question();
    let question = question.map_err(|error| by_option(error, arguments.record.source()))?;
    let report = Frontier::new(question, Cache::default()).run(&Watch::unwatched())?;
    Ok(show(&read, arguments.json, &report, || describe(&report))?)
}

impl FrontierArgs {
    fn request(&self, returns: &AnyReturns) -> FrontierRequest {
        let radius = Some(RadiusRule::bridge(self.alpha));
        let problem = match returns {
            AnyReturns::One(returns) => {
                FrontierProblem::Asset(ProblemSpecification { radius, ..self.record.problem(returns) })
            }
            AnyReturns::Several(returns) => {
                let within = |problem| ProblemSpecification { radius, ..problem };
                FrontierProblem::Assets(self.record.assets_problem(returns, within))
            }
        };
        let FrontierArgs { scales, resamples, block, seed, .. } = self.clone();
        FrontierRequest { problem, scales, resamples, block, seed }
    }
}

/// Renames the field of an error to the option that the user knows; `source` determines how many returns are used.
fn by_option(error: FieldError, source: &'static str) -> FieldError {
    let option = match error.field.as_str() {
        "resamples" => "--resamples",
        "block" => "--block",
        "problem.radius.alpha" => "--alpha",
        "problem.history" => source,
        "problem.periods_per_year" => "--periods-per-year",
        field if field.starts_with("scales") => "--scales",
        _ => return error,
    };
    FieldError { field: option.into(), ..error }
}

/// Returns a table for each law that records were drawn from, and the sentences about the figures.
fn describe(report: &FrontierReport) -> String {
    let mut text = String::new();
    for resampled in &report.resampled {
        table(&mut text, report, resampled);
    }
    text + &report.sentences.join("\n")
}

fn table(
    text: &mut String,
    report: &FrontierReport,
    ResampledFrontier { bootstrap, best, points }: &ResampledFrontier,
) {
    let per = if report.per_year { "a year" } else { "a period" };
    let records = match bootstrap {
        Bootstrap::Smoothed { .. } => "Records drawn from the smoothed returns".to_owned(),
        Bootstrap::Block { length } => format!("Records of blocks of {length} periods"),
        Bootstrap::WithoutPremium { .. } => "Records of a law without the premium".to_owned(),
    };
    let best = 100.0 * best.iter().sum::<f64>();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{records}; the best share under their law is {best:.1} %.");
    let lost = format!("lost {per}, bp [90 %]");
    let _ = writeln!(
        text,
        "{:>8}{lost:>26}{:>24}{:>20}{:>10}{:>16}",
        "scale", "from record to record", "beyond its own mix", "held", "held on yours"
    );
    for (point, own) in points.iter().zip(&report.own) {
        let lost = format!("{:.1} [{:.1}, {:.1}]", point.lost.value, point.lost.low, point.lost.high);
        let (held, own) = (100.0 * point.total, 100.0 * own.iter().sum::<f64>());
        let _ = writeln!(
            text,
            "{:>8}{lost:>26}{:>24.1}{:>20.1}{:>10}{:>16}",
            point.scale,
            point.deviation.value,
            point.beyond_own_mix.value,
            format!("{held:.1} %"),
            format!("{own:.1} %")
        );
    }
    text.push('\n');
}
