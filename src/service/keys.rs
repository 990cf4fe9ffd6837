//! Who is calling: keys as their holders show them, and what each may do.
//!
//! A store without a key answers everybody as the default tenant. From its first key on it answers holders of keys alone,
//! for good: revoking the last one closes the door, it does not take it off its hinges.
//!
//! A request costs one hash and one look into memory. The store is asked every [`REFRESH`] instead, so a key made or
//! revoked beside this process, or on another replica, counts within that time. While the store does not answer, what was
//! known last holds; nothing else that needs the store answers then either. A key that expires is turned away at that
//! moment whatever the store does: when is known beforehand, by the clock of the store. A key is rotated without a gap: its
//! successor is in force before it expires itself.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use sha2::{Digest, Sha256};

use super::allowance::{Allowance, Limits};
use super::clock::Clock;
use super::error::ServiceError;
use super::identity;
pub use super::secret::{PREFIX, Secret};
use crate::control::error::FieldError;
use crate::store::{
    Actor, KeyRing, KeyRole, KeyRoles, KeyRow, NewKey, Rotate, Store, StoreError, StoredKeys, Successor, Tenant,
};

/// A key made or revoked elsewhere counts within this time.
pub const REFRESH: Duration = Duration::from_millis(500);
fn hash(text: &str) -> [u8; 32] {
    Sha256::digest(text).into()
}

/// Makes a key for a tenant, in force until `expires_ms` where that is given; its name, and its text, which is nowhere
/// else.
///
/// # Errors
/// The store does not take it, or there are no random bits.
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
    /// As it is now.
    pub old: KeyRow,
    pub new: KeyRow,
    /// Of the new one.
    pub secret: Secret,
}

/// Makes a key in the place of `old`, with its tenant and roles, and has `old` expire after `overlap`. The new one is in
/// force until `expires_ms`; unless that is given, for as long as the old one was made for.
///
/// # Errors
/// There is no such key, or it is no longer in force; the store does not take it, or there are no random bits.
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
        Rotate::Rotated { old, new } => Ok(Rotated { old: *old, new: *new, secret }),
        Rotate::Absent => Err(ServiceError::unknown("key", old)),
        Rotate::Ended => Err(FieldError::new("key", old, "must be in force; make a new one").into()),
    }
}

/// Who a request is answered to.
#[derive(Debug)]
pub struct Caller {
    pub tenant: Tenant,
    /// `None` where no key is asked for: everything is allowed.
    key: Option<KeyRow>,
    /// As the audit names it, but for the time.
    actor: Actor,
    /// Shared by everybody of the tenant.
    pub allowance: Arc<Allowance>,
    clock: Clock,
    revoked: AtomicBool,
    /// Of the key; a rotation brings it forward while the caller is let in already.
    expires_ms: AtomicI64,
    /// When it last called; 0 before.
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

    /// Who changes something now.
    pub fn actor(&self) -> Actor {
        Actor { at_ms: self.clock.now_milliseconds(), ..self.actor.clone() }
    }

    /// The name of the key, which is no secret; empty where none is asked for.
    pub fn key(&self) -> &Arc<str> {
        &self.actor.key
    }

    pub fn may(&self, role: KeyRole) -> bool {
        self.key.as_ref().is_none_or(|key| key.roles.include(role))
    }

    /// The roles of the key, as text.
    pub fn roles(&self) -> String {
        self.key.as_ref().map_or(String::new(), |key| key.roles.to_string())
    }

    /// Whether it would be turned away by now: what goes on for long asks again.
    pub fn has_ended(&self) -> bool {
        let now_ms = || self.clock.now_milliseconds();
        self.revoked.load(Ordering::Relaxed) || self.expires_ms().is_some_and(|expires_ms| expires_ms <= now_ms())
    }

    /// When the key ends, in milliseconds since 1970; `None` where that is not set.
    pub fn expires_ms(&self) -> Option<i64> {
        Some(self.expires_ms.load(Ordering::Relaxed)).filter(|expires_ms| *expires_ms != NEVER)
    }

    /// The key as it is now, where nothing of it changed but when it expires.
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
        // Threads that share a key would fight for the line of memory at every call.
        if now_ms - used_ms >= USE_PRECISION_MS {
            self.used_ms.store(now_ms, Ordering::Relaxed);
        }
    }
}

/// A time that does not come.
const NEVER: i64 = i64::MAX;
/// When a key was last used is known to a second.
const USE_PRECISION_MS: i64 = 1000;

/// A key in force, as an operator watches it.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyFigures {
    pub tenant: Tenant,
    pub key: String,
    pub expires_ms: Option<i64>,
    /// When it last called this process; `None` where it never did.
    pub used_ms: Option<i64>,
}

/// Why nobody is admitted. What was shown is not repeated.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Turned {
    /// No key was shown.
    NoKey,
    /// None that is in force.
    WrongKey {
        /// Whose it was until it was revoked; that is for the operator's eyes.
        of: Option<Tenant>,
    },
    /// One that was in force until then. Only who holds its text is told.
    Expired { of: Tenant, expires_ms: i64 },
}

impl Turned {
    /// Of a key of the tenant that ended.
    fn of(tenant: &Tenant, expires_ms: Option<i64>, is_revoked: bool) -> Self {
        match expires_ms.filter(|_| !is_revoked) {
            Some(expires_ms) => Turned::Expired { of: tenant.clone(), expires_ms },
            None => Turned::WrongKey { of: Some(tenant.clone()) },
        }
    }
}

/// The keys in force, as of the last look into the store.
pub struct Keys {
    store: Store,
    limits: Limits,
    clock: Clock,
    known: RwLock<Known>,
}

struct Known {
    /// Answers everybody; `None` from the first key on.
    anybody: Option<Arc<Caller>>,
    /// By the first eight bytes of the hash, which need not be compared in constant time to tell keys apart.
    by_hash: HashMap<[u8; 8], Arc<Caller>>,
    /// Keys that expired or were revoked, likewise.
    ended: HashMap<[u8; 8], KeyRow>,
    /// Keys that are not what was written.
    damaged: Vec<String>,
    allowances: HashMap<Tenant, Arc<Allowance>>,
}

impl Keys {
    pub(super) async fn load(store: Store, limits: Limits, clock: Clock) -> Result<Self, StoreError> {
        let allowance = Arc::new(Allowance::new(&limits));
        let anybody = Some(Caller::new(Tenant::default(), None, allowance.clone(), clock.clone()));
        let allowances = HashMap::from([(Tenant::default(), allowance)]);
        let known = Known { anybody, by_hash: HashMap::new(), ended: HashMap::new(), damaged: Vec::new(), allowances };
        let keys = Keys { store, limits, clock, known: RwLock::new(known) };
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
        let is_shown = |key: &&KeyRow| is_equal(&key.hash, &shown);
        let found = known.by_hash.get(&start(&shown));
        match found.filter(|caller| caller.key.as_ref().filter(is_shown).is_some()) {
            Some(caller) if !caller.has_ended() => {
                caller.note_use();
                Ok(caller.clone())
            }
            Some(ended) => Err(Turned::of(&ended.tenant, ended.expires_ms(), ended.revoked.load(Ordering::Relaxed))),
            None => match known.ended.get(&start(&shown)).filter(is_shown) {
                Some(key) => Err(Turned::of(&key.tenant, key.expires_ms, key.revoked_ms.is_some())),
                None => Err(Turned::WrongKey { of: None }),
            },
        }
    }

    /// Every key in force, as far as this process knows.
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

    /// Looks into the store.
    pub(super) async fn refresh(&self) -> Result<(), StoreError> {
        let keys = self.store.keys().await?;
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        if keys.damaged != known.damaged {
            tracing::error!(damaged = ?keys.damaged, "keys that are damaged let nobody in");
        }
        let was_open = known.anybody.is_some();
        known.become_those(keys, &self.limits, &self.clock);
        if was_open && known.anybody.is_none() {
            self.store.mark_keys()?;
        }
        Ok(())
    }

    /// Keys that are not what was written.
    pub(super) fn damaged(&self) -> Vec<String> {
        self.read().damaged.clone()
    }

    fn read(&self) -> std::sync::RwLockReadGuard<'_, Known> {
        // No code panics while holding the lock.
        self.known.read().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Known {
    /// A key that is damaged closes as the first one does, and is none itself.
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
            // One that does not follow is left among those that are gone.
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
            expires_ms: None,
        }
    }

    async fn keys() -> (tempfile::TempDir, Keys) {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).await.unwrap();
        (folder, Keys::load(store, Limits::default(), Clock::system()).await.unwrap())
    }

    fn known(keys: &Keys, rows: Vec<KeyRow>) {
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
        assert_eq!(keys.admit(None).unwrap_err(), Turned::NoKey);
        assert_eq!(keys.admit(Some("b")).unwrap_err(), Turned::WrongKey { of: None });
        let holder = keys.admit(Some("a")).unwrap();
        assert!(holder.may(KeyRole::Read) && !holder.may(KeyRole::Train) && !holder.has_ended());
        known(&keys, vec![row("a", "north", Some(1))]);
        assert!(holder.has_ended());
        assert_eq!(keys.admit(Some("a")).unwrap_err(), Turned::WrongKey { of: Some("north".parse().unwrap()) });
        assert_eq!(keys.admit(None).unwrap_err(), Turned::NoKey);
    }

    #[tokio::test]
    async fn a_damaged_key_lets_nobody_in_and_hides_no_other() {
        let (_folder, keys) = keys().await;
        let damaged = |sound, what: &str| StoredKeys { sound, damaged: vec![what.to_owned()] };
        let become_those = |found| keys.known.write().unwrap().become_those(found, &keys.limits, &keys.clock);
        become_those(damaged(Vec::new(), "key key_of_a"));
        assert_eq!(keys.admit(None).unwrap_err(), Turned::NoKey);
        known(&keys, vec![row("a", "north", None), row("b", "north", None)]);
        let [a, b] = ["a", "b"].map(|text| keys.admit(Some(text)).unwrap());
        become_those(damaged(vec![row("b", "north", Some(1)), row("c", "south", None)], "key key_of_a"));
        assert!(a.has_ended() && b.has_ended() && keys.admit(Some("c")).is_ok());
        assert_eq!(keys.admit(Some("a")).unwrap_err(), Turned::WrongKey { of: None });
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
        let of_north = Turned::Expired { of: "north".parse().unwrap(), expires_ms: 10_000 };
        assert_eq!(keys.admit(Some("a")).unwrap_err(), of_north);
        known(&keys, vec![expiring(Some(10_000)), row("b", "north", None)]);
        assert_eq!(keys.admit(Some("a")).unwrap_err(), of_north);
        assert!(keys.admit(Some("b")).is_ok() && keys.figures().len() == 1);
        // Who is let in already ends with the key, should a rotation bring that forward.
        let follower = keys.admit(Some("b")).unwrap();
        known(&keys, vec![KeyRow { expires_ms: Some(20_000), ..row("b", "north", None) }]);
        assert!(!follower.has_ended() && Arc::ptr_eq(&follower, &keys.admit(Some("b")).unwrap()));
        now.store(20_000, Ordering::Relaxed);
        assert!(follower.has_ended());
    }
}
