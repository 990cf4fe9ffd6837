//! Who is calling: keys as their holders show them, and what each may do.
//!
//! A store without a key answers everybody as the default tenant. From its first key on it answers holders of keys alone,
//! for good: revoking the last one closes the door, it does not take it off its hinges.
//!
//! A request costs one hash and one look into memory. The store is asked every [`REFRESH`] instead, so a key made or
//! revoked beside this process, or on another replica, counts within that time. While the store does not answer, what was
//! known last holds; nothing else that needs the store answers then either.

use std::collections::HashMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use rand::TryRng;
use rand::rngs::SysRng;
use sha2::{Digest, Sha256};

use super::allowance::{Allowance, Limits};
use super::clock::Clock;
use super::error::ServiceError;
use super::identity;
use super::shutdown::Shutdown;
use crate::store::{KeyRing, KeyRole, KeyRoles, KeyRow, NewKey, Store, StoreError, Tenant};

/// A key made or revoked elsewhere counts within this time.
pub const REFRESH: Duration = Duration::from_millis(500);
/// What a key starts with, so that people and scanners of repositories know one when they see it.
pub const PREFIX: &str = "ballast_";

/// The text of a key, 256 random bits; shown once, printed by nothing else.
pub struct Secret(String);

impl Secret {
    /// # Errors
    /// The operating system gives no random bits.
    pub fn new() -> Result<Self, ServiceError> {
        let mut bits = [0u8; 32];
        SysRng.try_fill_bytes(&mut bits).map_err(|error| ServiceError::Internal(format!("no random bits: {error}")))?;
        let digits: String = bits.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Secret(format!("{PREFIX}{digits}")))
    }

    /// The text, to be shown to its new holder.
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Secret(..)")
    }
}

fn hash(text: &str) -> [u8; 32] {
    Sha256::digest(text).into()
}

/// Makes a key for a tenant; its name, and its text, which is nowhere else.
///
/// # Errors
/// The store does not take it, or there are no random bits.
pub async fn issue(
    ring: &KeyRing,
    tenant: Tenant,
    roles: KeyRoles,
    clock: &Clock,
) -> Result<(String, Secret), ServiceError> {
    let (key, secret) = (identity::new_id("key")?, Secret::new()?);
    let created_ms = clock.now_milliseconds();
    ring.create(NewKey { key: key.clone(), hash: hash(secret.reveal()), tenant, roles, created_ms }).await?;
    Ok((key, secret))
}

/// Who a request is answered to.
#[derive(Debug)]
pub struct Caller {
    pub tenant: Tenant,
    /// `None` where no key is asked for: everything is allowed.
    key: Option<KeyRow>,
    /// Shared by everybody of the tenant.
    pub allowance: Arc<Allowance>,
    revoked: AtomicBool,
}

impl Caller {
    fn new(tenant: Tenant, key: Option<KeyRow>, allowance: Arc<Allowance>) -> Arc<Self> {
        Arc::new(Caller { tenant, key, allowance, revoked: AtomicBool::new(false) })
    }

    pub fn may(&self, role: KeyRole) -> bool {
        self.key.as_ref().is_none_or(|key| key.roles.include(role))
    }

    /// The roles of the key, as text.
    pub fn roles(&self) -> String {
        self.key.as_ref().map_or(String::new(), |key| key.roles.to_string())
    }

    /// Whether it would be turned away by now: what goes on for long asks again.
    pub fn is_revoked(&self) -> bool {
        self.revoked.load(Ordering::Relaxed)
    }
}

/// Why nobody is admitted. What was shown is not repeated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turned {
    /// No key was shown.
    NoKey,
    /// None that is in force.
    WrongKey,
}

/// The keys in force, as of the last look into the store.
pub struct Keys {
    store: Store,
    limits: Limits,
    known: RwLock<Known>,
}

struct Known {
    /// Answers everybody; `None` from the first key on.
    anybody: Option<Arc<Caller>>,
    /// By the first eight bytes of the hash, which need not be compared in constant time to tell keys apart.
    by_hash: HashMap<[u8; 8], Arc<Caller>>,
    allowances: HashMap<Tenant, Arc<Allowance>>,
}

impl Keys {
    pub(super) async fn load(store: Store, limits: Limits) -> Result<Self, StoreError> {
        let allowance = Arc::new(Allowance::new(&limits));
        let anybody = Caller::new(Tenant::default(), None, allowance.clone());
        let allowances = HashMap::from([(Tenant::default(), allowance)]);
        let known = Known { anybody: Some(anybody), by_hash: HashMap::new(), allowances };
        let keys = Keys { store, limits, known: RwLock::new(known) };
        keys.refresh().await?;
        Ok(keys)
    }

    /// Whether requests are answered without a key.
    pub fn are_absent(&self) -> bool {
        self.read().anybody.is_some()
    }

    /// Who shows `text`, the part of an `Authorization: Bearer` after the scheme.
    ///
    /// # Errors
    /// A key is asked for, and this is none.
    pub fn admit(&self, text: Option<&str>) -> Result<Arc<Caller>, Turned> {
        let known = self.read();
        if let Some(anybody) = &known.anybody {
            return Ok(anybody.clone());
        }
        let shown = hash(text.ok_or(Turned::NoKey)?);
        let found = known.by_hash.get(&start(&shown)).ok_or(Turned::WrongKey)?;
        let stored = found.key.as_ref().ok_or(Turned::WrongKey)?.hash;
        if is_equal(&stored, &shown) { Ok(found.clone()) } else { Err(Turned::WrongKey) }
    }

    /// Looks into the store.
    pub(super) async fn refresh(&self) -> Result<(), StoreError> {
        let rows = self.store.keys().await?;
        self.known.write().unwrap_or_else(PoisonError::into_inner).become_those(rows, &self.limits);
        Ok(())
    }

    fn read(&self) -> std::sync::RwLockReadGuard<'_, Known> {
        // No code panics while holding the lock.
        self.known.read().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Known {
    fn become_those(&mut self, rows: Vec<KeyRow>, limits: &Limits) {
        if !rows.is_empty()
            && let Some(anybody) = self.anybody.take()
        {
            anybody.revoked.store(true, Ordering::Relaxed);
        }
        let mut before = std::mem::take(&mut self.by_hash);
        for row in rows.into_iter().filter(|row| row.revoked_ms.is_none()) {
            let start = start(&row.hash);
            let kept = before.remove(&start).filter(|caller| caller.key.as_ref() == Some(&row));
            let caller = kept.unwrap_or_else(|| {
                let allowance = self.allowances.entry(row.tenant.clone());
                let allowance = allowance.or_insert_with(|| Arc::new(Allowance::new(limits))).clone();
                Caller::new(row.tenant.clone(), Some(row), allowance)
            });
            self.by_hash.insert(start, caller);
        }
        for gone in before.into_values() {
            gone.revoked.store(true, Ordering::Relaxed);
        }
    }
}

/// Refreshes until the shutdown begins.
pub(super) async fn keep_fresh(keys: Arc<Keys>, shutdown: Shutdown) {
    loop {
        tokio::select! {
            () = shutdown.begun() => return,
            () = tokio::time::sleep(REFRESH) => {}
        }
        if let Err(error) = keys.refresh().await {
            tracing::warn!(error = &error as &dyn std::error::Error, "the keys known last stay in force");
        }
    }
}

fn start(hash: &[u8; 32]) -> [u8; 8] {
    std::array::from_fn(|index| hash[index])
}

/// Takes the same time wherever the two differ.
fn is_equal(one: &[u8; 32], other: &[u8; 32]) -> bool {
    std::hint::black_box(one.iter().zip(other).fold(0, |difference, (a, b)| difference | (a ^ b))) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(text: &str, tenant: &str, revoked_ms: Option<i64>) -> KeyRow {
        KeyRow {
            key: format!("key_of_{text}"),
            hash: hash(text),
            tenant: tenant.parse().unwrap(),
            roles: "read".parse().unwrap(),
            created_ms: 0,
            revoked_ms,
        }
    }

    async fn keys() -> (tempfile::TempDir, Keys) {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).await.unwrap();
        (folder, Keys::load(store, Limits::default()).await.unwrap())
    }

    fn known(keys: &Keys, rows: Vec<KeyRow>) {
        keys.known.write().unwrap().become_those(rows, &keys.limits);
    }

    #[test]
    fn a_secret_is_256_bits_behind_its_prefix_and_does_not_print() {
        let (one, other) = (Secret::new().unwrap(), Secret::new().unwrap());
        let digits = one.reveal().strip_prefix(PREFIX).unwrap();
        assert!(digits.len() == 64 && digits.chars().all(|digit| digit.is_ascii_hexdigit()));
        assert_ne!(one.reveal(), other.reveal());
        assert!(!format!("{one:?}").contains(digits));
    }

    #[test]
    fn hashes_are_equal_where_every_bit_is() {
        let hash = hash("key");
        assert!(is_equal(&hash, &hash));
        for bit in 0..256 {
            let mut other = hash;
            other[bit / 8] ^= 1 << (bit % 8);
            assert!(!is_equal(&hash, &other), "bit {bit}");
        }
    }

    #[tokio::test]
    async fn the_first_key_closes_the_door_for_good() {
        let (_folder, keys) = keys().await;
        let anybody = keys.admit(None).unwrap();
        assert!(anybody.tenant.is_default() && anybody.may(KeyRole::Admin) && !anybody.is_revoked());
        known(&keys, vec![row("a", "north", None)]);
        assert!(anybody.is_revoked());
        assert_eq!(keys.admit(None).unwrap_err(), Turned::NoKey);
        assert_eq!(keys.admit(Some("b")).unwrap_err(), Turned::WrongKey);
        let holder = keys.admit(Some("a")).unwrap();
        assert!(holder.may(KeyRole::Read) && !holder.may(KeyRole::Train) && !holder.is_revoked());
        known(&keys, vec![row("a", "north", Some(1))]);
        assert!(holder.is_revoked());
        assert_eq!(keys.admit(Some("a")).unwrap_err(), Turned::WrongKey);
        assert_eq!(keys.admit(None).unwrap_err(), Turned::NoKey);
    }

    #[tokio::test]
    async fn a_refresh_keeps_who_is_known_and_a_tenant_has_one_allowance() {
        let (_folder, keys) = keys().await;
        known(&keys, vec![row("a", "north", None), row("b", "north", None), row("c", "south", None)]);
        let [a, b, c] = ["a", "b", "c"].map(|text| keys.admit(Some(text)).unwrap());
        assert!(Arc::ptr_eq(&a.allowance, &b.allowance) && !Arc::ptr_eq(&a.allowance, &c.allowance));
        known(&keys, vec![row("a", "north", None), row("c", "south", None)]);
        assert!(Arc::ptr_eq(&a, &keys.admit(Some("a")).unwrap()) && !a.is_revoked() && b.is_revoked());
    }
}
