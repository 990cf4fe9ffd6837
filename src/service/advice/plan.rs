//! Plans: what to spend and to hold until a horizon. Nothing is stored.

use serde::Deserialize;
use utoipa::ToSchema;

use crate::control::cache::Cache;
use crate::control::error::{FieldError, TrainError};
use crate::control::evaluation::plan::Plan;
use crate::control::evaluation::plan::report::PlanReport;
use crate::control::problem::goal::NODES;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::plan::PlanQuestion;
use crate::control::request::specification::Specification;
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::store::Tenant;

/// Bytes of a return of the record while a plan is solved and shown: a return of each period's worst law.
const RETURN_BYTES: usize = 60;
/// Bytes of a period of a path: the return that was drawn.
const PATH_PERIOD_BYTES: usize = 4;

/// A question about one asset, or about several, which `problem.assets` names.
#[derive(Debug, Clone, Deserialize, ToSchema)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant)]
pub enum PlanAsked {
    /// One asset.
    Asset(PlanQuestion),
    /// Several.
    Assets(PlanQuestion<AssetsProblem>),
}

impl PlanAsked {
    /// Answers it in this process for its own user, with no store, no queue and no memory budget.
    ///
    /// # Errors
    /// A field breaks a rule, or a step has no finite solution.
    pub fn answer(self) -> Result<PlanReport, TrainError> {
        self.solved(&Cache::default())
    }

    fn solved(self, kept: &Cache) -> Result<PlanReport, TrainError> {
        let plan = match self {
            PlanAsked::Asset(question) => Plan::new(question, kept),
            PlanAsked::Assets(question) => Plan::of_assets(&question, kept),
        };
        Ok(plan?.report())
    }

    /// Returns the numbers of periods, paths and returns of all states of a period, with the specification whose radius is
    /// widest.
    fn sizes(&self) -> Result<([usize; 3], Specification), FieldError> {
        let (specification, paths, returns, is_aimed) = match self {
            PlanAsked::Asset(question) => {
                let returns = question.problem.history.len();
                (question.specification()?, question.paths, returns, question.is_aimed())
            }
            PlanAsked::Assets(question) => {
                question.problem.check()?;
                let specification = question.about(question.problem.of_fund()).specification()?;
                (specification, question.paths, question.problem.history.len(), question.is_aimed())
            }
        };
        let states = if is_aimed { NODES } else { 1 };
        Ok(([specification.problem.horizon, paths, states * returns], specification))
    }
}

impl Sessions {
    /// Answers a question.
    ///
    /// # Errors
    /// A field breaks a rule, a step has no finite solution, there is no room, or no permit to solve became free.
    pub async fn plan(&self, tenant: &Tenant, question: PlanAsked) -> Result<Large<PlanReport>, ServiceError> {
        let ([horizon, paths, returns], specification) = question.sizes()?;
        let kept = self.policies.kept_for(&specification)?;
        let room = self.memory.answers(horizon * returns * RETURN_BYTES + paths * horizon * PATH_PERIOD_BYTES).await?;
        let solve = move || question.solved(&kept);
        let value = self.resolving.run_on_record(tenant, horizon * returns, solve).await?.map_err(ended)?;
        Ok(Large { value, room })
    }
}

fn ended(error: TrainError) -> ServiceError {
    match error {
        TrainError::Specification(error) => ServiceError::Field(error),
        TrainError::NotFinite { .. } => {
            let rule = "must have a finite solution in every period: let `support` bound the returns";
            ServiceError::Field(FieldError::new("problem", "an object", rule))
        }
        error => ServiceError::internal(error),
    }
}
