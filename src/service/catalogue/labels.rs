//! The labels of policies and sessions, and how to change them.

use crate::service::callers::keys::Caller;
use crate::service::error::ServiceError;
use crate::store::{Labelled, Labels, Relabel, Store, Tenant};

/// The labels of the store.
pub struct Names {
    store: Store,
}

impl Names {
    pub(in crate::service) fn new(store: Store) -> Self {
        Names { store }
    }

    /// Returns the labels of a policy or a session.
    ///
    /// # Errors
    /// The store does not answer.
    pub async fn of(&self, tenant: &Tenant, object: &str) -> Result<Labels, ServiceError> {
        Ok(self.store.labels(tenant, object).await?)
    }

    /// Changes the labels of a policy or a session, and returns the new ones.
    ///
    /// # Errors
    /// A field breaks a rule, there is no such object, or the tenant's quota of bytes is used up.
    pub async fn change(
        &self,
        caller: &Caller,
        kind: Labelled,
        object: &str,
        change: Relabel,
    ) -> Result<Labels, ServiceError> {
        change.check()?;
        let what = match kind {
            Labelled::Policy => "policy",
            Labelled::Session => "session",
        };
        let changed = self.store.by(caller.actor()).relabel(&caller.tenant, kind, object, change).await?;
        changed.ok_or_else(|| ServiceError::unknown(what, object))
    }
}
