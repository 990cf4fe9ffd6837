//! The policies that a session lives by, one after the other, and how it is to be renewed by itself.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::content::{json, read};
use super::error::ServiceError;
use crate::control::error::FieldError;
use crate::control::policy::advice::Uncertainty;
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
    /// Of a session by the policy of a completed problem.
    pub fn new(problem: &ProblemSpecification, renew: Option<Renewing>) -> Self {
        Plan { terms: Terms::of(problem), renew }
    }

    /// As it is stored.
    ///
    /// # Errors
    /// It is no JSON, which it always is.
    pub fn json(&self) -> Result<String, ServiceError> {
        json(self)
    }

    /// Of a session as it was opened.
    pub(super) fn of(row: &SessionRow) -> Result<Self, ServiceError> {
        read(&row.plan_json)
    }
}

impl Stretch {
    /// The one that begins after `observed` periods.
    pub(super) fn after(observed: usize, renew: Renew, renewed: Renewed) -> Self {
        Stretch { policy: renew.policy, after: observed, terms: renewed.terms, window: renew.window }
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

    /// What becomes of money in the period after `observed` periods of the session.
    pub(super) fn dynamics(&self, observed: usize) -> Dynamics {
        self.terms.period(observed - self.after)
    }
}
