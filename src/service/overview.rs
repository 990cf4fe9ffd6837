//! Sessions as an overview shows them.

use super::answer::Stands;
use super::content::read;
use super::error::ServiceError;
use super::sessions::Sessions;
use crate::store::{SessionList, SessionQuery, SessionSummary, Tenant};

/// A session of a list, and where it stands by its last entry.
#[derive(Debug)]
pub struct Listed {
    pub row: SessionSummary,
    /// `None` before the first report.
    pub stands: Option<Stands>,
}

/// A page of sessions, and how many match in all.
#[derive(Debug)]
pub struct Overview {
    pub sessions: Vec<Listed>,
    pub total: usize,
}

impl Sessions {
    /// Sessions of a tenant as they are asked for.
    ///
    /// # Errors
    /// The store does not answer.
    pub async fn list(&self, tenant: &Tenant, asked: &SessionQuery) -> Result<Overview, ServiceError> {
        let SessionList { sessions, total } = self.store.sessions(tenant, asked).await?;
        let listed = |row: SessionSummary| {
            let stands = row.last.as_ref().map(|(answer, _)| read(answer)).transpose()?;
            Ok(Listed { row, stands })
        };
        Ok(Overview { sessions: sessions.into_iter().map(listed).collect::<Result<_, ServiceError>>()?, total })
    }
}
