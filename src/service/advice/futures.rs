//! The futures of a policy from its start or from the state of a session. Nothing is stored.

use std::sync::Arc;

use crate::control::error::FieldError;
use crate::control::policy::advisor::Advisor;
use crate::control::policy::futures::declared::DeclaredPlayer;
use crate::control::policy::futures::investor::InvestorPlayer;
use crate::control::policy::futures::{Futures, GamePlayer, Opening, PlayedPath, World, checked_paths};
use crate::control::policy_document::PreparedPolicy;
use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::service::sessions::session_state::SessionState;
use crate::store::Tenant;

/// Bytes of a figure of a played path, with its part of the answer.
const FIGURE_BYTES: usize = 100;

/// Periods that are played under one permit: a robust step of each takes about a millisecond.
const PERIODS_A_TURN: usize = 100;

/// Checks that futures end with what counts.
fn check_futures(advisor: &Advisor) -> Result<(), FieldError> {
    let why = "futures end with terminal wealth; a plan shows spending";
    advisor.specification().problem.check_without_spending(why)
}

impl Sessions {
    /// Returns the futures of a policy from its start.
    ///
    /// # Errors
    /// There is no such policy, `paths` breaks a rule, a state leaves its range, or too much work waits already.
    pub async fn futures_of_policy(
        &self,
        tenant: &Tenant,
        policy: &str,
        paths: Option<usize>,
    ) -> Result<Large<Futures>, ServiceError> {
        match self.policies.policy(tenant, policy).await? {
            PreparedPolicy::Investor(advisor) => {
                check_futures(&advisor)?;
                let start = advisor.initial_state(None, None)?;
                self.played(tenant, InvestorPlayer::opening(advisor, 0, start), paths).await
            }
            PreparedPolicy::Declared(advisor) => {
                let start = advisor.problem().start();
                self.played(tenant, DeclaredPlayer::opening(advisor, 0, start, Vec::new()), paths).await
            }
        }
    }

    /// Returns the futures of a session from its coming period to the last one that its policy decides.
    ///
    /// # Errors
    /// There is no such session or it has reached its horizon, and those of [`Self::futures_of_policy`].
    pub async fn futures_of_session(
        &self,
        tenant: &Tenant,
        session: &str,
        paths: Option<usize>,
    ) -> Result<Large<Futures>, ServiceError> {
        let live = self.get(tenant, session).await?;
        live.check_active()?;
        let step = live.step();
        let mut futures = match &live.standing {
            SessionState::Account(account) => {
                let advisor = self.advisor(tenant, &live).await?;
                check_futures(&advisor)?;
                self.played(tenant, InvestorPlayer::opening(advisor, step, account.state.clone()), paths).await?
            }
            SessionState::Declared(at) => {
                let advisor = self.policies.decider(tenant, &live.current.policy).await?;
                let opening = DeclaredPlayer::opening(advisor, step, at.state.clone(), at.seen.clone());
                self.played(tenant, opening, paths).await?
            }
        };
        futures.value.period = live.observed + 1;
        Ok(futures)
    }

    /// Plays both worlds. Some paths at a time wait for a permit, so that a long question starves nobody and a
    /// disconnected caller stops it.
    async fn played<P: GamePlayer + 'static>(
        &self,
        tenant: &Tenant,
        opening: Opening<P>,
        paths: Option<usize>,
    ) -> Result<Large<Futures>, ServiceError> {
        let periods = opening.player.horizon() - opening.step;
        let paths = checked_paths(paths, periods)?;
        let room = self.memory.answers(2 * paths * (periods + 1) * opening.player.names().len() * FIGURE_BYTES).await?;
        let opening = Arc::new(opening);
        let begun = opening.clone();
        let first = Arc::new(self.resolving.run(tenant, move || begun.first()).await??);
        let mut worlds = [World::Worst, World::Record].map(|world| (world, Vec::with_capacity(paths)));
        for (world, played) in &mut worlds {
            let (world, together) = (*world, (PERIODS_A_TURN / periods).max(1));
            while played.len() < paths {
                let some = played.len()..(played.len() + together).min(paths);
                let (opening, first) = (opening.clone(), first.clone());
                let play = move || some.map(|path| opening.path(&first, world, path)).collect();
                let found: Result<Vec<PlayedPath>, FieldError> = self.resolving.run(tenant, play).await?;
                played.extend(found?);
            }
        }
        let [(_, worst), (_, record)] = worlds;
        let report = self.resolving.run(tenant, move || opening.report(&first, &worst, &record)).await?;
        Ok(Large { value: report, room })
    }
}
