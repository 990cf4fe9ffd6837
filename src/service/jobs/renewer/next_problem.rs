//! The problem of the next policy of a session.

use crate::control::policy_document::PreparedPolicy;
use crate::control::posed::Posed;
use crate::service::entries::periods::Periods;
use crate::service::error::ServiceError;
use crate::service::sessions::plan::Renewing;
use crate::service::sessions::session_state::SessionState;
use crate::store::SessionFacts;

/// Returns the problem of a session's next policy: the present one, on what was observed since, from the present state,
/// `elapsed` periods into it.
///
/// # Errors
/// A recorded report no longer keeps the rules.
pub(super) fn next_problem(
    policy: &PreparedPolicy,
    standing: &SessionState,
    facts: &SessionFacts,
    (renew, elapsed): (Renewing, usize),
) -> Result<Posed, ServiceError> {
    let periods = Periods::of(facts)?;
    match (policy, standing) {
        (PreparedPolicy::Declared(advisor), SessionState::Declared(state)) => {
            let seen = periods.all.iter().filter_map(|period| period.report.noise);
            let known = facts.row.initial_history.iter().copied().chain(seen);
            let next = advisor.policy().specification().next(known, renew.window, state.named());
            Ok(Posed::Declared(next.into()))
        }
        (PreparedPolicy::Investor(advisor), SessionState::Account(account)) => {
            let record = periods.replay()?.record;
            let rate = periods.all.iter().rev().find_map(|period| period.report.rate);
            let next = advisor.specification().next(&record.last(renew.window), rate, account.state.wealth, elapsed)?;
            Ok(Posed::Investor(next.into()))
        }
        _ => Err(ServiceError::internal("a session has the policy of another problem")),
    }
}
