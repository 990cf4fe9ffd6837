//! `ballast-lab coverage`: how often balls hold the law that records were drawn from, how wide they are, and how much their
//! robust advice loses; and how often the balls of all steps of a horizon hold it.

use std::error::Error;
use std::num::ParseFloatError;

use ballast::control::error::FieldError;
use ballast::control::problem::sampling_law::continuous_law;
use ballast::control::request::centre::CentreSpecification;
use ballast::control::request::learning::Learning;
use ballast::control::request::radius_rule::RadiusRule;
use ballast::control::request::rules::{HISTORY_LENGTH, HORIZON};
use ballast::control::request::sampling_law::{MixtureComponent, SamplingLaw};
use ballast::control::request::specification::{ProblemSpecification, UtilitySpecification};
use ballast::numerics::law::ContinuousLaw;
use ballast::numerics::statistics::summary::Estimate;
use clap::Args;

use balls::{BallCoverage, CoverageQuestion, DrawnLaw, coverage};
use horizon::{HorizonCoverage, horizon_coverage};

use super::market::Market;
use super::paper;

mod balls;
mod horizon;

/// Interest rate for the paper's mixture, and for the laws that have its mean and variance.
const RATE: f64 = 0.002;
const DEGREES_OF_FREEDOM: f64 = 4.0;
/// Months of the market in one block of draws.
const BLOCK: usize = 12;
/// Confidence level of the intervals.
const LEVEL: f64 = 0.9;
/// Number of simulated paths behind the quantiles of the bridge.
const PATHS: usize = 2000;
/// Deviation of the smoothing error, as a share of the law's deviation.
const SMOOTHED: f64 = 0.25;
/// Periods in which the weight of a return in the volatility halves.
const HALF_LIFE: f64 = 12.0;
/// Number of returns that a law without premium counts as.
const ASSUMED: f64 = 60.0;

#[derive(Debug, Clone, Args)]
pub struct CoverageArgs {
    /// Probability that a ball may miss the law
    #[arg(long, default_value_t = 0.1)]
    alpha: f64,
    /// Returns in a record
    #[arg(long, value_delimiter = ',', default_values_t = [20, 60, 240])]
    sizes: Vec<usize>,
    /// Records drawn from each law at each size
    #[arg(long, default_value_t = 1000)]
    records: usize,
    /// Relative risk aversion: 1 is log utility, more is more careful
    #[arg(long, default_value_t = 3.0)]
    risk_aversion: f64,
    /// Measure instead how often the law is left at some step of this many, under `bridge` and under `joint`
    #[arg(long)]
    horizon: Option<usize>,
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// A law with its name, and the bank's rate used with it.
struct Named {
    name: &'static str,
    law: DrawnLaw,
    /// Standard deviation of its log-returns.
    deviation: f64,
    rate_per_step: f64,
}

impl Named {
    /// Returns the centres to compare. They are the observed returns, these smoothed, these scaled to the current
    /// volatility, and these mixed with a normal law of the right deviation. Under the normal law the asset's mean
    /// return is the bank's, which is wrong.
    fn centres(&self) -> Vec<CentreSpecification> {
        let variance = self.deviation * self.deviation;
        let without_premium =
            MixtureComponent { weight: 1.0, mean: self.rate_per_step.ln_1p() - 0.5 * variance, variance };
        let law = Some(SamplingLaw::GaussianMixture { components: vec![without_premium] });
        vec![
            CentreSpecification::Empirical {},
            CentreSpecification::Smoothed { bandwidth: SMOOTHED * self.deviation },
            CentreSpecification::VolatilityScaled { half_life: HALF_LIFE },
            CentreSpecification::Mixed { law, history: None, weight: ASSUMED },
        ]
    }
}

pub fn run(arguments: &CoverageArgs) -> Result<(), Box<dyn Error>> {
    if !(2..=100_000).contains(&arguments.records) {
        return Err(FieldError::new("--records", arguments.records, "must lie in [2, 100000]").into());
    }
    if let Some(&size) = arguments.sizes.iter().find(|size| !HISTORY_LENGTH.contains(size)) {
        let rule = format!("must lie in [{}, {}]", HISTORY_LENGTH.start(), HISTORY_LENGTH.end());
        return Err(FieldError::new("--sizes", size, rule).into());
    }
    let CoverageArgs { alpha, records, seed, .. } = *arguments;
    if let Some(horizon) = arguments.horizon {
        return over_horizon(arguments, horizon);
    }
    let bridge = |scale: f64| RadiusRule::Bridge { alpha, paths: PATHS, scale, correction: None };
    let rules = [bridge(0.0), bridge(0.5), bridge(1.0), RadiusRule::Calibrated { alpha, paths: PATHS, scale: 1.0 }];
    println!(
        "{:<22}{:>6}{:>20}{:>14}{:>24}{:>10}{:>28}{:>8}",
        "law", "n", "centre", "rule", "holds the law [90 %]", "radius", "lost a period, bp [90 %]", "held"
    );
    let utility = UtilitySpecification::relative(arguments.risk_aversion);
    for named in laws()? {
        let (rate_per_step, centres, rules) = (named.rate_per_step, named.centres(), rules.to_vec());
        let mut question =
            CoverageQuestion { size: 0, records, rate_per_step, utility, centres, rules, seed, level: LEVEL };
        for &size in &arguments.sizes {
            question.size = size;
            let found = coverage(&named.law, &question).map_err(by_option)?;
            let balls =
                question.centres.iter().flat_map(|centre| question.rules.iter().map(move |rule| (centre, rule)));
            balls.zip(found).for_each(|(ball, found)| println!("{}", line(named.name, size, ball, &found)));
        }
    }
    Ok(())
}

fn line(name: &str, size: usize, (centre, rule): (&CentreSpecification, &RadiusRule), found: &BallCoverage) -> String {
    let rule = match *rule {
        RadiusRule::Bridge { scale: 0.0, .. } => "none".to_owned(),
        RadiusRule::Bridge { scale, .. } if scale != 1.0 => format!("{scale} bridge"),
        rule => rule.name().to_owned(),
    };
    let BallCoverage { covered, radius, lost, allocation } = found;
    let percent = |share: f64| 100.0 * share;
    let covered = share(covered);
    let lost = format!("{:.2} [{:.2}, {:.2}]", lost.value, lost.low, lost.high);
    let centre = centre.name();
    format!(
        "{name:<22}{size:>6}{centre:>20}{rule:>14}{covered:>24}{:>10.5}{lost:>28}{:>6.0} %",
        radius.value,
        percent(*allocation)
    )
}

fn share(Estimate { value, low, high }: &Estimate) -> String {
    let [value, low, high] = [value, low, high].map(|share| 100.0 * share);
    format!("{value:.1} [{low:.1}, {high:.1}] %")
}

/// Prints how often the law is left over a horizon, with balls of single steps and with joint ones.
fn over_horizon(arguments: &CoverageArgs, horizon: usize) -> Result<(), Box<dyn Error>> {
    if !HORIZON.contains(&horizon) {
        let rule = format!("must lie in [{}, {}]", HORIZON.start(), HORIZON.end());
        return Err(FieldError::new("--horizon", horizon, rule).into());
    }
    let CoverageArgs { alpha, records, seed, .. } = *arguments;
    let single = RadiusRule::Bridge { alpha, paths: PATHS, scale: 1.0, correction: None };
    let rules = vec![single, RadiusRule::Joint { alpha, paths: PATHS }];
    println!(
        "{:<22}{:>6}{:>7}{:>29}{:>27}{:>27}{:>8}",
        "law", "n", "steps", "bridge left at first [90 %]", "bridge ever left", "joint ever left", "factor"
    );
    let utility = UtilitySpecification::relative(arguments.risk_aversion);
    for Named { name, law, rate_per_step, .. } in laws()? {
        for &size in &arguments.sizes {
            let (rules, centres) = (rules.clone(), Vec::new());
            let question =
                CoverageQuestion { size, records, rate_per_step, utility, centres, rules, seed, level: LEVEL };
            let found = horizon_coverage(&law, &question, horizon).map_err(by_option)?;
            let [HorizonCoverage { left_at_first, ever_left, radius }, joint] = &found[..] else { continue };
            let shares = [left_at_first, ever_left, &joint.ever_left].map(share);
            let factor = joint.radius.value / radius.value;
            println!("{name:<22}{size:>6}{horizon:>7}{:>29}{:>27}{:>27}{factor:>8.3}", shares[0], shares[1], shares[2]);
        }
    }
    Ok(())
}

fn laws() -> Result<Vec<Named>, ParseFloatError> {
    let mixture = continuous_law(&paper::mixture(), &ProblemSpecification::of(Vec::new(), RATE));
    let (atoms, masses) = mixture.quadrature();
    let mean = mixture.mean();
    let variance: f64 = atoms.iter().zip(&masses).map(|(z, mass)| mass * (z - mean).powi(2)).sum();
    let deviation = variance.sqrt();
    let scale = (variance * (DEGREES_OF_FREEDOM - 2.0) / DEGREES_OF_FREEDOM).sqrt();
    let normal = ContinuousLaw::mixture(vec![(1.0, mean, deviation)]);
    let student = ContinuousLaw::StudentT { location: mean, scale, degrees_of_freedom: DEGREES_OF_FREEDOM };
    let Market { log_returns: returns, bank } = Market::bundled()?;
    let market_deviation = Learning::Equal {}.deviation(&returns);
    let of = |name, law| Named { name, law: DrawnLaw::Continuous(law), deviation, rate_per_step: RATE };
    Ok(vec![
        of("normal", normal),
        of("the paper's mixture", mixture),
        of("Student, 4 degrees", student),
        Named {
            name: "market, in blocks",
            law: DrawnLaw::Blocks { returns, length: BLOCK },
            deviation: market_deviation,
            rate_per_step: bank,
        },
    ])
}

/// Renames the field of an error to the option that the user knows.
fn by_option(error: FieldError) -> FieldError {
    let option = match error.field.as_str() {
        "problem.radius.alpha" => "--alpha",
        "problem.utility.risk_aversion" => "--risk-aversion",
        _ => return error,
    };
    FieldError { field: option.into(), ..error }
}
