//! Why a key is not accepted.

use crate::store::Tenant;

/// Why a caller is rejected. The text of the key is not repeated.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Rejected {
    /// No key was given.
    NoKey,
    /// The key is not in force.
    WrongKey {
        /// Tenant of the key until it was revoked; for operators only.
        of: Option<Tenant>,
    },
    /// The key expired at that time. Only callers with its text learn this.
    Expired { of: Tenant, expires_ms: i64 },
}

impl Rejected {
    /// Builds the rejection of an ended key of the tenant.
    pub(super) fn of(tenant: &Tenant, expires_ms: Option<i64>, is_revoked: bool) -> Self {
        match expires_ms.filter(|_| !is_revoked) {
            Some(expires_ms) => Rejected::Expired { of: tenant.clone(), expires_ms },
            None => Rejected::WrongKey { of: Some(tenant.clone()) },
        }
    }
}
