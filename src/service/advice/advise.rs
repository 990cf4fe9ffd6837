//! Advice without a policy or a session: what to hold through one period, from a record of returns. Nothing is stored.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::cache::Cache;
use crate::control::error::FieldError;
use crate::control::policy::advice::Advice;
use crate::control::policy::caution::Caution;
use crate::control::policy::levels::{LevelsAdvised, WhyNothing};
use crate::control::policy::one_period::OnePeriod;
use crate::control::policy::sensitivity::{Sensitivity, cautions};
use crate::control::policy::worst_case::WorstCase;
use crate::control::request::annualised::Annualised;
use crate::control::request::rules;
use crate::control::request::specification::{ProblemSpecification, Specification, default_seed};
use crate::control::request::warnings::Warning;
use crate::service::advice::explain::ATOM_BYTES;
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::store::Tenant;

/// A request for one-period advice.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Advise {
    /// The problem as in a training. Its horizon must be 1 and may be left out.
    pub problem: ProblemSpecification,
    /// Wealth now. Default: the problem's initial wealth.
    pub wealth: Option<f64>,
    /// Share of wealth in the risky asset now, before trading. Default: 0.
    pub holding: Option<f64>,
    /// Seed of the simulated bridges.
    #[serde(default = "default_seed")]
    pub seed: u64,
    /// If true, say how near the advice is to changing.
    #[serde(default)]
    pub sensitivity: bool,
}

/// The advice, and the law that is worst for it.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Advised {
    #[serde(flatten)]
    pub advice: Advice,
    pub worst_case: WorstCase,
    /// Points to know before following the advice.
    pub caution: Vec<Caution>,
    /// The levels of caution, if one of them is followed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub levels: Option<LevelsAdvised>,
    /// Why nothing is held, if nothing is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why_nothing: Option<WhyNothing>,
    /// How near the advice is to changing, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensitivity: Option<Sensitivity>,
    /// Annualised figures, if `problem.periods_per_year` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub annualised: Option<Annualised>,
    /// Parts of the request that may be a mistake.
    pub warnings: Vec<Warning>,
}

/// A validated request.
struct CheckedAdvise {
    /// The training request whose single step is solved.
    specification: Specification,
    holding: f64,
    asks_sensitivity: bool,
}

impl Advise {
    /// Answers the request in this process for its own user, with no store, no queue and no memory budget.
    /// Checked by: `tests/project/advise_file.rs`.
    ///
    /// # Errors
    /// A field breaks a rule.
    pub fn answer(self) -> Result<Advised, FieldError> {
        let checked = self.checked()?;
        let investor = OnePeriod::new(&checked.specification, Cache::default());
        checked.check_sensitivity(&investor)?;
        checked.answered(&investor.resolved())
    }

    fn checked(mut self) -> Result<CheckedAdvise, FieldError> {
        let holding = self.holding.unwrap_or(0.0);
        rules::share("holding", holding)?;
        if self.problem.horizon != 1 {
            let rule = "must be 1 or left out: this call advises one period. Train a policy for more";
            return Err(FieldError::new("problem.horizon", self.problem.horizon, rule));
        }
        self.problem.check_without_spending("this call advises one period. Ask for a plan, or train a policy")?;
        if let Some(wealth) = self.wealth {
            rules::wealth("wealth", wealth)?;
            self.problem.initial_wealth = wealth;
        }
        let specification = Specification::of(self.problem, self.seed).completed()?;
        Ok(CheckedAdvise { specification, holding, asks_sensitivity: self.sensitivity })
    }
}

impl CheckedAdvise {
    fn check_sensitivity(&self, investor: &OnePeriod) -> Result<(), FieldError> {
        if self.asks_sensitivity { investor.check_sensitivity() } else { Ok(()) }
    }

    fn answered(&self, investor: &OnePeriod) -> Result<Advised, FieldError> {
        let (advice, worst_case) = investor.advise(self.holding)?;
        let sensitivity = self.asks_sensitivity.then(|| investor.sensitivity(self.holding, &advice)).transpose()?;
        let levels = investor.levels(self.holding)?;
        let why_nothing = investor.why_nothing(self.holding, &advice)?;
        let (caution, problem) = (cautions(&advice, sensitivity.as_ref()), &self.specification.problem);
        let (annualised, warnings) = (problem.annualised(), problem.warnings());
        Ok(Advised { advice, worst_case, caution, levels, why_nothing, sensitivity, annualised, warnings })
    }
}

impl Sessions {
    /// Answers the request.
    ///
    /// # Errors
    /// A field breaks a rule, the radius needs more memory than can be kept, or no permit to solve became free.
    pub async fn advise(&self, tenant: &Tenant, question: Advise) -> Result<Large<Advised>, ServiceError> {
        let checked = question.checked()?;
        let investor = self.policies.one_period(&checked.specification)?;
        checked.check_sensitivity(&investor)?;
        let shown = checked.specification.problem.history.len();
        let room = self.memory.answers(shown * ATOM_BYTES).await?;
        Ok(Large {
            value: self
                .resolving
                .run_on_record(tenant, shown, move || checked.answered(&investor.resolved()))
                .await??,
            room,
        })
    }
}
