//! Renews sessions automatically: trains the next policy on the observed returns, and continues the session with it.
//!
//! Each round finds its work in the store again, so it continues after a kill between any two steps, on every replica
//! alike. The entries of a session show that it is due. Its request ([`crate::store::TrainingRequest`]), with session,
//! renewal and attempt, identifies the job that trains its next policy. The renewal has a number. So a step that was
//! already done elsewhere is detected. Sessions of a tenant that need one policy wait for one job.
//!
//! A failed attempt leaves the session as it is. The delay before the next attempt doubles each time.

use std::collections::BTreeMap;
use std::time::Duration;

use futures_util::StreamExt;
use futures_util::stream::FuturesUnordered;
use tokio::sync::mpsc::Receiver;
use tokio::time::MissedTickBehavior;

use self::attempts::{Attempts, request};
use self::naming::next_labels;
use self::next_problem::next_problem;
use self::under_way::{Left, UnderWay};
use crate::service::error::ServiceError;
use crate::service::jobs::Jobs;
use crate::service::metrics::RENEWALS;
use crate::service::process::clock::Clock;
use crate::service::process::memory::Large;
use crate::service::process::shutdown::Shutdown;
use crate::service::sessions::live::LiveSession;
use crate::service::sessions::plan::{Renew, Renewing};
use crate::service::sessions::{Name, Sessions};
use crate::store::{Actor, JobRow, JobState, SessionTraining, Store};

/// Time between two polls of the jobs that train next policies.
const PAUSE: Duration = Duration::from_millis(500);
/// Time between two searches for due sessions that were not reported: after a kill, or a failure.
const ROUND: Duration = Duration::from_secs(60);
/// Delay before the second attempt; doubled before each later one, up to the longest.
const FIRST_DELAY: Duration = Duration::from_secs(60);
const LONGEST_DELAY: Duration = Duration::from_hours(24);
/// Longest time for one step. A step that takes longer is left to a later round, so that it does not delay the tenant's
/// other sessions.
const PATIENCE: Duration = Duration::from_secs(60);
/// Sessions read at a time in a round.
const PAGE: usize = 256;
/// Reported sessions that wait to be handled; a round finds any others.
pub(in crate::service) const TOLD: usize = 1024;

mod attempts;
mod naming;
mod next_problem;
mod turns;
mod under_way;
mod waiting;

pub use self::attempts::{RenewalDue, RenewalState};

pub(in crate::service) struct Renewer {
    pub store: Store,
    pub clock: Clock,
    pub sessions: Sessions,
    pub jobs: Jobs,
}

impl Renewer {
    /// Renews sessions until shutdown begins.
    pub(in crate::service) async fn run(self, mut due_names: Receiver<Name>, shutdown: Shutdown) {
        let (mut under_way, mut steps) = (UnderWay::default(), FuturesUnordered::new());
        let (mut round, mut look) = (tokio::time::interval(ROUND), tokio::time::interval(PAUSE));
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            while let Some(name) = under_way.turns.next() {
                steps.push(self.go_on(name));
            }
            tokio::select! {
                () = shutdown.begun() => return,
                Some(name) = due_names.recv() => self.hear(name, &mut under_way).await,
                Some((name, left)) = steps.next(), if !steps.is_empty() => {
                    under_way.stepped(name, left);
                    if under_way.left_after.is_some() && under_way.turns.is_empty() {
                        self.find(&mut under_way).await;
                    }
                }
                _ = look.tick(), if !under_way.waiting.is_empty() => self.follow(&mut under_way).await,
                _ = round.tick() => {
                    self.sweep().await;
                    under_way.retry();
                    self.find(&mut under_way).await;
                }
            }
        }
    }

    /// Handles a session that became due, or was renewed or deleted, in which case its training may no longer be
    /// needed.
    async fn hear(&self, name: Name, under_way: &mut UnderWay) {
        if under_way.waiting.contains(&name) {
            self.sweep().await;
        }
        under_way.begin(name);
    }

    async fn sweep(&self) {
        if let Err(error) = self.jobs.cancel_unrequested().await {
            tracing::warn!(
                error = &error as &dyn std::error::Error,
                "cancelling trainings that no session requests failed"
            );
        }
    }

    /// Begins with all sessions that are due, from the first that the last round left out.
    async fn find(&self, under_way: &mut UnderWay) {
        let mut after = under_way.left_after.take().unwrap_or_default();
        loop {
            let page = match self.store.due_sessions(PAGE, after).await {
                Ok(page) => page,
                Err(error) => {
                    tracing::warn!(
                        error = &error as &dyn std::error::Error,
                        "finding the sessions that are due failed"
                    );
                    return;
                }
            };
            if page.is_empty() {
                return;
            }
            for (sequence, tenant, session) in page {
                if !under_way.begin((tenant, session)) {
                    under_way.left_after.get_or_insert(after);
                }
                after = sequence;
            }
        }
    }

    /// Polls the jobs that sessions wait for.
    async fn follow(&self, under_way: &mut UnderWay) {
        for job in under_way.waiting.jobs() {
            match self.store.job(&job).await {
                Ok(Some(row)) if matches!(row.state, JobState::Queued | JobState::Running) => {}
                Ok(Some(row)) if matches!(row.state, JobState::Failed | JobState::Cancelled) => {
                    for name in under_way.ended(&job) {
                        if self.sessions.get(&name.0, &name.1).await.is_ok_and(|live| live.is_due()) {
                            metrics::counter!(RENEWALS, "outcome" => "failed").increment(1);
                            tracing::warn!(session = name.1, job, error = row.error, "a renewal failed");
                        }
                    }
                }
                _ => {
                    for name in under_way.ended(&job) {
                        under_way.turns.queue(name);
                    }
                }
            }
        }
    }

    /// Does the next step for a session; a step that fails is repeated in a later round.
    async fn go_on(&self, name: Name) -> (Name, Left) {
        let step = tokio::time::timeout(PATIENCE, self.step(&name)).await;
        let left = step.unwrap_or(Err(ServiceError::Busy)).unwrap_or_else(|error| {
            metrics::counter!(RENEWALS, "outcome" => "failed").increment(1);
            tracing::warn!(session = name.1, error = &error as &dyn std::error::Error, "a session was not renewed");
            Left::Nothing
        });
        (name, left)
    }

    async fn step(&self, (tenant, session): &Name) -> Result<Left, ServiceError> {
        let live = match self.sessions.get(tenant, session).await {
            Ok(live) => live,
            Err(ServiceError::Unknown { .. }) => {
                self.jobs.cancel_unrequested().await?;
                return Ok(Left::Nothing);
            }
            Err(error) => return Err(error),
        };
        let Some(renew) = live.renew.filter(|_| live.is_due()) else {
            self.jobs.cancel_unrequested().await?;
            return Ok(Left::Nothing);
        };
        let attempts = Attempts::of(&self.store, &live).await?;
        let Some(last) = &attempts.last else { return self.train(&live, renew, &attempts).await };
        match (last.state, &last.policy) {
            (JobState::Queued | JobState::Running, _) => return Ok(Left::Job(last.job.clone())),
            (JobState::Succeeded, Some(policy)) => {
                match self.onto(&live, policy, renew, attempts.number).await {
                    Ok(()) => return Ok(Left::Nothing),
                    // The policy was deleted, or does not fit the present state of the session: another is trained
                    // later.
                    Err(error @ (ServiceError::Unknown { what: "policy", .. } | ServiceError::Field(_))) => {
                        if self.is_early(last, attempts.count) {
                            return Err(error);
                        }
                    }
                    Err(error) => return Err(error),
                }
            }
            _ if self.is_early(last, attempts.count) => return Ok(Left::Nothing),
            _ => {}
        }
        self.train(&live, renew, &attempts).await
    }

    /// Returns whether it is too early for the attempt after `count` attempts, the last of which is `last`.
    fn is_early(&self, last: &JobRow, count: usize) -> bool {
        let ended_ms = last.finished_ms.unwrap_or_default();
        self.clock.now_milliseconds() < ended_ms.saturating_add(delay_ms(count))
    }

    /// Switches the session to the trained policy.
    async fn onto(&self, live: &LiveSession, policy: &str, renew: Renewing, number: usize) -> Result<(), ServiceError> {
        let (tenant, session) = (&live.row.tenant, &live.row.session);
        let (records, leaving) = (BTreeMap::new(), Vec::new());
        // The next policy of a declared problem was trained on the window, and its law is that of its own history.
        let window = renew.window.filter(|_| live.standing.account().is_ok());
        let renewal = Renew { renewal: number, policy: policy.to_owned(), window, records, leaving };
        let by = Actor::service(self.clock.now_milliseconds());
        match self.sessions.renew(tenant, by, session, &renewal, None).await {
            Ok(_) => {
                metrics::counter!(RENEWALS, "outcome" => "renewed").increment(1);
                tracing::info!(session, policy, renewal = number, "session renewed");
                Ok(())
            }
            // The session was renewed or deleted elsewhere meanwhile.
            Err(ServiceError::RenewedAlready { .. } | ServiceError::Conflict { .. } | ServiceError::Gap { .. }) => {
                Ok(())
            }
            Err(ServiceError::Unknown { what: "session", .. }) => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// Queues the next attempt.
    async fn train(&self, live: &LiveSession, renew: Renewing, attempts: &Attempts) -> Result<Left, ServiceError> {
        let (tenant, session) = (&live.row.tenant, &live.row.session);
        let policy = self.sessions.policies.policy(tenant, &live.current.policy).await?;
        let Large { value: facts, room: _room } = self.sessions.facts(tenant, session).await?;
        let standing = live.standing.clone();
        let at = (renew, live.step());
        let specify = move || next_problem(&policy, &standing, &facts, at);
        let posed = self.sessions.resolving.run(tenant, specify).await??;
        let request = request(live, attempts.number, attempts.count);
        let parent = self.store.labels(tenant, &live.current.policy).await?;
        let labels = next_labels(&parent.name, self.clock.now_milliseconds());
        Ok(match self.jobs.train_for_session(tenant, posed, labels, request).await? {
            SessionTraining::Job(row) => {
                let (job, renewal) = (row.job, attempts.number);
                tracing::info!(session, job, renewal, "training the next policy of a session");
                Left::Job(job)
            }
            SessionTraining::Later => Left::Room,
            SessionTraining::Obsolete => Left::Nothing,
        })
    }
}

/// Returns the delay before the attempt after `count` attempts.
fn delay_ms(count: usize) -> i64 {
    let doublings = u32::try_from(count.saturating_sub(1)).unwrap_or(u32::MAX).min(20);
    let delay = FIRST_DELAY.saturating_mul(1 << doublings).min(LONGEST_DELAY);
    i64::try_from(delay.as_millis()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attempts_follow_each_other_ever_more_slowly_up_to_a_day() {
        let minutes: Vec<i64> = [1, 2, 3, 11, 12, 1_000].into_iter().map(|count| delay_ms(count) / 60_000).collect();
        assert_eq!(minutes, [1, 2, 4, 1_024, 1_440, 1_440]);
    }
}
