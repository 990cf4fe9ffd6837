//! Hypotheses about a session of several assets, and the advice under them, which is what a report of them would lead
//! to.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::policy::advisor::{AdviceMode, Advisor};
use crate::control::policy::what_if::{Hypothesis, WhatIfResult};
use crate::control::policy::worst_case::{WorstCase, WorstLawSummary};
use crate::control::problem::dynamics::Dynamics;
use crate::service::entries::report::Report;
use crate::service::sessions::account_state::AccountState;
use crate::service::sessions::advised::AdvisedShares;
use crate::service::sessions::assets::shares;
use crate::service::sessions::fund_advice::FundAdvice;
use crate::service::sessions::live::LiveSession;

/// The advice on several assets under one hypothesis.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsWhatIfPoint {
    /// The period advised.
    pub period: usize,
    /// Wealth at its start.
    pub wealth: f64,
    /// The returns of the hypothesis by asset, if it has any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub log_returns: Option<BTreeMap<String, Option<f64>>>,
    /// The factor on the radius in the hypothesis, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_scale: Option<f64>,
    #[serde(flatten)]
    pub advice: FundAdvice,
    /// Lagrange multiplier of the ball: utility lost per unit of extra radius. Present if the step was solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gamma: Option<f64>,
    /// Figures of the worst law of the fund's log-return for the total. Present if the step was solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_law: Option<WorstLawSummary>,
    /// The worst law itself, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<WorstCase>,
}

/// A hypothesis about several assets, besides one about wealth and radius.
#[derive(Debug, Clone)]
pub(super) struct WhatIfScenario {
    standing: AccountState,
    /// Periods observed.
    observed: usize,
    step: usize,
    /// The step that advises the period after the coming one, if there is one.
    following: Option<usize>,
    dynamics: Dynamics,
    /// Shares of wealth held now, before trading.
    holdings: Option<Vec<f64>>,
    /// The coming returns, by the name of their field.
    report: Option<(&'static str, Report)>,
}

impl WhatIfScenario {
    /// Builds the hypothesis.
    ///
    /// # Errors
    /// The holdings are not shares of wealth in the assets, or there are returns past the last period.
    pub(in crate::service) fn new(
        live: &LiveSession,
        holdings: Option<&BTreeMap<String, f64>>,
        report: Option<(&'static str, Report)>,
    ) -> Result<Self, FieldError> {
        let account = live.standing.account()?;
        let names = &account.assets.as_ref().ok_or_else(of_one)?.names;
        if let (Some((field, _)), None) = (&report, live.following()) {
            let rule = "must be absent: the coming period is the last, so there is none after it to advise";
            return Err(FieldError::new(*field, "given", rule));
        }
        Ok(WhatIfScenario {
            standing: account.clone(),
            observed: live.observed,
            step: live.step(),
            following: live.following(),
            dynamics: live.current.dynamics(live.observed),
            holdings: holdings.map(|holdings| shares("holdings", holdings, names)).transpose()?,
            report,
        })
    }

    /// Returns whether a composition must be chosen for `hypothesis`.
    pub(super) fn composes(&self, hypothesis: &Hypothesis) -> bool {
        self.holdings.is_some() || self.report.is_some() || hypothesis.wealth.is_some()
    }

    /// Returns the advice under the hypothesis. With another wealth or other holdings, the composition is chosen again
    /// from the one held before. After a return, it is chosen as a report of that return would choose it.
    ///
    /// # Errors
    /// The returns are not of the assets, or wealth leaves the permitted range.
    pub(in crate::service) fn answer(
        self,
        advisor: &Advisor,
        hypothesis: &Hypothesis,
        mode: AdviceMode,
    ) -> Result<AssetsWhatIfPoint, FieldError> {
        let WhatIfScenario { mut standing, observed, mut step, following, dynamics, holdings, report } = self;
        if hypothesis.wealth.is_some() || holdings.is_some() {
            standing.suppose(advisor, step, hypothesis.wealth, holdings);
        }
        let (mut period, mut log_returns) = (observed + 1, None);
        if let (Some((field, report)), Some(following)) = (report, following) {
            let advised = AdvisedShares::of(&advisor.advise(step, &standing.state, AdviceMode::Surrogate));
            let passed = standing.after(dynamics, period, &report, (advised, None)).map_err(|error| {
                match error.field.as_str() {
                    "wealth" => FieldError { field: field.into(), ..error },
                    _ => error,
                }
            })?;
            log_returns = standing.assets.as_ref().and_then(|assets| assets.shown(&passed.seen));
            (standing, step, period) = (passed.standing, following, period + 1);
            standing.compose(advisor, step);
        }
        let of_radius = Hypothesis { radius: hypothesis.radius, ..Hypothesis::default() };
        let supposed = advisor.suppose(step, None, &standing.state, &of_radius, mode)?;
        let Some(assets) = &standing.assets else { return Err(of_one()) };
        let WhatIfResult { wealth, advice, worst_case } = supposed;
        Ok(AssetsWhatIfPoint {
            period,
            wealth,
            log_returns,
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
