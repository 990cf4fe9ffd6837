//! Policies: listed, imported, and made ready to answer.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::clock::Clock;
use super::error::ServiceError;
use crate::control::advisor::Advisor;
use crate::control::policy::{Policy, content_hash};
use crate::store::{DeletePolicy, PolicyRow, PolicySummary, Store};

/// Policies kept ready; one of 1000 design points and 10 steps takes some tens of megabytes.
const KEPT_READY: usize = 16;

/// The policies of the store.
pub struct Policies {
    store: Store,
    clock: Clock,
    ready: Mutex<HashMap<String, Arc<Advisor>>>,
}

impl Policies {
    pub(super) fn new(store: Store, clock: Clock) -> Self {
        Policies { store, clock, ready: Mutex::new(HashMap::new()) }
    }

    /// # Errors
    /// There is no such policy.
    pub async fn get(&self, policy: &str) -> Result<PolicyRow, ServiceError> {
        self.store.policy(policy).await?.ok_or_else(|| ServiceError::unknown("policy", policy))
    }

    /// The policy with what its evaluation needs prepared.
    ///
    /// # Errors
    /// There is no such policy, or it cannot be prepared.
    pub async fn advisor(&self, policy: &str) -> Result<Arc<Advisor>, ServiceError> {
        if let Some(advisor) = self.lock().get(policy) {
            return Ok(advisor.clone());
        }
        let row = self.get(policy).await?;
        let prepared = tokio::task::spawn_blocking(move || Policy::from_json(&row.json).map(Advisor::new));
        // What was stored was checked: a fault in it is not the caller's.
        let advisor = prepared.await.map_err(ServiceError::internal)?.map_err(ServiceError::internal)?;
        let advisor = Arc::new(advisor);
        let mut ready = self.lock();
        if ready.len() >= KEPT_READY {
            // Live sessions hold their own reference, so dropping any entry costs at most one more preparation.
            let evicted = ready.keys().next().cloned();
            evicted.and_then(|policy| ready.remove(&policy));
        }
        ready.insert(policy.to_owned(), advisor.clone());
        Ok(advisor)
    }

    /// At most `limit` policies, newest first, after the policy with sequence `after`.
    ///
    /// # Errors
    /// The store does not answer.
    pub async fn list(&self, limit: usize, after: Option<i64>) -> Result<Vec<PolicySummary>, ServiceError> {
        Ok(self.store.policies(limit, after).await?)
    }

    /// Checks a document as hostile input and stores it in canonical form; returns its name.
    ///
    /// # Errors
    /// The document is not a usable policy.
    pub async fn import(&self, document: Policy) -> Result<String, ServiceError> {
        let checked = tokio::task::spawn_blocking(move || document.checked().map(|policy| policy.to_json()));
        let json = checked.await.map_err(ServiceError::internal)??;
        let policy = content_hash(&json);
        self.store.insert_policy(&policy, &json, self.clock.now_milliseconds()).await?;
        Ok(policy)
    }

    /// # Errors
    /// There is no such policy, or sessions live by it.
    pub async fn delete(&self, policy: &str) -> Result<(), ServiceError> {
        match self.store.delete_policy(policy).await? {
            DeletePolicy::Deleted => {
                self.lock().remove(policy);
                Ok(())
            }
            DeletePolicy::Absent => Err(ServiceError::unknown("policy", policy)),
            DeletePolicy::InUse { sessions } => Err(ServiceError::PolicyInUse { policy: policy.to_owned(), sessions }),
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<String, Arc<Advisor>>> {
        // No code panics while holding the lock.
        self.ready.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
