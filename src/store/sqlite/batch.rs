//! Observations that wait together go into the table together: one statement for many rows, since handing a statement to
//! SQLite costs more than what it does to one row.

use futures_util::FutureExt;
use sqlx::SqliteConnection;
use tokio::sync::oneshot;

use super::writer::{Answer, Operation, Undo, Waiting, execute};
use crate::store::error::StoreError;
use crate::store::observations::{APPENDING, Append, NewObservation, ROWS_AT_ONCE, append, append_many};
use crate::store::query::Connection;

/// An observation to append, and where its answer goes.
pub(super) struct Appending {
    pub new: NewObservation,
    pub answer: oneshot::Sender<Result<Append, StoreError>>,
}

impl Appending {
    /// As an operation like every other, which finds out why it is refused where it is.
    pub(super) fn alone(self) -> Operation {
        let Appending { new, answer } = self;
        Operation::new(
            APPENDING,
            Undo::Statement,
            move |connection| append(Connection::Sqlite(connection), new).boxed(),
            answer,
        )
    }

    /// How to answer it once it is appended and its group's end is known.
    fn appended(self) -> Answer {
        Box::new(move |group: Result<(), StoreError>| drop(self.answer.send(group.map(|()| Append::Appended))))
    }
}

/// Appends what waits, as far as it fills whole statements, at the start of a transaction. The rest is left to go alone,
/// and so is everything where one of them cannot be appended.
///
/// # Errors
/// What ended the group; those that ran are among the answers.
pub(super) async fn append_all(
    connection: &mut SqliteConnection,
    waiting: &mut Waiting,
    answers: &mut Vec<Answer>,
) -> Result<(), StoreError> {
    let whole = waiting.appends.len() / ROWS_AT_ONCE * ROWS_AT_ONCE;
    let batch: Vec<_> = waiting.appends.drain(..whole).collect();
    let end = append_rows(connection, &batch).await;
    match end {
        Ok(false) => waiting.operations.extend(batch.into_iter().map(Appending::alone)),
        _ => answers.extend(batch.into_iter().map(Appending::appended)),
    }
    end.map(drop)
}

/// All of them, or none and false.
async fn append_rows(connection: &mut SqliteConnection, batch: &[Appending]) -> Result<bool, StoreError> {
    for rows in batch.chunks(ROWS_AT_ONCE) {
        let rows: Vec<&NewObservation> = rows.iter().map(|appending| &appending.new).collect();
        let appended = append_many(&mut Connection::Sqlite(connection), &rows).await;
        match appended.map_err(|failure| failure.during(APPENDING)) {
            Ok(true) => {}
            Err(error) if error.ends_group() => return Err(error),
            // Which of them it was is found out one by one.
            _ => {
                execute(connection, "ROLLBACK").await?;
                execute(connection, "BEGIN IMMEDIATE").await?;
                return Ok(false);
            }
        }
    }
    Ok(true)
}
