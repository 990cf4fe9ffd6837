//! SQLite in a folder that one process holds: read connections beside one writer, which commits in groups.

mod batch;
mod changes;
pub(in crate::store) mod held_file;
pub(in crate::store) mod opening;
mod operation;
mod space;
mod sync;
mod write_ahead_log;
mod writer;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use tokio::sync::{mpsc, oneshot, watch};

use crate::store::engine::error::{Failure, StoreError};
use crate::store::engine::query::{Purpose, Query, StoreConnection, StoreRow, query};
use crate::store::sessions::entries::{APPENDING, Append, EntryRow};
use batch::Appending;
use changes::Changes;
use opening::Readers;
use operation::{Operation, Reply, Undo};
use writer::WriterRequest;

/// An open folder. Clones share the connections, the lock and the writer.
#[derive(Clone)]
pub(in crate::store) struct Folder {
    dir: PathBuf,
    readers: Readers,
    requests: mpsc::Sender<WriterRequest>,
    changes: Arc<Changes>,
    /// The first fatal error, of a read or of a write.
    fatal: watch::Sender<Option<StoreError>>,
}

impl Folder {
    pub(in crate::store) async fn open(dir: &Path) -> Result<Folder, StoreError> {
        Folder::over(dir, opening::open(dir).await?)
    }

    /// Opens a folder that another process may hold, for writes that do not conflict with that process's own.
    pub(in crate::store) async fn open_beside(dir: &Path) -> Result<Folder, StoreError> {
        Folder::over(dir, opening::open_beside(dir).await?)
    }

    fn over(dir: &Path, opening::Opened { held, writer, readers }: opening::Opened) -> Result<Folder, StoreError> {
        let (requests, receiver) = mpsc::channel(writer::QUEUE);
        let fatal = watch::Sender::new(None);
        writer::start(writer, receiver, fatal.clone(), held)?;
        Ok(Folder { dir: dir.to_owned(), readers, requests, changes: Changes::new(changes::NUMBERS), fatal })
    }

    pub(in crate::store) async fn ping(&self) -> Result<(), StoreError> {
        let doing = "answering a ping";
        self.refuse_after_fatal()?;
        if self.requests.is_closed() {
            return Err(StoreError::Unavailable { doing, source: None });
        }
        self.read(Purpose::Probes, doing, query("SELECT job FROM jobs LIMIT 1")).await.map(|_| ())
    }

    pub(in crate::store) fn dir(&self) -> &Path {
        &self.dir
    }

    pub(in crate::store) async fn until_fatal(&self) -> StoreError {
        let mut fatal = self.fatal.subscribe();
        loop {
            if let Some(error) = fatal.borrow_and_update().clone() {
                return error;
            }
            if fatal.changed().await.is_err() {
                std::future::pending::<()>().await;
            }
        }
    }

    pub(in crate::store) async fn close(&self) {
        self.readers.close().await;
        let (answer, closed) = oneshot::channel();
        if self.requests.send(WriterRequest::Close(answer)).await.is_ok() {
            // An error means that the writer ended first, so the folder is closed as well.
            let _ = closed.await;
        }
    }

    /// Runs `work` in the writer and returns after its commit.
    pub(in crate::store) async fn write<T, W>(&self, doing: &'static str, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'c> FnOnce(StoreConnection<'c>) -> BoxFuture<'c, Result<T, Failure>> + Send + 'static,
    {
        let (reply, answer) = Reply::new(None);
        self.request(doing, writing(doing, work, reply), answer).await
    }

    /// Runs `work` like [`Self::write`], if it may change rows of `session`.
    pub(in crate::store) async fn write_to<T, W>(
        &self,
        session: &str,
        doing: &'static str,
        work: W,
    ) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'c> FnOnce(StoreConnection<'c>) -> BoxFuture<'c, Result<T, Failure>> + Send + 'static,
    {
        let (reply, answer) = Reply::new(Some(self.changes.of(session)));
        self.request(doing, writing(doing, work, reply), answer).await
    }

    /// Appends in the writer, many observations to a statement, and returns after the commit.
    pub(in crate::store) async fn append(&self, new: EntryRow) -> Result<Append, StoreError> {
        let (reply, answer) = Reply::new(Some(self.changes.of(&new.session)));
        self.request(APPENDING, WriterRequest::Append(Appending { new, reply }), answer).await
    }

    /// Returns a number that changes with every write to `session`.
    pub(in crate::store) fn change(&self, session: &str) -> u64 {
        self.changes.number(session)
    }

    async fn request<T>(
        &self,
        doing: &'static str,
        request: WriterRequest,
        answer: oneshot::Receiver<Result<T, StoreError>>,
    ) -> Result<T, StoreError> {
        self.refuse_after_fatal()?;
        // A writer that has ended drops the request and its answer channel.
        let _ = self.requests.send(request).await;
        match answer.await {
            Ok(result) => result,
            Err(_) => self.refuse_after_fatal().and(Err(StoreError::Unavailable { doing, source: None })),
        }
    }

    /// Reads rows, and remembers a fatal failure.
    pub(in crate::store) async fn read(
        &self,
        purpose: Purpose,
        doing: &'static str,
        query: Query,
    ) -> Result<Vec<StoreRow>, StoreError> {
        let reading = async {
            let acquired = self.readers.of_purpose(purpose).acquire().await;
            let mut reader = acquired.map_err(|error| Failure::sqlite(error).during(doing))?;
            let result =
                StoreConnection::Sqlite(&mut reader).rows(query).await.map_err(|failure| failure.during(doing));
            // Its thread may have died, so a failed connection is not used again.
            if result.is_err() {
                drop(reader.detach());
            }
            result
        };
        let result = reading.await;
        if let Err(error) = &result
            && error.is_fatal()
        {
            self.fatal.send_if_modified(|fatal| fatal.is_none() && fatal.replace(error.clone()).is_none());
        }
        result
    }

    fn refuse_after_fatal(&self) -> Result<(), StoreError> {
        self.fatal.borrow().clone().map_or(Ok(()), Err)
    }
}

fn writing<T, W>(doing: &'static str, work: W, reply: Reply<T>) -> WriterRequest
where
    T: Send + 'static,
    W: for<'c> FnOnce(StoreConnection<'c>) -> BoxFuture<'c, Result<T, Failure>> + Send + 'static,
{
    WriterRequest::Write(Operation::new(
        doing,
        Undo::Savepoint,
        move |connection| work(StoreConnection::Sqlite(connection)).boxed(),
        reply,
    ))
}
