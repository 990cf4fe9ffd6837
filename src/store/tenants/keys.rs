//! Keys: which calls a key allows, and for which tenant. Only the SHA-256 of a key's text is ever stored.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use futures_util::FutureExt;

use crate::control::error::FieldError;
use crate::store::engine::codec::Seal;
use crate::store::engine::error::Failure;
use crate::store::engine::query::{StoreConnection, StoreRow, query};
use crate::store::engine::sqlite;
use crate::store::tenants::audit::{Actor, AuditAction, AuditFilter, AuditRow};
use crate::store::tenants::audit_chain;
use crate::store::tenants::quotas::Quotas;
use crate::store::tenants::tenant::Tenant;
use crate::store::{Engine, PostgresUrl, Store, StoreError};

/// A role of a key: what it allows its holder to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum KeyRole {
    Read,
    /// Open, advance and delete sessions.
    Operate,
    /// Queue and cancel jobs, import and delete policies.
    Train,
    /// Everything above, and the figures of the whole service.
    Admin,
}

/// At least one role, each once, in the order of [`KeyRole`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyRoles(Vec<KeyRole>);

#[derive(Debug, Clone, PartialEq)]
pub struct NewKey {
    pub key: String,
    pub hash: [u8; 32],
    pub tenant: Tenant,
    pub roles: KeyRoles,
    pub created_ms: i64,
    pub expires_ms: Option<i64>,
}

/// A key that replaces another, with the same tenant and roles.
#[derive(Debug, Clone, PartialEq)]
pub struct Successor {
    pub key: String,
    pub hash: [u8; 32],
    pub created_ms: i64,
    /// If `None`, the key is in force for as long as the replaced key was made for.
    pub expires_ms: Option<i64>,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Rotation {
    /// Both are in force; `old` is the replaced key as it is now.
    Rotated {
        old: Box<KeyRow>,
        new: Box<KeyRow>,
    },
    Absent,
    /// The key is no longer in force, so it cannot be replaced.
    Ended,
}

/// A key as stored.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyRow {
    pub key: String,
    pub hash: [u8; 32],
    pub tenant: Tenant,
    pub roles: KeyRoles,
    pub created_ms: i64,
    pub revoked_ms: Option<i64>,
    pub expires_ms: Option<i64>,
}

/// The keys of a store, oldest first.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StoredKeys {
    /// The valid keys, including revoked ones.
    pub sound: Vec<KeyRow>,
    /// Names of keys that are not as they were written; they admit no call.
    pub damaged: Vec<String>,
}

impl StoredKeys {
    fn from_rows(rows: &[StoreRow]) -> Result<Self, Failure> {
        let mut keys = StoredKeys::default();
        for row in rows {
            match KeyRow::from_row(row) {
                Ok(key) => keys.sound.push(key),
                Err(failure) => keys.damaged.push(failure.damage()?),
            }
        }
        Ok(keys)
    }

    pub fn is_empty(&self) -> bool {
        self.sound.is_empty() && self.damaged.is_empty()
    }
}

/// The keys of a store, opened beside a process that may be serving it.
pub struct KeyRing(Store);

impl KeyRing {
    /// Opens the keys of a folder, which is created if absent, even if a process serves it. SQLite lets a second
    /// process write between two transactions of the first, and nothing else writes these rows.
    ///
    /// # Errors
    /// [`StoreError::Locked`] if the schema must be brought up to date while a process serves the folder, else as
    /// [`Store::open`].
    pub async fn open(dir: &Path) -> Result<KeyRing, StoreError> {
        Ok(KeyRing(Store::over(Engine::Sqlite(sqlite::Folder::open_beside(dir).await?))))
    }

    /// Opens the keys like [`KeyRing::open`], but creates nothing: [`StoreError::Folder`] if there is no database.
    pub async fn open_existing(dir: &Path) -> Result<KeyRing, StoreError> {
        sqlite::opening::existing(&dir.join(sqlite::opening::DATABASE))?;
        KeyRing::open(dir).await
    }

    /// Opens the keys of a PostgreSQL database.
    ///
    /// # Errors
    /// As [`Store::connect`].
    pub async fn connect(url: &PostgresUrl) -> Result<KeyRing, StoreError> {
        Store::connect(url).await.map(KeyRing)
    }

    pub async fn create(&self, new: NewKey) -> Result<(), StoreError> {
        let actor = Actor::operator(new.created_ms);
        self.0.write("creating a key", move |connection| create(connection, new, actor).boxed()).await?;
        // A service creates the marker file too, if this fails.
        let _ = self.0.mark_keys();
        Ok(())
    }

    pub async fn list(&self) -> Result<StoredKeys, StoreError> {
        self.0.keys().await
    }

    /// Revokes a key for good; an already revoked key stays as it is. Returns false if there is no key of this name.
    pub async fn revoke(&self, key: &str, now_ms: i64) -> Result<bool, StoreError> {
        let key = key.to_owned();
        self.0.write("revoking a key", move |connection| revoke(connection, key, now_ms).boxed()).await
    }

    /// Stores a successor of `key`, which itself expires at `old_expires_ms` or sooner. Both happen, or neither.
    pub async fn rotate(&self, key: &str, new: Successor, old_expires_ms: i64) -> Result<Rotation, StoreError> {
        let key = key.to_owned();
        self.0.write("rotating a key", move |connection| rotate(connection, key, new, old_expires_ms).boxed()).await
    }

    pub async fn deeds(
        &self,
        filter: &AuditFilter,
        limit: usize,
        after: Option<i64>,
    ) -> Result<Vec<AuditRow>, StoreError> {
        self.0.deeds(filter, limit, after).await
    }

    pub async fn close(&self) {
        self.0.close().await;
    }
}

impl Store {
    /// Returns every key, each verified by itself: a damaged key hides no other.
    pub async fn keys(&self) -> Result<StoredKeys, StoreError> {
        let all = query("SELECT * FROM access_keys ORDER BY sequence");
        self.probe("reading the keys", all, StoredKeys::from_rows).await
    }
}

async fn create(mut connection: StoreConnection<'_>, new: NewKey, actor: Actor) -> Result<(), Failure> {
    let (tenant, key, outcome) = (new.tenant.clone(), new.key.clone(), format!("in force, {}", new.roles));
    insert(&mut connection, new).await?;
    audit_chain::record(&mut connection, (Quotas::NONE, &actor), &tenant, AuditAction::CreateKey, &key, &outcome).await
}

async fn find(connection: &mut StoreConnection<'_>, key: &str) -> Result<Option<KeyRow>, Failure> {
    let find = query("SELECT * FROM access_keys WHERE access_key = $1").bind(key).for_update();
    connection.row(find).await?.as_ref().map(KeyRow::from_row).transpose()
}

async fn revoke(mut connection: StoreConnection<'_>, key: String, now_ms: i64) -> Result<bool, Failure> {
    let connection = &mut connection;
    let Some(row) = find(connection, &key).await? else { return Ok(false) };
    if row.revoked_ms.is_none() {
        change(connection, &KeyRow { revoked_ms: Some(now_ms), ..row.clone() }).await?;
        let actor = Actor::operator(now_ms);
        audit_chain::record(connection, (Quotas::NONE, &actor), &row.tenant, AuditAction::RevokeKey, &key, "revoked")
            .await?;
    }
    Ok(true)
}

async fn change(connection: &mut StoreConnection<'_>, row: &KeyRow) -> Result<(), Failure> {
    let change = query("UPDATE access_keys SET revoked_ms = $1, expires_ms = $2, seal = $3 WHERE access_key = $4");
    let change = change.bind(row.revoked_ms).bind(row.expires_ms).bind(row.seal().finish()).bind(row.key.as_str());
    connection.execute(change).await.map(drop)
}

async fn insert(connection: &mut StoreConnection<'_>, new: NewKey) -> Result<(), Failure> {
    let insert = query(
        "INSERT INTO access_keys (access_key, hash, tenant, roles, created_ms, expires_ms, seal)
         VALUES ($1, $2, $3, $4, $5, $6, $7)",
    );
    let seal = KeyRow::from(new.clone()).seal().finish();
    let insert = insert
        .bind(new.key)
        .bind(new.hash.to_vec())
        .bind(new.tenant.as_str())
        .bind(new.roles.to_string())
        .bind(new.created_ms)
        .bind(new.expires_ms)
        .bind(seal);
    connection.execute(insert).await.map(|_| ())
}

async fn rotate(
    mut connection: StoreConnection<'_>,
    key: String,
    new: Successor,
    old_expires_ms: i64,
) -> Result<Rotation, Failure> {
    let connection = &mut connection;
    let Some(old) = find(connection, &key).await? else { return Ok(Rotation::Absent) };
    if old.has_ended(new.created_ms) {
        return Ok(Rotation::Ended);
    }
    let life_ms = old.expires_ms.map(|expires_ms| expires_ms.saturating_sub(old.created_ms));
    let expires_ms = new.expires_ms.or(life_ms.map(|life_ms| new.created_ms.saturating_add(life_ms)));
    let Successor { key: name, hash, created_ms, .. } = new;
    let new = KeyRow { key: name, hash, created_ms, expires_ms, ..old.clone() };
    insert(connection, NewKey::from(new.clone())).await?;
    let expires_ms = old.expires_ms.map_or(old_expires_ms, |sooner| sooner.min(old_expires_ms));
    let old = KeyRow { expires_ms: Some(expires_ms), ..old };
    change(connection, &old).await?;
    let (actor, outcome) = (Actor::operator(created_ms), format!("succeeded by {}", new.key));
    audit_chain::record(connection, (Quotas::NONE, &actor), &old.tenant, AuditAction::RotateKey, &key, &outcome)
        .await?;
    Ok(Rotation::Rotated { old: Box::new(old), new: Box::new(new) })
}

impl From<KeyRow> for NewKey {
    fn from(row: KeyRow) -> Self {
        let KeyRow { key, hash, tenant, roles, created_ms, expires_ms, .. } = row;
        NewKey { key, hash, tenant, roles, created_ms, expires_ms }
    }
}

impl From<NewKey> for KeyRow {
    fn from(new: NewKey) -> Self {
        let NewKey { key, hash, tenant, roles, created_ms, expires_ms } = new;
        KeyRow { key, hash, tenant, roles, created_ms, revoked_ms: None, expires_ms }
    }
}

impl KeyRow {
    fn seal(&self) -> Seal {
        Seal::of("key")
            .text(&self.key)
            .bytes(&self.hash)
            .text(self.tenant.as_str())
            .text(&self.roles.to_string())
            .integer(self.created_ms)
            .integer(self.revoked_ms.unwrap_or(i64::MAX))
            .integer(self.expires_ms.unwrap_or(i64::MAX))
    }

    /// Returns true if the key was revoked, or has expired by `now_ms`.
    pub fn has_ended(&self, now_ms: i64) -> bool {
        self.revoked_ms.is_some() || self.expires_ms.is_some_and(|expires_ms| expires_ms <= now_ms)
    }

    pub(in crate::store) fn from_row(row: &StoreRow) -> Result<Self, Failure> {
        let key: String = row.get("access_key")?;
        let what = || format!("key {key}");
        let roles: String = row.get("roles")?;
        let read = KeyRow {
            hash: row.get::<Vec<u8>>("hash")?.try_into().map_err(|_| Failure::Corrupt(what()))?,
            tenant: Tenant::stored(&row.get::<String>("tenant")?),
            roles: roles.parse().map_err(|_| Failure::Corrupt(what()))?,
            created_ms: row.get("created_ms")?,
            revoked_ms: row.get("revoked_ms")?,
            expires_ms: row.get("expires_ms")?,
            key: key.clone(),
        };
        read.seal().verify(&row.get::<Vec<u8>>("seal")?, what)?;
        Ok(read)
    }
}

impl KeyRole {
    pub const ALL: [KeyRole; 4] = [KeyRole::Read, KeyRole::Operate, KeyRole::Train, KeyRole::Admin];

    pub fn as_str(self) -> &'static str {
        match self {
            KeyRole::Read => "read",
            KeyRole::Operate => "operate",
            KeyRole::Train => "train",
            KeyRole::Admin => "admin",
        }
    }
}

impl KeyRoles {
    /// Sorts the roles and drops repeated ones.
    ///
    /// # Errors
    /// Fails if there are no roles.
    pub fn new(mut roles: Vec<KeyRole>) -> Result<Self, FieldError> {
        roles.sort();
        roles.dedup();
        if roles.is_empty() {
            Err(FieldError::new("roles", "[]", "must have at least one role: read, operate, train or admin"))
        } else {
            Ok(KeyRoles(roles))
        }
    }

    /// Returns whether the roles allow what needs `role`.
    pub fn include(&self, role: KeyRole) -> bool {
        self.0.contains(&role) || self.0.contains(&KeyRole::Admin)
    }
}

impl fmt::Display for KeyRoles {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = self.0.iter().map(|role| role.as_str()).collect();
        formatter.write_str(&names.join(","))
    }
}

impl FromStr for KeyRoles {
    type Err = FieldError;

    fn from_str(names: &str) -> Result<Self, FieldError> {
        let role = |name: &str| KeyRole::ALL.into_iter().find(|role| role.as_str() == name);
        let roles: Option<Vec<_>> = names.split(',').map(role).collect();
        let roles = roles.ok_or_else(|| FieldError::new("roles", names, "must be read, operate, train or admin"))?;
        KeyRoles::new(roles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn admin_includes_every_role_and_no_other_does() {
        for name in KeyRole::ALL.map(KeyRole::as_str) {
            let roles: KeyRoles = name.parse().unwrap();
            assert_eq!(roles.to_string(), name);
            for needed in KeyRole::ALL {
                assert_eq!(roles.include(needed), name == needed.as_str() || name == "admin");
            }
        }
        assert_eq!("train,read,train".parse::<KeyRoles>().unwrap().to_string(), "read,train");
        assert!("".parse::<KeyRoles>().is_err() && "root".parse::<KeyRoles>().is_err());
    }
}
