//! What-if questions about a session, which change nothing: one hypothesis, or one quantity swept over a range.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::policy::advice::Advice;
use crate::control::policy::advisor::AdviceMode;
use crate::control::policy::what_if::{Hypothesis, HypotheticalRadius, WhatIfResult};
use crate::control::policy::worst_case::{WorstCase, WorstLawSummary};
use crate::control::request::by_name::distinct_if_given;
use crate::service::advice::explain::{self, ATOM_BYTES, Explain};
use crate::service::advice::what_if_assets::{AssetsWhatIfPoint, WhatIfScenario};
use crate::service::entries::report::{OF_ONE, OF_SEVERAL, Report, log_return_of, none_of};
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::service::sessions::live::LiveSession;
use crate::store::Tenant;

/// Number of points of a sweep; each waits for its own permit among the robust steps that requests cause.
pub const POINTS: std::ops::RangeInclusive<usize> = 2..=101;

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
    /// `worst_case`: solve the step, and show the whole worst-case law.
    pub explain: Option<Explain>,
    /// A range for one of the fields above; every point is solved.
    pub sweep: Option<Sweep>,
}

/// The swept range, exactly one.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    pub wealth: Option<SweepRange>,
    pub holding: Option<SweepRange>,
    pub radius_scale: Option<SweepRange>,
    pub radius: Option<SweepRange>,
    pub log_return: Option<SweepRange>,
    pub simple_return: Option<SweepRange>,
}

/// Evenly spaced values, including both ends.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepRange {
    #[schema(example = 0.0)]
    pub from: f64,
    #[schema(example = 2.0)]
    pub to: f64,
    /// 2 to 101.
    #[schema(example = 21)]
    pub points: usize,
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
}

impl SweepRange {
    fn values(&self, field: &str) -> Result<Vec<f64>, FieldError> {
        if !POINTS.contains(&self.points) {
            let rule = format!("must lie in [{}, {}]", POINTS.start(), POINTS.end());
            return Err(FieldError::new(format!("sweep.{field}.points"), self.points, rule));
        }
        let last = self.points - 1;
        // Both ends are exact.
        let at = |index| {
            if index == last { self.to } else { self.from + (self.to - self.from) * index as f64 / last as f64 }
        };
        Ok((0..self.points).map(at).collect())
    }
}

impl WhatIf {
    fn hypothesis(&self) -> Result<Hypothesis, FieldError> {
        let log_return = match (self.log_return, self.simple_return) {
            (Some(_), Some(value)) => {
                return Err(FieldError::new("simple_return", value, "must be absent if log_return is given"));
            }
            (None, Some(value)) => Some(log_return_of("simple_return", value)?),
            (log_return, None) => log_return,
        };
        let radius = match (self.radius_scale, self.radius) {
            (Some(_), Some(value)) => {
                return Err(FieldError::new("radius", value, "must be absent if radius_scale is given"));
            }
            (Some(scale), None) => Some(HypotheticalRadius::Scaled(scale)),
            (None, radius) => radius.map(HypotheticalRadius::Fixed),
        };
        let hypothesis = Hypothesis { wealth: self.wealth, holding: self.holding, log_return, radius };
        hypothesis.check()?;
        Ok(hypothesis)
    }

    /// Returns every hypothesis of the request in order. Checking the ends of the ranges covers all values between.
    fn hypotheses(&self) -> Result<Vec<Hypothesis>, FieldError> {
        let Some(sweep) = &self.sweep else { return Ok(vec![self.hypothesis()?]) };
        type Field = fn(&mut WhatIf) -> &mut Option<f64>;
        let fields: [(&str, Option<SweepRange>, Field); 6] = [
            ("wealth", sweep.wealth, |request| &mut request.wealth),
            ("holding", sweep.holding, |request| &mut request.holding),
            ("radius_scale", sweep.radius_scale, |request| &mut request.radius_scale),
            ("radius", sweep.radius, |request| &mut request.radius),
            ("log_return", sweep.log_return, |request| &mut request.log_return),
            ("simple_return", sweep.simple_return, |request| &mut request.simple_return),
        ];
        let given: Vec<_> = fields.iter().filter_map(|(name, range, field)| Some((*name, (*range)?, *field))).collect();
        let [(name, range, field)] = given[..] else {
            return Err(FieldError::new("sweep", format!("{} ranges", given.len()), "must hold exactly one range"));
        };
        let mut point = self.clone();
        if let Some(value) = *field(&mut point) {
            return Err(FieldError::new(name, value, format!("must be absent if sweep.{name} is given")));
        }
        let mut at = |value: f64| {
            *field(&mut point) = Some(value);
            point.hypothesis()
        };
        // Rules are intervals: if both ends keep them, all values between do.
        for (end, value) in [("from", range.from), ("to", range.to)] {
            at(value).map_err(|error| match error.field == name {
                true => FieldError { field: format!("sweep.{name}.{end}"), ..error },
                false => error,
            })?;
        }
        range.values(name)?.into_iter().map(at).collect()
    }

    /// Rejects fields that do not fit a session of one asset or of several.
    fn fits(&self, several: bool) -> Result<(), FieldError> {
        let sweep = self.sweep.clone().unwrap_or_default();
        if several {
            let of_one = [
                ("holding", self.holding.is_some()),
                ("log_return", self.log_return.is_some()),
                ("simple_return", self.simple_return.is_some()),
                ("sweep.holding", sweep.holding.is_some()),
                ("sweep.log_return", sweep.log_return.is_some()),
                ("sweep.simple_return", sweep.simple_return.is_some()),
            ];
            return none_of(&of_one, OF_ONE);
        }
        let returns = self.report().map(|(field, _)| (field, true));
        let of_several: Vec<_> = [("holdings", self.holdings.is_some())].into_iter().chain(returns).collect();
        none_of(&of_several, OF_SEVERAL)
    }

    /// Returns the hypothetical report of several assets for the coming period, and the field that gives it.
    fn report(&self) -> Option<(&'static str, Report)> {
        let WhatIf { log_returns, simple_returns, prices, previous_prices, .. } = self.clone();
        let field = match (&log_returns, &simple_returns, &prices, &previous_prices) {
            (Some(_), ..) => "log_returns",
            (None, Some(_), ..) => "simple_returns",
            (None, None, Some(_), _) => "prices",
            (None, None, None, Some(_)) => "previous_prices",
            _ => return None,
        };
        Some((field, Report { log_returns, simple_returns, prices, previous_prices, ..Report::default() }))
    }

    fn mode(&self) -> AdviceMode {
        let solves = self.sweep.is_some() || self.explain.is_some();
        if solves { AdviceMode::Resolve } else { AdviceMode::Surrogate }
    }

    /// Renames the field of an error about the hypothetical return to the one that the request used.
    fn renamed(&self, error: FieldError) -> FieldError {
        let sweep = self.sweep.clone().unwrap_or_default();
        let given = match error.field.as_str() {
            "log_return" if sweep.log_return.is_some() => "sweep.log_return",
            "log_return" if sweep.simple_return.is_some() => "sweep.simple_return",
            "log_return" if self.simple_return.is_some() => "simple_return",
            _ => return error,
        };
        FieldError { field: given.into(), ..error }
    }
}

impl Sessions {
    /// Returns the advice under the hypotheses without changing the session. Each point of a sweep waits for its own
    /// permit.
    /// So a long sweep starves nobody, and a disconnected caller stops it.
    ///
    /// # Errors
    /// A field breaks a rule, there is no such session, it has reached its horizon, or too much work waits already.
    pub async fn what_if(&self, tenant: &Tenant, request: WhatIf) -> Result<Large<WhatIfAnswer>, ServiceError> {
        let hypotheses = request.hypotheses()?;
        let live = self.get(tenant, &request.session).await?;
        live.check_active()?;
        let account = live.standing.account()?;
        let explained = explain::atoms(request.explain, hypotheses.len(), account.state.law.sample_size())?;
        let assets = account.assets.as_ref().map_or(1, |assets| assets.names.len());
        let room = self.memory.answers(explained * assets * ATOM_BYTES).await?;
        let several = account.assets.is_some();
        request.fits(several)?;
        if several {
            let mut points = self.suppose_of_assets(tenant, &request, &live, hypotheses).await?;
            let session = request.session;
            let value = match (request.sweep, points.pop()) {
                (None, Some(point)) => WhatIfAnswer::OneOfAssets { session, point: Box::new(point) },
                (_, last) => WhatIfAnswer::SweepOfAssets { session, points: points.into_iter().chain(last).collect() },
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
        let value = match (request.sweep, points.pop()) {
            (None, Some(point)) => WhatIfAnswer::One { session, point: Box::new(point) },
            (_, last) => WhatIfAnswer::Sweep { session, points: points.into_iter().chain(last).collect() },
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
