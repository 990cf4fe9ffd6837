//! Several assets in a session: reports by name, their state, and how answers show it.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::assets::advice::{OneStep, named};
use crate::control::assets::fund::Fund;
use crate::control::error::FieldError;
use crate::control::policy::advisor::Advisor;
use crate::control::problem::state::State;
use crate::control::request::asset_history::AssetHistory;
use crate::control::request::by_name::by_name;
use crate::control::request::fund::CompositionRule;
use crate::control::request::means::MeansRule;
use crate::control::request::rules;
use crate::control::request::specification::Specification;
use crate::control::request::support::LawExtent;
use crate::numerics::law::empirical::EmpiricalDistribution;
use crate::service::entries::record::PeriodNoise;
use crate::service::entries::report::Report;

/// The largest sum of shares of wealth, with room for rounding.
const WHOLE: f64 = 1.0 + 1e-9;

/// The assets of a session between two periods.
#[derive(Debug, Clone, PartialEq)]
pub struct Assets {
    /// The names, in the order of the columns.
    pub names: Arc<[String]>,
    pub fund: Fund,
    /// The one-step problem behind the composition, as answers show it.
    pub one_step: Option<OneStep>,
    /// The prices reported for the last period, or the last that came for an asset that waits for one.
    pub prices: Vec<Option<f64>>,
    /// True for an asset whose price did not come in the last period.
    pub waiting: Vec<bool>,
    /// Share of wealth in each asset that left the session, to be sold before the coming period.
    pub leaving: BTreeMap<String, f64>,
}

/// Several assets before the coming period, by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Composition {
    /// Share of each asset in the advised holdings; they sum to 1.
    pub composition: BTreeMap<String, f64>,
    /// Share of wealth in each asset, before trading.
    pub holdings: BTreeMap<String, f64>,
    /// Share of wealth in assets that left the session, to be sold before the coming period.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub leaving: BTreeMap<String, f64>,
    /// The optimum one period ahead, if the composition is chosen by it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub one_step: Option<OneStep>,
}

/// The assets of a session when it is opened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlannedAssets {
    pub(in crate::service) names: Vec<String>,
    pub(in crate::service) composed: Composition,
    /// The number of dates of the history before each asset's first return; empty if it is 0 for all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    missing: Vec<usize>,
}

impl PlannedAssets {
    /// Returns the number of dates of the history before each asset's first return.
    pub(in crate::service) fn missing(&self) -> Vec<usize> {
        if self.missing.is_empty() { vec![0; self.names.len()] } else { self.missing.clone() }
    }

    /// Returns true if these are the same assets and holdings, whatever the composition is.
    pub(in crate::service) fn is_like(&self, other: &PlannedAssets) -> bool {
        let (own, shares) = (&self.composed.composition, &other.composed.composition);
        self.names == other.names
            && self.missing == other.missing
            && self.composed.holdings == other.composed.holdings
            && own.keys().eq(shares.keys())
            && shares.values().all(|share| (0.0..=WHOLE).contains(share))
    }
}

/// A period of several assets, by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ObservedAssets {
    /// Null if they are missing. Null for an asset whose price did not come, or that lost everything, which `notes`
    /// says.
    pub log_returns: Option<BTreeMap<String, Option<f64>>>,
    /// Advised share of wealth in each asset.
    pub advised_allocations: BTreeMap<String, f64>,
    /// Executed share of wealth in each asset.
    pub executed_allocations: BTreeMap<String, f64>,
    /// Figures before the coming period.
    #[serde(flatten)]
    pub composed: Composition,
}

impl Assets {
    /// Builds the assets from the observed `rows`, whose law has these means, and the shares of wealth held, 0 by default.
    ///
    /// # Errors
    /// The holdings are not shares of wealth in these assets.
    pub(in crate::service) fn at(
        names: &[String],
        rows: AssetHistory,
        means: MeansRule,
        holdings: Option<&BTreeMap<String, f64>>,
    ) -> Result<Self, FieldError> {
        let holdings = match holdings {
            Some(holdings) => shares("holdings", holdings, names)?,
            None => vec![0.0; names.len()],
        };
        let (prices, waiting) = (vec![None; names.len()], vec![false; names.len()]);
        let (fund, leaving) = (Fund::at(rows, means, holdings), BTreeMap::new());
        Ok(Assets { names: names.into(), fund, one_step: None, prices, waiting, leaving })
    }

    /// Builds the assets as an answer showed them before the coming period.
    ///
    /// # Errors
    /// The answer names other assets.
    pub(in crate::service) fn with_composition(
        names: &[String],
        rows: AssetHistory,
        means: MeansRule,
        reported: &Composition,
    ) -> Result<Self, FieldError> {
        let mut assets = Assets::at(names, rows, means, Some(&reported.holdings))?;
        assets.take(reported)?;
        Ok(assets)
    }

    /// Applies the composition of an answer.
    ///
    /// # Errors
    /// It names other assets.
    pub(in crate::service) fn take(&mut self, reported: &Composition) -> Result<(), FieldError> {
        self.fund.take(by_name("composition", "asset", &reported.composition, &self.names)?);
        self.one_step = reported.one_step.clone();
        Ok(())
    }

    /// Returns the assets as the start of a session stores them.
    pub(in crate::service) fn planned(&self) -> PlannedAssets {
        let rows = &self.fund.rows;
        let missing = if rows.are_equal() { Vec::new() } else { rows.missing().to_vec() };
        PlannedAssets { names: self.names.to_vec(), composed: self.composed(), missing }
    }

    /// Returns the assets as answers show them.
    pub fn composed(&self) -> Composition {
        Composition {
            composition: named(&self.names, &self.fund.composition),
            holdings: named(&self.names, &self.fund.holdings),
            leaving: self.leaving.clone(),
            one_step: self.one_step.clone(),
        }
    }

    /// Chooses the composition before the period after `step`, if the policy advises that period, and returns the state
    /// of the fund. Cost: that of [`Fund::enter`].
    pub(in crate::service) fn compose(&mut self, advisor: &Advisor, step: usize, state: &State) -> State {
        let (composed, solution) = self.fund.enter(advisor, step, state);
        let bank = 1.0 + advisor.specification().problem.rate_per_step;
        self.one_step = solution.map(|solution| self.fund.one_step(&self.names, &solution, state.wealth * bank));
        composed
    }

    /// Chooses the composition again, from the one held when the present one was chosen.
    pub(super) fn compose_anew(&mut self, advisor: &Advisor, step: usize, state: &State) -> State {
        self.fund.composition.clone_from(&self.fund.before);
        self.compose(advisor, step, state)
    }

    /// Returns whether choosing the composition before the period after `step` needs a solve of the one-step problem.
    pub(super) fn must_solve(advisor: &Advisor, step: usize) -> bool {
        let Specification { problem, fund, .. } = advisor.specification();
        step < problem.horizon && fund.as_ref().is_some_and(|fund| fund.composition == CompositionRule::OneStep)
    }

    /// Returns the shares of wealth in the assets that sum to `total`.
    pub fn shares(&self, total: f64) -> Vec<f64> {
        self.fund.shares(total)
    }

    /// Returns the shares of wealth held in a period, given the `advised` total.
    ///
    /// # Errors
    /// A reported number is not a share of wealth, or not of these assets.
    pub(in crate::service) fn executed(&self, report: &Report, advised: f64) -> Result<Vec<f64>, FieldError> {
        match &report.executed_allocations {
            Some(executed) => shares("executed_allocations", executed, &self.names),
            None => Ok(self.shares(advised)),
        }
    }

    /// Reads the log-returns of a period.
    ///
    /// # Errors
    /// They are not given in exactly one way, are not of these assets, or one breaks a rule.
    pub(in crate::service) fn read(&self, report: &Report) -> Result<PeriodNoise, FieldError> {
        let log_returns = report.log_returns(&self.names, &self.prices)?;
        let came = |asset: &usize| self.waiting[*asset] && log_returns[*asset].is_some();
        let late = (0..log_returns.len()).filter(came).collect();
        Ok(PeriodNoise { values: log_returns, late })
    }

    /// Returns the log-returns of a period by name, `None` if they are missing.
    pub(in crate::service) fn shown(&self, seen: &PeriodNoise) -> Option<BTreeMap<String, Option<f64>>> {
        (!seen.is_missing()).then(|| named(&self.names, &seen.values))
    }

    /// Returns the share of wealth that is traded to reach `executed`, with all that is sold of assets that left.
    pub(in crate::service) fn traded(&self, executed: &[f64]) -> f64 {
        self.fund.traded(executed) + self.leaving.values().sum::<f64>()
    }

    /// Updates record and holdings after a period in which `executed` was held and that left the share `holding` in all
    /// assets.
    pub(in crate::service) fn passed(&mut self, executed: &[f64], seen: &PeriodNoise, holding: f64) {
        self.fund.passed(executed, &seen.moves(), seen.learned(), holding);
        self.leaving.clear();
        if !seen.is_missing() {
            self.waiting = seen.values.iter().map(Option::is_none).collect();
        }
    }

    /// Takes over the prices reported with the last period. An asset that waits for its price keeps the last one.
    pub(in crate::service) fn price_as(&mut self, report: &Report) {
        let prices = report.prices.as_ref().and_then(|prices| by_name("prices", "asset", prices, &self.names).ok());
        for (asset, known) in self.prices.iter_mut().enumerate() {
            if !self.waiting[asset] {
                *known = prices.as_ref().and_then(|prices| prices[asset]);
            }
        }
    }

    /// Returns the extent of an asset's log-returns.
    pub(in crate::service) fn extent(&self, asset: usize) -> LawExtent {
        LawExtent::of(self.fund.rows.iter().map(|row| row[asset]))
    }

    /// Returns the law of the mean log-return of each date, which does not depend on the composition.
    pub(in crate::service) fn means(rows: &[Vec<f64>]) -> EmpiricalDistribution {
        EmpiricalDistribution::new(&rows.iter().map(|row| mean(row)).collect::<Vec<f64>>())
    }
}

/// Returns the mean of the log-returns of a date.
pub(in crate::service) fn mean(row: &[f64]) -> f64 {
    row.iter().sum::<f64>() / row.len().max(1) as f64
}

/// Validates and returns the shares of wealth in the assets.
///
/// # Errors
/// They are not of these assets, one is not a share, or they sum to more than 1.
pub(in crate::service) fn shares(
    field: &str,
    values: &BTreeMap<String, f64>,
    names: &[String],
) -> Result<Vec<f64>, FieldError> {
    let shares = by_name(field, "asset", values, names)?;
    for (name, share) in names.iter().zip(&shares) {
        rules::share(&format!("{field}.{name}"), *share)?;
    }
    let whole: f64 = shares.iter().sum();
    if whole > WHOLE {
        return Err(FieldError::new(field, format!("shares summing to {whole}"), "must sum to at most 1"));
    }
    Ok(shares)
}
