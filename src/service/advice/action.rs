//! The advice of a session for its coming period.

use std::collections::BTreeMap;

use crate::control::error::FieldError;
use crate::control::policy::advice::Advice;
use crate::control::policy::advisor::{AdviceMode, Advisor};
use crate::control::policy::declared::Decided;
use crate::control::policy::sensitivity::Sensitivity;
use crate::control::policy::worst_case::WorstCase;
use crate::control::policy_document::PreparedPolicy;
use crate::control::problem::state::State;
use crate::service::advice::explain::ATOM_BYTES;
use crate::service::callers::allowance::HeavyPermit;
use crate::service::entries::periods::{Periods, Replay};
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::service::sessions::assets::Assets;
use crate::service::sessions::current_advice::CurrentAdvice;
use crate::service::sessions::live::LiveSession;
use crate::service::sessions::session_state::SessionState;
use crate::store::Tenant;

/// The advice for the coming period, as [`Sessions::action`] returns it.
pub struct PeriodAdvice {
    pub period: usize,
    pub kind: AdviceKind,
    /// The last period that the policy was trained for, if the session waits for its next policy.
    pub waiting: Option<usize>,
}

/// The advice of a problem.
pub enum AdviceKind {
    Account(Box<AccountAdvice>),
    /// With the states before the period.
    Declared(Box<Decided>, BTreeMap<String, f64>),
}

/// The advice of an investor.
pub struct AccountAdvice {
    /// For several assets, the advice of their fund.
    pub advice: Advice,
    /// Present if there are several assets.
    pub assets: Option<Box<Assets>>,
    pub worst_case: Option<WorstCase>,
    pub sensitivity: Option<Sensitivity>,
}

impl PeriodAdvice {
    /// Returns the current advice of a session for its coming period.
    fn current(live: &LiveSession, advice: &CurrentAdvice) -> Result<Self, ServiceError> {
        let kind = match (advice, &live.standing) {
            (CurrentAdvice::Account(advice), SessionState::Account(account)) => {
                let (advice, assets) = (advice.clone(), account.assets.clone());
                AdviceKind::Account(AccountAdvice { advice, assets, worst_case: None, sensitivity: None }.into())
            }
            (CurrentAdvice::Declared(decided), SessionState::Declared(state)) => {
                AdviceKind::Declared(decided.clone().into(), state.named())
            }
            _ => return Err(ServiceError::internal("the advice of another problem than the session")),
        };
        Ok(PeriodAdvice { period: live.observed + 1, kind, waiting: live.is_due().then(|| live.horizon()) })
    }
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
        let is_current = mode == AdviceMode::Surrogate && !explain && !sensitivity;
        if let (true, 0, Some(advice)) = (is_current, live.standing.law_shown(), &live.advice) {
            return Ok(Large::from(PeriodAdvice::current(live, advice)?));
        }
        let means = self.means(tenant, live, turn).await?;
        let advisor = match &means.policy {
            PreparedPolicy::Investor(advisor) if !is_current => advisor.clone(),
            PreparedPolicy::Declared(_) if sensitivity => {
                let rule = "must be left out: the sensitivity is not computed for declared problems";
                return Err(FieldError::new("sensitivity", true, rule).into());
            }
            // Of a declared problem every advice is solved, and shows its worst law.
            _ => {
                let room = self.memory.answers(live.standing.law_shown() * ATOM_BYTES).await?;
                let advice = live.current_advice(&means).await?.clone();
                return Ok(Large { value: PeriodAdvice::current(live, &advice)?, room });
            }
        };
        let (step, account) = (live.step(), live.standing.account()?);
        let (mut state, assets) = (account.state.clone(), account.assets.clone());
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
            AccountAdvice { advice, assets, worst_case, sensitivity }
        });
        let kind = AdviceKind::Account(solving.await?.into());
        Ok(Large { value: PeriodAdvice { period, kind, waiting }, room })
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
        let account = live.standing.account()?;
        if account.assets.is_some() {
            let rule = "must be left out: the sensitivity is not computed for several assets";
            return Err(FieldError::new("sensitivity", true, rule).into());
        }
        let Large { value: mut facts, room: _room } = self.facts(tenant, &live.row.session).await?;
        // Entries that another process has recorded since belong to the next request.
        facts.entries.truncate(live.seen.entries());
        advisor.check_sensitivity(account.state.law.sample_size())?;
        let periods = Periods::of(&facts)?;
        let Replay { standing, record, .. } = periods.replay()?;
        // The law holds only the last returns.
        let state = standing.account()?.state.clone();
        let older = record.all().len() - state.law.sample_size();
        Ok((state, record.all()[older..].to_vec()))
    }
}
