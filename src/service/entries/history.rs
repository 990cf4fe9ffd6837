//! The answers that a session was given, and what they would be after its corrections.

use std::collections::BTreeMap;

use jiff::civil::Date;
use serde::Serialize;
use utoipa::ToSchema;

use crate::control::policy::advice::{Advice, Uncertainty};
use crate::control::policy::advisor::AdviceMode;
use crate::control::request::terms::Terms;
use crate::service::callers::allowance::HeavyPermit;
use crate::service::entries::account::{self, Accounts, PeriodAccount};
use crate::service::entries::answer::{Corrected, Observed, ReportedPeriod};
use crate::service::entries::declared_history::DeclaredHistory;
use crate::service::entries::notes::{self, PeriodNote};
use crate::service::entries::periods::{Periods, Replay, ReplayedPeriod, SessionPeriod};
use crate::service::entries::report::{Correct, Report};
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::service::sessions::account_state::AccountState;
use crate::service::sessions::assets::{Composition, PlannedAssets};
use crate::service::sessions::content::{answer, content};
use crate::service::sessions::initial_history::InitialHistory;
use crate::service::sessions::plan::{Renew, Renewed, SessionPlan};
use crate::service::sessions::session_state::SessionState;
use crate::store::{EntryKind, InitialAccount, SessionFacts, SessionRow, Tenant};

/// The history of a session: an investor's, or one of a declared problem.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum HistoryAnswer {
    Account(Box<History>),
    Declared(Box<DeclaredHistory>),
}

/// The start of an investor's session, and everything recorded since.
#[derive(Debug, Serialize, ToSchema)]
pub struct History {
    pub session: String,
    /// The first policy.
    pub policy: String,
    /// Rate, cost and flows of its periods, unless a report gives others.
    pub terms: Terms,
    pub initial_wealth: f64,
    /// Share of wealth in the risky asset.
    pub initial_holding: f64,
    /// Radius of the uncertainty set before the first period, in the unit of an advice's radius.
    pub initial_radius: f64,
    /// Names of the assets at the start, if there are several. A renewal that changes them has the new `names`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assets: Option<Vec<String>>,
    /// Figures of the assets at the start.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub composed: Option<Composition>,
    /// Log-returns known at the start.
    pub history: InitialHistory,
    /// Log-returns that the law is made of, oldest first and with all corrections: of the present assets, and without
    /// periods in which one has none. A renewal may use the last ones only.
    pub record: InitialHistory,
    pub observations: Vec<Observation>,
    pub corrections: Vec<Correction>,
    /// The policies that followed the first.
    pub renewals: Vec<Renewal>,
}

/// One period, observed or inserted later.
#[derive(Debug, Serialize, ToSchema)]
pub struct Observation {
    /// The answer when it was reported, with its present number.
    #[serde(flatten)]
    pub answered: Observed,
    /// The first report of it.
    pub reported: Report,
    pub observed_ms: i64,
    /// Money of the period after all corrections, beside what simple rules would have made.
    pub account: PeriodAccount,
    /// Numbers of the corrections that inserted it or reported it again.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub corrections: Vec<usize>,
    /// The answer after all corrections; present from the first period that a correction changed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub now: Option<Now>,
}

/// A period after all corrections.
#[derive(Debug, Serialize, ToSchema)]
pub struct Now {
    /// Its present report, if it was corrected.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reported: Option<Report>,
    /// Null if it is missing, or after a total loss, which `notes` says.
    pub log_return: Option<f64>,
    /// Notes on the period: losses that the law does not learn in full, and prices that did not come.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<PeriodNote>,
    /// Figures of several assets by name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assets: Option<AssetsNow>,
    /// The allocation that would have been advised for it.
    pub advised_allocation: f64,
    pub executed_allocation: f64,
    /// Wealth at its end.
    pub wealth: f64,
    /// Share of wealth in the risky asset.
    pub holding: f64,
    /// Its last day, if it is known.
    #[schema(value_type = Option<String>, format = Date)]
    pub date: Option<Date>,
    /// Radius of the uncertainty set after it, in the unit of an advice's radius.
    pub radius: f64,
}

/// A period of several assets after all corrections.
#[derive(Debug, Serialize, ToSchema)]
pub struct AssetsNow {
    /// Log-returns by asset name; null if they are missing. Null for an asset whose price did not come, or that lost
    /// everything, which `notes` says.
    pub log_returns: Option<BTreeMap<String, Option<f64>>>,
}

/// One correction, as it was made.
#[derive(Debug, Serialize, ToSchema)]
pub struct Correction {
    #[serde(flatten)]
    pub correction: Correct,
    /// The answer to it.
    pub answer: Corrected,
    pub corrected_ms: i64,
}

/// One renewal, as it was made.
#[derive(Debug, Serialize, ToSchema)]
pub struct Renewal {
    /// The answer to it.
    #[serde(flatten)]
    pub answered: Renewed,
    /// Number of last returns that the law was made of; null if it used all.
    pub window: Option<usize>,
    /// The record that each asset entered with, by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub records: BTreeMap<String, Vec<Option<f64>>>,
    /// Names of the assets that left.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub leaving: Vec<String>,
    pub renewed_ms: i64,
}

impl Sessions {
    /// Reads the session's start and every entry. From the first corrected period on, periods are replayed and advised
    /// again.
    /// Each needs a permit to solve.
    ///
    /// # Errors
    /// There is no such session, or too much is being solved already.
    pub async fn history(
        &self,
        tenant: &Tenant,
        session: &str,
        turn: &HeavyPermit,
    ) -> Result<Large<HistoryAnswer>, ServiceError> {
        let Large { value: facts, room } = self.facts(tenant, session).await?;
        let is_large = room.is_some();
        let reading = move || {
            let periods = Periods::of(&facts)?;
            Ok::<_, ServiceError>(match periods.at_start() {
                SessionState::Account(_) => Read::Account((facts, periods).into()),
                SessionState::Declared(start) => Read::Declared(DeclaredHistory::of(&facts, &periods, start)?),
            })
        };
        let (facts, periods) = match self.apart(tenant, is_large, reading).await?? {
            Read::Account(read) => *read,
            Read::Declared(history) => return Ok(Large { value: HistoryAnswer::Declared(history.into()), room }),
        };
        let first = periods.first_changed();
        let changed = if first < periods.all.len() {
            turn.begin().await?;
            self.changed(tenant, session, &periods, first).await?
        } else {
            Vec::new()
        };
        let SessionPlan { terms, assets, .. } = SessionPlan::of(&facts.row)?;
        let start = periods.at_start().account()?.clone().with_law(terms.learning).state;
        let listing = move || {
            let Accounts { accounts, record } = account::of(&periods)?;
            let observations = observations(&facts, &periods, (first, changed), accounts)?;
            Ok::<_, ServiceError>((observations, amendments(&facts, &periods)?, record, facts.row))
        };
        let (observations, (corrections, renewals), record, row) = self.apart(tenant, is_large, listing).await??;
        let first = self.policies.advisor(tenant, &row.policy).await?;
        let initial_radius = self.advising.run(tenant, move || first.radius(&start)).await?;
        let missing = assets.as_ref().map(PlannedAssets::missing);
        let (assets, composed) = assets.map(|planned| (planned.names, planned.composed)).unzip();
        let SessionRow { session, policy, account, initial_history: history, .. } = row;
        let InitialAccount { wealth, holding } =
            account.ok_or_else(|| ServiceError::internal("a session of an investor has no wealth"))?;
        let value = History {
            session,
            policy,
            terms,
            initial_wealth: wealth,
            initial_holding: holding,
            initial_radius,
            history: InitialHistory::of(history, missing),
            record: record.shown(),
            assets,
            composed,
            observations,
            corrections,
            renewals,
        };
        Ok(Large { value: HistoryAnswer::Account(value.into()), room })
    }

    /// Returns each period from `first` on, the first that differs from its acknowledgement. Each waits for its own
    /// permit to be advised. So a long session starves nobody, and a disconnected caller stops the work.
    async fn changed(
        &self,
        tenant: &Tenant,
        session: &str,
        periods: &Periods,
        first: usize,
    ) -> Result<Vec<Changed>, ServiceError> {
        let (mut passage, mut changed): (Replay<'_>, Vec<Changed>) = (periods.passage()?, Vec::new());
        for (step, period) in periods.all.iter().enumerate() {
            let stretch = passage.stretch();
            let passed = passage.next().map_err(ServiceError::of_recorded)?;
            let Some(passed) = passed.filter(|_| step >= first) else { continue };
            let (advising, local) = (self.policies.advisor(tenant, &stretch.policy).await?, stretch.step(step));
            let before = passed.before.account()?.clone().with_law(stretch.terms.learning).state;
            let (law, after) = (advising.clone(), passage.stands().account()?.state.clone());
            let advise = move || advising.advise(local, &before, AdviceMode::Surrogate);
            let advice = self.resolving.run(tenant, advise).await?;
            // The radius after a period is the one of the next advice.
            changed.last_mut().into_iter().for_each(|(before, _)| before.radius = advice.radius);
            let inserted = match period.is_inserted() {
                true => {
                    let uncertainty = self.resolving.run(tenant, move || law.uncertainty(&after)).await?;
                    let name = (session, step + 1);
                    Some(inserted(name, &passed, passage.standing.account()?, (&advice, uncertainty))?)
                }
                false => None,
            };
            changed.push((now(period, &passed, passage.standing.account()?, &advice)?, inserted));
        }
        let (measuring, policy) = (passage.stands().account()?.state.clone(), &periods.current().policy);
        let advisor = self.policies.advisor(tenant, policy).await?;
        let radius = self.resolving.run(tenant, move || advisor.radius(&measuring)).await?;
        changed.last_mut().into_iter().for_each(|(last, _)| last.radius = radius);
        Ok(changed)
    }
}

/// Returns the corrections and the renewals, each in order.
pub(super) fn amendments(
    facts: &SessionFacts,
    periods: &Periods,
) -> Result<(Vec<Correction>, Vec<Renewal>), ServiceError> {
    let (mut corrections, mut renewals) = (Vec::new(), Vec::new());
    for entry in &facts.entries {
        match entry.kind {
            EntryKind::Observation => {}
            EntryKind::Correction => corrections.push(Correction {
                correction: content(entry, periods.names.at(entry.entry))?,
                answer: answer(entry, periods.names.at(entry.entry))?,
                corrected_ms: entry.created_ms,
            }),
            EntryKind::Renewal => {
                let names = periods.names.at(entry.entry);
                let Renew { window, records, leaving, .. } = content(entry, names)?;
                let answered = answer(entry, names)?;
                renewals.push(Renewal { answered, window, records, leaving, renewed_ms: entry.created_ms });
            }
        }
    }
    Ok((corrections, renewals))
}

/// A period after all corrections. For an inserted period also the substitute for the answer to its observation.
type Changed = (Now, Option<Observed>);

/// Returns every period; `changed` holds those from `first` on.
fn observations(
    facts: &SessionFacts,
    periods: &Periods,
    (first, changed): (usize, Vec<Changed>),
    accounts: Vec<PeriodAccount>,
) -> Result<Vec<Observation>, ServiceError> {
    let mut changed = changed.into_iter();
    let row = |((index, period), account): ((usize, &SessionPeriod), PeriodAccount)| {
        let entry = &facts.entries[period.entry];
        let names = periods.names.at(entry.entry);
        let (now, inserted) = if index >= first { changed.next() } else { None }.unzip();
        let (acknowledged, reported) = match inserted.flatten() {
            Some(observed) => (observed, content::<Correct>(entry, names)?.report()),
            None => (answer::<Observed>(entry, names)?, content(entry, names)?),
        };
        let (answered, corrections) = (Observed { period: index + 1, ..acknowledged }, period.corrections.clone());
        Ok(Observation { answered, reported, observed_ms: entry.created_ms, account, corrections, now })
    };
    periods.all.iter().enumerate().zip(accounts).map(row).collect()
}

/// Builds the period that leaves the session in the state `after`.
fn now(
    period: &SessionPeriod,
    passed: &ReplayedPeriod,
    after: &AccountState,
    advice: &Advice,
) -> Result<Now, ServiceError> {
    let (before, moved) = (passed.before.account()?, passed.moved.account()?);
    Ok(Now {
        reported: (!period.corrections.is_empty()).then(|| period.report.clone()),
        log_return: moved.log_return,
        notes: notes::of(&passed.seen, before.names()),
        assets: before.assets.as_ref().map(|assets| AssetsNow { log_returns: assets.shown(&passed.seen) }),
        advised_allocation: advice.allocation,
        executed_allocation: moved.executed_allocation,
        wealth: after.state.wealth,
        holding: after.state.holding,
        date: after.days.last,
        radius: f64::NAN,
    })
}

/// Builds the answer for an inserted period as if it had been observed. The executed allocation counts as the advised
/// one, because none was advised.
fn inserted(
    (session, period): (&str, usize),
    passed: &ReplayedPeriod,
    after: &AccountState,
    (advice, uncertainty): (&Advice, Uncertainty),
) -> Result<Observed, ServiceError> {
    let (before, moved) = (passed.before.account()?, passed.moved.account()?);
    let advice = Advice { allocation: moved.executed_allocation, ..advice.clone() };
    let about = ReportedPeriod { session: session.to_owned(), period, completed: false, uncertainty };
    let mut observed = after.observed(before, (&passed.seen, moved), &advice, about);
    if let Some((shown, assets)) = observed.assets.as_mut().zip(before.assets.as_ref()) {
        shown.advised_allocations.clone_from(&shown.executed_allocations);
        shown.composed = assets.composed();
    }
    Ok(observed)
}

/// The rows of an investor's session, or the history of another.
enum Read {
    Account(Box<(SessionFacts, Periods)>),
    Declared(DeclaredHistory),
}
