//! What-if questions about a session, which change nothing: one hypothesis, or one quantity swept over a range.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::policy::advice::Advice;
use crate::control::policy::advisor::AdviceMode;
use crate::control::policy::what_if::{Hypothesis, WhatIfResult};
use crate::control::policy::worst_case::{WorstCase, WorstLawSummary};
use crate::control::request::by_name::distinct_if_given;
use crate::service::advice::explain::{self, ATOM_BYTES, Explain};
use crate::service::advice::sweep::Sweep;
use crate::service::advice::what_if_assets::{AssetsWhatIfPoint, WhatIfScenario};
use crate::service::advice::what_if_problem::ProblemWhatIfPoint;
use crate::service::entries::report::{OF_DECLARED, none_of};
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::service::sessions::live::LiveSession;
use crate::service::sessions::session_state::SessionState;
use crate::store::Tenant;

/// A hypothesis about a session. Fields left out stay as they are.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WhatIf {
    #[schema(example = "session_0123456789abcdef0123456789abcdef")]
    pub session: String,
    /// Wealth now.
    pub wealth: Option<f64>,
    /// Share of wealth in the risky asset now, before trading.
    pub holding: Option<f64>,
    /// Factor on the radius of the uncertainty set of the period advised; later periods keep their own.
    #[schema(example = 0.5)]
    pub radius_scale: Option<f64>,
    /// The radius itself, in the unit of an advice's radius.
    pub radius: Option<f64>,
    /// Return of the coming period, through which the advised allocation is held; the advice is for the period after.
    pub log_return: Option<f64>,
    /// The return as `price / previous price - 1` instead.
    pub simple_return: Option<f64>,
    /// Share of wealth in each of several assets now, before trading, by name; each has one.
    #[serde(default, deserialize_with = "distinct_if_given")]
    pub holdings: Option<BTreeMap<String, f64>>,
    /// Returns of several assets in the coming period, in one of three ways; the advice is for the period after.
    #[schema(example = json!({ "stocks": 0.012, "bonds": 0.004 }))]
    #[serde(default, deserialize_with = "distinct_if_given")]
    pub log_returns: Option<BTreeMap<String, Option<f64>>>,
    /// The returns as `price / previous price - 1` instead.
    #[serde(default, deserialize_with = "distinct_if_given")]
    pub simple_returns: Option<BTreeMap<String, Option<f64>>>,
    /// Prices of several assets at the end of the coming period.
    #[serde(default, deserialize_with = "distinct_if_given")]
    pub prices: Option<BTreeMap<String, Option<f64>>>,
    /// Prices of several assets at its start. Default: those reported for the period before.
    #[serde(default, deserialize_with = "distinct_if_given")]
    pub previous_prices: Option<BTreeMap<String, Option<f64>>>,
    /// States of a declared problem now, each by its name.
    #[serde(default, deserialize_with = "distinct_if_given")]
    #[schema(example = json!({ "stock": 7.0 }))]
    pub state: Option<BTreeMap<String, f64>>,
    /// Noise of a declared problem's coming period, in which the advised actions are executed; the advice is for the
    /// period after.
    pub noise: Option<f64>,
    /// `worst_case`: solve the step, and show the whole worst-case law.
    pub explain: Option<Explain>,
    /// A range for one of the fields above; every point is solved.
    pub sweep: Option<Sweep>,
}

/// The advice under one hypothesis.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct WhatIfPoint {
    /// The period advised.
    pub period: usize,
    /// Wealth at its start.
    pub wealth: f64,
    /// The return of the hypothesis, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub log_return: Option<f64>,
    /// The factor on the radius in the hypothesis, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_scale: Option<f64>,
    #[serde(flatten)]
    pub advice: Advice,
    /// Lagrange multiplier of the ball: utility lost per unit of extra radius. Present if the step was solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gamma: Option<f64>,
    /// Figures of the worst law for the allocation. Present if the step was solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_law: Option<WorstLawSummary>,
    /// The worst law itself, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_case: Option<WorstCase>,
}

/// One point, or the points of a sweep in its order.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
pub enum WhatIfAnswer {
    One {
        session: String,
        #[serde(flatten)]
        point: Box<WhatIfPoint>,
    },
    Sweep {
        session: String,
        points: Vec<WhatIfPoint>,
    },
    /// One point for several assets.
    OneOfAssets {
        session: String,
        #[serde(flatten)]
        point: Box<AssetsWhatIfPoint>,
    },
    SweepOfAssets {
        session: String,
        points: Vec<AssetsWhatIfPoint>,
    },
    /// One point for a declared problem.
    OneOfProblem {
        session: String,
        #[serde(flatten)]
        point: Box<ProblemWhatIfPoint>,
    },
    SweepOfProblem {
        session: String,
        points: Vec<ProblemWhatIfPoint>,
    },
}

impl Sessions {
    /// Returns the advice under the hypotheses without changing the session. Each point of a sweep waits for its own
    /// permit.
    /// So a long sweep starves nobody, and a disconnected caller stops it.
    ///
    /// # Errors
    /// A field breaks a rule, there is no such session, it has reached its horizon, or too much work waits already.
    pub async fn what_if(&self, tenant: &Tenant, request: WhatIf) -> Result<Large<WhatIfAnswer>, ServiceError> {
        let live = self.get(tenant, &request.session).await?;
        live.check_active()?;
        let account = match &live.standing {
            SessionState::Account(account) => account,
            SessionState::Declared(state) => {
                let question = (request.state.as_ref(), request.of_problem()?);
                let Large { value: points, room } = self.what_if_problem(tenant, &live, state, question).await?;
                let session = request.session;
                let value = match only_point(request.sweep, points) {
                    Ok(point) => WhatIfAnswer::OneOfProblem { session, point },
                    Err(points) => WhatIfAnswer::SweepOfProblem { session, points },
                };
                return Ok(Large { value, room });
            }
        };
        none_of(&request.of_declared(), OF_DECLARED)?;
        let hypotheses = request.hypotheses()?;
        let explained = explain::atoms(request.explain, hypotheses.len(), account.state.law.sample_size())?;
        let assets = account.assets.as_ref().map_or(1, |assets| assets.names.len());
        let room = self.memory.answers(explained * assets * ATOM_BYTES).await?;
        let several = account.assets.is_some();
        request.fits(several)?;
        if several {
            let points = self.suppose_of_assets(tenant, &request, &live, hypotheses).await?;
            let session = request.session;
            let value = match only_point(request.sweep, points) {
                Ok(point) => WhatIfAnswer::OneOfAssets { session, point },
                Err(points) => WhatIfAnswer::SweepOfAssets { session, points },
            };
            return Ok(Large { value, room });
        }
        let advisor = self.advisor(tenant, &live).await?;
        let mode = request.mode();
        let mut points = Vec::with_capacity(hypotheses.len());
        for hypothesis in hypotheses {
            let (advisor, state) = (advisor.clone(), account.state.clone());
            let (step, following) = (live.step(), live.following());
            let solves = mode == AdviceMode::Resolve || hypothesis.radius.is_some();
            let turns = if solves { &self.resolving } else { &self.advising };
            let supposed =
                turns.run(tenant, move || advisor.suppose(step, following, &state, &hypothesis, mode)).await?;
            let supposed = supposed.map_err(|error| request.renamed(error))?;
            let period = live.observed + 1 + usize::from(hypothesis.log_return.is_some());
            points.push(WhatIfPoint::new(period, &hypothesis, supposed, request.explain));
        }
        let session = request.session;
        let value = match only_point(request.sweep, points) {
            Ok(point) => WhatIfAnswer::One { session, point },
            Err(points) => WhatIfAnswer::Sweep { session, points },
        };
        Ok(Large { value, room })
    }

    /// Answers the hypotheses for several assets, point by point.
    async fn suppose_of_assets(
        &self,
        tenant: &Tenant,
        request: &WhatIf,
        live: &LiveSession,
        hypotheses: Vec<Hypothesis>,
    ) -> Result<Vec<AssetsWhatIfPoint>, ServiceError> {
        let supposition = WhatIfScenario::new(live, request.holdings.as_ref(), request.report())?;
        let (advisor, mode) = (self.advisor(tenant, live).await?, request.mode());
        let mut points = Vec::with_capacity(hypotheses.len());
        for hypothesis in hypotheses {
            let solves =
                mode == AdviceMode::Resolve || hypothesis.radius.is_some() || supposition.composes(&hypothesis);
            let turns = if solves { &self.resolving } else { &self.advising };
            let (advisor, supposition) = (advisor.clone(), supposition.clone());
            let mut point = turns.run(tenant, move || supposition.answer(&advisor, &hypothesis, mode)).await??;
            point.worst_case.take_if(|_| request.explain.is_none());
            points.push(point);
        }
        Ok(points)
    }
}

/// Returns the point of a question without a sweep, or all points of a sweep.
fn only_point<P>(sweep: Option<Sweep>, mut points: Vec<P>) -> Result<Box<P>, Vec<P>> {
    match (sweep, points.pop()) {
        (None, Some(point)) => Ok(Box::new(point)),
        (_, last) => Err(points.into_iter().chain(last).collect()),
    }
}

impl WhatIfPoint {
    fn new(period: usize, hypothesis: &Hypothesis, supposed: WhatIfResult, explain: Option<Explain>) -> Self {
        let worst_case = supposed.worst_case;
        WhatIfPoint {
            period,
            wealth: supposed.wealth,
            log_return: hypothesis.log_return,
            radius_scale: hypothesis.radius_scale(),
            advice: supposed.advice,
            gamma: worst_case.as_ref().map(|worst| worst.multiplier),
            worst_law: worst_case.as_ref().and_then(WorstCase::summary),
            worst_case: worst_case.filter(|_| explain.is_some()),
        }
    }
}
