//! The events of a session: append-only entries, numbered from 1 in the order they were recorded.
//!
//! An entry stores a report and its answer, and is numbered one above the last. If two writers append at once, one
//! fails, reads the other's entry, and decides again.

use std::sync::LazyLock;

use futures_util::FutureExt;

use crate::store::engine::codec::{Seal, from_sql, hexadecimal, to_sql};
use crate::store::engine::error::Failure;
use crate::store::engine::postgres::Database;
use crate::store::engine::query::{Query, StoreConnection, StoreRow, query};
use crate::store::tenants::audit_chain;
use crate::store::tenants::quotas::{self, Quotas, Usage};
use crate::store::{Actor, AuditAction, AuditRow, Engine, Head, Store, StoreError, Tenant};

/// The kind of event that an entry records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EntryKind {
    /// A period that passed.
    Observation,
    /// A corrected report of an earlier period.
    Correction,
    /// The policy that the session continues with.
    Renewal,
}

/// One entry; verified against its seal when it is read.
#[derive(Debug, Clone, PartialEq)]
pub struct EntryRow {
    pub session: String,
    pub entry: usize,
    pub kind: EntryKind,
    /// Counts from 1 among the entries of its kind: the period, or the number of the correction.
    pub number: usize,
    /// The report: the same content under the same number is a repeat.
    pub content_json: String,
    pub answer_json: String,
    /// The numbers that `content_json` and `answer_json` refer to by position.
    pub numbers: Vec<u8>,
    pub created_ms: i64,
    /// The name of the key that reported it; empty if no key was required.
    pub key: String,
}

/// The outcome of an append.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Append {
    Appended,
    /// Its number is not one above the last entry's, because another writer appended meanwhile.
    NotNext,
    NoSession,
    /// Its tenant has no such policy.
    NoPolicy,
}

impl EntryKind {
    fn as_str(self) -> &'static str {
        match self {
            EntryKind::Observation => "observation",
            EntryKind::Correction => "correction",
            EntryKind::Renewal => "renewal",
        }
    }

    /// Returns the word for what the numbers of this kind count.
    pub fn counted(self) -> &'static str {
        match self {
            EntryKind::Observation => "period",
            EntryKind::Correction => "correction",
            EntryKind::Renewal => "renewal",
        }
    }

    pub(in crate::store) fn stored(text: &str) -> Result<Self, Failure> {
        let all = [EntryKind::Observation, EntryKind::Correction, EntryKind::Renewal];
        let found = all.into_iter().find(|kind| kind.as_str() == text);
        found.ok_or_else(|| Failure::Corrupt(format!("an entry of the kind {text}")))
    }
}

impl Store {
    /// Appends the entry after the last, or returns why it was not appended; decides and writes in one transaction. The
    /// quota for an observation was already reserved when the session was opened or renewed. Every other entry reserves
    /// its own quota and gets an audit entry.
    ///
    /// # Errors
    /// [`StoreError::OverQuota`] if an entry other than an observation exceeds the quota.
    pub async fn append(&self, new: EntryRow) -> Result<Append, StoreError> {
        if new.kind != EntryKind::Observation {
            return self.append_with(new, Vec::new()).await;
        }
        self.append_observation(new).await
    }

    /// Appends an observation without events.
    pub(super) async fn append_observation(&self, new: EntryRow) -> Result<Append, StoreError> {
        match &self.engine {
            Engine::Sqlite(folder) => folder.append(new).await,
            Engine::Postgres(database) => append_shared(database, new).boxed().await,
        }
    }

    /// Returns the newest entry of this kind and number. A period observed again after its removal has a newer entry.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] if the row is not what was written.
    pub async fn entry(&self, session: &str, kind: EntryKind, number: usize) -> Result<Option<EntryRow>, StoreError> {
        // The entry with number n of its kind is at least the n-th entry.
        let find = query(
            "SELECT * FROM entries WHERE session = $1 AND entry >= $2 AND number = $2 AND kind = $3
             ORDER BY entry DESC LIMIT 1",
        );
        let find = find.bind(session).bind(to_sql(number)).bind(kind.as_str());
        self.read("reading an entry", find, |rows| rows.first().map(EntryRow::from_row).transpose()).await
    }

    /// Returns every entry of the session, in order, or `None` if there is no such session. One statement reads both,
    /// so a session deleted meanwhile never looks like one without entries.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] if a row is not what was written or one is missing.
    pub async fn entries(&self, session: &str) -> Result<Option<Vec<EntryRow>>, StoreError> {
        self.read("reading entries", all_of(session), |rows| numbered(session, rows)).await
    }
}

pub(in crate::store) fn all_of(session: &str) -> Query {
    let all = query(
        "SELECT entries.* FROM sessions LEFT JOIN entries ON entries.session = sessions.session
         WHERE sessions.session = $1 ORDER BY entries.entry",
    );
    all.bind(session)
}

/// Decodes the rows of [`all_of`], verifying each and that none is missing before the last.
pub(in crate::store) fn numbered(session: &str, rows: &[StoreRow]) -> Result<Option<Vec<EntryRow>>, Failure> {
    let Some(first) = rows.first() else { return Ok(None) };
    if first.get::<Option<i64>>("entry")?.is_none() {
        return Ok(Some(Vec::new()));
    }
    let rows: Vec<_> = rows.iter().map(EntryRow::from_row).collect::<Result<_, Failure>>()?;
    match rows.iter().zip(1..).find(|(row, entry)| row.entry != *entry) {
        None => Ok(Some(rows)),
        Some((_, entry)) => Err(Failure::Corrupt(format!("entry {entry} of session {session}"))),
    }
}

/// Appends by one statement, which commits by itself. The table's keys decide between two writers of the same entry, or
/// between an append and a deletion. The reason for a failure is looked up afterwards.
async fn append_shared(database: &Database, new: EntryRow) -> Result<Append, StoreError> {
    match database.execute(APPENDING, bind_row(query(INSERT_ONE.as_str()), &new)).await {
        Ok(rows) if rows > 0 => Ok(Append::Appended),
        Ok(_) | Err(StoreError::Refused { .. }) => {
            database.write(APPENDING, move |connection| append(connection, new).boxed()).await
        }
        Err(error) => Err(error),
    }
}

pub(in crate::store) const APPENDING: &str = "appending an entry";

/// Inserts the row by a statement that itself checks that it is the next one. No other statement here changes rows.
pub(in crate::store) async fn append(mut connection: StoreConnection<'_>, new: EntryRow) -> Result<Append, Failure> {
    append_next(&mut connection, &new).await.map(|(append, _)| append)
}

/// Appends like [`append`], and also returns the tenant of the session. Observations are inserted without this row
/// lock. The lock must not block their reference to the session, or the two could deadlock.
pub(super) async fn append_next(
    connection: &mut StoreConnection<'_>,
    new: &EntryRow,
) -> Result<(Append, Tenant), Failure> {
    let session = query("SELECT tenant FROM sessions WHERE session = $1").bind(new.session.as_str());
    let Some(found) = connection.row(session.for_update_but_references()).await? else {
        return Ok((Append::NoSession, Tenant::default()));
    };
    let is_next = connection.execute(bind_row(query(INSERT_ONE.as_str()), new)).await? > 0;
    let append = if is_next { Append::Appended } else { Append::NotNext };
    Ok((append, Tenant::stored(&found.get::<String>("tenant")?)))
}

pub(super) async fn take_room(
    connection: &mut StoreConnection<'_>,
    tenant: &Tenant,
    session: &str,
    room: i64,
    (quotas, actor): (Quotas, Actor),
    (deed, outcome): (AuditAction, &str),
) -> Result<(), Failure> {
    let widen = query("UPDATE sessions SET room = room + $1 WHERE session = $2 RETURNING assets");
    let assets = connection.row(widen.bind(room).bind(session)).await?.map_or(Ok(0), |row| row.get("assets"))?;
    quotas::take(connection, tenant, Usage::of_entries(room, assets), quotas).await?;
    audit_chain::record(connection, (quotas, &actor), tenant, deed, session, outcome).await
}

const NAMES: &str = "session, entry, kind, number, content_json, answer_json, numbers, created_ms, access_key, seal";
const COLUMNS: usize = 10;
const NEXT: &str = "(SELECT coalesce(max(entry), 0) + 1 FROM entries WHERE entries.session = new.session)";

/// Inserts the next entry of a session that exists, unless another transaction inserts it.
static INSERT_ONE: LazyLock<String> = LazyLock::new(|| {
    let numbers: Vec<String> = (1..=COLUMNS).map(|column| format!("${column}")).collect();
    format!(
        "WITH new ({NAMES}) AS (VALUES ({}))
         INSERT INTO entries ({NAMES}) SELECT new.* FROM new CROSS JOIN sessions
         WHERE sessions.session = new.session AND new.entry = {NEXT} ON CONFLICT (session, entry) DO NOTHING",
        numbers.join(", ")
    )
});

/// The sizes are powers of two, so that any number of rows fits a statement of less than twice its size.
const SIZES: usize = 7;
/// The most rows that one statement inserts.
pub(in crate::store) const ROWS_AT_ONCE: usize = 1 << (SIZES - 1);

static INSERT_MANY: [LazyLock<String>; SIZES] = [
    LazyLock::new(|| insert_all(1)),
    LazyLock::new(|| insert_all(2)),
    LazyLock::new(|| insert_all(4)),
    LazyLock::new(|| insert_all(8)),
    LazyLock::new(|| insert_all(16)),
    LazyLock::new(|| insert_all(32)),
    LazyLock::new(|| insert_all(64)),
];

/// Inserts `rows` rows into SQLite, or none. A row that is not the next of its session gets no seal, which the table
/// rejects. A row of an unknown session fails its foreign key. Unbound values are NULL, and rows of them are skipped.
fn insert_all(rows: usize) -> String {
    let sealed = NAMES.replace("seal", &format!("CASE entry WHEN {NEXT} THEN seal END"));
    let row = format!("({})", ["?"; COLUMNS].join(", "));
    format!(
        "INSERT INTO entries ({NAMES}) WITH new ({NAMES}) AS (VALUES {})
         SELECT {sealed} FROM new WHERE session IS NOT NULL",
        vec![row; rows].join(", ")
    )
}

/// Inserts up to [`ROWS_AT_ONCE`] rows into SQLite by one statement, all of them or none.
///
/// # Errors
/// Fails too if some row is not the next one of a session that exists.
pub(in crate::store) async fn append_all(
    connection: &mut StoreConnection<'_>,
    new: &[&EntryRow],
) -> Result<(), Failure> {
    let size = new.len().next_power_of_two().trailing_zeros() as usize;
    let insert = new.iter().fold(query(INSERT_MANY[size].as_str()), |insert, new| bind_row(insert, new));
    connection.execute(insert).await.map(drop)
}

fn bind_row(insert: Query, new: &EntryRow) -> Query {
    insert
        .bind(new.session.as_str())
        .bind(to_sql(new.entry))
        .bind(new.kind.as_str())
        .bind(to_sql(new.number))
        .bind(new.content_json.as_str())
        .bind(new.answer_json.as_str())
        .bind(new.numbers.clone())
        .bind(new.created_ms)
        .bind(new.key.as_str())
        .bind(new.seal().finish())
}

impl EntryRow {
    pub fn head(&self) -> Head {
        Head { entries: self.entry, seal: self.seal().finish() }
    }

    /// Returns how many entries it counts as, because a correction may have a long reason.
    pub(super) fn room(&self) -> i64 {
        let lengths = [self.content_json.len(), self.answer_json.len(), self.session.len(), self.key.len()];
        1 + (quotas::SEALED_BYTES + to_sql(lengths.into_iter().sum())) / quotas::ENTRY_BYTES
    }

    fn seal(&self) -> Seal {
        Seal::of("entry")
            .text(&self.session)
            .integer(to_sql(self.entry))
            .text(self.kind.as_str())
            .integer(to_sql(self.number))
            .text(&self.content_json)
            .text(&self.answer_json)
            .bytes(&self.numbers)
            .integer(self.created_ms)
            .text(&self.key)
    }

    pub(super) fn audit_row(row: &StoreRow) -> Result<AuditRow, Failure> {
        let observation = EntryRow::from_row(row)?;
        Ok(AuditRow {
            sequence: 0,
            tenant: Tenant::stored(&row.get::<String>("tenant")?),
            key: observation.key,
            roles: String::new(),
            deed: AuditAction::Observe.as_str().to_owned(),
            object: observation.session,
            outcome: format!("period {} recorded", observation.number),
            at_ms: observation.created_ms,
            number: to_sql(observation.entry),
            seal: hexadecimal(&row.get::<Vec<u8>>("seal")?),
        })
    }

    pub(in crate::store) fn from_row(row: &StoreRow) -> Result<Self, Failure> {
        Self::beside(row, "created_ms", "seal")
    }

    /// Reads the entry from a row that is joined with a session, so that its time and its seal have other column names.
    pub(in crate::store) fn beside(row: &StoreRow, created_ms: &str, seal: &str) -> Result<Self, Failure> {
        let read = EntryRow {
            session: row.get("session")?,
            entry: from_sql(row.get("entry")?)?,
            kind: EntryKind::stored(&row.get::<String>("kind")?)?,
            number: from_sql(row.get("number")?)?,
            content_json: row.get("content_json")?,
            answer_json: row.get("answer_json")?,
            numbers: row.get("numbers")?,
            created_ms: row.get(created_ms)?,
            key: row.get("access_key")?,
        };
        read.verified(&row.get::<Vec<u8>>(seal)?)
    }

    /// Verifies the entry against its seal.
    ///
    /// # Errors
    /// [`Failure::Corrupt`] if this is not the entry that was sealed.
    pub(in crate::store) fn verified(self, seal: &[u8]) -> Result<Self, Failure> {
        self.seal().verify(seal, || format!("entry {} of session {}", self.entry, self.session))?;
        Ok(self)
    }
}
