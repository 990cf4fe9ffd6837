//! One connection from its first byte to its last: its requests one after the other, with the phase of each.

use std::convert::Infallible;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use http_body_util::BodyExt;
use hyper::body::{Body as _, Bytes, Frame, Incoming, SizeHint};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::Watcher;
use thiserror::Error;
use tokio::io::{AsyncRead, AsyncWrite};
use tower::Service;

use crate::http::connection::connection_table::{AllowedRequests, ConnectionGuard, ConnectionPhase, TrackedConnection};
use crate::http::connection::timed_stream::{ClientLimits, TimedStream};
use crate::http::problem::{ProblemDocument, ProblemKind};
use crate::service::process::shutdown::Shutdown;

/// Size limit of a request head: it is refused if it is incomplete after so many bytes plus one read of as many. hyper
/// allows at most 100 lines.
const HEAD_BYTES: usize = 32 << 10;
/// A refused body of at most this size is still read if it arrives within [`SMALL_BODY_WAIT`], so that the connection
/// can go on.
const SMALL_BODY: u64 = 64 << 10;
const SMALL_BODY_WAIT: Duration = Duration::from_millis(100);
/// Paths that may be requested if every other connection is busy.
const PROBES: [&str; 4] = ["/livez", "/readyz", "/health", "/metrics"];

/// The local address of a request's connection.
#[derive(Debug, Clone, Copy)]
pub struct LocalAddress(pub SocketAddr);

/// The signals that tell a connection that the service stops.
pub struct Stopping {
    pub shutdown: Shutdown,
    /// Ends the connection between two requests.
    pub watcher: Watcher,
}

/// The error of a connection that was closed to make room before its request began.
#[derive(Debug, Error)]
#[error("the connection was closed to make room for another")]
struct GaveWay;

/// Serves `stream` until it ends, must close to make room, or the service stops.
pub async fn hold<S>(
    stream: S,
    held: &ConnectionGuard,
    local: SocketAddr,
    limits: ClientLimits,
    application: Router,
    stopping: Stopping,
) where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let connection = held.connection.clone();
    let shutdown = stopping.shutdown.clone();
    let service = service_fn(move |request| {
        let leaving = shutdown.clone();
        answer((connection.clone(), leaving), local, limits, application.clone(), request)
    });
    let stream = TokioIo::new(TimedStream::new(stream, limits, held.connection.clone()));
    let serving = http1::Builder::new()
        .timer(TokioTimer::new())
        // The stream has timeouts of its own, which distinguish a head under way from an idle connection.
        .header_read_timeout(None)
        .max_buf_size(HEAD_BYTES)
        .serve_connection(stream, service);
    tokio::select! {
        ended = stopping.watcher.watch(serving) => {
            if let Err(error) = ended {
                tracing::debug!(%error, "connection ended");
            }
        }
        () = held.connection.gave_way() => tracing::debug!("connection was closed to make room for another"),
        () = unused_at_the_end(&stopping.shutdown, &held.connection) => {}
    }
}

/// Resolves at the shutdown if there was no request: hyper waits for a first request before it ends a connection.
async fn unused_at_the_end(shutdown: &Shutdown, connection: &TrackedConnection) {
    shutdown.begun().await;
    if connection.requests() > 0 {
        std::future::pending().await
    }
}

async fn answer(
    (connection, shutdown): (Arc<TrackedConnection>, Shutdown),
    local: SocketAddr,
    limits: ClientLimits,
    mut application: Router,
    request: hyper::Request<Incoming>,
) -> Result<Response, GaveWay> {
    let receives = !request.body().is_end_stream();
    if !connection.begin(if receives { ConnectionPhase::Receiving } else { ConnectionPhase::Working }) {
        return Err(GaveWay);
    }
    let small = is_small(request.headers(), request.body());
    let (parts, body) = request.into_parts();
    let inbox = Arc::new(Mutex::new(body));
    let path = parts.uri.path().to_owned();
    let mut request =
        Request::from_parts(parts, Body::new(BodyReading { inbox: inbox.clone(), connection: connection.clone() }));
    request.extensions_mut().insert(LocalAddress(local));
    let mut response = match connection.place {
        AllowedRequests::Probes if !PROBES.contains(&path.as_str()) => {
            ProblemDocument::new(ProblemKind::Overloaded, "the limit of simultaneous calls is reached").into_response()
        }
        _ => application.call(request).await.unwrap_or_else(|never: Infallible| match never {}),
    };
    let is_whole = !receives || take_rest(&inbox, small).await;
    if !is_whole {
        connection.leave();
    }
    let is_old = connection.requests() >= limits.requests || connection.age() >= limits.age;
    if !is_whole || is_old || shutdown.is_announced() || connection.place == AllowedRequests::Probes {
        response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    } else {
        let keep_alive = HeaderValue::from_str(&format!("timeout={}", limits.between.as_secs()));
        response.headers_mut().insert("keep-alive", keep_alive.unwrap_or(HeaderValue::from_static("timeout=1")));
    }
    if response.headers().get(header::CONTENT_TYPE).is_some_and(|media| media == "text/event-stream") {
        connection.stream();
    }
    Ok(response.map(|body| Body::new(Writing { body, connection })))
}

/// Returns true if the rest of a refused body is small enough to wait for. Clients that wait for `100 Continue` have
/// not sent it.
fn is_small(headers: &HeaderMap, body: &Incoming) -> bool {
    !headers.contains_key(header::EXPECT) && body.size_hint().upper().is_some_and(|bytes| bytes <= SMALL_BODY)
}

/// Returns true if the body is complete, after discarding a small rest.
async fn take_rest(inbox: &Arc<Mutex<Incoming>>, small: bool) -> bool {
    let is_whole = || inbox.lock().unwrap_or_else(PoisonError::into_inner).is_end_stream();
    if is_whole() || !small {
        return is_whole();
    }
    let rest = async {
        let mut body = Rest(inbox.clone());
        while let Some(Ok(_)) = body.frame().await {}
    };
    // A rest that is too late counts as missing.
    let _ = tokio::time::timeout(SMALL_BODY_WAIT, rest).await;
    is_whole()
}

/// The body of a request, which outlives its reader.
struct Rest(Arc<Mutex<Incoming>>);

impl hyper::body::Body for Rest {
    type Data = Bytes;
    type Error = hyper::Error;

    fn poll_frame(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, hyper::Error>>> {
        let mut body = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        Pin::new(&mut *body).poll_frame(context)
    }
}

/// The body of a request as the application reads it; its end ends the phase [`ConnectionPhase::Receiving`].
struct BodyReading {
    inbox: Arc<Mutex<Incoming>>,
    connection: Arc<TrackedConnection>,
}

impl hyper::body::Body for BodyReading {
    type Data = Bytes;
    type Error = hyper::Error;

    fn poll_frame(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, hyper::Error>>> {
        let mut body = self.inbox.lock().unwrap_or_else(PoisonError::into_inner);
        let frame = Pin::new(&mut *body).poll_frame(context);
        if body.is_end_stream() || matches!(frame, Poll::Ready(None)) {
            self.connection.received();
        }
        frame
    }

    fn is_end_stream(&self) -> bool {
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner).is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner).size_hint()
    }
}

/// The body of an answer; its connection returns to waiting when it is dropped.
struct Writing {
    body: Body,
    connection: Arc<TrackedConnection>,
}

impl Drop for Writing {
    fn drop(&mut self) {
        self.connection.rest();
    }
}

impl hyper::body::Body for Writing {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;
    use std::time::Instant;

    use hyper_util::server::graceful::GracefulShutdown;
    use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};

    use super::*;
    use crate::http::connection::connection_table::{ConnectionLimits, Connections};

    const LONG: Duration = Duration::from_secs(60);

    /// Returns the client's end of a connection that closes after so many requests, or at this age.
    fn connection(requests: u64, age: Duration) -> DuplexStream {
        let (here, there) = tokio::io::duplex(4096);
        let limits = ClientLimits {
            to_read: LONG,
            for_head: LONG,
            between: LONG,
            to_finish: LONG,
            left_bytes: 64,
            requests,
            age,
        };
        tokio::spawn(async move {
            let connections = Connections::new(ConnectionLimits { all: 1, of_address: 1, for_probes: 0 });
            let held = connections.place(Ipv4Addr::LOCALHOST.into()).unwrap();
            let graceful = GracefulShutdown::new();
            let stopping = Stopping { shutdown: Shutdown::new(), watcher: graceful.watcher() };
            hold(here, &held, (Ipv4Addr::LOCALHOST, 1).into(), limits, Router::new(), stopping).await;
        });
        there
    }

    /// Sends one request; returns true if the answer says that the connection closes with it.
    async fn is_last(stream: &mut DuplexStream) -> bool {
        stream.write_all(b"GET / HTTP/1.1\r\nhost: a\r\n\r\n").await.unwrap();
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            head.push(stream.read_u8().await.unwrap());
        }
        let head = String::from_utf8(head).unwrap();
        let [closes, stays] = ["connection: close\r\n", "keep-alive: timeout=60\r\n"].map(|line| head.contains(line));
        assert!(closes != stays && head.contains("content-length: 0"), "{head}");
        closes
    }

    async fn is_closed(stream: &mut DuplexStream) -> bool {
        stream.read(&mut [0]).await.unwrap() == 0
    }

    #[tokio::test]
    async fn a_connection_is_closed_with_the_answer_to_the_last_of_its_requests() {
        let mut stream = connection(3, LONG);
        let mut lasts = Vec::new();
        for _ in 0..3 {
            lasts.push(is_last(&mut stream).await);
        }
        assert_eq!(lasts, [false, false, true]);
        assert!(is_closed(&mut stream).await);
    }

    #[tokio::test]
    async fn a_connection_is_closed_with_the_first_answer_after_its_age() {
        let (age, begun) = (Duration::from_secs(1), Instant::now());
        let mut stream = connection(u64::MAX, age);
        assert!(!is_last(&mut stream).await);
        while !is_last(&mut stream).await {
            tokio::time::sleep(age / 20).await;
        }
        assert!(begun.elapsed() >= age);
        assert!(is_closed(&mut stream).await);
    }
}
