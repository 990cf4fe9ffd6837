//! Advice on several assets without a policy or a session.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::control::assets::advice::AssetsAdvice;
use crate::control::cache::Cache;
use crate::control::error::FieldError;
use crate::control::policy::levels::WhyNothing;
use crate::control::policy::one_period::OnePeriod;
use crate::control::request::annualised::Annualised;
use crate::control::request::assets::AssetsProblem;
use crate::control::request::by_name::distinct_if_given;
use crate::control::request::rules;
use crate::control::request::specification::{Specification, default_seed};
use crate::control::request::warnings::Warning;
use crate::service::error::ServiceError;
use crate::service::sessions::Sessions;
use crate::service::sessions::assets::shares;
use crate::store::Tenant;

/// A request for one-period advice on several assets.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AdviseAssets {
    /// The assets and the investor.
    pub problem: AssetsProblem,
    /// Wealth now. Default: the problem's initial wealth.
    pub wealth: Option<f64>,
    /// Share of wealth in each asset now, before trading, by its name. Default: 0 for each.
    #[serde(default, deserialize_with = "distinct_if_given")]
    pub holdings: Option<BTreeMap<String, f64>>,
    /// Seed of the simulated bridges.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

/// The advice on several assets.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AssetsAdvised {
    #[serde(flatten)]
    pub advice: AssetsAdvice,
    /// Why nothing is held, if nothing is; for the inverse-volatility fund.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why_nothing: Option<WhyNothing>,
    /// Annualised figures of the inverse-volatility fund, if `problem.periods_per_year` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub annualised: Option<Annualised>,
    /// Parts of the request that may be a mistake.
    pub warnings: Vec<Warning>,
}

impl Sessions {
    /// Answers the request.
    ///
    /// # Errors
    /// A field breaks a rule, the radius needs more memory than can be kept, or no permit to solve became free.
    pub async fn advise_assets(&self, tenant: &Tenant, question: AdviseAssets) -> Result<AssetsAdvised, ServiceError> {
        let CheckedAssets { problem, holdings, fund } = question.checked()?;
        let fund = self.policies.one_period(&fund)?;
        let returns = problem.history.len();
        let answer = move || AssetsAdvised::of(&problem, &holdings, &fund);
        Ok(self.resolving.run_on_record(tenant, returns, answer).await??)
    }
}

impl AdviseAssets {
    /// Answers the request in this process for its own user, as [`crate::service::advice::advise::Advise::answer`] does.
    ///
    /// # Errors
    /// A field breaks a rule.
    pub fn answer(self) -> Result<AssetsAdvised, FieldError> {
        let CheckedAssets { problem, holdings, fund } = self.checked()?;
        AssetsAdvised::of(&problem, &holdings, &OnePeriod::new(&fund, Cache::default()))
    }

    fn checked(self) -> Result<CheckedAssets, FieldError> {
        let AdviseAssets { mut problem, wealth, holdings, seed } = self;
        if let Some(wealth) = wealth {
            rules::wealth("wealth", wealth)?;
            problem.initial_wealth = wealth;
        }
        let fund = problem.fund(seed)?;
        let holdings = match holdings {
            Some(holdings) => shares("holdings", &holdings, &problem.assets)?,
            None => vec![0.0; problem.assets.len()],
        };
        Ok(CheckedAssets { problem, holdings, fund })
    }
}

/// A validated request with the problem of its inverse-volatility fund.
struct CheckedAssets {
    problem: AssetsProblem,
    /// One share for each asset.
    holdings: Vec<f64>,
    fund: Specification,
}

impl AssetsAdvised {
    fn of(problem: &AssetsProblem, holdings: &[f64], fund: &OnePeriod) -> Result<Self, FieldError> {
        let (advice, why_nothing) = AssetsAdvice::of(problem, holdings, fund)?;
        let estimated = problem.history.warning(&problem.assets);
        let (annualised, warnings) =
            (fund.problem().annualised(), fund.problem().warnings().into_iter().chain(estimated));
        let warnings = warnings.collect();
        Ok(AssetsAdvised { advice, why_nothing, annualised, warnings })
    }
}
