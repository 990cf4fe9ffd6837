//! A request about several assets: what is known of their returns, and how far the adversary may move them.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::asset_history::AssetHistory;
use super::bounds::{Bounded, FieldBounds, ValueBounds};
use super::caution::CautionLevel;
use super::caution_rules::{check_support, check_within};
use super::contributions::Contributions;
use super::framework::Framework;
use super::fund::{CompositionRule, FundSpecification, GroundNorm};
use super::learning::Learning;
use super::limits::WeightLimits;
use super::means::MeansRule;
use super::radius_rule::RadiusRule;
use super::rules;
use super::specification::{InitialLaws, ProblemSpecification, Specification, UtilitySpecification, defaults};
use super::spending::Spending;
use super::support::Support;
use super::text::check_text;
use crate::control::error::FieldError;
use crate::control::problem::compositions::CompositionSet;
use crate::numerics::bridge::funds::fund_returns;
use crate::numerics::transport::water_filling::inverse_volatility;

/// Largest number of assets.
pub const MOST_ASSETS: usize = 30;
/// Allowed number of assets in a request.
pub const ASSETS: std::ops::RangeInclusive<usize> = 2..=MOST_ASSETS;
/// Allowed number of dates in a history. The most dates of the most assets take some seconds of search.
pub const DATES: std::ops::RangeInclusive<usize> = 2..=10_000;
/// Allowed number of characters in an asset's name.
pub const NAME_LENGTH: std::ops::RangeInclusive<usize> = 1..=100;

/// The investor, several assets, and what is known of their returns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AssetsProblem {
    /// Names of the assets, 2 to 30, all different, in the order of the columns of `history`.
    #[schema(example = json!(["stocks", "bonds"]))]
    pub assets: Vec<String>,
    /// Distance that sets the adversary's cost of moving a law. Default: `scaled_one`.
    #[serde(default)]
    pub ground_norm: GroundNorm,
    /// How the shares of the assets within the risky holdings are chosen, period after period. Default: `one_step`.
    #[serde(default)]
    pub composition: CompositionRule,
    /// Limits on the composition, for advice and for every period of a policy. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<WeightLimits>,
    /// The means of the assets under the law at the centre. Default: `sample`.
    #[serde(default)]
    pub means: MeansRule,
    /// Number of allocation decisions that a policy is trained for, 1 to 520. Default: 10 for a policy; always 1 for
    /// advice.
    #[serde(default)]
    pub horizon: Option<usize>,
    /// Return of the bank per step, as a fraction, -0.5 to 0.5.
    pub rate_per_step: f64,
    /// Number of periods of the history in a year, 1 to 366. It is used for annual figures and does not change the
    /// advice.
    #[serde(default)]
    pub periods_per_year: Option<f64>,
    /// Initial wealth, in any currency, 1e-6 to 1e15. Default 100.
    #[serde(default = "defaults::initial_wealth")]
    pub initial_wealth: f64,
    /// Share of wealth that may be held in all assets together: `[0, highest]`. Default: `[0, 1]`.
    #[serde(default = "defaults::action_interval")]
    pub action_interval: [f64; 2],
    /// Cost of moving money between the bank and any asset, as a share of the amount moved, 0 to 0.1. Default 0. Advice
    /// accepts a cost under power and log utility only.
    #[serde(default)]
    pub trading_cost: f64,
    /// Money added at the end of each period, or withdrawn if negative. Default 0. Advice accepts no other value.
    #[serde(default)]
    pub contributions: Contributions,
    /// Spending that the policy chooses, period after period. Default: none. Advice accepts none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spending: Option<Box<Spending>>,
    /// Relative risk aversion, 1 to 100, instead of `utility`: log utility at 1, power utility above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub risk_aversion: Option<f64>,
    /// Utility of wealth at the horizon, or of spending. Default: power utility with risk aversion 3.
    #[serde(default = "UtilitySpecification::not_given")]
    pub utility: UtilitySpecification,
    /// Radius rule of the inverse-volatility fund; its radius is then widened to cover all funds at once. Default:
    /// `bridge`.
    #[serde(default)]
    pub radius: Option<RadiusRule>,
    /// Share of the radius that is used, found for the inverse-volatility fund. Default: `balanced`, or `paper` if a
    /// `radius` is given.
    #[serde(default)]
    pub caution: Option<CautionLevel>,
    /// The log-returns of each asset that the adversary may use. Default: `worst_seen`.
    #[serde(default)]
    pub support: Option<Support>,
    /// Log-returns by date, oldest first, 2 to 10,000 dates; each date has one value for each asset, null before the asset's
    /// first return. What such an asset would have earned then follows from the assets with longer records, by regression.
    #[schema(value_type = Vec<Vec<Option<f64>>>)]
    pub history: AssetHistory,
}

impl AssetsProblem {
    /// Returns the one-period problem of the inverse-volatility fund. Its rate, utility and radius are checked and
    /// completed here. The radius for all funds is a multiple of its radius.
    ///
    /// # Errors
    /// A field breaks a rule.
    pub fn fund(&self, seed: u64) -> Result<Specification, FieldError> {
        self.check()?;
        if let Some(horizon) = self.horizon.filter(|horizon| *horizon != 1) {
            let rule = "must be 1 or left out: the advice covers one period; train a policy for more periods";
            return Err(FieldError::new("problem.horizon", horizon, rule));
        }
        if !self.contributions.are_none() {
            let rule = "must be 0 or left out: train a policy to add or withdraw money";
            return Err(FieldError::new("problem.contributions", "not 0", rule));
        }
        let problem = self.of_fund();
        problem.check_without_spending("this call advises one period. Train a policy")?;
        if self.trading_cost != 0.0 && matches!(self.utility, UtilitySpecification::Exponential { .. }) {
            let rule = "must be 0 or left out under exponential utility; power and log utility allow a trading cost";
            return Err(FieldError::new("problem.trading_cost", self.trading_cost, rule));
        }
        Specification::of(ProblemSpecification { horizon: 1, ..problem }, seed).completed()
    }

    /// Returns the investor's problem with the inverse-volatility fund as the only asset.
    pub fn of_fund(&self) -> ProblemSpecification {
        let returns = fund_returns(&self.means.applied(&self.history), &inverse_volatility(&self.history));
        ProblemSpecification {
            horizon: self.horizon.unwrap_or_else(defaults::horizon),
            periods_per_year: self.periods_per_year,
            initial_wealth: self.initial_wealth,
            action_interval: self.action_interval,
            trading_cost: self.trading_cost,
            contributions: self.contributions.clone(),
            spending: self.spending.clone(),
            risk_aversion: self.risk_aversion,
            utility: self.utility,
            radius: self.radius,
            caution: self.caution,
            support: self.support,
            ..ProblemSpecification::of(returns, self.rate_per_step)
        }
    }

    /// Checks the names, the returns, the radius rule and the composition of the assets.
    ///
    /// # Errors
    /// The first field that breaks a rule.
    pub fn check(&self) -> Result<(), FieldError> {
        check_names("problem.assets", &self.assets)?;
        check_rows("problem.history", &self.history, &self.assets, self.support)?;
        if let Some(rule @ (RadiusRule::Joint { .. } | RadiusRule::Concentration { .. })) = self.radius {
            let allowed = "must be bridge, calibrated, root_n or fixed: what the rule promises holds for one asset";
            return Err(FieldError::new("problem.radius.rule", rule.name(), allowed));
        }
        self.means.check("problem.means", self.support)?;
        check_composition("problem.composition", &self.composition, self.assets.len())?;
        self.limits.as_ref().map_or(Ok(()), |limits| limits.check("problem.limits", &self.assets))
    }

    /// Returns the compositions that the limits allow from `holdings`, which are shares of wealth; `None` without limits.
    pub fn compositions(&self, holdings: &[f64]) -> Option<CompositionSet> {
        self.limits.as_ref().map(|limits| limits.compositions(&self.assets, holdings))
    }
}

/// The bounds of the names of several assets.
pub const NAMES: ValueBounds = ValueBounds::set(&ASSETS, &ValueBounds::text(&NAME_LENGTH));
const LOG_RETURN_ROWS: ValueBounds = ValueBounds::list(&DATES, &ValueBounds::list(&ASSETS, &rules::LOG_RETURNS));

impl Bounded for AssetsProblem {
    const BOUNDS: &'static [FieldBounds] = &[
        ("assets", NAMES),
        ("history", LOG_RETURN_ROWS),
        ("horizon", ValueBounds::count(&rules::HORIZON)),
        ("rate_per_step", ValueBounds::number(rules::RATE)),
        ("periods_per_year", ValueBounds::number(rules::PERIODS_PER_YEAR)),
        ("initial_wealth", ValueBounds::number(rules::WEALTH)),
        ("action_interval", ValueBounds::List(2, 2, &rules::SHARES)),
        ("trading_cost", ValueBounds::number(rules::TRADING_COST)),
        ("risk_aversion", ValueBounds::number(rules::RELATIVE_RISK_AVERSION)),
    ];
}

impl Bounded for FundSpecification {
    const BOUNDS: &'static [FieldBounds] =
        &[("assets", NAMES), ("history", LOG_RETURN_ROWS), ("radius_factor", ValueBounds::number(FACTOR))];
}

/// Checks the names of assets in the field `named`.
///
/// # Errors
/// There are too few or too many, or one breaks a rule.
pub fn check_names(named: &str, assets: &[String]) -> Result<(), FieldError> {
    if !ASSETS.contains(&assets.len()) {
        let rule = format!("must name {} to {} assets, each with a column of history", ASSETS.start(), ASSETS.end());
        return Err(FieldError::new(named, format!("{} names", assets.len()), rule));
    }
    let mut seen = BTreeSet::new();
    for (index, name) in assets.iter().enumerate() {
        let field = || format!("{named}[{index}]");
        check_text(&field(), name, NAME_LENGTH, &[])?;
        if !seen.insert(name) {
            return Err(FieldError::new(field(), name, "must differ from the other names"));
        }
    }
    Ok(())
}

/// Checks the log-returns of assets, date by date, in the field `named`.
///
/// # Errors
/// The first that breaks a rule.
pub fn check_rows(
    named: &str,
    rows: &AssetHistory,
    assets: &[String],
    support: Option<Support>,
) -> Result<(), FieldError> {
    if !DATES.contains(&rows.len()) {
        let rule = format!("must hold {} to {} dates", DATES.start(), DATES.end());
        return Err(FieldError::new(named, format!("{} dates", rows.len()), rule));
    }
    let width = |row: &Vec<f64>| row.len() != assets.len();
    if let Some(date) = rows.iter().position(width) {
        let rule =
            format!("must have one log-return for each of the {} assets, or null before its first", assets.len());
        return Err(FieldError::new(format!("{named}[{date}]"), format!("{} values", rows[date].len()), rule));
    }
    rows.check(named, assets)?;
    for (date, row) in rows.iter().enumerate() {
        for (asset, &value) in row.iter().enumerate() {
            rules::log_return(&format!("{named}[{date}][{asset}]"), value)?;
        }
    }
    for (asset, name) in assets.iter().enumerate() {
        let column: Vec<f64> = rows.iter().map(|row| row[asset]).collect();
        Learning::Equal {}.check_deviation(&format!("{named}, {name}"), &column)?;
    }
    let Some(support) = support else { return Ok(()) };
    check_support("problem.support", support)?;
    if !rows.are_equal() && support.given().is_some() {
        let rule =
            "must not be between if a record begins later than others: a return that is filled in may lie outside";
        return Err(FieldError::new("problem.support.rule", "between", rule));
    }
    for (date, row) in rows.iter().enumerate() {
        for (asset, &value) in row.iter().enumerate() {
            check_within(support, || format!("{named}[{date}][{asset}]"), value)?;
        }
    }
    Ok(())
}

/// Tolerance on the sum of given shares, which should be 1.
const WHOLE: f64 = 1e-6;

/// Checks given shares in the field `named`: one for each asset, each from 0 to 1, with the sum 1.
fn check_composition(named: &str, rule: &CompositionRule, assets: usize) -> Result<(), FieldError> {
    let CompositionRule::Given(shares) = rule else { return Ok(()) };
    let field = format!("{named}.given");
    if shares.len() != assets {
        let rule = format!("must hold a share for each of the {assets} assets");
        return Err(FieldError::new(field, format!("{} shares", shares.len()), rule));
    }
    for (index, &share) in shares.iter().enumerate() {
        rules::share(&format!("{field}[{index}]"), share)?;
    }
    let whole: f64 = shares.iter().sum();
    if (whole - 1.0).abs() > WHOLE {
        return Err(FieldError::new(field, format!("shares summing to {whole}"), "must sum to 1"));
    }
    Ok(())
}
/// Allowed factors on the radius of one fund.
const FACTOR: (f64, f64) = (1.0, 100.0);
/// Tolerance between a log-return of the fund and the one computed from its assets, possibly on another machine.
const ROUNDING: f64 = 1e-9;

/// Checks that a fund satisfies its rules and that `problem` is the problem of its investor.
///
/// # Errors
/// The first field that breaks a rule.
pub(super) fn check_fund(
    fund: &FundSpecification,
    problem: &ProblemSpecification,
    laws: InitialLaws,
) -> Result<(), FieldError> {
    if laws != InitialLaws::Resampled {
        let rule = "must be resampled for a fund of several assets, because its law changes with its shares";
        return Err(FieldError::new("design.initial_laws", "given", rule));
    }
    if problem.framework != Framework::Adaptive {
        let rule = "must be adaptive for a fund of several assets";
        return Err(FieldError::new("problem.framework", problem.framework.name(), rule));
    }
    if problem.learning.decays() {
        let rule = "must be equal for a fund of several assets";
        return Err(FieldError::new("problem.learning", "decay", rule));
    }
    if !problem.centre.is_empirical() {
        let rule = "must be empirical for a fund of several assets";
        return Err(FieldError::new("problem.centre.kind", problem.centre.name(), rule));
    }
    check_names("fund.assets", &fund.assets)?;
    check_rows("fund.history", &fund.history, &fund.assets, problem.support)?;
    fund.means.check("fund.means", problem.support)?;
    check_composition("fund.composition", &fund.composition, fund.assets.len())?;
    fund.limits.as_ref().map_or(Ok(()), |limits| limits.check("fund.limits", &fund.assets))?;
    if let Some(factor) = fund.radius_factor {
        rules::within("fund.radius_factor", factor, FACTOR.0, FACTOR.1)?;
    }
    let returns = fund_returns(&fund.means.applied(&fund.history), &inverse_volatility(&fund.history));
    let differs = |(index, (given, of_fund)): (usize, (&f64, f64))| {
        ((given - of_fund).abs() > ROUNDING).then_some((index, *given, of_fund))
    };
    if returns.len() != problem.history.len() {
        let rule = format!("must hold {} log-returns, one for each date of fund.history", returns.len());
        return Err(FieldError::new("problem.history", format!("{} values", problem.history.len()), rule));
    }
    match problem.history.iter().zip(returns).enumerate().find_map(differs) {
        None => Ok(()),
        Some((index, given, of_fund)) => {
            let rule = format!("must be {of_fund}, the log-return of the inverse-volatility fund of fund.history");
            Err(FieldError::new(format!("problem.history[{index}]"), given, rule))
        }
    }
}
