//! What the writer is asked to do: an operation, how it is undone, and how its caller is answered after the commit.

use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use sqlx::SqliteConnection;
use tokio::sync::oneshot;

use super::changes::Change;
use crate::store::error::{Failure, StoreError};

/// One caller's reads and writes. Given an error instead of a connection, it passes that on as its own.
pub(super) struct Operation {
    pub undo: Undo,
    pub run: Run,
}

/// How what an operation changed before it failed is undone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Undo {
    /// By a savepoint, two statements more.
    Savepoint,
    /// By SQLite, as it changes rows by one statement.
    Statement,
}

pub(super) type Run =
    Box<dyn for<'c> FnOnce(Result<&'c mut SqliteConnection, StoreError>) -> BoxFuture<'c, Ran> + Send>;

/// An operation that ran: whether its savepoint may be kept, and how to answer its caller once the group's end is known.
pub(super) struct Ran {
    pub end: Result<(), StoreError>,
    pub answer: Answer,
}

/// Tells a caller how its group ended.
pub(super) type Answer = Box<dyn FnOnce(Result<(), StoreError>) + Send>;

/// Where the outcome of a write goes, and the change it may be.
pub(super) struct Reply<T> {
    change: Option<Change>,
    sender: oneshot::Sender<Result<T, StoreError>>,
}

impl<T> Reply<T> {
    pub(super) fn new(change: Option<Change>) -> (Self, oneshot::Receiver<Result<T, StoreError>>) {
        let (sender, answer) = oneshot::channel();
        (Reply { change, sender }, answer)
    }

    /// Call after the end of the transaction.
    pub(super) fn send(self, outcome: Result<T, StoreError>) {
        drop(self.change);
        // A caller that stopped waiting needs no answer.
        let _ = self.sender.send(outcome);
    }
}

impl Operation {
    /// `work` as an operation, answered to `reply`.
    pub(super) fn new<T, W>(doing: &'static str, undo: Undo, work: W, reply: Reply<T>) -> Self
    where
        T: Send + 'static,
        W: for<'c> FnOnce(&'c mut SqliteConnection) -> BoxFuture<'c, Result<T, Failure>> + Send + 'static,
    {
        let run: Run = Box::new(move |connection| {
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
