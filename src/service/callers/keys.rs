//! Authenticates callers by their keys, and knows what each may do.
//!
//! A store without a key answers everybody as the default tenant. Once a store has a key, every call needs one, and
//! this stays so after the last key is revoked.
//!
//! A request costs one hash and one lookup in memory. The store is read every [`REFRESH`] instead, so a key made or
//! revoked by another process or replica counts within that time. While the store does not answer, the last known keys
//! hold; nothing else that needs the store answers then either. An expired key is rejected from its expiry on, whatever
//! the store does, because its expiry is known beforehand by the clock of the store. A key is rotated without a gap:
//! its successor is in force before it expires.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use sha2::{Digest, Sha256};

use crate::control::error::FieldError;
use crate::service::callers::allowance::{Allowance, Limits};
use crate::service::callers::identity;
pub use crate::service::callers::rejected::Rejected;
pub use crate::service::callers::secret::{PREFIX, Secret};
use crate::service::error::ServiceError;
use crate::service::process::clock::Clock;
use crate::store::{
    Actor, KeyRing, KeyRole, KeyRoles, KeyRow, NewKey, Rotation, Store, StoreError, StoredKeys, Successor, Tenant,
};

/// A key made or revoked elsewhere counts within this time.
pub const REFRESH: Duration = Duration::from_millis(500);
fn hash(text: &str) -> [u8; 32] {
    Sha256::digest(text).into()
}

/// Makes a key for a tenant, in force until `expires_ms` if that is given. Returns its name and its text, which is kept
/// nowhere else.
///
/// # Errors
/// The store rejects it, or there are no random bits.
pub async fn issue(
    ring: &KeyRing,
    tenant: Tenant,
    roles: KeyRoles,
    expires_ms: Option<i64>,
    clock: &Clock,
) -> Result<(String, Secret), ServiceError> {
    let (key, secret) = (identity::new_id("key")?, Secret::new()?);
    let (name, hash, created_ms) = (key.clone(), hash(secret.reveal()), clock.now_milliseconds());
    ring.create(NewKey { key: name, hash, tenant, roles, created_ms, expires_ms }).await?;
    Ok((key, secret))
}

/// A key and its successor.
pub struct Rotated {
    /// The old key with its new expiry.
    pub old: KeyRow,
    pub new: KeyRow,
    /// The secret of the new key.
    pub secret: Secret,
}

/// Makes a key that replaces `old`, with its tenant and roles, and lets `old` expire after `overlap`. The new one is in
/// force until `expires_ms`; by default for as long as the old one was made for.
///
/// # Errors
/// There is no such key, it is no longer in force, the store rejects the new one, or there are no random bits.
pub async fn rotate(
    ring: &KeyRing,
    old: &str,
    overlap: Duration,
    expires_ms: Option<i64>,
    clock: &Clock,
) -> Result<Rotated, ServiceError> {
    let (key, secret) = (identity::new_id("key")?, Secret::new()?);
    let (hash, created_ms) = (hash(secret.reveal()), clock.now_milliseconds());
    let overlap_ms = i64::try_from(overlap.as_millis()).unwrap_or(i64::MAX);
    let successor = Successor { key, hash, created_ms, expires_ms };
    match ring.rotate(old, successor, created_ms.saturating_add(overlap_ms)).await? {
        Rotation::Rotated { old, new } => Ok(Rotated { old: *old, new: *new, secret }),
        Rotation::Absent => Err(ServiceError::unknown("key", old)),
        Rotation::Ended => Err(FieldError::new("key", old, "must be in force; make a new one").into()),
    }
}

/// The caller of a request.
#[derive(Debug)]
pub struct Caller {
    pub tenant: Tenant,
    /// `None` if no key is needed: everything is allowed.
    key: Option<KeyRow>,
    /// The caller as the audit names it, without the time.
    actor: Actor,
    /// Shared by all callers of the tenant.
    pub allowance: Arc<Allowance>,
    clock: Clock,
    revoked: AtomicBool,
    /// Expiry of the key; a rotation may bring it forward while the caller is connected.
    expires_ms: AtomicI64,
    /// Time of the last call; 0 before the first.
    used_ms: AtomicI64,
}

impl Caller {
    fn new(tenant: Tenant, key: Option<KeyRow>, allowance: Arc<Allowance>, clock: Clock) -> Arc<Self> {
        let (revoked, used_ms) = (AtomicBool::new(false), AtomicI64::new(0));
        let expires_ms = AtomicI64::new(key.as_ref().and_then(|key| key.expires_ms).unwrap_or(NEVER));
        let (name, roles) = key.as_ref().map_or(("", "anybody".to_owned()), |key| (&key.key, key.roles.to_string()));
        let actor = Actor { key: name.into(), roles: roles.into(), at_ms: 0 };
        Arc::new(Caller { tenant, key, actor, allowance, clock, revoked, expires_ms, used_ms })
    }

    /// Returns the actor of a change made now.
    pub fn actor(&self) -> Actor {
        Actor { at_ms: self.clock.now_milliseconds(), ..self.actor.clone() }
    }

    /// Returns the name of the key, which is not secret; empty if no key is needed.
    pub fn key(&self) -> &Arc<str> {
        &self.actor.key
    }

    pub fn may(&self, role: KeyRole) -> bool {
        self.key.as_ref().is_none_or(|key| key.roles.include(role))
    }

    /// Returns the roles of the key as text.
    pub fn roles(&self) -> String {
        self.key.as_ref().map_or(String::new(), |key| key.roles.to_string())
    }

    /// Returns whether the key has ended by now. Long-running work checks this again.
    pub fn has_ended(&self) -> bool {
        let now_ms = || self.clock.now_milliseconds();
        self.revoked.load(Ordering::Relaxed) || self.expires_ms().is_some_and(|expires_ms| expires_ms <= now_ms())
    }

    /// Returns when the key ends, in milliseconds since 1970; `None` if it never does.
    pub fn expires_ms(&self) -> Option<i64> {
        Some(self.expires_ms.load(Ordering::Relaxed)).filter(|expires_ms| *expires_ms != NEVER)
    }

    /// Takes over the expiry of `row` and returns true, if nothing else of the key changed.
    fn follow(&self, row: &KeyRow) -> bool {
        let expires_ms = row.expires_ms;
        let is_same = self.key.as_ref().is_some_and(|key| KeyRow { expires_ms, ..key.clone() } == *row);
        if is_same {
            self.expires_ms.store(expires_ms.unwrap_or(NEVER), Ordering::Relaxed);
        }
        is_same
    }

    fn note_use(&self) {
        let (now_ms, used_ms) = (self.clock.now_milliseconds(), self.used_ms.load(Ordering::Relaxed));
        // Threads that share a key would contend for the cache line at every call.
        if now_ms - used_ms >= USE_PRECISION_MS {
            self.used_ms.store(now_ms, Ordering::Relaxed);
        }
    }
}

/// A time that never comes.
const NEVER: i64 = i64::MAX;
/// The last use of a key is known to a second.
const USE_PRECISION_MS: i64 = 1000;

/// A key in force, as an operator monitors it.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyFigures {
    pub tenant: Tenant,
    pub key: String,
    pub expires_ms: Option<i64>,
    /// Time of the last call to this process; `None` if there was none.
    pub used_ms: Option<i64>,
}

/// The keys in force, as of the last read of the store.
pub struct KeysInForce {
    store: Store,
    limits: Limits,
    clock: Clock,
    known: RwLock<KnownKeys>,
}

struct KnownKeys {
    /// The caller for everybody; `None` once the store has a key.
    anybody: Option<Arc<Caller>>,
    /// Keys by the first eight bytes of the hash. Finding a key by these need not take constant time.
    by_hash: HashMap<[u8; 8], Arc<Caller>>,
    /// Keys that expired or were revoked, in the same way.
    ended: HashMap<[u8; 8], KeyRow>,
    /// Keys that differ from what was written.
    damaged: Vec<String>,
    allowances: HashMap<Tenant, Arc<Allowance>>,
}

impl KeysInForce {
    pub(in crate::service) async fn load(store: Store, limits: Limits, clock: Clock) -> Result<Self, StoreError> {
        let allowance = Arc::new(Allowance::new(&limits));
        let anybody = Some(Caller::new(Tenant::default(), None, allowance.clone(), clock.clone()));
        let allowances = HashMap::from([(Tenant::default(), allowance)]);
        let known =
            KnownKeys { anybody, by_hash: HashMap::new(), ended: HashMap::new(), damaged: Vec::new(), allowances };
        let keys = KeysInForce { store, limits, clock, known: RwLock::new(known) };
        keys.refresh().await?;
        Ok(keys)
    }

    /// Returns whether requests are answered without a key.
    pub fn are_absent(&self) -> bool {
        self.read().anybody.is_some()
    }

    /// Returns the caller for `text`, the part of an `Authorization: Bearer` header after the scheme.
    ///
    /// # Errors
    /// A key is needed, and this is none.
    pub fn admit(&self, text: Option<&str>) -> Result<Arc<Caller>, Rejected> {
        let known = self.read();
        if let Some(anybody) = &known.anybody {
            return Ok(anybody.clone());
        }
        let shown = hash(text.ok_or(Rejected::NoKey)?);
        let is_shown = |key: &&KeyRow| is_equal(&key.hash, &shown);
        let found = known.by_hash.get(&start(&shown));
        match found.filter(|caller| caller.key.as_ref().filter(is_shown).is_some()) {
            Some(caller) if !caller.has_ended() => {
                caller.note_use();
                Ok(caller.clone())
            }
            Some(ended) => Err(Rejected::of(&ended.tenant, ended.expires_ms(), ended.revoked.load(Ordering::Relaxed))),
            None => match known.ended.get(&start(&shown)).filter(is_shown) {
                Some(key) => Err(Rejected::of(&key.tenant, key.expires_ms, key.revoked_ms.is_some())),
                None => Err(Rejected::WrongKey { of: None }),
            },
        }
    }

    /// Returns the allowance that the calls of a tenant share.
    pub(in crate::service) fn allowance(&self, tenant: &Tenant) -> Arc<Allowance> {
        let known = self.read();
        known.allowances.get(tenant).cloned().unwrap_or_else(|| Arc::new(Allowance::new(&self.limits)))
    }

    /// Returns every key in force that this process knows.
    pub fn figures(&self) -> Vec<KeyFigures> {
        let known = self.read();
        let figures = known.by_hash.values().filter_map(|caller| {
            let (key, used_ms) = (caller.key.as_ref()?, caller.used_ms.load(Ordering::Relaxed));
            let used_ms = (used_ms > 0).then_some(used_ms);
            Some(KeyFigures {
                tenant: key.tenant.clone(),
                key: key.key.clone(),
                expires_ms: caller.expires_ms(),
                used_ms,
            })
        });
        let mut figures: Vec<_> = figures.collect();
        figures.sort_by(|one, other| one.key.cmp(&other.key));
        figures
    }

    /// Reads the keys from the store again.
    pub(super) async fn refresh(&self) -> Result<(), StoreError> {
        let keys = self.store.keys().await?;
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        if keys.damaged != known.damaged {
            tracing::error!(damaged = ?keys.damaged, "damaged keys are refused");
        }
        let was_open = known.anybody.is_some();
        known.become_those(keys, &self.limits, &self.clock);
        if was_open && known.anybody.is_none() {
            self.store.mark_keys()?;
        }
        Ok(())
    }

    /// Returns the keys that differ from what was written.
    pub(in crate::service) fn damaged(&self) -> Vec<String> {
        self.read().damaged.clone()
    }

    fn read(&self) -> std::sync::RwLockReadGuard<'_, KnownKeys> {
        // No code panics while holding the lock.
        self.known.read().unwrap_or_else(PoisonError::into_inner)
    }
}

impl KnownKeys {
    /// Replaces the known keys. A damaged key ends anonymous access as the first key does, but admits nobody itself.
    fn become_those(&mut self, keys: StoredKeys, limits: &Limits, clock: &Clock) {
        if !keys.is_empty()
            && let Some(anybody) = self.anybody.take()
        {
            anybody.revoked.store(true, Ordering::Relaxed);
        }
        let mut before = std::mem::take(&mut self.by_hash);
        self.damaged = keys.damaged;
        for row in keys.sound {
            let start = start(&row.hash);
            if row.has_ended(clock.now_milliseconds()) {
                self.ended.insert(start, row);
                continue;
            }
            // A caller that cannot follow stays among those that are gone.
            let kept = before.get(&start).filter(|caller| caller.follow(&row)).cloned();
            if kept.is_some() {
                before.remove(&start);
            }
            let caller = kept.unwrap_or_else(|| {
                let allowance = self.allowances.entry(row.tenant.clone());
                let allowance = allowance.or_insert_with(|| Arc::new(Allowance::new(limits))).clone();
                Caller::new(row.tenant.clone(), Some(row), allowance, clock.clone())
            });
            self.by_hash.insert(start, caller);
        }
        for gone in before.into_values() {
            gone.revoked.store(true, Ordering::Relaxed);
        }
    }
}

fn start(hash: &[u8; 32]) -> [u8; 8] {
    std::array::from_fn(|index| hash[index])
}

/// Compares in a time that does not depend on where the two differ.
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
            expires_ms: None,
        }
    }

    async fn keys() -> (tempfile::TempDir, KeysInForce) {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).await.unwrap();
        (folder, KeysInForce::load(store, Limits::default(), Clock::system()).await.unwrap())
    }

    fn known(keys: &KeysInForce, rows: Vec<KeyRow>) {
        let rows = StoredKeys { sound: rows, damaged: Vec::new() };
        keys.known.write().unwrap().become_those(rows, &keys.limits, &keys.clock);
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
        assert!(anybody.tenant == Tenant::default() && anybody.may(KeyRole::Admin) && !anybody.has_ended());
        known(&keys, vec![row("a", "north", None)]);
        assert!(anybody.has_ended());
        assert_eq!(keys.admit(None).unwrap_err(), Rejected::NoKey);
        assert_eq!(keys.admit(Some("b")).unwrap_err(), Rejected::WrongKey { of: None });
        let holder = keys.admit(Some("a")).unwrap();
        assert!(holder.may(KeyRole::Read) && !holder.may(KeyRole::Train) && !holder.has_ended());
        known(&keys, vec![row("a", "north", Some(1))]);
        assert!(holder.has_ended());
        assert_eq!(keys.admit(Some("a")).unwrap_err(), Rejected::WrongKey { of: Some("north".parse().unwrap()) });
        assert_eq!(keys.admit(None).unwrap_err(), Rejected::NoKey);
    }

    #[tokio::test]
    async fn a_damaged_key_lets_nobody_in_and_hides_no_other() {
        let (_folder, keys) = keys().await;
        let damaged = |sound, what: &str| StoredKeys { sound, damaged: vec![what.to_owned()] };
        let become_those = |found| keys.known.write().unwrap().become_those(found, &keys.limits, &keys.clock);
        become_those(damaged(Vec::new(), "key key_of_a"));
        assert_eq!(keys.admit(None).unwrap_err(), Rejected::NoKey);
        known(&keys, vec![row("a", "north", None), row("b", "north", None)]);
        let [a, b] = ["a", "b"].map(|text| keys.admit(Some(text)).unwrap());
        become_those(damaged(vec![row("b", "north", Some(1)), row("c", "south", None)], "key key_of_a"));
        assert!(a.has_ended() && b.has_ended() && keys.admit(Some("c")).is_ok());
        assert_eq!(keys.admit(Some("a")).unwrap_err(), Rejected::WrongKey { of: None });
    }

    #[tokio::test]
    async fn a_refresh_keeps_who_is_known_and_a_tenant_has_one_allowance() {
        let (_folder, keys) = keys().await;
        known(&keys, vec![row("a", "north", None), row("b", "north", None), row("c", "south", None)]);
        let [a, b, c] = ["a", "b", "c"].map(|text| keys.admit(Some(text)).unwrap());
        assert!(Arc::ptr_eq(&a.allowance, &b.allowance) && !Arc::ptr_eq(&a.allowance, &c.allowance));
        known(&keys, vec![row("a", "north", None), row("c", "south", None)]);
        assert!(Arc::ptr_eq(&a, &keys.admit(Some("a")).unwrap()) && !a.has_ended() && b.has_ended());
    }

    #[tokio::test]
    async fn a_key_is_turned_away_from_the_moment_it_expires_whatever_the_store_does() {
        let (_folder, mut keys) = keys().await;
        let now = Arc::new(AtomicI64::new(0));
        keys.clock = Clock::new({
            let now = now.clone();
            move || now.load(Ordering::Relaxed)
        });
        let expiring = |expires_ms| KeyRow { expires_ms, ..row("a", "north", None) };
        known(&keys, vec![expiring(Some(10_000)), row("b", "north", None)]);
        now.store(9_999, Ordering::Relaxed);
        let holder = keys.admit(Some("a")).unwrap();
        assert!(!holder.has_ended());
        let figures = &keys.figures()[0];
        assert_eq!((figures.expires_ms, figures.used_ms), (Some(10_000), Some(9_999)));
        now.store(10_000, Ordering::Relaxed);
        assert!(holder.has_ended());
        let of_north = Rejected::Expired { of: "north".parse().unwrap(), expires_ms: 10_000 };
        assert_eq!(keys.admit(Some("a")).unwrap_err(), of_north);
        known(&keys, vec![expiring(Some(10_000)), row("b", "north", None)]);
        assert_eq!(keys.admit(Some("a")).unwrap_err(), of_north);
        assert!(keys.admit(Some("b")).is_ok() && keys.figures().len() == 1);
        // A connected caller ends with the key if a rotation brings its expiry forward.
        let follower = keys.admit(Some("b")).unwrap();
        known(&keys, vec![KeyRow { expires_ms: Some(20_000), ..row("b", "north", None) }]);
        assert!(!follower.has_ended() && Arc::ptr_eq(&follower, &keys.admit(Some("b")).unwrap()));
        now.store(20_000, Ordering::Relaxed);
        assert!(follower.has_ended());
    }
}
