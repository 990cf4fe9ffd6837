//! Advice without a policy or a session: what to hold through one period, from a record of returns. Nothing is stored.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::error::ServiceError;
use super::sessions::Sessions;
use crate::control::error::FieldError;
use crate::control::kept::Kept;
use crate::control::policy::advice::Advice;
use crate::control::policy::one_period::OnePeriod;
use crate::control::policy::worst_case::WorstCase;
use crate::control::request::annualised::Annualised;
use crate::control::request::rules;
use crate::control::request::specification::{ProblemSpecification, Specification, default_seed};
use crate::control::request::warnings::Warning;
use crate::store::Tenant;

/// A question for one period.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Advise {
    /// As in a training, for a horizon of 1, which may be left out.
    pub problem: ProblemSpecification,
    /// Wealth now. Default: the problem's initial wealth.
    pub wealth: Option<f64>,
    /// Share of wealth in the risky asset now, before trading. Default: 0.
    pub holding: Option<f64>,
    /// Of the simulated bridges.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

/// The advice, and the law that is worst for it.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Advised {
    #[serde(flatten)]
    pub advice: Advice,
    pub worst_case: WorstCase,
    /// Where `problem.periods_per_year` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub annualised: Option<Annualised>,
    /// What in the question may be a mistake.
    pub warnings: Vec<Warning>,
}

impl Advise {
    /// The answer, found in this process for its own user: no store, no turns, and the memory that it takes.
    /// Checked by: `tests/advise_file.rs`.
    ///
    /// # Errors
    /// A field breaks a rule.
    pub fn answer(self) -> Result<Advised, FieldError> {
        let (holding, specification) = self.checked()?;
        let (advice, worst_case) = OnePeriod::new(&specification, Kept::default()).advise(holding)?;
        Ok(Advised { advice, worst_case })
    }

    /// The holding, and the training request of one step.
    fn checked(self) -> Result<(f64, Specification), FieldError> {
        let holding = self.holding.unwrap_or(0.0);
        rules::share("holding", holding)?;
        Ok((holding, self.specification()?))
    }

    /// The training request of which it asks the one step.
    fn specification(mut self) -> Result<Specification, FieldError> {
        if self.problem.horizon != 1 {
            let rule = "must be 1 or left out: one period is advised; train a policy for more";
            return Err(FieldError::new("problem.horizon", self.problem.horizon, rule));
        }
        if let Some(wealth) = self.wealth {
            rules::wealth("wealth", wealth)?;
            self.problem.initial_wealth = wealth;
        }
        Specification::of(self.problem, self.seed).completed()
    }
}

impl Sessions {
    /// # Errors
    /// A field breaks a rule; the radius asks for more memory than can be kept; no turn to solve.
    pub async fn advise(&self, tenant: &Tenant, question: Advise) -> Result<Advised, ServiceError> {
        let (holding, specification) = question.checked()?;
        let investor = self.policies.one_period(&specification)?;
        let (advice, worst_case) = self.resolving.run(tenant, move || investor.advise(holding)).await??;
        let problem = &specification.problem;
        Ok(Advised { advice, worst_case, annualised: problem.annualised(), warnings: problem.warnings() })
    }
}
