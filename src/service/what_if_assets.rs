//! What is supposed of a session of several assets, and what would then be told: what a report of it would lead to.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use super::assets::shares;
use super::fund_advice::FundAdvice;
use super::live::Live;
use super::report::Report;
use super::standing::Standing;
use crate::control::assets::advice::named;
use crate::control::error::FieldError;
use crate::control::policy::advisor::{AdviceMode, Advisor};
use crate::control::policy::what_if::{Hypothesis, Supposed};
use crate::control::policy::worst_case::{WorstCase, WorstLawSummary};
use crate::control::problem::dynamics::Dynamics;

/// The advice on several assets under one hypothesis.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsWhatIfPoint {
    /// The period advised.
    pub period: usize,
    /// Wealth at its start.
    pub wealth: f64,
    /// The returns supposed, by asset, if any were.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub log_returns: Option<BTreeMap<String, f64>>,
    /// The factor on the radius supposed, if one was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_scale: Option<f64>,
    #[serde(flatten)]
    pub advice: FundAdvice,
    /// Lagrange multiplier of the ball: utility lost per unit of extra radius. Where the step was solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gamma: Option<f64>,
    /// The law of the fund's log-return that is worst for the total, in figures. Where the step was solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_law: Option<WorstLawSummary>,
    /// That law itself, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<WorstCase>,
}

/// What is supposed of several assets, beside a hypothesis of wealth and radius.
#[derive(Debug, Clone)]
pub(super) struct Supposition {
    standing: Standing,
    /// Periods observed.
    observed: usize,
    step: usize,
    /// The step that advises the period after the coming one, if one does.
    following: Option<usize>,
    dynamics: Dynamics,
    /// Shares of wealth held now, before trading.
    holdings: Option<Vec<f64>>,
    /// The coming returns, by the name of their field.
    report: Option<(&'static str, Report)>,
}

impl Supposition {
    /// # Errors
    /// Holdings that are no shares of wealth in the assets; returns past the last period.
    pub(super) fn new(
        live: &Live,
        holdings: Option<&BTreeMap<String, f64>>,
        report: Option<(&'static str, Report)>,
    ) -> Result<Self, FieldError> {
        let names = &live.standing.assets.as_ref().ok_or_else(of_one)?.names;
        if let (Some((field, _)), None) = (&report, live.following()) {
            let rule = "must be absent: the coming period is the last, and none is left to advise after it";
            return Err(FieldError::new(*field, "given", rule));
        }
        Ok(Supposition {
            standing: live.standing.clone(),
            observed: live.observed,
            step: live.step(),
            following: live.following(),
            dynamics: live.current.dynamics(live.observed),
            holdings: holdings.map(|holdings| shares("holdings", holdings, names)).transpose()?,
            report,
        })
    }

    /// Whether a composition must be chosen for `hypothesis`.
    pub(super) fn composes(&self, hypothesis: &Hypothesis) -> bool {
        self.holdings.is_some() || self.report.is_some() || hypothesis.wealth.is_some()
    }

    /// What would be told. With another wealth or other holdings the composition is chosen anew from the one held before, as it
    /// would have been; after a return it is chosen as the report of it would.
    ///
    /// # Errors
    /// Returns that are not of the assets, or lead out of the wealth that is taken.
    pub(super) fn answer(
        self,
        advisor: &Advisor,
        hypothesis: &Hypothesis,
        mode: AdviceMode,
    ) -> Result<AssetsWhatIfPoint, FieldError> {
        let Supposition { mut standing, observed, mut step, following, dynamics, holdings, report } = self;
        if hypothesis.wealth.is_some() || holdings.is_some() {
            standing.suppose(advisor, step, hypothesis.wealth, holdings);
        }
        let (mut period, mut log_returns) = (observed + 1, None);
        if let (Some((field, report)), Some(following)) = (report, following) {
            let advised = advisor.advise(step, &standing.state, AdviceMode::Surrogate).allocation;
            let passed = standing.after(dynamics, period, &report, (advised, None)).map_err(|error| {
                match error.field.as_str() {
                    "wealth" => FieldError { field: field.into(), ..error },
                    _ => error,
                }
            })?;
            log_returns = passed.seen.row().map(<[f64]>::to_vec);
            (standing, step, period) = (passed.standing, following, period + 1);
            standing.compose(advisor, step);
        }
        let of_radius = Hypothesis { radius: hypothesis.radius, ..Hypothesis::default() };
        let supposed = advisor.suppose(step, None, &standing.state, &of_radius, mode)?;
        let Some(assets) = &standing.assets else { return Err(of_one()) };
        let Supposed { wealth, advice, worst_case } = supposed;
        Ok(AssetsWhatIfPoint {
            period,
            wealth,
            log_returns: log_returns.map(|row| named(&assets.names, &row)),
            radius_scale: hypothesis.radius_scale(),
            advice: FundAdvice::new(&advice, assets),
            gamma: worst_case.as_ref().map(|worst| worst.multiplier),
            worst_law: worst_case.as_ref().and_then(WorstCase::summary),
            worst_case,
        })
    }
}

fn of_one() -> FieldError {
    FieldError::new("session", "of one asset", "must be of several assets")
}
