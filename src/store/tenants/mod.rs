//! Who owns what is stored: tenants, their keys and quotas, and the audit.

pub(super) mod audit;
pub(super) mod audit_chain;
pub(super) mod key_mark;
pub(super) mod keys;
pub(super) mod quotas;
pub(super) mod tenant;
