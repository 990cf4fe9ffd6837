//! Renews a session: records the switch to its next policy.
//!
//! A renewal is an entry of its session. It names the next policy, which advises from the coming period on. It also
//! holds the terms of the periods from there on, so that a replay does not need policies that no longer advise. The law
//! is rebuilt from the corrected returns: all of them, or a window of the last ones.

use std::sync::Arc;

use tracing::Instrument;

use crate::control::error::FieldError;
use crate::control::policy::advice::Uncertainty;
use crate::control::policy::advisor::Advisor;
use crate::control::policy::declared::DeclaredAdvisor;
use crate::control::policy_document::PreparedPolicy;
use crate::control::request::declared::DeclaredProblem;
use crate::control::request::terms::Terms;
use crate::service::callers::allowance::HeavyPermit;
use crate::service::entries::periods::{Periods, Replay};
use crate::service::entries::recording::{is_repeat, numbered};
use crate::service::entries::report::{OF_INVESTORS, none_of};
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::process::spans;
use crate::service::sessions::Sessions;
use crate::service::sessions::account_state::AccountState;
use crate::service::sessions::asset_change::AssetChange;
use crate::service::sessions::content::Packed;
use crate::service::sessions::current_advice::with_uncertainty;
use crate::service::sessions::live::LiveSession;
use crate::service::sessions::plan::{
    DeclaredRenewed, MOST_PERIODS, MOST_RENEWALS, PolicyTenure, Renew, RenewalAnswer, Renewed, SessionPlan,
    check_window, terms_of,
};
use crate::service::sessions::session_state::{NextPolicy, SessionState};
use crate::store::{Actor, EntryKind, EntryRow, RenewalTarget, SessionFacts, Tenant};

impl Sessions {
    /// Switches to another policy from the coming period on, exactly once and durably before the answer. Returns a
    /// [`Renewed`] in JSON.
    ///
    /// # Errors
    /// A field breaks a rule, there is no such session or policy, or the renewal was made with other content or is not
    /// the next.
    pub async fn renew(
        &self,
        tenant: &Tenant,
        by: Actor,
        session: &str,
        renew: &Renew,
        turn: Option<&HeavyPermit>,
    ) -> Result<String, ServiceError> {
        let number = numbered("renewal", renew.renewal)?;
        check_window("window", renew.window)?;
        let mut held = self.hold(tenant, session).await;
        loop {
            let Large { value: facts, room: _room } = self.facts(tenant, session).await?;
            let periods = Periods::of(&facts)?;
            if is_repeat(EntryKind::Renewal, number, periods.renewals())? {
                return self.repeat(session, (EntryKind::Renewal, number), renew, &periods.names).await;
            }
            if number > MOST_RENEWALS {
                let rule = format!("must be at most {MOST_RENEWALS}: open a new session with the present history");
                return Err(FieldError::new("renewal", number, rule).into());
            }
            let DecidedRenewal { new, sent, onto, next } =
                self.decided((tenant, turn), &by, facts, periods, renew).await?;
            let store = self.store.by(by.clone());
            held.clear();
            let appended = store.renew(new, onto).instrument(spans::of_write("append an entry")).await?;
            if self.after_append(&mut held, appended, next)? {
                if turn.is_some() {
                    // A caller renewed it, so the training that the session requested is no longer needed.
                    let _ = self.due.try_send((tenant.clone(), session.to_owned()));
                }
                return Ok(sent);
            }
        }
    }

    /// Computes the next renewal of a session from `facts`.
    async fn decided(
        &self,
        (tenant, turn): (&Tenant, Option<&HeavyPermit>),
        by: &Actor,
        facts: SessionFacts,
        periods: Periods,
        renew: &Renew,
    ) -> Result<DecidedRenewal, ServiceError> {
        let policy = match periods.at_start() {
            SessionState::Account(_) => PreparedPolicy::Investor(self.policies.advisor(tenant, &renew.policy).await?),
            SessionState::Declared(_) => PreparedPolicy::Declared(self.policies.decider(tenant, &renew.policy).await?),
        };
        let (observed, corrections, before) = (periods.all.len(), periods.corrections, periods.current().horizon());
        let plan = SessionPlan::of(&facts.row)?;
        let (onto, planned, renewal) = (policy.clone(), plan.clone(), renew.clone());
        let (mut names, entry) = (periods.names.clone(), facts.seen.entries() + 1);
        let go_on = move || match onto {
            PreparedPolicy::Investor(onto) => go_on(&periods, &planned, &onto, &renewal),
            PreparedPolicy::Declared(onto) => declared_goes_on(&periods, &planned, &onto, &renewal),
        };
        let Continuation { standing, terms, next: onto } = self.advising.run(tenant, go_on).await??;
        if let Some(change) = onto.asset_change() {
            names.change(entry, change.names.clone());
        }
        if let PreparedPolicy::Investor(advisor) = &policy {
            self.policies.starts_from(advisor, standing.sample_size(), terms.horizon)?;
        }
        let (standing, uncertainty) = with_uncertainty(&self.means_of(policy, turn), tenant, 0, standing).await?;
        let current = plan.stretch(renew.policy.clone(), observed, terms, renew.window);
        let (horizon, radius) = (current.horizon(), Some(uncertainty.radius));
        let answer = answered((&facts.row.session, renew), (observed + 1, &current), (onto, &standing), uncertainty)?;
        let Packed { content_json, answer_json, numbers, sent } = Packed::of(renew, &answer, standing.names())?;
        let new = EntryRow {
            session: facts.row.session.clone(),
            entry,
            kind: EntryKind::Renewal,
            number: renew.renewal,
            content_json,
            answer_json,
            numbers,
            created_ms: self.clock.now_milliseconds(),
            key: by.key.to_string(),
        };
        let due = plan.renew.and_then(|next| next.due(renew.renewal, &current));
        let onto =
            RenewalTarget { policy: renew.policy.clone(), horizon, periods: horizon.saturating_sub(before), due };
        let next = LiveSession {
            seen: facts.seen.followed_by(&new),
            row: facts.row.into(),
            names,
            standing,
            observed,
            corrections,
            renewals: renew.renewal,
            current: Arc::new(current),
            renew: plan.renew,
            radius,
            advice: None,
        };
        Ok(DecidedRenewal { new, sent, onto, next })
    }
}

/// The state and the terms that a renewal leads to.
struct Continuation {
    standing: SessionState,
    terms: Terms,
    next: NextPolicy,
}

/// Returns the state and the terms that the renewal of an investor's session leads to.
fn go_on(periods: &Periods, plan: &SessionPlan, onto: &Advisor, renew: &Renew) -> Result<Continuation, ServiceError> {
    let terms = Terms::of(onto.specification());
    // A plan may end before its next renewal is due.
    plan.renew.filter(|_| !terms.ends).map_or(Ok(()), |every| every.check(&terms))?;
    let (observed, window) = (periods.all.len(), renew.window);
    let Replay { standing, mut record, .. } = periods.replay()?;
    let change = AssetChange::new((standing.names(), assets_of(onto)), renew, observed)?;
    if let Some(change) = &change {
        record = change.record(&record);
    }
    let dates = record.last(window).len() / record.assets();
    let terms = plan.terms(onto, dates, observed);
    let terms = terms.map_err(|rule| FieldError::new("policy", &renew.policy, rule))?;
    let standing = standing.account()?.renewed(&record, window, &terms, change.as_ref())?;
    accepts(onto, &record.last(window), &standing)?;
    let standing = SessionState::Account(standing.into());
    Ok(Continuation { standing, terms, next: NextPolicy::Account(change) })
}

/// Returns the state and the terms that the renewal of a declared problem's session leads to. The law begins with the
/// policy's own history.
fn declared_goes_on(
    periods: &Periods,
    plan: &SessionPlan,
    onto: &DeclaredAdvisor,
    renew: &Renew,
) -> Result<Continuation, ServiceError> {
    let of_investors = [
        ("window", renew.window.is_some()),
        ("records", !renew.records.is_empty()),
        ("leaving", !renew.leaving.is_empty()),
    ];
    none_of(&of_investors, OF_INVESTORS)?;
    let problem = DeclaredProblem { history: Vec::new(), ..onto.policy().specification().problem.clone() };
    let (observed, terms) = (periods.all.len(), terms_of(&problem));
    plan.renew.map_or(Ok(()), |every| every.check(&terms))?;
    if observed + terms.horizon > MOST_PERIODS {
        let rule = format!("must end within {MOST_PERIODS} periods of the session: open a new session with its state");
        return Err(FieldError::new("policy", &renew.policy, rule).into());
    }
    let Replay { standing, .. } = periods.replay()?;
    let SessionState::Declared(standing) = standing else {
        return Err(ServiceError::internal("a session of another problem"));
    };
    let standing = SessionState::Declared(standing.renewed(&problem)?.into());
    Ok(Continuation { standing, terms, next: NextPolicy::Declared(problem.into()) })
}

/// Returns the answer to a renewal, which begins with this period.
fn answered(
    (session, renew): (&str, &Renew),
    (period, current): (usize, &PolicyTenure),
    (next, standing): (NextPolicy, &SessionState),
    uncertainty: Uncertainty,
) -> Result<RenewalAnswer, ServiceError> {
    let (session, renewal, policy) = (session.to_owned(), renew.renewal, renew.policy.clone());
    let horizon = current.horizon();
    Ok(match next {
        NextPolicy::Account(change) => RenewalAnswer::Account(Box::new(Renewed {
            session,
            renewal,
            policy,
            period,
            horizon,
            terms: current.terms.clone(),
            names: change.map(|change| change.names.to_vec()),
            assets: standing.account()?.assets.as_ref().map(|assets| assets.composed()),
            uncertainty,
        })),
        NextPolicy::Declared(problem) => RenewalAnswer::Declared(Box::new(DeclaredRenewed {
            session,
            renewal,
            policy,
            period,
            horizon,
            problem: *problem,
            uncertainty,
        })),
    })
}

/// A renewal to append, and the state it leads to.
struct DecidedRenewal {
    new: EntryRow,
    /// The answer as it is sent.
    sent: String,
    onto: RenewalTarget,
    next: LiveSession,
}

/// Checks that a session with this record and state can use the policy, whose assets it has.
fn accepts(advisor: &Advisor, record: &[f64], standing: &AccountState) -> Result<(), FieldError> {
    let returns = standing.assets.as_ref().map(|assets| assets.fund.returns());
    let state = advisor.initial_state(Some(returns.as_deref().unwrap_or(record)), Some(standing.state.wealth))?;
    advisor.check_withdrawals(&state)
}

/// Returns the names of the assets of a policy; empty for one asset.
fn assets_of(advisor: &Advisor) -> &[String] {
    advisor.specification().fund.as_deref().map_or(&[][..], |fund| &fund.assets)
}
