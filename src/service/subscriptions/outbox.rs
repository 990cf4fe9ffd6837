//! The tenants whose advice is followed, and the signal that an event was stored.
//!
//! Comparing the advice before and after a report costs an advice, so it is done only for tenants that subscribed to it.
//! The list is read again with every look for deliveries. A process therefore compares the advice for a subscription
//! that another process made once its next look is over.

use std::collections::HashSet;
use std::sync::{Arc, PoisonError, RwLock};

use tokio::sync::Notify;

use crate::store::{EventKind, Store, StoreError, Tenant};

/// The events that need the advice after a report.
const OF_ADVICE: [EventKind; 2] = [EventKind::AdviceChanged, EventKind::LeftBand];

/// Clones share the list and the signal.
#[derive(Clone, Default)]
pub struct Outbox {
    followed: Arc<RwLock<HashSet<Tenant>>>,
    stored: Arc<Notify>,
}

impl Outbox {
    /// Returns whether a subscription of the tenant asks for events about advice.
    pub(in crate::service) fn is_followed(&self, tenant: &Tenant) -> bool {
        self.followed.read().unwrap_or_else(PoisonError::into_inner).contains(tenant)
    }

    /// Reads the list again.
    pub(in crate::service) async fn refresh(&self, store: &Store) -> Result<(), StoreError> {
        let tenants = store.subscribed(OF_ADVICE).await?.into_iter().collect();
        *self.followed.write().unwrap_or_else(PoisonError::into_inner) = tenants;
        Ok(())
    }

    /// Signals that an event was stored, so that it is sent at once.
    pub(in crate::service) fn ring(&self) {
        self.stored.notify_one();
    }

    /// Waits for the signal.
    pub(super) async fn rung(&self) {
        self.stored.notified().await;
    }
}
