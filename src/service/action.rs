//! The advice of a session for its coming period.

use super::allowance::HeavyTurn;
use super::error::ServiceError;
use super::live;
use super::periods::Periods;
use super::sessions::Sessions;
use crate::control::policy::advice::Advice;
use crate::control::policy::advisor::{AdviceMode, Advisor};
use crate::control::policy::sensitivity::Sensitivity;
use crate::control::policy::worst_case::WorstCase;
use crate::store::Tenant;

/// What [`Sessions::action`] found.
pub struct Action {
    pub period: usize,
    pub advice: Advice,
    pub worst_case: Option<WorstCase>,
    pub sensitivity: Option<Sensitivity>,
}

/// How an action is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Question {
    pub mode: AdviceMode,
    /// Re-solve, and show the worst-case law.
    pub explain: bool,
    /// Say how near the advice is to changing.
    pub sensitivity: bool,
}

impl Sessions {
    /// The robust allocation for the coming period.
    ///
    /// # Errors
    /// There is no such session, it has reached its horizon, or it must be solved and too much is under way.
    pub async fn action(
        &self,
        tenant: &Tenant,
        session: &str,
        question: Question,
        turn: &HeavyTurn,
    ) -> Result<Action, ServiceError> {
        let mut held = self.hold(tenant, session).await;
        let live = held.current(&self.rows(tenant, session)).await?;
        live.goes_on()?;
        let period = live.observed + 1;
        let Question { mode, explain, sensitivity } = question;
        let surrogate = mode == AdviceMode::Surrogate && !explain;
        if let Some(advice) = live.advice.clone().filter(|_| surrogate && !sensitivity) {
            return Ok(Action { period, advice, worst_case: None, sensitivity: None });
        }
        let means = self.means(tenant, live, turn).await?;
        if surrogate && !sensitivity {
            let advice = live.surrogate_advice(&means).await?.clone();
            return Ok(Action { period, advice, worst_case: None, sensitivity: None });
        }
        let advisor = means.advisor;
        let (state, step) = (live.standing.state.clone(), live.observed);
        drop(held);
        let record = if sensitivity { Some(self.record(tenant, session, step, &advisor).await?) } else { None };
        turn.begin()?;
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
            Action { period, advice, worst_case, sensitivity }
        });
        solving.await
    }

    /// The returns that a session has seen by the period after `step`, in their order.
    ///
    /// # Errors
    /// There is no such session; its sensitivity would take too long.
    async fn record(
        &self,
        tenant: &Tenant,
        session: &str,
        step: usize,
        advisor: &Advisor,
    ) -> Result<Vec<f64>, ServiceError> {
        let facts = self.facts(tenant, session).await?;
        advisor.check_sensitivity(facts.row.initial_history.len() + step)?;
        let start = live::started(&facts.row, advisor)?;
        let mut record = facts.row.initial_history;
        Periods::of(&facts.entries)?.replay(advisor, start, |period, _, passed| {
            record.extend(passed.log_return.filter(|_| period <= step));
        })?;
        Ok(record)
    }
}
