//! The operations of the writer: how each is undone, and how its caller is answered after the commit.

use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use sqlx::SqliteConnection;
use tokio::sync::oneshot;

use super::changes::WriteInProgress;
use crate::store::engine::error::{Failure, StoreError};

/// One caller's reads and writes. If it gets an error instead of a connection, it returns that error to its caller.
pub(super) struct Operation {
    pub undo: Undo,
    pub run: OperationRun,
}

/// The way to undo the changes of an operation that failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Undo {
    /// By a savepoint, which takes two more statements.
    Savepoint,
    /// By SQLite itself, because the operation changes rows by one statement.
    Statement,
}

pub(super) type OperationRun =
    Box<dyn for<'c> FnOnce(Result<&'c mut SqliteConnection, StoreError>) -> BoxFuture<'c, Ran> + Send>;

/// An operation that ran: the outcome that decides its savepoint, and how to answer its caller once its group has
/// ended.
pub(super) struct Ran {
    pub end: Result<(), StoreError>,
    pub answer: Respond,
}

/// Answers a caller with the outcome of its group.
pub(super) type Respond = Box<dyn FnOnce(Result<(), StoreError>) + Send>;

/// The channel for the outcome of a write, and the change to mark when it ends.
pub(super) struct Reply<T> {
    change: Option<WriteInProgress>,
    sender: oneshot::Sender<Result<T, StoreError>>,
}

impl<T> Reply<T> {
    pub(super) fn new(change: Option<WriteInProgress>) -> (Self, oneshot::Receiver<Result<T, StoreError>>) {
        let (sender, answer) = oneshot::channel();
        (Reply { change, sender }, answer)
    }

    /// Sends the outcome. Call this after the end of the transaction.
    pub(super) fn send(self, outcome: Result<T, StoreError>) {
        drop(self.change);
        // A caller that stopped waiting needs no answer.
        let _ = self.sender.send(outcome);
    }
}

impl Operation {
    /// Wraps `work` as an operation, answered through `reply`.
    pub(super) fn new<T, W>(doing: &'static str, undo: Undo, work: W, reply: Reply<T>) -> Self
    where
        T: Send + 'static,
        W: for<'c> FnOnce(&'c mut SqliteConnection) -> BoxFuture<'c, Result<T, Failure>> + Send + 'static,
    {
        let run: OperationRun = Box::new(move |connection| {
            async move {
                let result = match connection {
                    Ok(connection) => work(connection).await.map_err(|failure| failure.during(doing)),
                    Err(error) => Err(error),
                };
                let end = result.as_ref().map(|_| ()).map_err(StoreError::clone);
                let answer = Box::new(move |group: Result<(), StoreError>| reply.send(group.and(result)));
                Ran { end, answer }
            }
            .boxed()
        });
        Operation { undo, run }
    }
}
