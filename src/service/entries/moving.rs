//! Moves a session to another service or tenant: as one document, which the other side replays before it stores it.
//!
//! The document holds the rows of a session as they are stored, so nothing is computed anew. A hash covers it, so a
//! changed byte is found. The importing service opens the session again from its policy, and replays the entries. Both
//! must lead to what the document says, so a service that computes differently refuses the session.
//!
//! Not done, and why:
//! - Proof of who recorded an entry. Anybody can make a document with a valid hash, for a session of their own tenant.
//! - Idempotency keys and the audit. They belong to the service that answered the calls.

use serde::Deserialize;
use serde_json::{Value, json};
use tracing::Instrument;

use crate::control::error::FieldError;
use crate::control::policy_document::PreparedPolicy;
use crate::service::callers::allowance::HeavyPermit;
use crate::service::callers::keys::Caller;
use crate::service::entries::account;
use crate::service::entries::answer::Observed;
use crate::service::entries::declared_history::DeclaredHistory;
use crate::service::entries::history::amendments;
use crate::service::entries::periods::Periods;
use crate::service::entries::session_document::{ExportedSession, SessionDocument};
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::process::spans;
use crate::service::sessions::Sessions;
use crate::service::sessions::content::{answer, read};
use crate::service::sessions::live::LiveSession;
use crate::service::sessions::plan::{MOST_PERIODS, MOST_RENEWALS, SessionPlan};
use crate::service::sessions::session_state::SessionState;
use crate::store::{
    CreateSession, EntryKind, InitialAccount, Relabel, RenewalTarget, SessionFacts, SessionImport, SessionRow, Tenant,
};

/// The relative difference that rounding may make between a state as it was answered and as its reports lead to it.
const ROUNDING: f64 = 1e-9;

impl Sessions {
    /// Returns a session as one document.
    ///
    /// # Errors
    /// There is no such session, or there is no memory for it in time.
    pub async fn export(&self, tenant: &Tenant, session: &str) -> Result<Large<SessionDocument>, ServiceError> {
        let labels = self.store.labels(tenant, session).await?;
        let Large { value: facts, room } = self.facts(tenant, session).await?;
        let is_large = room.is_some();
        let exporting = self.apart(tenant, is_large, move || {
            let reached = (used(&Periods::of(&facts)?), figures(&LiveSession::replayed(facts.clone())?));
            SessionDocument::new(facts, labels, reached)
        });
        Ok(Large { value: exporting.await??, room })
    }

    /// Stores the session of a document, once its policies are there and its entries lead to what it says.
    ///
    /// # Errors
    /// The document was changed, it is not that of a session, a policy is missing, or the session exists.
    pub async fn import(
        &self,
        caller: &Caller,
        SessionDocument { hash, session }: SessionDocument,
        turn: &HeavyPermit,
    ) -> Result<LiveSession, ServiceError> {
        let tenant = &caller.tenant;
        let found = session.hash()?;
        if found != hash {
            let rule = format!("must be the hash of the session, which is {found}: export it again");
            return Err(FieldError::new("hash", hash, rule).into());
        }
        let labels = session.check()?;
        for policy in &session.policies {
            self.policies.created_ms(tenant, policy).await?;
        }
        let row = self.opened_again((tenant, turn), &session).await?;
        let entries = session.rows()?;
        let facts = SessionFacts { seen: row.as_opened(), row, entries };
        let replaying = move || verified(facts, &session);
        let Verified { live, import } = self.advising.run(tenant, replaying).await??;
        let import = SessionImport { labels, ..import };
        let mut held = self.hold(tenant, &import.row.session).await;
        held.clear();
        let (name, policy) = (import.row.session.clone(), import.row.policy.clone());
        let store = self.store.by(caller.actor());
        match store.import_session(import).instrument(spans::of_write("import a session")).await? {
            CreateSession::Created => {}
            CreateSession::NoPolicy => return Err(ServiceError::unknown("policy", &policy)),
            CreateSession::Exists | CreateSession::Repeated(_) | CreateSession::KeyConflict => {
                return Err(ServiceError::SessionExists { session: name });
            }
        }
        if live.is_due() {
            let _ = self.due.try_send((tenant.clone(), name));
        }
        Ok(live)
    }

    /// Returns the row of the session as this service would open it.
    ///
    /// # Errors
    /// The policy does not lead to the start that the document has.
    async fn opened_again(
        &self,
        (tenant, turn): (&Tenant, &HeavyPermit),
        exported: &ExportedSession,
    ) -> Result<SessionRow, ServiceError> {
        let start = &exported.start;
        let plan: SessionPlan = read(&start.plan)
            .map_err(|_| FieldError::new("session.start.plan", &start.plan, "must be the plan of a session"))?;
        let own = match self.policies.policy(tenant, &start.policy).await? {
            PreparedPolicy::Investor(advisor) => match &advisor.specification().fund {
                Some(fund) => fund.history.concat(),
                None => advisor.specification().problem.history.clone(),
            },
            PreparedPolicy::Declared(advisor) => advisor.policy().specification().problem.history.clone(),
        };
        let (begun, opened) = self.begins((tenant, turn), start.request(&plan, own)).await?;
        // The composition is solved, and its last digits may depend on the processor.
        let opened = match (opened.assets, &plan.assets) {
            (Some(again), Some(planned)) if again.is_like(planned) => {
                SessionPlan { assets: Some(planned.clone()), ..opened }
            }
            (assets, _) => SessionPlan { assets, ..opened },
        };
        let account = start.account.map(|(wealth, holding)| InitialAccount { wealth, holding });
        if opened.json()? != start.plan || begun.account != account || begun.history != start.history {
            let rule = format!("must be the start that this service makes with the policy {}", start.policy);
            return Err(FieldError::new("session.start", "another start", rule).into());
        }
        Ok(SessionRow {
            session: exported.session.clone(),
            tenant: tenant.clone(),
            policy: start.policy.clone(),
            account,
            initial_history: start.history.clone(),
            horizon: opened.terms.horizon,
            plan_json: start.plan.clone(),
            due: opened.renew.map(|renew| renew.every),
            assets: begun.named,
            created_ms: start.created_ms,
        })
    }
}

/// A session that was replayed from its document, and what is to be stored of it.
struct Verified {
    live: LiveSession,
    import: SessionImport,
}

/// Replays a session, and compares it with its document.
fn verified(facts: SessionFacts, exported: &ExportedSession) -> Result<Verified, ServiceError> {
    let wrong = |field: &str, value: &Value, rule: String| FieldError::new(format!("session.{field}"), value, rule);
    let periods = Periods::of(&facts).map_err(of_document)?;
    let (observed, renewals) = (periods.all.len(), periods.renewals());
    if observed > MOST_PERIODS || renewals > MOST_RENEWALS {
        let rule = format!("must hold at most {MOST_PERIODS} periods and {MOST_RENEWALS} renewals");
        return Err(wrong("entries", &json!(facts.entries.len()), rule).into());
    }
    let policies = used(&periods);
    if policies != exported.policies {
        let rule = format!("must be the policies of the entries: {}", policies.join(", "));
        return Err(wrong("policies", &json!(exported.policies), rule).into());
    }
    check_answers(&facts, &periods).map_err(of_document)?;
    let live = LiveSession::replayed(facts.clone()).map_err(of_document)?;
    if observed > live.last_period() {
        let rule = format!("must hold at most {} periods, the last that its policy advises", live.last_period());
        return Err(wrong("entries", &json!(observed), rule).into());
    }
    if !is_near(&periods.recomputed().map_err(of_document)?, &live.standing) {
        let rule = "must hold answers that follow from the reports: these lead to another wealth or state".to_owned();
        return Err(wrong("entries", &json!(facts.entries.len()), rule).into());
    }
    let figures = figures(&live);
    if figures != exported.state {
        let rule = format!("must be what the entries lead to: {figures}");
        return Err(wrong("state", &exported.state, rule).into());
    }
    let plan = SessionPlan::of(&facts.row)?;
    let followed = periods.stretches.windows(2).zip(1..).map(|(pair, number)| RenewalTarget {
        policy: pair[1].policy.clone(),
        horizon: pair[1].horizon(),
        periods: pair[1].horizon().saturating_sub(pair[0].horizon()),
        due: plan.renew.and_then(|renew| renew.due(number, &pair[1])),
    });
    let renewals = followed.collect();
    let SessionFacts { row, entries, .. } = facts;
    Ok(Verified { live, import: SessionImport { row, labels: Relabel::default(), entries, renewals } })
}

/// Checks that every answer can be read, and is an answer of this session.
fn check_answers(facts: &SessionFacts, periods: &Periods) -> Result<(), ServiceError> {
    #[derive(Deserialize)]
    struct AnswerSession {
        session: String,
    }
    for entry in &facts.entries {
        let AnswerSession { session } = read(&entry.answer_json)?;
        if session != facts.row.session {
            return Err(ServiceError::internal(format!("entry {} is of the session {session}", entry.entry)));
        }
    }
    match periods.at_start() {
        SessionState::Account(_) => {
            for entry in facts.entries.iter().filter(|entry| entry.kind == EntryKind::Observation) {
                answer::<Observed>(entry, periods.names.at(entry.entry))?;
            }
            amendments(facts, periods)?;
            account::of(periods).map(drop)
        }
        SessionState::Declared(start) => DeclaredHistory::of(facts, periods, start).map(drop),
    }
}

/// Returns the policies of a session, each once, in their order.
fn used(periods: &Periods) -> Vec<String> {
    let mut used: Vec<String> = Vec::new();
    for tenure in &periods.stretches {
        if !used.contains(&tenure.policy) {
            used.push(tenure.policy.clone());
        }
    }
    used
}

/// Returns true if two states have the same wealth, or the same states of a declared problem, up to rounding.
fn is_near(one: &SessionState, other: &SessionState) -> bool {
    let near = |one: f64, other: f64| (one - other).abs() <= ROUNDING * one.abs().max(1.0);
    match (one, other) {
        (SessionState::Account(one), SessionState::Account(other)) => near(one.state.wealth, other.state.wealth),
        (SessionState::Declared(one), SessionState::Declared(other)) => {
            let (one, other) = (one.named(), other.named());
            one.keys().eq(other.keys()) && one.values().zip(other.values()).all(|(one, other)| near(*one, *other))
        }
        _ => false,
    }
}

/// Returns the figures of a session before its coming period.
fn figures(live: &LiveSession) -> Value {
    let (account, declared) = match &live.standing {
        SessionState::Account(account) => (Some(account), None),
        SessionState::Declared(declared) => (None, Some(declared)),
    };
    json!({
        "period": live.observed + 1,
        "horizon": live.horizon(),
        "corrections": live.corrections,
        "renewals": live.renewals,
        "sample_size": live.standing.sample_size(),
        "wealth": account.map(|account| account.state.wealth),
        "holding": account.map(|account| account.state.holding),
        "assets": account.and_then(|account| account.assets.as_ref()).map(|assets| assets.composed()),
        "states": declared.map(|declared| declared.named()),
        "earned": declared.map(|declared| declared.state.earned),
        "drift": live.standing.bet().drift(),
    })
}

/// Turns a failure to read rows, which are the caller's here, into an error of the document.
fn of_document(error: ServiceError) -> ServiceError {
    match error {
        ServiceError::Internal(reason) => {
            FieldError::new("session.entries", "other entries", format!("must be those of a session: {reason}")).into()
        }
        error => error,
    }
}
