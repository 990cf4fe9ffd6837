//! The single writer: operations that wait together are committed together.
//!
//! A commit costs one fsync however much it holds, so each transaction takes every waiting operation, up to [`GROUP`].
//! A busy service writes mostly observations; a group of observations alone is one statement and therefore its own
//! transaction. In other groups each operation runs in a savepoint, or changes rows by a single statement, so that a
//! failed one is undone alone. Answers are sent after the commit. Errors after which SQLite may have rolled back by
//! itself (disk full, I/O) fail every operation that ran in the group; those that had not run yet go to the next one.
//! After a fatal error the writer stops for good.

use std::time::Duration;

use sqlx::{Connection, SqliteConnection};
use tokio::sync::{mpsc, oneshot, watch};

use super::batch::{self, Appending, NextGroup};
use super::held_file::HeldFile;
use super::operation::{Operation, Respond, Undo};
use crate::store::engine::error::{Failure, StoreError};
use crate::store::sessions::entries::ROWS_AT_ONCE;

/// The most operations in one transaction: as many observations as one statement takes. A row then costs a hundredth of
/// what it costs alone; a larger group only adds waiting.
const GROUP: usize = ROWS_AT_ONCE;
/// The interval between checks of a held file while nothing is written.
const BETWEEN_LOOKS: Duration = Duration::from_millis(500);
/// The number of requests that may wait in the queue before callers have to wait.
pub(super) const QUEUE: usize = 1024;

pub(super) enum WriterRequest {
    Write(Operation),
    Append(Appending),
    /// Commits waiting writes, then closes and answers.
    Close(oneshot::Sender<()>),
}

/// Starts the writer on its own thread, so that its many short waits for SQLite do not queue behind requests.
pub(super) fn start(
    connection: SqliteConnection,
    requests: mpsc::Receiver<WriterRequest>,
    fatal: watch::Sender<Option<StoreError>>,
    held: Vec<HeldFile>,
) -> Result<(), StoreError> {
    let unavailable = |_| StoreError::Unavailable { doing: "starting the writer", source: None };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().map_err(unavailable)?;
    let serving = move || runtime.block_on(serve(connection, requests, fatal, held));
    std::thread::Builder::new().name("writer".into()).spawn(serving).map(drop).map_err(unavailable)
}

/// Serves requests until the last [`Folder`](super::Folder) is dropped, one closes it, or a write fails fatally. Keeps
/// the folder's files locked, if it has them, as long as it can write, and ends once one of them is replaced.
async fn serve(
    mut connection: SqliteConnection,
    mut requests: mpsc::Receiver<WriterRequest>,
    fatal: watch::Sender<Option<StoreError>>,
    held: Vec<HeldFile>,
) {
    let mut waiting = NextGroup::default();
    let mut closed = Vec::new();
    let mut looks = tokio::time::interval(BETWEEN_LOOKS);
    loop {
        let end = tokio::select! {
            biased;
            _ = looks.tick() => verify(&held),
            goes_on = receive(&mut requests, &mut waiting, &mut closed) => {
                if !goes_on && waiting.is_empty() {
                    break;
                }
                commit_group(&mut connection, &mut waiting, &held).await
            }
        };
        if let Err(error) = end
            && (error.is_fatal() || has_lost_its_engine(&error))
        {
            fatal.send_replace(Some(error));
            return;
        }
    }
    // The commits are already durable; closing only shortens the log that the next start reads.
    let _ = connection.close().await;
    drop(held);
    for closed in closed {
        let _ = closed.send(());
    }
}

/// Returns true if the thread that SQLite runs on has died, because every later write would fail.
fn has_lost_its_engine(error: &StoreError) -> bool {
    matches!(error, StoreError::Unavailable { source: Some(source), .. } if matches!(**source, sqlx::Error::WorkerCrashed))
}

fn verify(held: &[HeldFile]) -> Result<(), StoreError> {
    held.iter().try_for_each(HeldFile::verify)
}

/// Waits for a request, unless some wait already, and takes those queued behind it, up to a group. Returns false once
/// there will be no more.
async fn receive(
    requests: &mut mpsc::Receiver<WriterRequest>,
    waiting: &mut NextGroup,
    closed: &mut Vec<oneshot::Sender<()>>,
) -> bool {
    if !waiting.is_empty() {
        return true;
    }
    let mut received = Vec::new();
    let count = requests.recv_many(&mut received, GROUP).await;
    for request in received {
        match request {
            WriterRequest::Write(operation) => waiting.operations.push_back(operation),
            WriterRequest::Append(append) => waiting.appends.push(append),
            WriterRequest::Close(answer) => {
                requests.close();
                closed.push(answer);
            }
        }
    }
    count > 0
}

/// Runs the waiting operations as one transaction and answers every operation that ran.
///
/// # Errors
/// Returns the error that ended the group before its commit.
async fn commit_group(
    connection: &mut SqliteConnection,
    waiting: &mut NextGroup,
    held: &[HeldFile],
) -> Result<(), StoreError> {
    let mut answers = Vec::new();
    let end = run_group(connection, waiting, &mut answers).await;
    // A commit to a file that is no longer there is not acknowledged.
    let end = end.and_then(|()| verify(held));
    if end.is_err() {
        // It is refused if SQLite rolled back by itself, which has the same effect.
        let _ = execute(connection, "ROLLBACK").await;
    }
    for answer in answers {
        answer(end.clone());
    }
    end
}

async fn run_group(
    connection: &mut SqliteConnection,
    waiting: &mut NextGroup,
    answers: &mut Vec<Respond>,
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
