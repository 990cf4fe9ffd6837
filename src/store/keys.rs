//! Keys: who may call what, for which tenant. Of a key's text only the SHA-256 ever comes here.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use futures_util::FutureExt;

use super::error::Failure;
use super::query::{Connection, Row, query};
use super::tenant::Tenant;
use super::{Engine, PostgresUrl, Store, StoreError, sqlite};
use crate::control::error::FieldError;

/// What a key lets its holder do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum KeyRole {
    /// Everything that changes nothing.
    Read,
    /// Open, advance and delete sessions.
    Operate,
    /// Queue and cancel jobs, import and delete policies.
    Train,
    /// All of it, and the figures of the whole service.
    Admin,
}

/// At least one role, each once, in the order of [`KeyRole`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyRoles(Vec<KeyRole>);

/// A key to store.
#[derive(Debug, Clone, PartialEq)]
pub struct NewKey {
    /// Its name, which is no secret.
    pub key: String,
    pub hash: [u8; 32],
    pub tenant: Tenant,
    pub roles: KeyRoles,
    pub created_ms: i64,
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
}

/// The keys of a store, held beside whoever serves it.
pub struct KeyRing(Store);

impl KeyRing {
    /// The keys of a folder, created if absent, whether or not a process serves it: SQLite lets a second process write
    /// between two transactions of the first, and what is written here nothing else writes.
    ///
    /// # Errors
    /// [`StoreError::Locked`] where the schema is to be brought up to date and a process serves the folder, else as
    /// [`Store::open`].
    pub async fn open(dir: &Path) -> Result<KeyRing, StoreError> {
        Ok(KeyRing(Store(Engine::Sqlite(sqlite::Folder::open_beside(dir).await?))))
    }

    /// # Errors
    /// As [`Store::connect`].
    pub async fn connect(url: &PostgresUrl) -> Result<KeyRing, StoreError> {
        Store::connect(url).await.map(KeyRing)
    }

    pub async fn create(&self, new: NewKey) -> Result<(), StoreError> {
        self.0.write("creating a key", move |connection| create(connection, new).boxed()).await
    }

    /// Every key, revoked ones among them, oldest first.
    pub async fn list(&self) -> Result<Vec<KeyRow>, StoreError> {
        self.0.keys().await
    }

    /// Revokes a key for good; one revoked before stays as it is. False where there is none of this name.
    pub async fn revoke(&self, key: &str, now_ms: i64) -> Result<bool, StoreError> {
        let key = key.to_owned();
        self.0
            .write("revoking a key", move |mut connection| {
                async move {
                    let revoke =
                        query("UPDATE access_keys SET revoked_ms = coalesce(revoked_ms, $1) WHERE access_key = $2");
                    Ok(connection.execute(revoke.bind(now_ms).bind(key)).await? > 0)
                }
                .boxed()
            })
            .await
    }

    pub async fn close(&self) {
        self.0.close().await;
    }
}

impl Store {
    /// Every key, revoked ones among them, oldest first.
    pub async fn keys(&self) -> Result<Vec<KeyRow>, StoreError> {
        let all = query("SELECT * FROM access_keys ORDER BY sequence");
        self.read("reading the keys", all, |rows| rows.iter().map(KeyRow::from_row).collect()).await
    }
}

async fn create(mut connection: Connection<'_>, new: NewKey) -> Result<(), Failure> {
    let insert =
        query("INSERT INTO access_keys (access_key, hash, tenant, roles, created_ms) VALUES ($1, $2, $3, $4, $5)");
    let insert = insert
        .bind(new.key)
        .bind(new.hash.to_vec())
        .bind(new.tenant.as_str())
        .bind(new.roles.to_string())
        .bind(new.created_ms);
    connection.execute(insert).await.map(|_| ())
}

impl KeyRow {
    pub(super) fn from_row(row: &Row) -> Result<Self, Failure> {
        let key: String = row.get("access_key")?;
        let damaged = |column: &str| Failure::Corrupt(format!("the {column} of key {key}"));
        let roles: String = row.get("roles")?;
        Ok(KeyRow {
            hash: row.get::<Vec<u8>>("hash")?.try_into().map_err(|_| damaged("hash"))?,
            tenant: Tenant::stored(&row.get::<String>("tenant")?),
            roles: roles.parse().map_err(|_| damaged("roles"))?,
            created_ms: row.get("created_ms")?,
            revoked_ms: row.get("revoked_ms")?,
            key,
        })
    }
}

impl KeyRole {
    pub const ALL: [KeyRole; 4] = [KeyRole::Read, KeyRole::Operate, KeyRole::Train, KeyRole::Admin];

    /// The name on the wire, on the command line and in SQL.
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
    /// # Errors
    /// There is none.
    pub fn new(mut roles: Vec<KeyRole>) -> Result<Self, FieldError> {
        roles.sort();
        roles.dedup();
        if roles.is_empty() { Err(FieldError::new("roles", "[]", "must hold a role")) } else { Ok(KeyRoles(roles)) }
    }

    /// Whether its holder may do what needs `role`.
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
