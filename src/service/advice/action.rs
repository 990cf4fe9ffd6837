//! The advice of a session for its coming period.

use crate::control::error::FieldError;
use crate::control::policy::advice::Advice;
use crate::control::policy::advisor::{AdviceMode, Advisor};
use crate::control::policy::sensitivity::Sensitivity;
use crate::control::policy::worst_case::WorstCase;
use crate::control::problem::state::State;
use crate::service::advice::explain::ATOM_BYTES;
use crate::service::callers::allowance::HeavyPermit;
use crate::service::entries::periods::{Periods, Replay};
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::service::sessions::assets::Assets;
use crate::service::sessions::live::LiveSession;
use crate::store::Tenant;

/// The advice for the coming period, as [`Sessions::action`] returns it.
pub struct PeriodAdvice {
    pub period: usize,
    /// For several assets, the advice of their fund.
    pub advice: Advice,
    /// Present if there are several assets.
    pub assets: Option<Box<Assets>>,
    pub worst_case: Option<WorstCase>,
    pub sensitivity: Option<Sensitivity>,
    /// The last period that the policy was trained for, if the session waits for its next policy.
    pub waiting: Option<usize>,
}

/// Options of a request for advice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AdviceOptions {
    pub mode: AdviceMode,
    /// If true, re-solve and show the worst-case law.
    pub explain: bool,
    /// If true, say how near the advice is to changing.
    pub sensitivity: bool,
}

impl Sessions {
    /// Returns the robust allocation for the coming period.
    ///
    /// # Errors
    /// There is no such session, it has reached its horizon, or it needs a solve and too much work is under way.
    pub async fn action(
        &self,
        tenant: &Tenant,
        session: &str,
        question: AdviceOptions,
        turn: &HeavyPermit,
    ) -> Result<Large<PeriodAdvice>, ServiceError> {
        let mut held = self.hold(tenant, session).await;
        let live = held.current(&self.rows(tenant, session)).await?;
        live.check_active()?;
        let (period, waiting) = (live.observed + 1, live.is_due().then(|| live.horizon()));
        let AdviceOptions { mode, explain, sensitivity } = question;
        let surrogate = mode == AdviceMode::Surrogate && !explain;
        if let Some(advice) = live.advice.clone().filter(|_| surrogate && !sensitivity) {
            let assets = live.standing.assets.clone();
            return Ok(PeriodAdvice { period, advice, assets, worst_case: None, sensitivity: None, waiting }.into());
        }
        let means = self.means(tenant, live, turn).await?;
        if surrogate && !sensitivity {
            let advice = live.surrogate_advice(&means).await?.clone();
            let assets = live.standing.assets.clone();
            return Ok(PeriodAdvice { period, advice, assets, worst_case: None, sensitivity: None, waiting }.into());
        }
        let advisor = means.advisor;
        let (mut state, step, assets) = (live.standing.state.clone(), live.step(), live.standing.assets.clone());
        let mut record = None;
        if sensitivity {
            let (same, seen) = self.record(tenant, live, &advisor).await?;
            (state, record) = (same, Some(seen));
        }
        drop(held);
        turn.begin().await?;
        let shown = if explain { state.law.sample_size() } else { 0 };
        let room = self.memory.answers(shown * ATOM_BYTES).await?;
        let solving = self.resolving.run(tenant, move || {
            let (advice, worst_case) = match explain {
                true => {
                    let (advice, worst_case) = advisor.explain(step, &state);
                    (advice, Some(worst_case))
                }
                false => (advisor.advise(step, &state, mode), None),
            };
            let mode = if explain { AdviceMode::Resolve } else { mode };
            let sensitivity = record.map(|record| advisor.sensitivity(step, &state, &record, (&advice, mode)));
            PeriodAdvice { period, advice, assets, worst_case, sensitivity, waiting }
        });
        Ok(Large { value: solving.await?, room })
    }

    /// Returns the state of a session and its observed returns in order, both as of the entries that `live` has seen.
    ///
    /// # Errors
    /// There is no such session, or its sensitivity would take too long.
    async fn record(
        &self,
        tenant: &Tenant,
        live: &LiveSession,
        advisor: &Advisor,
    ) -> Result<(State, Vec<f64>), ServiceError> {
        if live.standing.assets.is_some() {
            let rule = "must be left out: the sensitivity is not computed for several assets";
            return Err(FieldError::new("sensitivity", true, rule).into());
        }
        let Large { value: mut facts, room: _room } = self.facts(tenant, &live.row.session).await?;
        // Entries that another process has recorded since belong to the next request.
        facts.entries.truncate(live.seen.entries());
        advisor.check_sensitivity(live.standing.state.law.sample_size())?;
        let periods = Periods::of(&facts)?;
        let Replay { standing, record, .. } = periods.replay()?;
        // The law holds only the last returns.
        let older = record.all().len() - standing.state.law.sample_size();
        Ok((standing.state, record.all()[older..].to_vec()))
    }
}
