//! Command-line options for the share of the statistical doubt that is used.

use ballast::control::error::FieldError;
use ballast::control::request::caution::CautionLevel;
use ballast::control::request::caution_rules::check_support;
use ballast::control::request::radius_rule::RadiusRule;
use ballast::control::request::specification::ProblemSpecification;
use ballast::control::request::support::Support;
use clap::Args;

#[derive(Debug, Clone, Args)]
pub struct CautionArgs {
    /// Level of caution: bold, balanced, cautious, or paper, which uses the whole radius
    #[arg(long, value_parser = level, conflicts_with = "scale")]
    caution: Option<CautionLevel>,
    /// Share of the radius that is used, instead of a level: 0 takes the record as true
    #[arg(long)]
    scale: Option<f64>,
    /// Probability that the ball of the whole radius misses the true law
    #[arg(long, default_value_t = 0.1)]
    alpha: f64,
    /// Returns that are considered possible: a multiple of the worst and the best observed, or none for any at all
    #[arg(long, value_parser = support)]
    support: Option<Support>,
}

impl CautionArgs {
    /// Returns the problem at this caution.
    pub fn applied(&self, problem: ProblemSpecification) -> ProblemSpecification {
        let given = self.scale.map(CautionLevel::Scale).or(self.caution);
        ProblemSpecification {
            caution: given.or(problem.caution_level()),
            radius: Some(RadiusRule::bridge(self.alpha)),
            support: self.support,
            ..problem
        }
    }
}

/// The option for each field of the problem.
pub const OPTIONS: [(&str, &str); 4] = [
    ("problem.caution.scale", "--scale"),
    ("problem.caution", "--caution"),
    ("problem.radius.alpha", "--alpha"),
    ("problem.support.factor", "--support"),
];

pub fn level(text: &str) -> Result<CautionLevel, String> {
    let levels = CautionLevel::FOUND.into_iter().chain([CautionLevel::Paper]);
    let named = levels.clone().find(|level| level.name() == text);
    named.ok_or_else(|| {
        let names: Vec<&str> = levels.map(CautionLevel::name).collect();
        format!("must be {}; use --scale to give a share of the radius", names.join(", "))
    })
}

pub fn support(text: &str) -> Result<Support, String> {
    match text {
        "none" => Ok(Support::None {}),
        factor => {
            let factor: f64 = factor.parse().map_err(|_| "must be a number or none".to_owned())?;
            let support = Support::WorstSeen { factor };
            check_support("--support", support).map_err(|FieldError { rule, .. }| rule).map(|()| support)
        }
    }
}
