//! A connection with timeouts, which also closes cleanly.
//!
//! A client is cut off if it stops reading its answer, begins a head and does not finish it, or makes no request for
//! long. If an answer was sent before the request was fully read, the rest of the request is read and discarded, within
//! bounds, before the connection closes. Otherwise the system would send a reset, which makes many clients discard the
//! answer unread.

use std::future::Future;
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep};

use crate::http::connection::connection_table::{ConnectionPhase, TrackedConnection};

/// The time limits for a client.
#[derive(Debug, Clone, Copy)]
pub struct ClientLimits {
    /// Limit to read any part of its answer.
    pub to_read: Duration,
    /// Limit from the first byte of a head to its last.
    pub for_head: Duration,
    /// Limit between two requests.
    pub between: Duration,
    /// Limit to send the rest of a request that was already answered.
    pub to_finish: Duration,
    /// Most bytes of that rest that are read.
    pub left_bytes: usize,
    /// Number of requests after which the connection closes with the answer.
    pub requests: u64,
    /// Age at which the connection closes with the answer.
    pub age: Duration,
}

/// A `stream` whose reads and writes fail once a time limit of its client has passed.
pub struct TimedStream<S> {
    stream: S,
    limits: ClientLimits,
    connection: Arc<TrackedConnection>,
    /// Timer that runs while a write waits.
    stalled: Option<Pin<Box<Sleep>>>,
    /// The number of the request whose head is under way, and when the head began.
    head: Option<(u64, Instant)>,
    /// Timer that runs while the connection waits for a request; it never fires late.
    silent: Option<Pin<Box<Sleep>>>,
    /// Number of bytes discarded at the end, and the timer that bounds it.
    end: Option<(usize, Pin<Box<Sleep>>)>,
}

impl<S: AsyncRead + AsyncWrite + Unpin> TimedStream<S> {
    pub fn new(stream: S, limits: ClientLimits, connection: Arc<TrackedConnection>) -> Self {
        TimedStream { stream, limits, connection, stalled: None, head: None, silent: None, end: None }
    }

    fn bounded<T>(
        &mut self,
        context: &mut Context<'_>,
        write: impl FnOnce(Pin<&mut S>, &mut Context<'_>) -> Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        let written = write(Pin::new(&mut self.stream), context);
        if written.is_ready() {
            self.stalled = None;
            self.connection.note_read();
            return written;
        }
        let limit = self.limits.to_read;
        let stalled = self.stalled.get_or_insert_with(|| Box::pin(tokio::time::sleep(limit)));
        stalled.as_mut().poll(context).map(|()| Err(io::ErrorKind::TimedOut.into()))
    }

    /// Fails if the client has been silent for too long; wakes the task no later than then.
    fn silence(&mut self, context: &mut Context<'_>) -> Poll<io::Error> {
        loop {
            let ends = match self.head {
                Some((_, began)) => began + self.limits.for_head,
                None => Instant::from_std(self.connection.since()) + self.limits.between,
            };
            if ends <= Instant::now() {
                return Poll::Ready(io::ErrorKind::TimedOut.into());
            }
            let silent = self.silent.get_or_insert_with(|| Box::pin(tokio::time::sleep_until(ends)));
            // Postponed only when it fires, because every request on a busy connection moves the deadline.
            if silent.deadline() > ends {
                silent.as_mut().reset(ends);
            }
            ready!(silent.as_mut().poll(context));
            silent.as_mut().reset(ends);
        }
    }

    /// Discards what the client still sends; ready once the client has ended or has sent too much.
    fn finish(&mut self, context: &mut Context<'_>) -> Poll<()> {
        let limits = self.limits;
        let (discarded, over) = self.end.get_or_insert_with(|| (0, Box::pin(tokio::time::sleep(limits.to_finish))));
        let mut space = [0; 16 << 10];
        while *discarded < limits.left_bytes && over.as_mut().poll(context).is_pending() {
            let mut buffer = ReadBuf::new(&mut space);
            match ready!(Pin::new(&mut self.stream).poll_read(context, &mut buffer)) {
                Ok(()) if !buffer.filled().is_empty() => *discarded += buffer.filled().len(),
                _ => break,
            }
        }
        Poll::Ready(())
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> AsyncWrite for TimedStream<S> {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        self.bounded(context, |stream, context| stream.poll_write(context, bytes))
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        self.bounded(context, |stream, context| stream.poll_write_vectored(context, slices))
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.bounded(context, |stream, context| stream.poll_flush(context))
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        if self.end.is_none() {
            ready!(self.bounded(context, |stream, context| stream.poll_shutdown(context)))?;
        }
        if self.connection.has_left() {
            ready!(self.finish(context));
        }
        Poll::Ready(Ok(()))
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> AsyncRead for TimedStream<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let read = Pin::new(&mut self.stream).poll_read(context, buffer);
        let requests = self.connection.requests();
        self.head = self.head.filter(|(of, _)| *of == requests);
        if self.connection.phase() != ConnectionPhase::Waiting {
            return read;
        }
        match read {
            Poll::Pending => self.silence(context).map(Err),
            Poll::Ready(_) if buffer.filled().len() > before => {
                let (_, began) = *self.head.get_or_insert_with(|| (requests, Instant::now()));
                // A client that sends a byte now and then never leaves a read pending.
                if began.elapsed() < self.limits.for_head {
                    read
                } else {
                    Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
                }
            }
            read => read,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};

    use super::*;
    use crate::http::connection::connection_table::{ConnectionGuard, ConnectionLimits, Connections};

    const LIMIT: Duration = Duration::from_millis(200);

    fn timed(stream: DuplexStream) -> (ConnectionGuard, TimedStream<DuplexStream>) {
        let connections = Connections::new(ConnectionLimits { all: 1, of_address: 1, for_probes: 0 });
        let held = connections.place(Ipv4Addr::LOCALHOST.into()).unwrap();
        let between = 3 * LIMIT;
        let (requests, age) = (u64::MAX, Duration::MAX);
        let limits =
            ClientLimits { to_read: LIMIT, for_head: LIMIT, between, to_finish: LIMIT, left_bytes: 64, requests, age };
        let timed = TimedStream::new(stream, limits, held.connection.clone());
        (held, timed)
    }

    #[tokio::test]
    async fn a_reader_that_stops_is_cut_off_and_one_that_goes_on_is_not() {
        let (here, mut there) = tokio::io::duplex(16);
        let (_held, mut timed) = timed(here);
        let reading = tokio::spawn(async move {
            let mut chunk = [0; 16];
            for _ in 0..6 {
                tokio::time::sleep(LIMIT / 4).await;
                there.read_exact(&mut chunk).await.unwrap();
            }
            there
        });
        // Seven times the capacity of the pipe: longer than the limit in all, but never silent for that long.
        timed.write_all(&[7; 16 * 7]).await.unwrap();
        let _there = reading.await.unwrap();
        let refused = timed.write_all(&[7; 16]).await.unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::TimedOut);
    }

    #[tokio::test]
    async fn a_head_that_does_not_end_is_cut_off_however_it_comes() {
        let (here, mut there) = tokio::io::duplex(16);
        let (_held, mut timed) = timed(here);
        let dripping = tokio::spawn(async move {
            while there.write_all(b"x").await.is_ok() {
                tokio::time::sleep(LIMIT / 10).await;
            }
        });
        let began = Instant::now();
        let refused = loop {
            if let Err(error) = timed.read_u8().await {
                break error;
            }
        };
        assert_eq!(refused.kind(), io::ErrorKind::TimedOut);
        assert!(began.elapsed() < 2 * LIMIT, "{:?}", began.elapsed());
        drop(timed);
        dripping.await.unwrap();
    }

    #[tokio::test]
    async fn who_asks_again_and_again_is_never_cut_off() {
        let (here, mut there) = tokio::io::duplex(16);
        let (held, mut timed) = timed(here);
        for _ in 0..8 {
            there.write_all(b"head").await.unwrap();
            let mut head = [0; 4];
            timed.read_exact(&mut head).await.unwrap();
            assert!(held.connection.begin(ConnectionPhase::Working));
            held.connection.rest();
            tokio::time::sleep(LIMIT / 3).await;
        }
    }

    #[tokio::test]
    async fn who_asks_nothing_is_waited_for_longer_but_not_without_end() {
        let (here, _there) = tokio::io::duplex(16);
        let (_held, mut timed) = timed(here);
        let began = Instant::now();
        assert_eq!(timed.read_u8().await.unwrap_err().kind(), io::ErrorKind::TimedOut);
        assert!((2 * LIMIT..5 * LIMIT).contains(&began.elapsed()), "{:?}", began.elapsed());
    }

    #[tokio::test]
    async fn what_is_left_of_a_request_is_taken_within_bounds() {
        for (sent, accepted) in [(48, true), (96 + 16 + 1, false)] {
            let (here, mut there) = tokio::io::duplex(16);
            let (held, mut timed) = timed(here);
            held.connection.leave();
            let sending = tokio::spawn(async move {
                let sent = there.write_all(&vec![1; sent]).await;
                (sent.is_ok(), there)
            });
            timed.shutdown().await.unwrap();
            drop(timed);
            assert_eq!(sending.await.unwrap().0, accepted, "{sent}");
        }
    }
}
