//! Checks that stored data is what was written: reads every row once and recomputes every seal and hash.
//!
//! A check only reads, over a connection of its own, one page of rows at a time. It can therefore run beside a process
//! that writes: rows added or deleted meanwhile are sound or gone. Damage does not end the check; it lists all damage.
//! Cost: one pass over the database, and memory for one policy or one session.
//!
//! Not found: a session whose last rows are missing, if all of them are observations (see the head of [`super`]).

use std::path::Path;

use sqlx::SqliteConnection;
use sqlx::postgres::PgConnection;

use crate::store::engine::codec::to_sql;
use crate::store::engine::error::{Cause, Failure, StoreError};
use crate::store::engine::query::{Query, StoreConnection, StoreRow, query};
use crate::store::engine::{migrations, postgres, sqlite};
use crate::store::jobs::job::JobRow;
use crate::store::jobs::leases;
use crate::store::sessions::SessionRow;
use crate::store::sessions::entries::{self, EntryRow};
use crate::store::sessions::links::LinkRow;
use crate::store::tenants::audit_chain::{self, AuditChain};
use crate::store::tenants::keys::KeyRow;
use crate::store::tenants::quotas::{ASSET_BYTES, ENTRY_BYTES, ROW_BYTES};
use crate::store::{PostgresUrl, policies};

const DOING: &str = "checking the store";
/// The number of rows of jobs, policies or sessions read at a time.
const PAGE: i64 = 256;

/// Selects each tenant with its stored totals and the sums over its rows. $1 is the overhead of a row in bytes, $2 the
/// size of an entry, and $3 the addition to an entry for each of several assets.
pub(in crate::store) const TOTALS: &str = "
    WITH parts (tenant, sessions, bytes) AS (
        SELECT tenant, 0, $1 FROM jobs
        UNION ALL SELECT tenant, 0, octet_length(json) + octet_length(labels_json)
            FROM job_requests JOIN jobs ON jobs.job = job_requests.job
        UNION ALL SELECT tenant, 0, octet_length(json) FROM job_reports JOIN jobs ON jobs.job = job_reports.job
        UNION ALL SELECT tenant, 0, $1 + octet_length(json)
            FROM policy_owners JOIN policies ON policies.policy = policy_owners.policy
        UNION ALL SELECT tenant, 0, octet_length(name) + octet_length(notes) + octet_length(tags)
            + octet_length(folded_name) + 2 * octet_length(words)
            + 64 * (octet_length(words) - octet_length(replace(words, ' ', ''))) FROM labels
        UNION ALL SELECT tenant, 1, $1 + octet_length(initial_history) + octet_length(plan_json)
            + room * ($2 + assets * $3) FROM sessions
    ), sums (tenant, sessions, bytes) AS (SELECT tenant, sum(sessions), sum(bytes) FROM parts GROUP BY tenant)
    SELECT coalesce(usage.tenant, sums.tenant) AS tenant, usage.sessions, CAST(sums.sessions AS BIGINT) AS counted,
           usage.bytes AS kept, CAST(sums.bytes AS BIGINT) AS summed
    FROM usage FULL JOIN sums ON sums.tenant = usage.tenant";

/// Selects sessions for which the audit has more corrections or renewals than there are entries.
const UNRECORDED: &str = "
    SELECT DISTINCT object FROM (
        SELECT object, CASE deed WHEN 'session.correct' THEN 'correction' ELSE 'renewal' END AS kind, count(*) AS recorded
        FROM audit WHERE deed IN ('session.correct', 'session.renew') GROUP BY object, deed) AS changes
    JOIN sessions ON sessions.session = changes.object
    WHERE recorded > (SELECT count(*) FROM entries WHERE entries.session = object AND entries.kind = changes.kind)
    ORDER BY object";

/// The parts of a check, in the order in which they run.
#[derive(Debug, Clone, Copy)]
enum CheckPart {
    File,
    Policies,
    Jobs,
    Sessions,
    Totals,
    Keys,
    Audit,
}

impl CheckPart {
    const ALL: [CheckPart; 7] = [
        CheckPart::File,
        CheckPart::Policies,
        CheckPart::Jobs,
        CheckPart::Sessions,
        CheckPart::Totals,
        CheckPart::Keys,
        CheckPart::Audit,
    ];
}

/// A store about to be checked.
pub struct Inspection {
    reader: CheckReader,
    /// The damage found so far.
    damage: Vec<String>,
}

enum CheckReader {
    Sqlite(SqliteConnection),
    Postgres(PgConnection),
}

impl From<CheckReader> for Inspection {
    fn from(reader: CheckReader) -> Self {
        Inspection { reader, damage: Vec::new() }
    }
}

impl Inspection {
    /// Opens the database of a folder, even if a process holds it.
    ///
    /// # Errors
    /// Fails if there is no database or it cannot be read.
    pub async fn of_folder(dir: &Path) -> Result<Self, StoreError> {
        sqlite::opening::inspect(dir).await.map(|connection| CheckReader::Sqlite(connection).into())
    }

    /// Opens a file that `backup` wrote, to which nothing writes.
    ///
    /// # Errors
    /// As [`Inspection::of_folder`].
    pub async fn of_backup(file: &Path) -> Result<Self, StoreError> {
        sqlite::opening::inspect_file(file).await.map(|connection| CheckReader::Sqlite(connection).into())
    }

    /// Connects to the database at `url`.
    ///
    /// # Errors
    /// Fails if the database cannot be reached.
    pub async fn of_database(url: &PostgresUrl) -> Result<Self, StoreError> {
        postgres::inspect(url).await.map(|connection| CheckReader::Postgres(connection).into())
    }

    /// Checks everything, and calls `tell` with a sentence for each sound kind of data and for each damaged thing.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] counts what is damaged; [`StoreError::NewerSchema`] and [`StoreError::OlderSchema`] say that
    /// another release must check it.
    pub async fn run(mut self, tell: &mut impl FnMut(String)) -> Result<(), StoreError> {
        let version = self.schema().await.map_err(|error| match error {
            StoreError::Fatal { source, .. } => StoreError::Corrupt { what: format!("the database ({source})") },
            other => other,
        });
        tell(format!("schema {}: the one that this binary uses", version?));
        self.all(tell).await.map_err(|failure| failure.during(DOING))?;
        let others = self.damage.len().saturating_sub(1);
        match self.damage.into_iter().next() {
            None => Ok(()),
            Some(first) => Err(StoreError::Damaged { first, others }),
        }
    }

    async fn schema(&mut self) -> Result<i64, StoreError> {
        match &mut self.reader {
            CheckReader::Sqlite(connection) => {
                migrations::require_newest(&migrations::sqlite(), sqlite::opening::version(connection).await?)
            }
            CheckReader::Postgres(connection) => {
                migrations::require_newest(&migrations::postgres(), postgres::version(connection).await?)
            }
        }
    }

    async fn all(&mut self, tell: &mut impl FnMut(String)) -> Result<(), Failure> {
        for part in CheckPart::ALL {
            let before = self.damage.len();
            // A part that cannot be read at all counts as damage of the file; the other parts may still be readable.
            let found = self.part(part).await;
            let sentence = self.note(found)?;
            match (sentence, &self.damage[before..]) {
                (Some(sentence), []) => tell(sentence),
                (_, damage) => damage.iter().for_each(|what| tell(format!("damaged: {what}"))),
            }
            if self.damage.iter().any(|what| what.starts_with("the ")) && matches!(part, CheckPart::File) {
                // The driver may fail to read rows on damaged pages.
                break;
            }
        }
        Ok(())
    }

    /// Returns the value that was read; records damage and returns `None` if it is damaged.
    fn note<T>(&mut self, read: Result<T, Failure>) -> Result<Option<T>, Failure> {
        let failure = match read {
            Ok(value) => return Ok(Some(value)),
            Err(Failure::Engine(Cause::Fatal, error)) => Failure::Corrupt(format!("the database ({error})")),
            Err(failure) => failure,
        };
        self.damage.push(failure.damage()?);
        Ok(None)
    }

    /// Checks a part, and returns a sentence that counts what it holds.
    async fn part(&mut self, part: CheckPart) -> Result<String, Failure> {
        Ok(match part {
            CheckPart::File => {
                self.file().await?;
                match self.reader {
                    CheckReader::Sqlite(_) => "the file: pages, indexes and references are intact".to_owned(),
                    CheckReader::Postgres(_) => "the file: PostgreSQL checks it itself".to_owned(),
                }
            }
            CheckPart::Policies => {
                format!("policies: {}, and each name is the hash of the content", self.policies().await?)
            }
            CheckPart::Jobs => {
                let (jobs, checkpoints) = self.jobs().await?;
                format!("jobs: {jobs}, with {checkpoints} checkpoints; every seal is valid")
            }
            CheckPart::Sessions => {
                let (sessions, entries) = self.sessions().await?;
                format!("sessions: {sessions}, with {entries} entries; every seal is valid and no entry is missing")
            }
            CheckPart::Totals => {
                format!("totals: of {} tenants; each is the sum of the stored rows", self.totals().await?)
            }
            CheckPart::Keys => {
                let rows = self.read(query("SELECT * FROM access_keys ORDER BY sequence")).await?;
                rows.iter().try_for_each(|row| self.note(KeyRow::from_row(row)).map(drop))?;
                let links = self.read(query("SELECT * FROM links ORDER BY link")).await?;
                links.iter().try_for_each(|row| self.note(LinkRow::from_row(row)).map(drop))?;
                format!("keys: {}, with {} links to letters, and every seal is valid", rows.len(), links.len())
            }
            CheckPart::Audit => {
                let (chains, entries) = self.audit().await?;
                format!("audit: {entries} entries in {chains} chains; every seal is valid and no entry is missing")
            }
        })
    }

    async fn audit(&mut self) -> Result<(usize, usize), Failure> {
        let mut entries = 0;
        let found = self.read(audit_chain::chains()).await?;
        let total = self.read(audit_chain::total()).await?;
        for row in &found {
            let Some(mut chain) = self.note(AuditChain::from_row(row))? else { continue };
            self.note(chain.verify())?;
            while !chain.is_whole() {
                let page = self.read(chain.next(PAGE)).await?;
                self.damage.extend(chain.follow(&page)?);
                entries += page.len();
            }
        }
        self.note(audit_chain::verify_total(total.first(), to_sql(found.len())))?;
        for row in self.read(query(UNRECORDED)).await? {
            self.damage.push(format!("the end of session {}", row.get::<String>("object")?));
        }
        Ok((found.len(), entries))
    }

    /// Runs SQLite's own checks: its trees and indexes are intact, and no row refers to a missing one.
    async fn file(&mut self) -> Result<(), Failure> {
        if let CheckReader::Postgres(_) = self.reader {
            return Ok(());
        }
        let faults = "SELECT CAST(integrity_check AS TEXT) AS fault FROM pragma_integrity_check LIMIT 100";
        for row in self.read(query(faults)).await? {
            let fault: String = row.get("fault")?;
            if fault != "ok" {
                self.damage.push(format!("the file of the database ({fault})"));
            }
        }
        let broken = r#"SELECT "table" AS child, parent FROM pragma_foreign_key_check LIMIT 100"#;
        for row in self.read(query(broken)).await? {
            let (child, parent): (String, String) = (row.get("child")?, row.get("parent")?);
            self.damage.push(format!("a reference from {child} to {parent}"));
        }
        Ok(())
    }

    async fn policies(&mut self) -> Result<usize, Failure> {
        let (mut after, mut checked) = (0, 0);
        // One at a time, because a policy may take megabytes.
        let next = "SELECT sequence, policy, json FROM policies WHERE sequence > $1 ORDER BY sequence LIMIT 1";
        while let Some(row) = self.read(query(next).bind(after)).await?.first() {
            (after, checked) = (row.get("sequence")?, checked + 1);
            let bytes = row.get::<String>("policy").and_then(|policy| Ok((policy, row.get::<Vec<u8>>("json")?)));
            self.note(bytes.and_then(|(policy, json)| policies::verify(&policy, &json)))?;
        }
        Ok(checked)
    }

    async fn jobs(&mut self) -> Result<(usize, usize), Failure> {
        let (mut after, mut jobs, mut checkpoints) = (0, 0, 0);
        loop {
            let next = query("SELECT * FROM jobs WHERE sequence > $1 ORDER BY sequence LIMIT $2");
            let page = self.read(next.bind(after).bind(PAGE)).await?;
            let Some(last) = page.last() else { return Ok((jobs, checkpoints)) };
            after = last.get("sequence")?;
            for row in &page {
                let Some(JobRow { job, .. }) = self.note(JobRow::from_row(row))? else { continue };
                for row in self.read(leases::checkpoints_of(&job)).await? {
                    self.note(leases::verified_checkpoints(&job, std::slice::from_ref(&row)))?;
                    checkpoints += 1;
                }
            }
            jobs += page.len();
        }
    }

    async fn sessions(&mut self) -> Result<(usize, usize), Failure> {
        let (mut after, mut sessions, mut recorded) = (0, 0, 0);
        loop {
            let next = query("SELECT * FROM sessions WHERE sequence > $1 ORDER BY sequence LIMIT $2");
            let page = self.read(next.bind(after).bind(PAGE)).await?;
            let Some(last) = page.last() else { return Ok((sessions, recorded)) };
            after = last.get("sequence")?;
            for row in &page {
                self.note(SessionRow::from_row(row))?;
                let Some(session) = self.note(row.get::<String>("session"))? else { continue };
                let rows = self.read(entries::all_of(&session)).await?;
                let (read, damage) = each(&session, &rows)?;
                self.damage.extend(damage);
                recorded += read;
            }
            sessions += page.len();
        }
    }

    /// Compares the totals of each tenant, which quotas are based on, with its rows.
    async fn totals(&mut self) -> Result<usize, Failure> {
        let totals = self.read(query(TOTALS).bind(ROW_BYTES).bind(ENTRY_BYTES).bind(ASSET_BYTES)).await?;
        for row in &totals {
            let [kept, summed]: [Option<i64>; 2] = [row.get("kept")?, row.get("summed")?];
            let [sessions, counted]: [Option<i64>; 2] = [row.get("sessions")?, row.get("counted")?];
            if kept.unwrap_or(0) != summed.unwrap_or(0) || sessions.unwrap_or(0) != counted.unwrap_or(0) {
                self.damage.push(format!("the total of tenant {}", row.get::<String>("tenant")?));
            }
        }
        Ok(totals.len())
    }

    async fn read(&mut self, query: Query) -> Result<Vec<StoreRow>, Failure> {
        let mut connection = match &mut self.reader {
            CheckReader::Sqlite(connection) => StoreConnection::Sqlite(connection),
            CheckReader::Postgres(connection) => StoreConnection::Postgres(connection),
        };
        connection.rows(query).await
    }
}

/// Counts the entries of a session, and lists those that are damaged or missing.
fn each(session: &str, rows: &[StoreRow]) -> Result<(usize, Vec<String>), Failure> {
    let (mut last, mut damage) = (0, Vec::new());
    for row in rows {
        let Some(entry) = row.get::<Option<i64>>("entry")? else { return Ok((0, damage)) };
        if entry != last + 1 {
            damage.push(format!("entry {} of session {session}", last + 1));
        }
        if let Err(failure) = EntryRow::from_row(row) {
            damage.push(failure.damage()?);
        }
        last = entry;
    }
    Ok((rows.len(), damage))
}
