//! The request for the share of the capital that the record of a strategy supports.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::assets::AssetsProblem;
use super::caution::CautionLevel;
use super::frequency::Frequency;
use super::specification::{ProblemSpecification, Specification, UtilitySpecification, default_seed};
use crate::control::error::FieldError;

/// The values of a record.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordUnit {
    /// The returns of periods, one after another.
    #[default]
    Periods,
    /// The outcomes of trades, one after another: each is the profit or loss as a share of the stake.
    Trades,
}

impl RecordUnit {
    /// Returns the noun for one value of a record with so many in a year.
    pub fn noun(self, periods_per_year: Option<f64>) -> &'static str {
        match self {
            RecordUnit::Periods => Frequency::noun_for(periods_per_year),
            RecordUnit::Trades => "trade",
        }
    }
}

/// A question about the share of the capital that the record of one strategy or several supports.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SleeveQuestion<P = ProblemSpecification> {
    /// The problem as in `POST /advise`, with a strategy for each asset. Utility is logarithmic, so `utility` and
    /// `risk_aversion` are left out, and so is `trading_cost`: a record is net of costs. The default of `caution` is `paper`,
    /// the whole radius.
    pub problem: P,
    /// The values of `problem.history`: returns of `periods` or outcomes of `trades`. Default `periods`.
    #[serde(default)]
    pub record_of: RecordUnit,
    /// Seed of the simulated bridges. Default 1.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

impl SleeveQuestion {
    /// Returns the completed specification of the step.
    ///
    /// # Errors
    /// A field breaks a rule.
    pub fn specification(&self) -> Result<Specification, FieldError> {
        let problem = &self.problem;
        if problem.horizon != 1 {
            let rule = "must be 1 or left out: the share is that of one period or trade";
            return Err(FieldError::new("problem.horizon", problem.horizon, rule));
        }
        problem.check_without_spending("growth has no spending. Ask for a plan")?;
        if !problem.framework.has_ball() {
            let rule = "must be adaptive or left out: only a ball doubts the record";
            return Err(FieldError::new("problem.framework", problem.framework.name(), rule));
        }
        if !problem.centre.is_empirical() {
            let rule = "must be empirical or left out: the Kelly share is that of the record";
            return Err(FieldError::new("problem.centre.kind", problem.centre.name(), rule));
        }
        if !problem.contributions.are_none() {
            let rule = "must be 0 or left out: the share is one of the capital, whatever is added later";
            return Err(FieldError::new("problem.contributions", "not 0", rule));
        }
        check_growth(problem.utility, problem.risk_aversion, problem.trading_cost)?;
        let caution = Some(problem.caution.unwrap_or(USUAL_CAUTION));
        let problem = ProblemSpecification { risk_aversion: None, utility: GROWTH, caution, ..problem.clone() };
        Specification::of(problem, self.seed).completed()
    }
}

impl SleeveQuestion<AssetsProblem> {
    /// Returns the problem with its utility, and the completed specification of its fund of inverse volatilities.
    ///
    /// # Errors
    /// A field breaks a rule.
    pub fn completed(&self) -> Result<(AssetsProblem, Specification), FieldError> {
        let problem = &self.problem;
        check_growth(problem.utility, problem.risk_aversion, problem.trading_cost)?;
        let caution = Some(problem.caution.unwrap_or(USUAL_CAUTION));
        let problem = AssetsProblem { risk_aversion: None, utility: GROWTH, caution, ..problem.clone() };
        let fund = problem.fund(self.seed)?;
        Ok((problem, fund))
    }
}

/// The whole radius, because the question is what the record supports, and not what would be regretted least.
pub const USUAL_CAUTION: CautionLevel = CautionLevel::Paper;

/// The utility whose mean is growth.
const GROWTH: UtilitySpecification = UtilitySpecification::Log {};

/// Checks that nothing but growth is wanted.
fn check_growth(utility: UtilitySpecification, risk_aversion: Option<f64>, cost: f64) -> Result<(), FieldError> {
    if utility.is_given() && utility != GROWTH {
        let name = if utility.power() == 0.0 { "exponential" } else { "power" };
        let rule = "must be log or left out: the Kelly share maximises growth. Ask for advice with another utility";
        return Err(FieldError::new("problem.utility.kind", name, rule));
    }
    if let Some(risk_aversion) = risk_aversion.filter(|risk_aversion| *risk_aversion != 1.0) {
        let rule = "must be 1 or left out: the Kelly share maximises growth. Ask for advice with another risk aversion";
        return Err(FieldError::new("problem.risk_aversion", risk_aversion, rule));
    }
    if cost != 0.0 {
        let rule = "must be 0 or left out: give returns net of costs";
        return Err(FieldError::new("problem.trading_cost", cost, rule));
    }
    Ok(())
}
