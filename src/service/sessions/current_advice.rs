//! The advice of a live session for its coming period, and the uncertainty set behind it: what its policy says of its
//! state.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::control::error::FieldError;
use crate::control::policy::advice::{Advice, Uncertainty};
use crate::control::policy::advisor::{Advisor, OutsideDesign};
use crate::control::policy::declared::{Decided, DeclaredAdvisor};
use crate::control::policy_document::PreparedPolicy;
use crate::control::problem::state::State;
use crate::service::callers::allowance::HeavyPermit;
use crate::service::callers::fair_queue::FairQueue;
use crate::service::error::ServiceError;
use crate::service::sessions::account_state::AccountState;
use crate::service::sessions::assets::Assets;
use crate::service::sessions::problem_state::ProblemState;
use crate::service::sessions::session_state::SessionState;
use crate::store::Tenant;

/// The resources that a call needs: its policy, the queues for its work, and the permits it must acquire before it
/// solves.
pub(in crate::service) struct AdviceContext<'a> {
    pub policy: PreparedPolicy,
    pub advising: &'a FairQueue,
    pub resolving: &'a FairQueue,
    /// `None` for the service's own work.
    pub turn: Option<&'a HeavyPermit>,
}

impl AdviceContext<'_> {
    /// Acquires the permits for heavy work that comes next.
    async fn begin(&self) -> Result<(), ServiceError> {
        match self.turn {
            Some(turn) => Ok(turn.begin().await?),
            None => Ok(()),
        }
    }
}

/// The advice of a session for its coming period.
#[derive(Debug, Clone)]
pub enum CurrentAdvice {
    /// An investor's, from the surrogate.
    Account(Advice),
    /// A declared problem's.
    Declared(Decided),
}

impl CurrentAdvice {
    /// Returns the actions of a declared problem, by name.
    pub(super) fn actions(self) -> Option<BTreeMap<String, f64>> {
        match self {
            CurrentAdvice::Account(_) => None,
            CurrentAdvice::Declared(decided) => Some(decided.actions),
        }
    }
}

/// The state of a session beside its policy, which is of the same problem.
enum AdvisedState<'a> {
    Account(&'a AccountState, &'a Arc<Advisor>),
    Declared(&'a ProblemState, &'a Arc<DeclaredAdvisor>),
}

impl<'a> AdvisedState<'a> {
    /// # Errors
    /// They are of different problems, which no session is.
    fn of(standing: &'a SessionState, policy: &'a PreparedPolicy) -> Result<Self, ServiceError> {
        match (standing, policy) {
            (SessionState::Account(state), PreparedPolicy::Investor(advisor)) => {
                Ok(AdvisedState::Account(state, advisor))
            }
            (SessionState::Declared(state), PreparedPolicy::Declared(advisor)) => {
                Ok(AdvisedState::Declared(state, advisor))
            }
            _ => Err(ServiceError::internal("a session has the policy of another problem")),
        }
    }
}

impl AdviceContext<'_> {
    /// Returns the advice of a tenant for the period after `step` periods of the policy, at a state whose radius may be
    /// known: of an investor the surrogate's, of a declared problem its robust step. A short computation runs here, a
    /// longer one on a thread that may block. A solve is heavy work.
    ///
    /// # Errors
    /// A state of a declared problem whose step has no solution, or too much is solved already.
    pub(super) async fn advise(
        &self,
        tenant: &Tenant,
        (standing, radius): (&SessionState, Option<f64>),
        step: usize,
    ) -> Result<CurrentAdvice, ServiceError> {
        match AdvisedState::of(standing, &self.policy)? {
            AdvisedState::Account(AccountState { state, .. }, advisor) => {
                match self.predicted(tenant, (state, radius), advisor, step).await? {
                    Ok(advice) => Ok(CurrentAdvice::Account(advice)),
                    Err(outside) => {
                        self.begin().await?;
                        let (advisor, state) = (advisor.clone(), state.clone());
                        let solve = move || advisor.advise_outside(step, &state, &outside);
                        Ok(CurrentAdvice::Account(self.resolving.run(tenant, solve).await?))
                    }
                }
            }
            AdvisedState::Declared(state, advisor) => {
                self.begin().await?;
                let (advisor, state, seen) = (advisor.clone(), state.state.clone(), state.seen.clone());
                let solve = move || advisor.advise(step, &state, &seen, 1.0);
                Ok(CurrentAdvice::Declared(self.resolving.run(tenant, solve).await?.map_err(of_state)?))
            }
        }
    }

    /// Returns the surrogate's prediction for the state, unless the state lies outside the design.
    async fn predicted(
        &self,
        tenant: &Tenant,
        (state, radius): (&State, Option<f64>),
        advisor: &Arc<Advisor>,
        step: usize,
    ) -> Result<Result<Advice, OutsideDesign>, ServiceError> {
        let predict = move |advisor: &Advisor, state: &State| {
            let radius = radius.unwrap_or_else(|| advisor.radius(state));
            advisor.advise_from_surrogate(step, state, radius)
        };
        if advisor.is_prompt(step, state) {
            return Ok(predict(advisor, state));
        }
        let (advisor, state) = (advisor.clone(), state.clone());
        self.advising.run(tenant, move || predict(&advisor, &state)).await
    }
}

/// Names the state in a fault that it leads to.
pub(in crate::service) fn of_state(fault: FieldError) -> FieldError {
    match fault.field.strip_prefix("problem") {
        None => fault,
        Some(_) => {
            FieldError::new("state", "a state of the policy's problem", format!("must lead to no fault, but {fault}"))
        }
    }
}

/// Returns the uncertainty set before `step` of the policy. For several assets the composition is chosen first, which
/// is heavy work if it needs a solve.
pub(in crate::service) async fn with_uncertainty(
    means: &AdviceContext<'_>,
    tenant: &Tenant,
    step: usize,
    standing: SessionState,
) -> Result<(SessionState, Uncertainty), ServiceError> {
    let advisor = match AdvisedState::of(&standing, &means.policy)? {
        AdvisedState::Account(_, advisor) => advisor.clone(),
        AdvisedState::Declared(state, advisor) => {
            let (advisor, seen) = (advisor.clone(), state.seen.clone());
            let uncertainty = means.advising.run(tenant, move || advisor.uncertainty(&seen)).await?;
            return Ok((standing, uncertainty));
        }
    };
    let SessionState::Account(mut account) = standing else {
        return Err(ServiceError::internal("a session has the policy of another problem"));
    };
    if account.assets.is_none() && advisor.is_prompt(step, &account.state) {
        let uncertainty = advisor.uncertainty(&account.state);
        return Ok((SessionState::Account(account), uncertainty));
    }
    let turns = match account.assets.is_some() && Assets::must_solve(&advisor, step) {
        true => {
            means.begin().await?;
            means.resolving
        }
        false => means.advising,
    };
    let measure = move || {
        account.compose(&advisor, step);
        let (uncertainty, reached) = (advisor.uncertainty(&account.state), account.state.clone());
        // If this is the first session to get this far, the next advice finds its common random numbers simulated.
        ((SessionState::Account(account), uncertainty), move || advisor.prepare(step, &reached))
    };
    turns.run_and_prepare(tenant, measure).await
}
