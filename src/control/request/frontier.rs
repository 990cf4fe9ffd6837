//! A request for the frontier of caution: what each radius would have cost and saved on records like the one given.

use std::ops::RangeInclusive;

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use super::asset_history::AssetHistory;
use super::assets::AssetsProblem;
use super::bounds::{Bounded, FieldBounds, ValueBounds};
use super::caution::CautionLevel;
use super::contributions::Contributions;
use super::framework::Framework;
use super::fund::{CompositionRule, GroundNorm};
use super::learning::Learning;
use super::means::MeansRule;
use super::rules;
use super::specification::{ProblemSpecification, Specification, default_seed};
use super::support::Interval;
use crate::control::error::FieldError;

/// Allowed number of periods of a record. With fewer, resampling is uninformative.
pub const RETURNS: RangeInclusive<usize> = 12..=5000;
/// Allowed number of multiples of the radius.
pub const SCALES: RangeInclusive<usize> = 1..=20;
/// The largest multiple of the radius.
pub const LARGEST_SCALE: f64 = 10.0;
/// Limit on the log-returns drawn from each law, times the number of scales: some minutes on two cores.
pub const MOST_DRAWN: usize = 20_000_000;
/// Allowed number of resampled records of each kind.
pub const RESAMPLES: RangeInclusive<usize> = 20..=2000;

/// A request for a frontier of caution: a record, an investor, and the radii to try.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FrontierRequest {
    /// The problem of one asset, as in `/advise`, or of several assets. Its history holds 12 to 5000 periods.
    pub problem: FrontierProblem,
    /// Multiples of the rule's radius to try, ascending: 1 to 20 numbers from 0 to 10. At 0 the record is taken as the
    /// true law. Default: 0, 0.1, 0.25, 0.5 and 1.
    #[serde(default = "default_scales")]
    pub scales: Vec<f64>,
    /// Number of resampled records of each kind, 20 to 2000. Default: 400 for one asset, and 60 for several, whose
    /// steps take longer.
    #[serde(default)]
    pub resamples: Option<usize>,
    /// Number of consecutive periods that are drawn together, from 1 to half of the record. Default: the cube root of
    /// the record's length.
    #[serde(default)]
    pub block: Option<usize>,
    /// Seed of the resampled records and of the simulated bridges. Default 1.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

/// Returns the default multiples of the radius.
pub fn default_scales() -> Vec<f64> {
    vec![0.0, 0.1, 0.25, 0.5, 1.0]
}

/// Default number of resampled records, for one asset and for several: some seconds at 240 returns of twelve assets.
const DEFAULT_RESAMPLES: [usize; 2] = [400, 60];

/// The problem of one asset, or of several assets if it has the field `assets`.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant)]
pub enum FrontierProblem {
    /// One asset, which may be held beside the bank.
    Asset(ProblemSpecification),
    /// Several assets.
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

/// A valid request, for any number of assets.
#[derive(Debug, Clone, PartialEq)]
pub struct FrontierQuestion {
    /// The completed request. Reading it again gives the same question.
    pub request: FrontierRequest,
    /// The assets and the investor. A single asset is named `asset`.
    pub assets: AssetsProblem,
    /// The one-period problem of the inverse-volatility fund. With one asset, the fund is that asset.
    pub fund: Specification,
    /// Number of resampled records of each kind.
    pub resamples: usize,
    /// Number of consecutive periods that are drawn together.
    pub block: usize,
    /// Bounds on all log-returns, if the request gives them.
    pub support: Option<Interval>,
}

impl Bounded for FrontierRequest {
    const BOUNDS: &'static [FieldBounds] = &[
        ("scales", ValueBounds::list(&SCALES, &ValueBounds::Number(0.0, LARGEST_SCALE))),
        ("resamples", ValueBounds::count(&RESAMPLES)),
        ("block", ValueBounds::CountFrom(1)),
    ];
}

impl FrontierRequest {
    /// Checks the request and fills in its defaults.
    ///
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
            let rule = "must be `paper` or left out: `scales` already sets the shares of the radius to try";
            return Err(FieldError::new("problem.caution", given.name(), rule));
        }
        let (assets, mut fund) = match &self.problem {
            FrontierProblem::Assets(assets) => {
                check_turnover(assets)?;
                (assets.clone(), assets.fund(self.seed)?)
            }
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
                "must be at most {}: periods times assets times scales times resamples may be at most {MOST_DRAWN}",
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

/// Rejects a limit on the turnover.
fn check_turnover(problem: &AssetsProblem) -> Result<(), FieldError> {
    let Some(most) = problem.limits.as_ref().and_then(|limits| limits.max_turnover) else { return Ok(()) };
    let rule = "must be left out: a frontier starts without holdings";
    Err(FieldError::new("problem.limits.max_turnover", most, rule))
}

/// Rejects options that do not apply to a resampled record.
fn check_static(problem: &ProblemSpecification) -> Result<(), FieldError> {
    let name = problem.framework.name();
    if problem.framework != Framework::Adaptive {
        return Err(FieldError::new(
            "problem.framework",
            name,
            "must be `adaptive`: a frontier varies the radius of this framework",
        ));
    }
    if problem.horizon != 1 {
        return Err(FieldError::new(
            "problem.horizon",
            problem.horizon,
            "must be 1 or left out: a frontier covers one period",
        ));
    }
    if problem.trading_cost != 0.0 {
        let rule = "must be 0 or left out: a frontier starts without holdings";
        return Err(FieldError::new("problem.trading_cost", problem.trading_cost, rule));
    }
    if problem.learning != (Learning::Equal {}) {
        return Err(FieldError::new("problem.learning", "decay", "must be `equal`: resampled records have no order"));
    }
    if !problem.centre.is_empirical() {
        let rule = "must be empirical: a frontier centres its balls on the law of the record alone";
        return Err(FieldError::new("problem.centre.kind", problem.centre.name(), rule));
    }
    problem.check_without_spending("a frontier compares wealth after one period")?;
    if !problem.contributions.are_none() {
        return Err(FieldError::new("problem.contributions", "not 0", "must be left out"));
    }
    Ok(())
}

fn as_assets(problem: &ProblemSpecification) -> AssetsProblem {
    let rows: Vec<Vec<f64>> = problem.history.iter().map(|&value| vec![value]).collect();
    asked_of(vec!["asset".to_owned()], rows.into(), problem)
}

/// Returns the one-period problem of these assets with the options that `problem` has for one asset.
pub fn asked_of(assets: Vec<String>, history: AssetHistory, problem: &ProblemSpecification) -> AssetsProblem {
    AssetsProblem {
        assets,
        ground_norm: GroundNorm::default(),
        means: MeansRule::default(),
        composition: CompositionRule::default(),
        limits: None,
        horizon: None,
        trading_cost: 0.0,
        contributions: Contributions::default(),
        spending: None,
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
