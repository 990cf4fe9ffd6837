//! Whether what is stored is what was written: every row is read once, every seal and every hash computed anew.
//!
//! It reads only, over a connection of its own, a page of rows at a time, so it runs beside a process that writes: what
//! is added or deleted meanwhile is sound or gone. It ends at the first damage, since what else is wrong is found after
//! that is mended. Cost: one pass over the database, and memory for one policy or one session.
//!
//! Not found: a session that lost its last entries, whole rows and nothing else (see the head of [`super`]).

use std::path::Path;

use sqlx::SqliteConnection;
use sqlx::postgres::PgConnection;

use super::audit_chain::{self, Chain};
use super::error::{Failure, StoreError};
use super::job::JobRow;
use super::keys::KeyRow;
use super::query::{Connection, Query, Row, query};
use super::quotas::{ENTRY_BYTES, ROW_BYTES};
use super::sessions::SessionRow;
use super::{PostgresUrl, entries, leases, migrations, policies, postgres, sqlite};

const DOING: &str = "checking the store";
/// Rows of jobs, policies or sessions read at a time.
const PAGE: i64 = 256;

/// Each tenant with its totals and what its rows sum to; of a row $1 bytes beside what it holds, of an entry $2.
const TOTALS: &str = "
    WITH parts (tenant, sessions, bytes) AS (
        SELECT tenant, 0, $1 FROM jobs
        UNION ALL SELECT tenant, 0, octet_length(json) + octet_length(labels_json)
            FROM job_requests JOIN jobs ON jobs.job = job_requests.job
        UNION ALL SELECT tenant, 0, octet_length(json) FROM job_reports JOIN jobs ON jobs.job = job_reports.job
        UNION ALL SELECT tenant, 0, $1 + octet_length(json)
            FROM policy_owners JOIN policies ON policies.policy = policy_owners.policy
        UNION ALL SELECT tenant, 0, octet_length(name) + octet_length(notes) + octet_length(tags)
            + octet_length(folded_name) + octet_length(folded_tags) FROM labels
        UNION ALL SELECT tenant, 1, $1 + octet_length(initial_history) + room * $2 FROM sessions
    ), sums (tenant, sessions, bytes) AS (SELECT tenant, sum(sessions), sum(bytes) FROM parts GROUP BY tenant)
    SELECT coalesce(usage.tenant, sums.tenant) AS tenant, usage.sessions, CAST(sums.sessions AS BIGINT) AS counted,
           usage.bytes AS kept, CAST(sums.bytes AS BIGINT) AS summed
    FROM usage FULL JOIN sums ON sums.tenant = usage.tenant";

/// A store about to be checked.
pub struct Inspection(Reader);

enum Reader {
    Sqlite(SqliteConnection),
    Postgres(PgConnection),
}

impl Inspection {
    /// The database of a folder, whether or not a process holds it.
    ///
    /// # Errors
    /// There is none, or it cannot be read.
    pub async fn of_folder(dir: &Path) -> Result<Self, StoreError> {
        sqlite::opening::inspect(dir).await.map(|connection| Inspection(Reader::Sqlite(connection)))
    }

    /// A [`backup`](super::backup), which nobody writes to.
    ///
    /// # Errors
    /// As [`Inspection::of_folder`].
    pub async fn of_backup(file: &Path) -> Result<Self, StoreError> {
        sqlite::opening::inspect_file(file).await.map(|connection| Inspection(Reader::Sqlite(connection)))
    }

    /// # Errors
    /// The database is not reached.
    pub async fn of_database(url: &PostgresUrl) -> Result<Self, StoreError> {
        postgres::inspect(url).await.map(|connection| Inspection(Reader::Postgres(connection)))
    }

    /// Checks everything, and tells a sentence for each kind of thing that is sound.
    ///
    /// # Errors
    /// [`StoreError::Corrupt`] names the first damage; [`StoreError::NewerSchema`] and [`StoreError::OlderSchema`] say that
    /// another release must check it.
    pub async fn run(mut self, tell: &mut impl FnMut(String)) -> Result<(), StoreError> {
        let damaged = |error| match error {
            StoreError::Fatal { source, .. } => StoreError::Corrupt { what: format!("the database ({source})") },
            other => other,
        };
        tell(format!("schema {}: this binary's", self.schema().await.map_err(damaged)?));
        self.rows(tell).await.map_err(|failure| damaged(failure.during(DOING)))
    }

    async fn schema(&mut self) -> Result<i64, StoreError> {
        match &mut self.0 {
            Reader::Sqlite(connection) => {
                migrations::require_newest(&migrations::sqlite(), sqlite::opening::version(connection).await?)
            }
            Reader::Postgres(connection) => {
                migrations::require_newest(&migrations::postgres(), postgres::version(connection).await?)
            }
        }
    }

    async fn rows(&mut self, tell: &mut impl FnMut(String)) -> Result<(), Failure> {
        if let Reader::Sqlite(_) = self.0 {
            self.file().await?;
            tell("the file: pages, indexes and references are whole".to_owned());
        }
        let policies = self.policies().await?;
        tell(format!("policies: {policies}, each the bytes its name is the hash of"));
        let (jobs, checkpoints) = self.jobs().await?;
        tell(format!("jobs: {jobs}, with {checkpoints} checkpoints as sealed"));
        let (sessions, entries) = self.sessions().await?;
        tell(format!("sessions: {sessions}, with {entries} entries, as sealed and none missing between"));
        let tenants = self.totals().await?;
        tell(format!("totals: of {tenants} tenants, each the sum of what it keeps"));
        let keys = self.read(query("SELECT * FROM access_keys ORDER BY sequence")).await?;
        let keys: Vec<_> = keys.iter().map(KeyRow::from_row).collect::<Result<_, _>>()?;
        tell(format!("keys: {}, each readable", keys.len()));
        let (chains, entries) = self.audit().await?;
        tell(format!("audit: {entries} entries in {chains} chains, as sealed and none missing"));
        Ok(())
    }

    async fn audit(&mut self) -> Result<(usize, usize), Failure> {
        let (mut chains, mut entries) = (0, 0);
        for row in self.read(audit_chain::chains()).await? {
            let mut chain = Chain::from_row(&row)?;
            while !chain.is_whole() {
                let page = self.read(chain.next(PAGE)).await?;
                chain.follow(&page)?;
                entries += page.len();
            }
            chains += 1;
        }
        Ok((chains, entries))
    }

    /// What SQLite knows of its file: the trees and indexes, and that no row refers to one that is not there.
    async fn file(&mut self) -> Result<(), Failure> {
        let found = self.read(query("SELECT integrity_check AS found FROM pragma_integrity_check LIMIT 1")).await?;
        let found: String = found.first().map_or(Ok("nothing".to_owned()), |row| row.get("found"))?;
        if found != "ok" {
            return Err(Failure::Corrupt(format!("the file of the database ({found})")));
        }
        let broken = query(r#"SELECT "table" AS child, parent FROM pragma_foreign_key_check LIMIT 1"#);
        match self.read(broken).await?.first() {
            None => Ok(()),
            Some(row) => {
                let (child, parent): (String, String) = (row.get("child")?, row.get("parent")?);
                Err(Failure::Corrupt(format!("a reference from {child} to {parent}")))
            }
        }
    }

    async fn policies(&mut self) -> Result<usize, Failure> {
        let (mut after, mut checked) = (0, 0);
        // One at a time: a policy may have megabytes.
        let next = "SELECT sequence, policy, json FROM policies WHERE sequence > $1 ORDER BY sequence LIMIT 1";
        while let Some(row) = self.read(query(next).bind(after)).await?.first() {
            policies::verify(&row.get::<String>("policy")?, &row.get::<Vec<u8>>("json")?)?;
            (after, checked) = (row.get("sequence")?, checked + 1);
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
                let job = JobRow::from_row(row)?.job;
                let rows = self.read(leases::checkpoints_of(&job)).await?;
                checkpoints += leases::verified_checkpoints(&job, &rows)?.len();
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
                let session = SessionRow::from_row(row)?.session;
                let rows = self.read(entries::all_of(&session)).await?;
                recorded += entries::numbered(&session, &rows)?.map_or(0, |rows| rows.len());
            }
            sessions += page.len();
        }
    }

    /// What quotas go by: the totals of each tenant against its rows.
    async fn totals(&mut self) -> Result<usize, Failure> {
        let totals = self.read(query(TOTALS).bind(ROW_BYTES).bind(ENTRY_BYTES)).await?;
        for row in &totals {
            let [kept, summed]: [Option<i64>; 2] = [row.get("kept")?, row.get("summed")?];
            let [sessions, counted]: [Option<i64>; 2] = [row.get("sessions")?, row.get("counted")?];
            if kept.unwrap_or(0) != summed.unwrap_or(0) || sessions.unwrap_or(0) != counted.unwrap_or(0) {
                return Err(Failure::Corrupt(format!("the total of tenant {}", row.get::<String>("tenant")?)));
            }
        }
        Ok(totals.len())
    }

    async fn read(&mut self, query: Query) -> Result<Vec<Row>, Failure> {
        let mut connection = match &mut self.0 {
            Reader::Sqlite(connection) => Connection::Sqlite(connection),
            Reader::Postgres(connection) => Connection::Postgres(connection),
        };
        connection.rows(query).await
    }
}
