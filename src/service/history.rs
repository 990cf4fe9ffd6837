//! What a session was told, and what it would be told now.

use std::collections::BTreeMap;

use serde::Serialize;
use utoipa::ToSchema;

use super::allowance::HeavyTurn;
use super::answer::{Corrected, Observed};
use super::assets::Composed;
use super::content::read;
use super::error::ServiceError;
use super::known::KnownReturns;
use super::periods::{Passage, Periods, Step};
use super::plan::{Plan, Renew, Renewed};
use super::report::{Correct, Report};
use super::sessions::Sessions;
use crate::control::assets::advice::named;
use crate::control::policy::advisor::AdviceMode;
use crate::control::request::terms::Terms;
use crate::store::{EntryKind, SessionRow, Tenant};

/// Where a session started, and everything recorded of it.
#[derive(Debug, Serialize, ToSchema)]
pub struct History {
    pub session: String,
    /// The first policy.
    pub policy: String,
    /// Rate, cost and flows of its periods, where none other are reported.
    pub terms: Terms,
    pub initial_wealth: f64,
    /// Share of it in the risky asset.
    pub initial_holding: f64,
    /// Radius of the uncertainty set before the first period, in the unit of an advice's.
    pub initial_radius: f64,
    /// Names of the assets, where there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assets: Option<Vec<String>>,
    /// What was told of them at the start.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub composed: Option<Composed>,
    /// Log-returns known at the start.
    pub history: KnownReturns,
    pub observations: Vec<Observation>,
    pub corrections: Vec<Correction>,
    /// The policies that followed the first.
    pub renewals: Vec<Renewal>,
}

/// One observed period.
#[derive(Debug, Serialize, ToSchema)]
pub struct Observation {
    /// What was answered when it was reported.
    #[serde(flatten)]
    pub told: Observed,
    /// What was reported first.
    pub reported: Report,
    pub observed_ms: i64,
    /// What would be told now; from the first period on that was put right.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub now: Option<Now>,
}

/// A period with all corrections made.
#[derive(Debug, Serialize, ToSchema)]
pub struct Now {
    /// What is reported of it now, where it was put right.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reported: Option<Report>,
    /// Null where it is missing.
    pub log_return: Option<f64>,
    /// Of several assets, by their names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assets: Option<AssetsNow>,
    /// What would have been advised for it.
    pub advised_allocation: f64,
    pub executed_allocation: f64,
    /// Wealth at its end.
    pub wealth: f64,
    /// Share of it in the risky asset.
    pub holding: f64,
    /// Radius of the uncertainty set after it, in the unit of an advice's.
    pub radius: f64,
}

/// What stands of a period of several assets with all corrections made.
#[derive(Debug, Serialize, ToSchema)]
pub struct AssetsNow {
    /// By the names of the assets; null where they are missing.
    pub log_returns: Option<BTreeMap<String, f64>>,
}

/// One correction, as it was made.
#[derive(Debug, Serialize, ToSchema)]
pub struct Correction {
    #[serde(flatten)]
    pub correction: Correct,
    /// What was answered to it.
    pub told: Corrected,
    pub corrected_ms: i64,
}

/// One renewal, as it was made.
#[derive(Debug, Serialize, ToSchema)]
pub struct Renewal {
    /// What was answered to it.
    #[serde(flatten)]
    pub told: Renewed,
    /// Returns that the law was made of, the last ones; null where those were all.
    pub window: Option<usize>,
    pub renewed_ms: i64,
}

impl Sessions {
    /// The session's start and every entry. Where a period was put right, those from it on are passed through and advised
    /// again, each in a turn of those that solve.
    ///
    /// # Errors
    /// There is no such session; too much is solved already.
    pub async fn history(&self, tenant: &Tenant, session: &str, turn: &HeavyTurn) -> Result<History, ServiceError> {
        let facts = self.facts(tenant, session).await?;
        let (mut observations, mut corrections, mut renewals) = (Vec::new(), Vec::new(), Vec::new());
        for entry in &facts.entries {
            match entry.kind {
                EntryKind::Observation => observations.push(Observation {
                    told: read(&entry.answer_json)?,
                    reported: read(&entry.content_json)?,
                    observed_ms: entry.created_ms,
                    now: None,
                }),
                EntryKind::Correction => corrections.push(Correction {
                    correction: read(&entry.content_json)?,
                    told: read(&entry.answer_json)?,
                    corrected_ms: entry.created_ms,
                }),
                EntryKind::Renewal => renewals.push(Renewal {
                    told: read(&entry.answer_json)?,
                    window: read::<Renew>(&entry.content_json)?.window,
                    renewed_ms: entry.created_ms,
                }),
            }
        }
        let periods = Periods::of(&facts)?;
        if !corrections.is_empty() {
            turn.begin().await?;
            let first = periods.first_corrected();
            let now = self.told_now(tenant, &periods, first).await?;
            for (observation, now) in observations.iter_mut().skip(first).zip(now) {
                observation.now = Some(now);
            }
        }
        let Plan { terms, assets, .. } = Plan::of(&facts.row)?;
        let (first, start) =
            (self.policies.advisor(tenant, &facts.row.policy).await?, periods.at_start(terms.learning));
        let measured = tokio::task::spawn_blocking(move || first.radius(&start)).await;
        let (assets, composed) = assets.map(|planned| (planned.names, planned.composed)).unzip();
        let SessionRow { session, policy, initial_wealth, initial_holding, initial_history: history, .. } = facts.row;
        Ok(History {
            session,
            policy,
            terms,
            initial_wealth,
            initial_holding,
            initial_radius: measured.map_err(ServiceError::internal)?,
            history: KnownReturns::of(history, assets.as_ref().map(Vec::len)),
            assets,
            composed,
            observations,
            corrections,
            renewals,
        })
    }

    /// Of each period from `first` on, the first that was put right. Each waits its turn to be advised by itself, so that a long session
    /// starves nobody, and a caller who goes away stops it.
    async fn told_now(&self, tenant: &Tenant, periods: &Periods, first: usize) -> Result<Vec<Now>, ServiceError> {
        let (mut passage, mut told): (Passage<'_>, Vec<Now>) = (periods.passage()?, Vec::new());
        for (step, period) in periods.all.iter().enumerate() {
            let stretch = passage.stretch();
            let passed = passage.next().map_err(ServiceError::of_recorded)?;
            let Some(Step { before, seen, log_return, executed_allocation }) = passed else { break };
            if step >= first {
                let assets = before
                    .assets
                    .as_ref()
                    .map(|assets| AssetsNow { log_returns: seen.row().map(|row| named(&assets.names, row)) });
                let (advising, local) = (self.policies.advisor(tenant, &stretch.policy).await?, stretch.step(step));
                let before = before.with_law(stretch.terms.learning).state;
                let advise = move || advising.advise(local, &before, AdviceMode::Surrogate);
                let advice = self.resolving.run(tenant, advise).await?;
                // The radius after a period is the one that the next advice is within.
                told.last_mut().into_iter().for_each(|before| before.radius = advice.radius);
                let then = &passage.standing.state;
                told.push(Now {
                    reported: period.is_corrected.then(|| period.report.clone()),
                    log_return,
                    assets,
                    advised_allocation: advice.allocation,
                    executed_allocation,
                    wealth: then.wealth,
                    holding: then.holding,
                    radius: f64::NAN,
                });
            }
        }
        let (measuring, policy) = (passage.stands().state, &periods.current().policy);
        let advisor = self.policies.advisor(tenant, policy).await?;
        let radius = self.resolving.run(tenant, move || advisor.radius(&measuring)).await?;
        told.last_mut().into_iter().for_each(|last| last.radius = radius);
        Ok(told)
    }
}
