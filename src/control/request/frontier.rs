//! A request for the frontier of caution: what a radius would have cost and saved on records like the one given.

use std::ops::RangeInclusive;

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use super::assets::AssetsProblem;
use super::caution::CautionLevel;
use super::contributions::Contributions;
use super::framework::Framework;
use super::fund::{CompositionRule, GroundNorm};
use super::learning::Learning;
use super::rules;
use super::specification::{ProblemSpecification, Specification, default_seed};
use super::support::Interval;
use crate::control::error::FieldError;

/// Returns of a record: of fewer, resampling tells nothing.
pub const RETURNS: RangeInclusive<usize> = 12..=5000;
/// Multiples of the radius.
pub const SCALES: RangeInclusive<usize> = 1..=20;
/// The largest of them.
pub const LARGEST_SCALE: f64 = 10.0;
/// Log-returns drawn from each law, times the scales: these are some minutes of two cores.
pub const MOST_DRAWN: usize = 20_000_000;
/// Resampled records of each kind.
pub const RESAMPLES: RangeInclusive<usize> = 20..=2000;

/// A record, an investor, and the radii to try.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FrontierRequest {
    /// One asset as in `/advise`, or several.
    pub problem: FrontierProblem,
    /// Multiples of the radius of the rule, ascending. 0 takes the record for the law.
    #[serde(default = "default_scales")]
    pub scales: Vec<f64>,
    /// Resampled records of each kind. Default: 400 of one asset, 60 of several, whose steps take longer.
    #[serde(default)]
    pub resamples: Option<usize>,
    /// Periods in a row that are drawn together, 1 to half of the record. Default: the cube root of its length.
    #[serde(default)]
    pub block: Option<usize>,
    /// Of the resamples and of the simulated bridges.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

/// Those tried unless others are given.
pub fn default_scales() -> Vec<f64> {
    vec![0.0, 0.1, 0.25, 0.5, 1.0]
}

/// Records drawn unless another number is given, of one asset and of several: at 240 returns of twelve that is some seconds.
const DEFAULT_RESAMPLES: [usize; 2] = [400, 60];

/// The problem of one asset, or of several, which `assets` names.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant)]
pub enum FrontierProblem {
    /// One, which may be held beside the bank.
    Asset(ProblemSpecification),
    /// Several.
    Assets(AssetsProblem),
}

impl FrontierProblem {
    fn caution(&self) -> Option<CautionLevel> {
        match self {
            FrontierProblem::Asset(problem) => problem.caution,
            FrontierProblem::Assets(problem) => problem.caution,
        }
    }

    fn periods(&self) -> usize {
        match self {
            FrontierProblem::Asset(problem) => problem.history.len(),
            FrontierProblem::Assets(problem) => problem.history.len(),
        }
    }
}

impl<'de> Deserialize<'de> for FrontierProblem {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut value = serde_json::Value::deserialize(deserializer)?;
        if value.get("assets").is_some() {
            return serde_json::from_value(value).map(FrontierProblem::Assets).map_err(D::Error::custom);
        }
        if let Some(problem) = value.as_object_mut() {
            problem.entry("horizon").or_insert(1.into());
        }
        serde_json::from_value(value).map(FrontierProblem::Asset).map_err(D::Error::custom)
    }
}

/// A request that keeps the rules, of however many assets.
#[derive(Debug, Clone, PartialEq)]
pub struct FrontierQuestion {
    /// As completed: another reading of it gives the same question.
    pub request: FrontierRequest,
    /// The assets and the investor; one asset is called `asset`.
    pub assets: AssetsProblem,
    /// The problem of the fund of inverse volatilities, which one asset is itself, for one period.
    pub fund: Specification,
    /// Resampled records of each kind.
    pub resamples: usize,
    /// Periods in a row that are drawn together.
    pub block: usize,
    /// Between which all log-returns lie, where that is given.
    pub support: Option<Interval>,
}

impl FrontierRequest {
    /// # Errors
    /// A field breaks a rule.
    pub fn question(mut self) -> Result<FrontierQuestion, FieldError> {
        self.check_scales()?;
        let [of_one, of_several] = DEFAULT_RESAMPLES;
        let usual = if matches!(self.problem, FrontierProblem::Asset(_)) { of_one } else { of_several };
        let resamples = self.resamples.unwrap_or(usual);
        rules::whole("resamples", resamples, &RESAMPLES)?;
        let count = self.problem.periods();
        if !RETURNS.contains(&count) {
            let rule = format!("must hold {} to {} periods", RETURNS.start(), RETURNS.end());
            return Err(FieldError::new("problem.history", format!("{count} periods"), rule));
        }
        if let Some(given) = self.problem.caution().filter(|given| *given != CautionLevel::Paper) {
            let rule = "must be `paper` or left out: `scales` are the shares of the radius that are tried";
            return Err(FieldError::new("problem.caution", given.name(), rule));
        }
        let (assets, mut fund) = match &self.problem {
            FrontierProblem::Assets(assets) => (assets.clone(), assets.fund(self.seed)?),
            FrontierProblem::Asset(problem) => {
                check_static(problem)?;
                let fund = Specification::of(problem.clone(), self.seed).completed()?;
                (as_assets(&fund.problem), fund)
            }
        };
        // The scales are shares of the whole radius.
        fund.problem.caution = Some(CautionLevel::Paper);
        let drawn = count * assets.assets.len() * self.scales.len();
        if drawn * resamples > MOST_DRAWN {
            let rule = format!(
                "must be at most {}: periods, assets, scales and resamples multiply to at most {MOST_DRAWN}",
                MOST_DRAWN / drawn
            );
            return Err(FieldError::new("resamples", resamples, rule));
        }
        let block = self.block.unwrap_or_else(|| (count as f64).cbrt().round() as usize);
        rules::whole("block", block, &(1..=count / 2))?;
        (self.resamples, self.block) = (Some(resamples), Some(block));
        match &mut self.problem {
            FrontierProblem::Asset(problem) => {
                (problem.utility, problem.risk_aversion) = (fund.problem.utility, None);
            }
            FrontierProblem::Assets(problem) => {
                (problem.utility, problem.risk_aversion) = (fund.problem.utility, None);
            }
        }
        let support = fund.problem.support_rule().given();
        Ok(FrontierQuestion { request: self, assets, fund, resamples, block, support })
    }

    fn check_scales(&self) -> Result<(), FieldError> {
        let scales = &self.scales;
        if !SCALES.contains(&scales.len()) {
            let rule = format!("must be {} to {} numbers", SCALES.start(), SCALES.end());
            return Err(FieldError::new("scales", format!("{} numbers", scales.len()), rule));
        }
        for (index, &scale) in scales.iter().enumerate() {
            let field = format!("scales[{index}]");
            rules::within(&field, scale, 0.0, LARGEST_SCALE)?;
            if index > 0 && scale <= scales[index - 1] {
                return Err(FieldError::new(field, scale, "must be larger than the one before"));
            }
        }
        Ok(())
    }
}

/// That nothing is asked for which a record drawn anew does not have.
fn check_static(problem: &ProblemSpecification) -> Result<(), FieldError> {
    let name = problem.framework.name();
    if problem.framework != Framework::Adaptive {
        return Err(FieldError::new("problem.framework", name, "must be `adaptive`: its radius is what is tried"));
    }
    if problem.horizon != 1 {
        return Err(FieldError::new(
            "problem.horizon",
            problem.horizon,
            "must be 1 or left out: one period is advised",
        ));
    }
    if problem.trading_cost != 0.0 {
        let rule = "must be 0 or left out: nothing is held before";
        return Err(FieldError::new("problem.trading_cost", problem.trading_cost, rule));
    }
    if problem.learning != (Learning::Equal {}) {
        return Err(FieldError::new(
            "problem.learning",
            "decay",
            "must be `equal`: records are drawn without an order",
        ));
    }
    if !problem.centre.is_empirical() {
        let rule = "must be empirical: radii are tried around the law of a record alone";
        return Err(FieldError::new("problem.centre.kind", problem.centre.name(), rule));
    }
    if !problem.contributions.are_none() {
        return Err(FieldError::new("problem.contributions", "not 0", "must be left out"));
    }
    Ok(())
}

fn as_assets(problem: &ProblemSpecification) -> AssetsProblem {
    let rows = problem.history.iter().map(|&value| vec![value]).collect();
    asked_of(vec!["asset".to_owned()], rows, problem)
}

/// What `problem` asks of one asset, asked of these for one period.
pub fn asked_of(assets: Vec<String>, history: Vec<Vec<f64>>, problem: &ProblemSpecification) -> AssetsProblem {
    AssetsProblem {
        assets,
        ground_norm: GroundNorm::default(),
        composition: CompositionRule::default(),
        horizon: None,
        trading_cost: 0.0,
        contributions: Contributions::default(),
        rate_per_step: problem.rate_per_step,
        periods_per_year: problem.periods_per_year,
        initial_wealth: problem.initial_wealth,
        action_interval: problem.action_interval,
        risk_aversion: problem.risk_aversion,
        utility: problem.utility,
        radius: problem.radius,
        caution: problem.caution,
        support: problem.support,
        history,
    }
}
