//! The sequence of policies of a session, and its automatic renewal.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::error::FieldError;
use crate::control::policy::advice::Uncertainty;
use crate::control::policy::advisor::Advisor;
use crate::control::policy_document::PreparedPolicy;
use crate::control::problem::dynamics::Dynamics;
use crate::control::request::by_name::distinct;
use crate::control::request::contributions::Contributions;
use crate::control::request::declared::DeclaredProblem;
use crate::control::request::means::MeansRule;
use crate::control::request::rules;
use crate::control::request::specification::Specification;
use crate::control::request::terms::Terms;
use crate::service::error::ServiceError;
use crate::service::sessions::assets::{Composition, PlannedAssets};
use crate::service::sessions::content::{json, read};
use crate::store::SessionRow;

/// The most renewals of a session and periods that it may observe: a replay goes through all of them.
pub const MOST_RENEWALS: usize = 1_000;
pub const MOST_PERIODS: usize = 5_200;

/// How a session renews itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Renewing {
    /// Periods with one policy until the next is trained; fewer than its horizon.
    #[schema(minimum = 1, example = 12)]
    pub every: usize,
    /// Number of last returns that the next policy is trained on. Default: all observed returns.
    #[serde(default)]
    #[schema(example = 240)]
    pub window: Option<usize>,
}

/// The settings that are fixed when a session is opened, besides its initial state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SessionPlan {
    pub(in crate::service) terms: Terms,
    pub(in crate::service) renew: Option<Renewing>,
    /// True if every period is advised by the first step of the policy.
    pub(in crate::service) rolling: bool,
    /// The declared problem, if the session lives one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(in crate::service) problem: Option<Box<PlannedProblem>>,
    /// Several assets, in the order of the record, with their figures at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(in crate::service) assets: Option<PlannedAssets>,
}

/// The declared problem of a session, so that a replay does not need its policy, and its state at the start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlannedProblem {
    /// Its history is that of the session, which is stored apart, so that lists need not read it.
    pub(in crate::service) problem: DeclaredProblem,
    pub(in crate::service) state: BTreeMap<String, f64>,
}

/// The policy of a session from some period on.
#[derive(Debug, Clone, PartialEq)]
pub struct PolicyTenure {
    pub policy: String,
    /// Periods observed before it.
    pub after: usize,
    pub(in crate::service) terms: Terms,
    /// Number of last returns that its law was made of.
    pub(in crate::service) window: Option<usize>,
    /// True if its first step advises every period.
    rolling: bool,
}

/// A request to continue a session with another policy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Renew {
    /// Number of the renewal, from 1.
    #[schema(example = 1)]
    pub renewal: usize,
    /// The next policy.
    pub policy: String,
    /// Number of last returns that the law is made of. Default: all observed returns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 240)]
    pub window: Option<usize>,
    /// Log-returns of each asset that enters the session, by name, oldest first. The last one is that of the last
    /// observed period, and null stands for a period without one. The law keeps the periods with a return of every
    /// asset.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "distinct")]
    #[schema(example = json!({}))]
    pub records: BTreeMap<String, Vec<Option<f64>>>,
    /// Names of the assets that leave the session. What is held of them is sold before the coming period.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(example = json!([]))]
    pub leaving: Vec<String>,
}

/// The session after a renewal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Renewed {
    pub session: String,
    pub renewal: usize,
    pub policy: String,
    /// The coming period, the first that the policy advises.
    pub period: usize,
    /// The last period that the policy advises.
    pub horizon: usize,
    /// Rate, cost and flows of its periods, unless a report gives others.
    pub terms: Terms,
    /// Names of the assets from here on, in the order of the policy, if they changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub names: Option<Vec<String>>,
    /// Figures of several assets before the coming period.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assets: Option<Composition>,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// The session of a declared problem after a renewal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DeclaredRenewed {
    pub session: String,
    pub renewal: usize,
    pub policy: String,
    /// The coming period, the first that the policy advises.
    pub period: usize,
    /// The last period that the policy advises.
    pub horizon: usize,
    /// The problem from here on as it was declared, but without its history.
    #[schema(value_type = Object)]
    pub problem: DeclaredProblem,
    /// In the unit of the noise.
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

/// The session after a renewal: an investor's, or one of a declared problem.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum RenewalAnswer {
    Account(Box<Renewed>),
    Declared(Box<DeclaredRenewed>),
}

impl Renewing {
    /// Returns the number of periods after which the session is due for renewal; `None` if it may not continue any
    /// longer.
    pub(in crate::service) fn due(self, renewals: usize, current: &PolicyTenure) -> Option<usize> {
        let due = current.after + self.every;
        let ends = current.terms.ends && due >= current.horizon();
        (!ends && renewals < MOST_RENEWALS && due + current.terms.horizon <= MOST_PERIODS).then_some(due)
    }

    /// Checks the setting against the terms of the policy.
    ///
    /// # Errors
    /// A field breaks a rule, or sessions with the policy of these terms cannot renew themselves.
    pub(in crate::service) fn check(self, terms: &Terms) -> Result<(), FieldError> {
        let Renewing { every, window } = self;
        if !(1..terms.horizon).contains(&every) {
            let rule = format!("must be at least 1 and less than the policy's horizon of {} periods", terms.horizon);
            return Err(FieldError::new("renew.every", every, rule));
        }
        check_window("renew.window", window)?;
        if let Contributions::Listed(amounts) = &terms.contributions {
            let rule = "must be absent if the policy's contributions are a list, which ends with the policy";
            return Err(FieldError::new("renew", format!("{} contributions", amounts.len()), rule));
        }
        Ok(())
    }
}

/// Returns the terms of a declared problem, which has no bank.
pub(in crate::service) fn terms_of(problem: &DeclaredProblem) -> Terms {
    Terms {
        horizon: problem.horizon,
        learning: problem.learning,
        rate_per_step: 0.0,
        trading_cost: 0.0,
        contributions: Contributions::default(),
        ends: false,
        periods_per_year: None,
        means: MeansRule::default(),
    }
}

pub(in crate::service) fn check_window(field: &str, window: Option<usize>) -> Result<(), FieldError> {
    let Some(window) = window.filter(|window| !rules::HISTORY_LENGTH.contains(window)) else { return Ok(()) };
    let (least, most) = (rules::HISTORY_LENGTH.start(), rules::HISTORY_LENGTH.end());
    Err(FieldError::new(field, window, format!("must lie in [{least}, {most}]")))
}

impl SessionPlan {
    /// Returns the plan of a session that runs through the horizon of a policy and ends.
    pub fn once(specification: &Specification) -> Self {
        SessionPlan { terms: Terms::of(specification), renew: None, rolling: false, assets: None, problem: None }
    }

    /// Returns the plan of a session that starts a policy from `returns` returns.
    ///
    /// # Errors
    /// Sessions with this policy cannot renew themselves as `renew` says, or cannot roll.
    pub fn new(advisor: &Advisor, returns: usize, renew: Option<Renewing>, rolling: bool) -> Result<Self, FieldError> {
        let specification = advisor.specification();
        renew.map_or(Ok(()), |renew| renew.check(&Terms::of(specification)))?;
        if renew.is_some() && specification.problem.centre.has_column() {
            let rule = "must be absent if the policy's centre has a column: the next policy needs a figure for each new return";
            return Err(FieldError::new("renew", "an object", rule));
        }
        if rolling && renew.is_some() {
            let rule = "must be false if renew is given: a rolling session continues without renewals";
            return Err(FieldError::new("rolling", rolling, rule));
        }
        let plan = SessionPlan { renew, rolling, ..SessionPlan::once(specification) };
        let terms = plan.terms(advisor, returns, 0).map_err(|rule| FieldError::new("rolling", rolling, rule))?;
        Ok(SessionPlan { terms, ..plan })
    }

    /// Returns the plan of a session that lives a declared problem.
    ///
    /// # Errors
    /// Sessions with this policy cannot renew themselves as `renew` says.
    pub(in crate::service) fn of_declared(
        planned: PlannedProblem,
        renew: Option<Renewing>,
    ) -> Result<Self, FieldError> {
        let terms = terms_of(&planned.problem);
        renew.map_or(Ok(()), |renew| renew.check(&terms))?;
        Ok(SessionPlan { terms, renew, rolling: false, assets: None, problem: Some(planned.into()) })
    }

    /// Returns the terms of the periods after `observed` ones, with a policy that starts from `returns` returns. They
    /// cover its horizon, or all remaining periods if the session rolls.
    ///
    /// # Errors
    /// The rule that such a policy breaks.
    pub(in crate::service) fn terms(
        &self,
        advisor: &Advisor,
        returns: usize,
        observed: usize,
    ) -> Result<Terms, String> {
        let (terms, left) = (Terms::of(advisor.specification()), MOST_PERIODS.saturating_sub(observed));
        let horizon = if self.rolling { left } else { terms.horizon };
        if horizon > left || left == 0 {
            return Err(format!(
                "must end within {MOST_PERIODS} periods of the session: open a new session with the present history"
            ));
        }
        if self.rolling {
            advisor.check_rolling(returns)?;
        }
        Ok(Terms { horizon, ..terms })
    }

    /// Returns the entry for the policy after `observed` periods.
    pub(in crate::service) fn stretch(
        &self,
        policy: String,
        after: usize,
        terms: Terms,
        window: Option<usize>,
    ) -> PolicyTenure {
        PolicyTenure { policy, after, terms, window, rolling: self.rolling }
    }

    /// Returns the plan as it is stored.
    ///
    /// # Errors
    /// It cannot be written as JSON, which never happens.
    pub fn json(&self) -> Result<String, ServiceError> {
        json(self)
    }

    /// Returns the names of the assets if there are several; empty for one asset.
    pub(in crate::service) fn names(&self) -> &[String] {
        self.assets.as_ref().map_or(&[][..], |assets| &assets.names)
    }

    /// Reads the plan of a session from its row.
    pub(in crate::service) fn of(row: &SessionRow) -> Result<Self, ServiceError> {
        read(&row.plan_json)
    }
}

impl PolicyTenure {
    /// Returns whether the first step of its policy advises every period.
    pub fn is_rolling(&self) -> bool {
        self.rolling
    }

    /// Returns the last period that its policy advises.
    pub fn horizon(&self) -> usize {
        self.after + self.terms.horizon
    }

    /// Checks that its policy can follow a correction of `period`.
    ///
    /// # Errors
    /// What the policy knows up to that period is its own history, whatever was reported.
    pub(in crate::service) fn follows(&self, period: usize, policy: &PreparedPolicy) -> Result<(), FieldError> {
        let known = match policy {
            _ if period > self.after || self.after == 0 => return Ok(()),
            PreparedPolicy::Investor(advisor) if !advisor.specification().problem.framework.is_frozen() => {
                return Ok(());
            }
            PreparedPolicy::Investor(_) => {
                "the uncertainty set of the static policy is frozen at the returns up to that period. Renew with another policy first"
            }
            PreparedPolicy::Declared(_) => {
                "up to that period the policy knows its own history, which no correction changes"
            }
        };
        let rule = format!("must be later than {}: {known}", self.after);
        Err(FieldError::new("period", period, rule))
    }

    /// Returns the step of its policy for the period after `observed` periods of the session. The last step looks one
    /// period ahead. It also advises periods past the horizon until the next policy is there.
    pub(in crate::service) fn step(&self, observed: usize) -> usize {
        if self.rolling { 0 } else { (observed - self.after).min(self.terms.horizon.saturating_sub(1)) }
    }

    /// Returns whether a session with its policy, after so many renewals, is due to renew itself.
    pub(in crate::service) fn is_due(&self, observed: usize, renew: Option<Renewing>, renewals: usize) -> bool {
        renew.and_then(|renew| renew.due(renewals, self)).is_some_and(|due| observed >= due)
    }

    /// Returns the step that advises after `observed` periods; past every step of the policy if the session ends there.
    pub(in crate::service) fn step_from(&self, observed: usize, renew: Option<Renewing>, renewals: usize) -> usize {
        match observed < self.horizon() || self.rolling || self.is_due(observed, renew, renewals) {
            true => self.step(observed),
            false => self.terms.horizon,
        }
    }

    /// Returns how wealth evolves in that period.
    pub(in crate::service) fn dynamics(&self, observed: usize) -> Dynamics {
        self.terms.period(self.step(observed))
    }
}
