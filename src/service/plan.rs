//! The policies that a session lives by, one after the other, and how it is to be renewed by itself.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::assets::{Composed, PlannedAssets};
use super::content::{json, read};
use super::error::ServiceError;
use crate::control::error::FieldError;
use crate::control::policy::advice::Uncertainty;
use crate::control::policy::advisor::Advisor;
use crate::control::problem::dynamics::Dynamics;
use crate::control::request::contributions::Contributions;
use crate::control::request::framework::Framework;
use crate::control::request::rules;
use crate::control::request::specification::ProblemSpecification;
use crate::control::request::terms::Terms;
use crate::store::SessionRow;

/// Renewals of a session, and the periods that it may pass by them: a replay passes through all of them.
pub const MOST_RENEWALS: usize = 1_000;
pub const MOST_PERIODS: usize = 5_200;

/// How a session is renewed by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Renewing {
    /// Periods by one policy, until the next is trained; fewer than its horizon.
    #[schema(minimum = 1, example = 12)]
    pub every: usize,
    /// Returns that the next policy is trained on, the last ones. Default: all that were seen.
    #[serde(default)]
    #[schema(example = 240)]
    pub window: Option<usize>,
}

/// What is fixed of a session when it is opened, beside what it starts from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    pub(super) terms: Terms,
    pub(super) renew: Option<Renewing>,
    /// Whether every period is advised by the first step of the policy.
    pub(super) rolling: bool,
    /// Several assets, in the order of the record, as they were told at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) assets: Option<PlannedAssets>,
}

/// The policy that a session lives by, from some period on.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    pub policy: String,
    /// Periods observed before it.
    pub after: usize,
    pub(super) terms: Terms,
    /// Of the last returns, which its law was made of.
    pub(super) window: Option<usize>,
    /// Whether its first step advises every period.
    rolling: bool,
}

/// The policy that a session goes on by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Renew {
    /// Number of the renewal, from 1.
    #[schema(example = 1)]
    pub renewal: usize,
    /// The next policy.
    pub policy: String,
    /// Returns that the law is made of, the last ones. Default: all that were seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 240)]
    pub window: Option<usize>,
}

/// The session after a renewal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Renewed {
    pub session: String,
    pub renewal: usize,
    pub policy: String,
    /// The coming period, the first that the policy advises.
    pub period: usize,
    /// The last period that it advises.
    pub horizon: usize,
    /// Rate, cost and flows of its periods, where none other are reported.
    pub terms: Terms,
    /// Of several assets, before the coming period.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assets: Option<Composed>,
    #[serde(flatten)]
    pub uncertainty: Uncertainty,
}

impl Renewing {
    /// Periods after which a session is due that was renewed so many times; `None` where it may not go on any longer.
    pub(super) fn due(self, renewals: usize, current: &Stretch) -> Option<usize> {
        let due = current.after + self.every;
        (renewals < MOST_RENEWALS && due + current.terms.horizon <= MOST_PERIODS).then_some(due)
    }

    /// # Errors
    /// A field breaks a rule, or sessions by the policy of this problem are not renewed by themselves.
    pub(super) fn check(self, problem: &ProblemSpecification) -> Result<(), FieldError> {
        let Renewing { every, window } = self;
        if !(1..problem.horizon).contains(&every) {
            let rule = format!("must be at least 1 and less than the policy's horizon of {} periods", problem.horizon);
            return Err(FieldError::new("renew.every", every, rule));
        }
        check_window("renew.window", window)?;
        if let Contributions::Listed(amounts) = &problem.contributions {
            let rule = "must be absent for a policy whose contributions are a list, which ends with its horizon";
            return Err(FieldError::new("renew", format!("{} contributions", amounts.len()), rule));
        }
        Ok(())
    }
}

pub(super) fn check_window(field: &str, window: Option<usize>) -> Result<(), FieldError> {
    let Some(window) = window.filter(|window| !rules::HISTORY_LENGTH.contains(window)) else { return Ok(()) };
    let (least, most) = (rules::HISTORY_LENGTH.start(), rules::HISTORY_LENGTH.end());
    Err(FieldError::new(field, window, format!("must lie in [{least}, {most}]")))
}

impl Plan {
    /// Of a session that lives through the horizon of a policy and ends.
    pub fn once(problem: &ProblemSpecification) -> Self {
        Plan { terms: Terms::of(problem), renew: None, rolling: false, assets: None }
    }

    /// Of a session that lives by a policy from `returns` on.
    ///
    /// # Errors
    /// Sessions by this policy are not renewed by themselves as `renew` says, or do not roll.
    pub fn new(advisor: &Advisor, returns: usize, renew: Option<Renewing>, rolling: bool) -> Result<Self, FieldError> {
        let problem = &advisor.specification().problem;
        renew.map_or(Ok(()), |renew| renew.check(problem))?;
        if rolling && renew.is_some() {
            let rule = "must be false where renew is given: a session that rolls goes on without";
            return Err(FieldError::new("rolling", rolling, rule));
        }
        let plan = Plan { renew, rolling, ..Plan::once(problem) };
        let terms = plan.terms(advisor, returns, 0).map_err(|rule| FieldError::new("rolling", rolling, rule))?;
        Ok(Plan { terms, ..plan })
    }

    /// Of the periods after `observed` ones, by a policy that starts from `returns`: those of its horizon, or where the session
    /// rolls as many as are left to it.
    ///
    /// # Errors
    /// The rule that such a policy breaks.
    pub(super) fn terms(&self, advisor: &Advisor, returns: usize, observed: usize) -> Result<Terms, String> {
        let (terms, left) = (Terms::of(&advisor.specification().problem), MOST_PERIODS.saturating_sub(observed));
        let horizon = if self.rolling { left } else { terms.horizon };
        if horizon > left || left == 0 {
            return Err(format!(
                "must end after {MOST_PERIODS} periods of the session at most: open one on the record as it is now"
            ));
        }
        if self.rolling {
            advisor.check_rolling(returns)?;
        }
        Ok(Terms { horizon, ..terms })
    }

    /// By the policy, after `observed` periods.
    pub(super) fn stretch(&self, policy: String, after: usize, terms: Terms, window: Option<usize>) -> Stretch {
        Stretch { policy, after, terms, window, rolling: self.rolling }
    }

    /// As it is stored.
    ///
    /// # Errors
    /// It is no JSON, which it always is.
    pub fn json(&self) -> Result<String, ServiceError> {
        json(self)
    }

    /// Names of the assets where there are several; none of one.
    pub(super) fn names(&self) -> &[String] {
        self.assets.as_ref().map_or(&[][..], |assets| &assets.names)
    }

    /// Of a session as it was opened.
    pub(super) fn of(row: &SessionRow) -> Result<Self, ServiceError> {
        read(&row.plan_json)
    }
}

impl Stretch {
    /// Whether the first step of its policy advises every period.
    pub fn is_rolling(&self) -> bool {
        self.rolling
    }

    /// The last period that its policy advises.
    pub fn horizon(&self) -> usize {
        self.after + self.terms.horizon
    }

    /// Whether its policy, of this framework, follows a correction of `period`.
    ///
    /// # Errors
    /// The set of the policy is frozen at the returns up to that period.
    pub(super) fn follows(&self, period: usize, framework: Framework) -> Result<(), FieldError> {
        if period > self.after || !framework.is_frozen() {
            return Ok(());
        }
        let rule = format!(
            "must be later than {}: the set of the static policy is frozen at the returns up to there; renew onto another first",
            self.after
        );
        Err(FieldError::new("period", period, rule))
    }

    /// The step of its policy that advises the period after `observed` periods of the session. The last step, which looks one
    /// period ahead, also advises those past the horizon, until the next policy is there.
    pub(super) fn step(&self, observed: usize) -> usize {
        if self.rolling { 0 } else { (observed - self.after).min(self.terms.horizon.saturating_sub(1)) }
    }

    /// Whether a session by its policy that was renewed so many times is due to be renewed by itself.
    pub(super) fn is_due(&self, observed: usize, renew: Option<Renewing>, renewals: usize) -> bool {
        renew.and_then(|renew| renew.due(renewals, self)).is_some_and(|due| observed >= due)
    }

    /// The step that advises after `observed` periods; past every step of the policy if the session ends there.
    pub(super) fn step_from(&self, observed: usize, renew: Option<Renewing>, renewals: usize) -> usize {
        match observed < self.horizon() || self.rolling || self.is_due(observed, renew, renewals) {
            true => self.step(observed),
            false => self.terms.horizon,
        }
    }

    /// What becomes of money in that period.
    pub(super) fn dynamics(&self, observed: usize) -> Dynamics {
        self.terms.period(self.step(observed))
    }
}
