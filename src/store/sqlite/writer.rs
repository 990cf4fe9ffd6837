//! The one writer: operations that wait together are committed together.
//!
//! A commit costs one fsync however much it holds, so each transaction takes every operation that waits, up to [`GROUP`].
//! Observations alone, which is what a busy service writes, are one statement and so a transaction of their own. Of other
//! groups each operation runs in a savepoint, or changes rows by a single statement: one that fails is undone alone. Answers
//! leave after the commit. Errors after which SQLite may have rolled back by itself (disk full, I/O) fail every operation
//! that ran in the group; those that had not run yet go to the next one. After a fatal error the writer stops for good.

use std::fs::File;

use sqlx::{Connection, SqliteConnection};
use tokio::sync::{mpsc, oneshot, watch};

use super::batch::{self, Appending, Waiting};
use super::operation::{Answer, Operation, Undo};
use crate::store::entries::ROWS_AT_ONCE;
use crate::store::error::{Failure, StoreError};

/// Operations in one transaction: the observations that one statement takes. A row then costs a hundredth of what it costs
/// alone; more only adds waiting.
const GROUP: usize = ROWS_AT_ONCE;
/// Requests that may wait before callers do.
pub(super) const QUEUE: usize = 1024;

pub(super) enum Request {
    Write(Operation),
    Append(Appending),
    /// Commit what waits, then close and answer.
    Close(oneshot::Sender<()>),
}

/// Starts the writer on a thread of its own: its many short waits for SQLite do not queue behind requests.
pub(super) fn start(
    connection: SqliteConnection,
    requests: mpsc::Receiver<Request>,
    fatal: watch::Sender<Option<StoreError>>,
    lock: Option<File>,
) -> Result<(), StoreError> {
    let unavailable = |_| StoreError::Unavailable { doing: "starting the writer", source: None };
    let runtime = tokio::runtime::Builder::new_current_thread().build().map_err(unavailable)?;
    let serving = move || runtime.block_on(serve(connection, requests, fatal, lock));
    std::thread::Builder::new().name("writer".into()).spawn(serving).map(drop).map_err(unavailable)
}

/// Serves requests until the last [`Folder`](super::Folder) is dropped, one closes it, or a write fails fatally.
/// Holds the folder's lock, where it has it, as long as it can write.
async fn serve(
    mut connection: SqliteConnection,
    mut requests: mpsc::Receiver<Request>,
    fatal: watch::Sender<Option<StoreError>>,
    lock: Option<File>,
) {
    let mut waiting = Waiting::default();
    let mut closed = Vec::new();
    while !waiting.is_empty() || receive(&mut requests, &mut waiting, &mut closed).await {
        if let Err(error) = commit_group(&mut connection, &mut waiting).await
            && (error.is_fatal() || has_lost_its_engine(&error))
        {
            fatal.send_replace(Some(error));
            return;
        }
    }
    // The commits are durable already; what closing adds is a shorter log to read at the next start.
    let _ = connection.close().await;
    drop(lock);
    for closed in closed {
        let _ = closed.send(());
    }
}

/// True where the thread that SQLite runs on has died: every write to come would fail.
fn has_lost_its_engine(error: &StoreError) -> bool {
    matches!(error, StoreError::Unavailable { source: Some(source), .. } if matches!(**source, sqlx::Error::WorkerCrashed))
}

/// Waits for a request and takes those behind it, a group at most. False once there will be no more.
async fn receive(
    requests: &mut mpsc::Receiver<Request>,
    waiting: &mut Waiting,
    closed: &mut Vec<oneshot::Sender<()>>,
) -> bool {
    let mut received = Vec::new();
    let count = requests.recv_many(&mut received, GROUP).await;
    for request in received {
        match request {
            Request::Write(operation) => waiting.operations.push_back(operation),
            Request::Append(append) => waiting.appends.push(append),
            Request::Close(answer) => {
                requests.close();
                closed.push(answer);
            }
        }
    }
    count > 0
}

/// Runs what waits as one transaction and answers every operation that ran.
///
/// # Errors
/// What ended the group before its commit.
async fn commit_group(connection: &mut SqliteConnection, waiting: &mut Waiting) -> Result<(), StoreError> {
    let mut answers = Vec::new();
    let end = run_group(connection, waiting, &mut answers).await;
    if end.is_err() {
        // Refused where SQLite rolled back by itself, which is as good.
        let _ = execute(connection, "ROLLBACK").await;
    }
    for answer in answers {
        answer(end.clone());
    }
    end
}

async fn run_group(
    connection: &mut SqliteConnection,
    waiting: &mut Waiting,
    answers: &mut Vec<Answer>,
) -> Result<(), StoreError> {
    if waiting.operations.is_empty() {
        batch::append_all(connection, waiting, answers).await?;
    }
    if waiting.is_empty() {
        return Ok(());
    }
    let mut begun = execute(connection, "BEGIN IMMEDIATE").await;
    if begun.is_ok() {
        batch::append_all(connection, waiting, answers).await?;
    }
    waiting.operations.extend(waiting.appends.drain(..).map(Appending::alone));
    while let Some(operation) = waiting.operations.pop_front() {
        let saved = operation.undo == Undo::Savepoint;
        if begun.is_ok() && saved {
            begun = execute(connection, "SAVEPOINT operation").await;
        }
        let ran = (operation.run)(begun.clone().map(|()| &mut *connection)).await;
        answers.push(ran.answer);
        match ran.end {
            Err(error) if begun.is_err() || error.ends_group() => return Err(error),
            Err(_) if saved => execute(connection, "ROLLBACK TO operation").await?,
            _ => {}
        }
        if saved {
            execute(connection, "RELEASE operation").await?;
        }
    }
    execute(connection, "COMMIT").await
}

pub(super) async fn execute(connection: &mut SqliteConnection, statement: &'static str) -> Result<(), StoreError> {
    let result = sqlx::query(statement).execute(connection).await;
    result.map(|_| ()).map_err(|error| Failure::sqlite(error).during("committing a group"))
}
