//! Policies: listed, imported, and made ready to answer.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::clock::Clock;
use super::error::ServiceError;
use crate::control::advisor::Advisor;
use crate::control::policy::{Policy, content_hash};
use crate::store::{DeletePolicy, PolicyRow, PolicySummary, Store, Tenant};

/// Policies kept ready; one of 1000 design points and 10 steps takes some tens of megabytes.
const KEPT_READY: usize = 16;

/// The policies of the store.
pub struct Policies {
    store: Store,
    clock: Clock,
    /// By owner and name: what is here was looked up in the store for that tenant.
    ready: Mutex<HashMap<(Tenant, String), Arc<Advisor>>>,
}

impl Policies {
    pub(super) fn new(store: Store, clock: Clock) -> Self {
        Policies { store, clock, ready: Mutex::new(HashMap::new()) }
    }

    /// # Errors
    /// There is no such policy.
    pub async fn get(&self, tenant: &Tenant, policy: &str) -> Result<PolicyRow, ServiceError> {
        self.store.policy(tenant, policy).await?.ok_or_else(|| ServiceError::unknown("policy", policy))
    }

    /// The policy with what its evaluation needs prepared.
    ///
    /// # Errors
    /// There is no such policy, or it cannot be prepared.
    pub async fn advisor(&self, tenant: &Tenant, policy: &str) -> Result<Arc<Advisor>, ServiceError> {
        let name = (tenant.clone(), policy.to_owned());
        if let Some(advisor) = self.lock().get(&name) {
            return Ok(advisor.clone());
        }
        let row = self.get(tenant, policy).await?;
        // Equal names are equal policies, whoever had it prepared.
        let prepared = self.lock().iter().find(|((_, ready), _)| ready == policy).map(|(_, advisor)| advisor.clone());
        let advisor = match prepared {
            Some(advisor) => advisor,
            None => Arc::new(prepare(row).await?),
        };
        let mut ready = self.lock();
        if ready.len() >= KEPT_READY {
            // Live sessions hold their own reference, so dropping any entry costs at most one more preparation.
            let evicted = ready.keys().next().cloned();
            evicted.and_then(|name| ready.remove(&name));
        }
        ready.insert(name, advisor.clone());
        Ok(advisor)
    }

    /// At most `limit` policies, newest first, after the policy with sequence `after`.
    ///
    /// # Errors
    /// The store does not answer.
    pub async fn list(
        &self,
        tenant: &Tenant,
        limit: usize,
        after: Option<i64>,
    ) -> Result<Vec<PolicySummary>, ServiceError> {
        Ok(self.store.policies(tenant, limit, after).await?)
    }

    /// Checks a document as hostile input and stores it in canonical form; returns its name.
    ///
    /// # Errors
    /// The document is not a usable policy.
    pub async fn import(&self, tenant: &Tenant, document: Policy) -> Result<String, ServiceError> {
        let checked = tokio::task::spawn_blocking(move || document.checked().map(|policy| policy.to_json()));
        let json = checked.await.map_err(ServiceError::internal)??;
        let policy = content_hash(&json);
        self.store.insert_policy(tenant, &policy, &json, self.clock.now_milliseconds()).await?;
        Ok(policy)
    }

    /// # Errors
    /// There is no such policy, or sessions live by it.
    pub async fn delete(&self, tenant: &Tenant, policy: &str) -> Result<(), ServiceError> {
        match self.store.delete_policy(tenant, policy).await? {
            DeletePolicy::Deleted => {
                self.lock().remove(&(tenant.clone(), policy.to_owned()));
                Ok(())
            }
            DeletePolicy::Absent => Err(ServiceError::unknown("policy", policy)),
            DeletePolicy::InUse { sessions } => Err(ServiceError::PolicyInUse { policy: policy.to_owned(), sessions }),
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<(Tenant, String), Arc<Advisor>>> {
        // No code panics while holding the lock.
        self.ready.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

async fn prepare(row: PolicyRow) -> Result<Advisor, ServiceError> {
    let prepared = tokio::task::spawn_blocking(move || Policy::from_json(&row.json).map(Advisor::new));
    // What was stored was checked: a fault in it is not the caller's.
    prepared.await.map_err(ServiceError::internal)?.map_err(ServiceError::internal)
}
