//! Lists, imports and prepares policies.

use std::sync::Arc;

use tokio::sync::Semaphore;

use crate::control::cache::{Cache, Key};
use crate::control::error::FieldError;
use crate::control::estimate::Footprint;
use crate::control::policy::advisor::Advisor;
use crate::control::policy::content_hash;
use crate::control::policy::declared::DeclaredAdvisor;
use crate::control::policy::one_period::OnePeriod;
use crate::control::policy_document::{PolicyDocument, PreparedPolicy};
use crate::control::request::specification::Specification;
use crate::service::callers::fair_queue::FairQueue;
use crate::service::callers::keys::Caller;
use crate::service::error::ServiceError;
use crate::service::process::memory::{Large, Memory};
use crate::store::{DeletePolicy, PolicyRow, PolicySummary, Store, Stored, Tenant};

/// Policies read and prepared concurrently: a document takes several times its bytes while it is read.
const PREPARED_AT_A_TIME: usize = 2;

/// The policies of the store.
pub struct Policies {
    store: Store,
    memory: Memory,
    kept: Cache,
    preparing: Semaphore,
    /// The queue for checking imported documents.
    decoding: FairQueue,
}

impl Policies {
    pub(in crate::service) fn new(store: Store, memory: Memory, decoding: FairQueue) -> Self {
        let kept = memory.kept();
        Policies { store, memory, kept, preparing: Semaphore::new(PREPARED_AT_A_TIME), decoding }
    }

    async fn get(&self, tenant: &Tenant, policy: &str) -> Result<PolicyRow, ServiceError> {
        self.store.policy(tenant, policy).await?.ok_or_else(|| ServiceError::unknown("policy", policy))
    }

    /// Returns when the tenant got the policy.
    ///
    /// # Errors
    /// There is no such policy.
    pub async fn created_ms(&self, tenant: &Tenant, policy: &str) -> Result<i64, ServiceError> {
        Ok(self.stored(tenant, policy).await?.created_ms)
    }

    /// Returns the portable document.
    ///
    /// # Errors
    /// There is no such policy, or other large answers leave no room for it.
    pub async fn document(&self, tenant: &Tenant, policy: &str) -> Result<Large<Vec<u8>>, ServiceError> {
        let room = self.memory.answers(self.stored(tenant, policy).await?.bytes).await?;
        let row = self.store.policy_to_send(tenant, policy).await?;
        let row = row.ok_or_else(|| ServiceError::unknown("policy", policy))?;
        Ok(Large { value: row.json, room })
    }

    async fn stored(&self, tenant: &Tenant, policy: &str) -> Result<Stored, ServiceError> {
        self.store.policy_stored(tenant, policy).await?.ok_or_else(|| ServiceError::unknown("policy", policy))
    }

    /// Returns the policy, prepared for evaluation. Callers drop it after their answer: the cache decides what is kept.
    ///
    /// # Errors
    /// There is no such policy, or it cannot be prepared.
    pub async fn prepared(&self, tenant: &Tenant, policy: &str) -> Result<Arc<PreparedPolicy>, ServiceError> {
        self.kept.get_or_prepare(&key(tenant, policy), PreparedPolicy::bytes, self.read(tenant, policy)).await
    }

    /// Returns the policy of either kind, prepared as above.
    ///
    /// # Errors
    /// As above.
    pub async fn policy(&self, tenant: &Tenant, policy: &str) -> Result<PreparedPolicy, ServiceError> {
        Ok(PreparedPolicy::clone(&*self.prepared(tenant, policy).await?))
    }

    /// Returns the policy of an investor, prepared as above.
    ///
    /// # Errors
    /// As above, or the policy is of a declared problem.
    pub async fn advisor(&self, tenant: &Tenant, policy: &str) -> Result<Arc<Advisor>, ServiceError> {
        match &*self.prepared(tenant, policy).await? {
            PreparedPolicy::Investor(advisor) => Ok(advisor.clone()),
            PreparedPolicy::Declared(_) => {
                let rule = "must be of an investor's problem; this one is of a declared problem";
                Err(FieldError::new("policy", policy, rule).into())
            }
        }
    }

    /// Returns the policy of a declared problem, prepared as above.
    ///
    /// # Errors
    /// As above, or the policy is of an investor.
    pub async fn decider(&self, tenant: &Tenant, policy: &str) -> Result<Arc<DeclaredAdvisor>, ServiceError> {
        match &*self.prepared(tenant, policy).await? {
            PreparedPolicy::Declared(advisor) => Ok(advisor.clone()),
            PreparedPolicy::Investor(_) => {
                let rule = "must be of a declared problem; this one is of an investor";
                Err(FieldError::new("policy", policy, rule).into())
            }
        }
    }

    async fn read(&self, tenant: &Tenant, policy: &str) -> Result<PreparedPolicy, ServiceError> {
        let _turn = self.preparing.acquire().await.map_err(ServiceError::internal)?;
        let row = self.get(tenant, policy).await?;
        let kept = self.kept.clone();
        let prepared = tokio::task::spawn_blocking(move || {
            let document = PolicyDocument::from_json(&row.json).map_err(ServiceError::internal)?;
            document.prepared(kept).map_err(ServiceError::internal)
        });
        // The stored document was checked before, so a fault in it is not the caller's.
        prepared.await.map_err(ServiceError::internal)?
    }

    /// Checks that sessions of so many periods with a policy can start from so many returns.
    ///
    /// # Errors
    /// The bridges that they need are too large to be kept ready.
    pub(in crate::service) fn starts_from(
        &self,
        advisor: &Advisor,
        returns: usize,
        periods: usize,
    ) -> Result<(), FieldError> {
        self.memory.keeps(&[Footprint::of("history", returns, advisor.laws().radii.heaviest(returns, periods))])
    }

    /// Returns the one-period problem of a completed specification.
    ///
    /// # Errors
    /// The bridges for its radius are too large to be kept ready.
    pub(in crate::service) fn one_period(&self, specification: &Specification) -> Result<OnePeriod, FieldError> {
        let investor = OnePeriod::new(specification, self.kept.clone());
        let returns = specification.problem.history.len();
        self.memory.keeps(&[Footprint::of("problem.history", returns, investor.bridges())])?;
        Ok(investor)
    }

    /// Returns the cache of recomputable results, if it has room for what the radius of `specification` needs.
    ///
    /// # Errors
    /// As [`Self::one_period`].
    pub(in crate::service) fn kept_for(&self, specification: &Specification) -> Result<Cache, FieldError> {
        self.one_period(specification).map(|_| self.kept.clone())
    }

    /// Lists at most `limit` policies, newest first, after the policy with sequence `after`.
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
    /// The document is not a usable policy, or needs more memory than can be kept ready.
    pub async fn import(&self, caller: &Caller, document: PolicyDocument) -> Result<String, ServiceError> {
        let memory = self.memory.clone();
        let check = move || {
            let (document, bytes) = document.checked()?;
            memory.keeps(&bytes)?;
            document.to_json().map_err(ServiceError::internal)
        };
        let json = self.decoding.run(&caller.tenant, check).await??;
        let policy = content_hash(&json);
        let actor = caller.actor();
        let imported_ms = actor.at_ms;
        self.store.by(actor).insert_policy(&caller.tenant, &policy, &json, imported_ms).await?;
        Ok(policy)
    }

    /// Deletes a policy.
    ///
    /// # Errors
    /// There is no such policy, or sessions use it.
    pub async fn delete(&self, caller: &Caller, policy: &str) -> Result<(), ServiceError> {
        let tenant = &caller.tenant;
        match self.store.by(caller.actor()).delete_policy(tenant, policy).await? {
            DeletePolicy::Deleted => {
                self.kept.forget(&key(tenant, policy));
                Ok(())
            }
            DeletePolicy::Absent => Err(ServiceError::unknown("policy", policy)),
            DeletePolicy::InUse { sessions } => Err(ServiceError::PolicyInUse { policy: policy.to_owned(), sessions }),
        }
    }
}

/// Returns the cache key. Policies in the cache were read from the store for that tenant.
fn key(tenant: &Tenant, policy: &str) -> Key {
    Key::Policy(format!("{tenant}/{policy}").into())
}
