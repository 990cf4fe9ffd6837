//! Observations that wait together go into the table together: one statement for all of them, since handing a statement
//! to SQLite, which has a thread of its own, costs more than what it does to one row.

use std::collections::VecDeque;

use futures_util::FutureExt;
use sqlx::SqliteConnection;

use super::operation::{Answer, Operation, Reply, Undo};
use crate::store::entries::{self, APPENDING, Append, EntryRow, append};
use crate::store::error::StoreError;
use crate::store::query::Connection;

/// An observation to append, and where its answer goes.
pub(super) struct Appending {
    pub new: EntryRow,
    pub reply: Reply<Append>,
}

impl Appending {
    /// As an operation like every other, which finds out why it is refused where it is.
    pub(super) fn alone(self) -> Operation {
        let Appending { new, reply } = self;
        Operation::new(
            APPENDING,
            Undo::Statement,
            move |connection| append(Connection::Sqlite(connection), new).boxed(),
            reply,
        )
    }

    /// How to answer it once it is appended and its group's end is known.
    fn appended(self) -> Answer {
        Box::new(move |group: Result<(), StoreError>| self.reply.send(group.map(|()| Append::Appended)))
    }
}

/// What the next group is made of.
#[derive(Default)]
pub(super) struct Waiting {
    pub operations: VecDeque<Operation>,
    pub appends: Vec<Appending>,
}

impl Waiting {
    pub(super) fn is_empty(&self) -> bool {
        self.operations.is_empty() && self.appends.is_empty()
    }
}

/// Appends what waits by one statement, which is a transaction of its own where none is open. Where one of them cannot be
/// appended none is, and all are left to go alone: which of them it was is found out one by one.
///
/// # Errors
/// What ended the group; those that ran are among the answers.
pub(super) async fn append_all(
    connection: &mut SqliteConnection,
    waiting: &mut Waiting,
    answers: &mut Vec<Answer>,
) -> Result<(), StoreError> {
    let batch = std::mem::take(&mut waiting.appends);
    let rows: Vec<&EntryRow> = batch.iter().map(|appending| &appending.new).collect();
    let end = match rows.as_slice() {
        [] => Ok(()),
        rows => entries::append_all(&mut Connection::Sqlite(connection), rows).await,
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
