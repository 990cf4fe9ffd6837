//! Reads the rows of a session, within the memory that other large answers leave, and replays the session from them.

use crate::service::error::ServiceError;
use crate::service::process::memory::Large;
use crate::service::sessions::Sessions;
use crate::service::sessions::live::LiveSession;
use crate::service::sessions::slots::Source;
use crate::store::{SessionFacts, Tenant};

/// Entries that can be replayed in a few milliseconds.
const PROMPT_ENTRIES: usize = 520;
/// Initial log-returns that double the replay time of each entry.
const RETURNS_AN_ENTRY: usize = 2000;
/// Entries are held both as rows and as what is read from them.
const FORMS_OF_ENTRIES: usize = 2;

impl Sessions {
    pub(in crate::service) fn rows<'a>(&'a self, tenant: &'a Tenant, session: &'a str) -> SessionRows<'a> {
        SessionRows { sessions: self, tenant, session }
    }

    /// Runs short work at once. Runs long work in the tenant's queue, apart from the runtime's threads.
    ///
    /// # Errors
    /// No permit came in time.
    pub(in crate::service) async fn apart<T: Send + 'static>(
        &self,
        tenant: &Tenant,
        is_long: bool,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        match is_long {
            true => self.advising.run(tenant, work).await,
            false => Ok(work()),
        }
    }

    /// Reads a session and its entries once other large answers leave room for them. The room is held as long as they
    /// are.
    ///
    /// # Errors
    /// There is no such session, or there is no room in time.
    pub(in crate::service) async fn facts(
        &self,
        tenant: &Tenant,
        session: &str,
    ) -> Result<Large<SessionFacts>, ServiceError> {
        let room = self.memory.answers(FORMS_OF_ENTRIES * self.store.entry_bytes(session).await?).await?;
        let facts = self.store.session_facts(tenant, session).await?;
        Ok(Large { value: facts.ok_or_else(|| ServiceError::unknown("session", session))?, room })
    }
}

/// The rows of a tenant's session.
pub(in crate::service) struct SessionRows<'a> {
    sessions: &'a Sessions,
    tenant: &'a Tenant,
    session: &'a str,
}

impl Source<LiveSession> for SessionRows<'_> {
    type Error = ServiceError;

    async fn is_current(&self, live: &mut LiveSession) -> Result<bool, ServiceError> {
        Ok(self.sessions.store.is_as_seen(self.session, &mut live.seen).await?)
    }

    async fn read(&self) -> Result<LiveSession, ServiceError> {
        let Large { value: facts, room } = self.sessions.facts(self.tenant, self.session).await?;
        let is_prompt =
            facts.entries.len() * (1 + facts.row.initial_history.len() / RETURNS_AN_ENTRY) <= PROMPT_ENTRIES;
        let live = self.sessions.apart(self.tenant, !is_prompt, move || LiveSession::replayed(facts)).await??;
        drop(room);
        self.sessions.weigh(&live);
        Ok(live)
    }
}
