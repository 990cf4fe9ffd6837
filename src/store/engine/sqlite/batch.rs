//! Observations that wait together are inserted together, by one statement. SQLite has a thread of its own, and handing
//! a statement to it costs more than its work on one row.

use std::collections::VecDeque;

use futures_util::FutureExt;
use sqlx::SqliteConnection;

use super::operation::{Operation, Reply, Respond, Undo};
use crate::store::engine::error::StoreError;
use crate::store::engine::query::StoreConnection;
use crate::store::sessions::entries::{self, APPENDING, Append, EntryRow, append};

/// An observation to append, and the channel for its answer.
pub(super) struct Appending {
    pub new: EntryRow,
    pub reply: Reply<Append>,
}

impl Appending {
    /// Returns a separate operation for this observation, which finds the reason if it is rejected.
    pub(super) fn alone(self) -> Operation {
        let Appending { new, reply } = self;
        Operation::new(
            APPENDING,
            Undo::Statement,
            move |connection| append(StoreConnection::Sqlite(connection), new).boxed(),
            reply,
        )
    }

    /// Returns how to answer it once it is appended and the outcome of its group is known.
    fn appended(self) -> Respond {
        Box::new(move |group: Result<(), StoreError>| self.reply.send(group.map(|()| Append::Appended)))
    }
}

/// The contents of the next group.
#[derive(Default)]
pub(super) struct NextGroup {
    pub operations: VecDeque<Operation>,
    pub appends: Vec<Appending>,
}

impl NextGroup {
    pub(super) fn is_empty(&self) -> bool {
        self.operations.is_empty() && self.appends.is_empty()
    }
}

/// Appends all waiting observations by one statement, which is its own transaction if none is open. If one of them
/// cannot be appended, none is, and each is retried as a separate operation, which finds the one at fault.
///
/// # Errors
/// Returns the error that ended the group; the answers include the observations that ran.
pub(super) async fn append_all(
    connection: &mut SqliteConnection,
    waiting: &mut NextGroup,
    answers: &mut Vec<Respond>,
) -> Result<(), StoreError> {
    let batch = std::mem::take(&mut waiting.appends);
    let rows: Vec<&EntryRow> = batch.iter().map(|appending| &appending.new).collect();
    let end = match rows.as_slice() {
        [] => Ok(()),
        rows => entries::append_all(&mut StoreConnection::Sqlite(connection), rows).await,
    };
    match end.map_err(|failure| failure.during(APPENDING)) {
        Err(error) if !error.ends_group() => {
            waiting.operations.extend(batch.into_iter().map(Appending::alone));
            Ok(())
        }
        end => {
            answers.extend(batch.into_iter().map(Appending::appended));
            end
        }
    }
}
