//! The share of the capital that the record of a strategy supports. Nothing is stored.

use serde::Deserialize;
use utoipa::ToSchema;

use crate::control::cache::Cache;
use crate::control::error::FieldError;
use crate::control::policy::one_period::OnePeriod;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::sleeve::{RecordUnit, SleeveQuestion};
use crate::control::request::specification::Specification;
use crate::control::sleeve::report::SleeveReport;
use crate::service::advice::explain::ATOM_BYTES;
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::store::Tenant;

/// A question about one strategy, or about several, which `problem.assets` names.
#[derive(Debug, Clone, Deserialize, ToSchema)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant)]
pub enum SleeveRequest {
    /// One strategy.
    Strategy(SleeveQuestion),
    /// Several.
    Strategies(SleeveQuestion<AssetsProblem>),
}

/// A validated request.
struct CheckedSleeve {
    /// The step of the strategy, or of the fund of several.
    specification: Specification,
    several: Option<AssetsProblem>,
    unit: RecordUnit,
}

impl SleeveRequest {
    /// Answers the request in this process for its own user, as [`crate::service::advice::advise::Advise::answer`] does.
    /// Checked by: `tests/solver/sleeve.rs`.
    ///
    /// # Errors
    /// A field breaks a rule.
    pub fn answer(self) -> Result<SleeveReport, FieldError> {
        let checked = self.checked()?;
        checked.answered(&OnePeriod::new(&checked.specification, Cache::default()))
    }

    fn checked(self) -> Result<CheckedSleeve, FieldError> {
        match self {
            SleeveRequest::Strategy(question) => {
                Ok(CheckedSleeve { specification: question.specification()?, several: None, unit: question.record_of })
            }
            SleeveRequest::Strategies(question) => {
                let (problem, specification) = question.completed()?;
                Ok(CheckedSleeve { specification, several: Some(problem), unit: question.record_of })
            }
        }
    }
}

impl CheckedSleeve {
    fn answered(&self, investor: &OnePeriod) -> Result<SleeveReport, FieldError> {
        match &self.several {
            None => SleeveReport::of(&investor.resolved(), self.unit),
            Some(problem) => SleeveReport::of_several(problem, investor, self.unit),
        }
    }
}

impl Sessions {
    /// Answers the request.
    ///
    /// # Errors
    /// A field breaks a rule, the radius needs more memory than can be kept, or no permit to solve became free.
    pub async fn sleeve(&self, tenant: &Tenant, request: SleeveRequest) -> Result<Large<SleeveReport>, ServiceError> {
        let checked = request.checked()?;
        let investor = self.policies.one_period(&checked.specification)?;
        let returns = checked.specification.problem.history.len();
        let room = self.memory.answers(returns * ATOM_BYTES).await?;
        let value = self.resolving.run_on_record(tenant, returns, move || checked.answered(&investor)).await??;
        Ok(Large { value, room })
    }
}
