//! Repairs one damaged thing of a folder: a session, a policy or a key from a backup, or the totals from their rows.
//!
//! Only damaged or missing rows are taken from the backup, and only if they are sound there. Sound rows written after
//! the backup stay. Either the thing is sound afterwards, or nothing is changed. A repair restores neither a session
//! that was deleted nor a key that was changed after the backup. The repair is recorded in the audit.
//!
//! Not done, and why: repairing entries of the audit. Damage to them must stay visible.

use std::collections::HashSet;
use std::path::Path;

use sqlx::{Connection as _, SqliteConnection};

use crate::store::engine::error::{Failure, StoreError};
use crate::store::engine::migrations;
use crate::store::engine::query::{StoreConnection, StoreRow, query};
use crate::store::engine::sqlite::opening::{DATABASE, connect, existing, lock, opening, version};
use crate::store::maintenance::check::TOTALS;
use crate::store::policies;
use crate::store::sessions::SessionRow;
use crate::store::sessions::entries::{self, EntryRow};
use crate::store::tenants::audit::{Actor, AuditAction};
use crate::store::tenants::audit_chain;
use crate::store::tenants::keys::KeyRow;
use crate::store::tenants::quotas::{ASSET_BYTES, ENTRY_BYTES, Quotas, ROW_BYTES};
use crate::store::tenants::tenant::Tenant;

const DOING: &str = "repairing the store";

/// A repair to make.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Repair<'a> {
    /// A session, a policy or a key, by its name, from a backup.
    Thing { name: &'a str, from: &'a Path },
    /// The totals of each tenant, recomputed.
    Totals,
}

/// The reason why nothing is repaired.
enum Refusal {
    Failure(Failure),
    Reason(String),
}

impl From<Failure> for Refusal {
    fn from(failure: Failure) -> Self {
        Refusal::Failure(failure)
    }
}

/// A table whose rows can be put back.
struct RepairableTable {
    name: &'static str,
    /// The column with the name of the thing that a row belongs to.
    of: &'static str,
    /// The column that distinguishes its rows, if a thing has several.
    number: Option<&'static str>,
    /// The columns that are restored; the other columns of an existing row stay.
    columns: &'static [&'static str],
    /// The additional columns that a missing row needs.
    others: &'static [&'static str],
    verify: fn(&StoreRow) -> Result<(), Failure>,
}

const SESSIONS: RepairableTable = RepairableTable {
    name: "sessions",
    of: "session",
    number: None,
    columns: &[
        "tenant",
        "policy",
        "initial_wealth",
        "initial_holding",
        "history_seal",
        "initial_history",
        "horizon",
        "plan_json",
        "assets",
        "created_ms",
        "seal",
    ],
    others: &["due", "room"],
    verify: |row| SessionRow::from_row(row).map(drop),
};
const ENTRIES: RepairableTable = RepairableTable {
    name: "entries",
    of: "session",
    number: Some("entry"),
    columns: &["kind", "number", "content_json", "answer_json", "numbers", "created_ms", "access_key", "seal"],
    others: &[],
    verify: |row| EntryRow::from_row(row).map(drop),
};
const POLICIES: RepairableTable = RepairableTable {
    name: "policies",
    of: "policy",
    number: None,
    columns: &["created_ms", "periods_per_year", "json"],
    others: &[],
    verify: |row| policies::verify(&row.get::<String>("policy")?, &row.get::<Vec<u8>>("json")?),
};
const KEYS: RepairableTable = RepairableTable {
    name: "access_keys",
    of: "access_key",
    number: None,
    columns: &["hash", "tenant", "roles", "created_ms", "revoked_ms", "expires_ms", "seal"],
    others: &[],
    verify: |row| KeyRow::from_row(row).map(drop),
};

/// Repairs a thing of the folder `dir`, which no process holds, and returns how many rows were restored or changed.
///
/// # Errors
/// Fails if a process holds `dir`. Fails too if the thing is not in the backup, must not be restored, or is still
/// damaged afterwards. Nothing is changed then.
pub async fn repair(dir: &Path, what: Repair<'_>, now_ms: i64) -> Result<usize, StoreError> {
    let held = lock(dir)?;
    let database = dir.join(DATABASE);
    existing(&database)?;
    let mut connection = connect(&database).await?;
    migrations::require_newest(&migrations::sqlite(), version(&mut connection).await?)?;
    if let Repair::Thing { from, .. } = &what {
        existing(from)?;
        let attach = sqlx::query("ATTACH DATABASE ? AS backup").bind(from.to_string_lossy().into_owned());
        attach.execute(&mut connection).await.map_err(opening)?;
    }
    let repaired = in_transaction(&mut connection, &what, now_ms).await;
    connection.close().await.map_err(opening)?;
    drop(held);
    repaired.map_err(|refusal| match refusal {
        Refusal::Failure(failure) => failure.during(DOING),
        Refusal::Reason(reason) => StoreError::NotRepaired { reason },
    })
}

async fn in_transaction(connection: &mut SqliteConnection, what: &Repair<'_>, now_ms: i64) -> Result<usize, Refusal> {
    let mut transaction = connection.begin().await.map_err(Failure::sqlite)?;
    let mut repairs = Repairs { connection: StoreConnection::Sqlite(&mut transaction), rows: 0 };
    let repaired = match what {
        Repair::Totals => repairs.totals(None).await.map_err(Refusal::from),
        Repair::Thing { name, .. } => repairs.thing(name, now_ms).await,
    };
    let rows = repairs.rows;
    match repaired {
        Ok(()) => transaction.commit().await.map_err(Failure::sqlite)?,
        Err(refusal) => {
            transaction.rollback().await.map_err(Failure::sqlite)?;
            return Err(refusal);
        }
    }
    Ok(rows)
}

/// A repair in progress, in one transaction.
struct Repairs<'c> {
    connection: StoreConnection<'c>,
    rows: usize,
}

impl Repairs<'_> {
    async fn thing(&mut self, name: &str, now_ms: i64) -> Result<(), Refusal> {
        let tenant = if self.is_backed_up(&SESSIONS, name).await? {
            self.session(name).await?
        } else if self.is_backed_up(&KEYS, name).await? {
            self.key(name).await?
        } else if self.is_backed_up(&POLICIES, name).await? {
            self.policy(name).await?
        } else {
            return Err(Refusal::Reason(format!("the backup has no session, policy or key '{name}'")));
        };
        if self.rows > 0 {
            let (actor, outcome) = (Actor::operator(now_ms), format!("{} rows restored from a backup", self.rows));
            let by = (Quotas::NONE, &actor);
            audit_chain::record(&mut self.connection, by, &tenant, AuditAction::Repair, name, &outcome).await?;
        }
        Ok(())
    }

    async fn is_backed_up(&mut self, table: &RepairableTable, name: &str) -> Result<bool, Failure> {
        Ok(!self.rows_of("backup", table, name).await?.is_empty())
    }

    async fn rows_of(&mut self, store: &str, table: &RepairableTable, name: &str) -> Result<Vec<StoreRow>, Failure> {
        let find = format!("SELECT * FROM {store}.{} WHERE {} = $1", table.name, table.of);
        self.connection.rows(query(find).bind(name)).await
    }

    async fn session(&mut self, session: &str) -> Result<Tenant, Refusal> {
        let deleted = query("SELECT 1 AS one FROM main.audit WHERE object = $1 AND deed = $2").bind(session);
        if self.connection.row(deleted.bind(AuditAction::DeleteSession.as_str())).await?.is_some() {
            return Err(Refusal::Reason(format!("the session {session} was deleted")));
        }
        self.put_back(&SESSIONS, session).await?;
        self.put_back(&ENTRIES, session).await?;
        for (table, of) in [("renewals", "session"), ("labels", "object")] {
            let restore = format!("INSERT OR IGNORE INTO main.{table} SELECT * FROM backup.{table} WHERE {of} = $1");
            self.connection.execute(query(restore).bind(session)).await?;
        }
        let words = "INSERT OR IGNORE INTO main.words SELECT words.tenant, words.kind, words.word, now.sequence
            FROM backup.sessions AS kept JOIN main.sessions AS now ON now.session = kept.session
            JOIN backup.words AS words ON words.tenant = kept.tenant AND words.kind = 'session'
                 AND words.sequence = kept.sequence WHERE kept.session = $1";
        self.connection.execute(query(words).bind(session)).await?;
        let start = self.rows_of("main", &SESSIONS, session).await?;
        let start = start.first().map(SessionRow::from_row).transpose()?;
        let rows = self.connection.rows(entries::all_of(session)).await?;
        entries::numbered(session, &rows)?;
        let tenant = start.map(|start| start.tenant).unwrap_or_default();
        self.totals(Some(&tenant)).await?;
        Ok(tenant)
    }

    async fn policy(&mut self, policy: &str) -> Result<Tenant, Refusal> {
        self.put_back(&POLICIES, policy).await?;
        let owner = query("SELECT tenant FROM main.policy_owners WHERE policy = $1 ORDER BY sequence").bind(policy);
        let owner = self.connection.row(owner).await?.map(|row| row.get::<String>("tenant")).transpose()?;
        Ok(owner.map(|owner| Tenant::stored(&owner)).unwrap_or_default())
    }

    /// Restores a key. Its state at the backup is current only if the audit has no later changes of it.
    async fn key(&mut self, key: &str) -> Result<Tenant, Refusal> {
        let changes = query(
            "SELECT (SELECT count(*) FROM main.audit WHERE object = $1) AS now,
                    (SELECT count(*) FROM backup.audit WHERE object = $1) AS before",
        );
        let changes = self.connection.row(changes.bind(key)).await?;
        let is_same =
            changes.map_or(Ok(false), |row| Ok::<_, Failure>(row.get::<i64>("now")? == row.get::<i64>("before")?))?;
        if !is_same {
            return Err(Refusal::Reason(format!("the key {key} was changed after the backup; create another key")));
        }
        self.put_back(&KEYS, key).await?;
        let row = self.rows_of("main", &KEYS, key).await?;
        let row = row.first().map(KeyRow::from_row).transpose()?;
        Ok(row.map(|row| row.tenant).unwrap_or_default())
    }

    /// Recomputes the totals of each tenant, or of one.
    async fn totals(&mut self, only: Option<&Tenant>) -> Result<(), Failure> {
        for row in self.connection.rows(query(TOTALS).bind(ROW_BYTES).bind(ENTRY_BYTES).bind(ASSET_BYTES)).await? {
            let tenant: String = row.get("tenant")?;
            let sum = |column: &str| row.get::<Option<i64>>(column).map(Option::unwrap_or_default);
            let (kept, summed) = ((sum("sessions")?, sum("kept")?), (sum("counted")?, sum("summed")?));
            if kept == summed || only.is_some_and(|only| only.as_str() != tenant) {
                continue;
            }
            let total = query(
                "INSERT INTO main.usage (tenant, sessions, bytes) VALUES ($1, $2, $3)
                 ON CONFLICT (tenant) DO UPDATE SET sessions = excluded.sessions, bytes = excluded.bytes",
            );
            self.connection.execute(total.bind(tenant).bind(summed.0).bind(summed.1)).await?;
            self.rows += 1;
        }
        Ok(())
    }

    /// Restores the rows of a thing that are damaged or missing and are sound in the backup.
    async fn put_back(&mut self, table: &RepairableTable, name: &str) -> Result<(), Failure> {
        let number = |row: &StoreRow| table.number.map_or(Ok(0), |number| row.get::<i64>(number));
        let mut sound = HashSet::new();
        for row in self.rows_of("main", table, name).await? {
            if (table.verify)(&row).is_ok() {
                sound.insert(number(&row)?);
            }
        }
        for row in self.rows_of("backup", table, name).await? {
            let number = number(&row)?;
            if !sound.contains(&number) && (table.verify)(&row).is_ok() {
                self.take(table, name, number).await?;
            }
        }
        Ok(())
    }

    /// Copies a row from the backup unchanged.
    async fn take(&mut self, table: &RepairableTable, name: &str, number: i64) -> Result<(), Failure> {
        let mut key = vec![table.of];
        key.extend(table.number);
        let all = [key.as_slice(), table.columns, table.others].concat().join(", ");
        let is_row = table.number.map_or(String::new(), |column| format!(" AND {column} = $2"));
        let set: Vec<_> = table.columns.iter().map(|column| format!("{column} = excluded.{column}")).collect();
        let take = format!(
            "INSERT INTO main.{table} ({all}) SELECT {all} FROM backup.{table} WHERE {of} = $1{is_row}
             ON CONFLICT ({key}) DO UPDATE SET {set}",
            table = table.name,
            of = table.of,
            key = key.join(", "),
            set = set.join(", ")
        );
        let take = query(take).bind(name);
        let take = if table.number.is_some() { take.bind(number) } else { take };
        self.rows += usize::try_from(self.connection.execute(take).await?).unwrap_or_default();
        Ok(())
    }
}
