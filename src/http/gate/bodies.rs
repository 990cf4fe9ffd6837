//! The memory budget for request bodies under way, and how a large answer is sent.
//!
//! A large body reserves its share of one budget before its first byte is read, and releases it when the call is
//! answered. If many callers send large bodies at once, some are asked to retry, and the process never holds more than
//! the budget. Small bodies are not counted, because the limit on connections bounds them.

use std::convert::Infallible;
use std::io;
use std::sync::Arc;

use axum::body::{Body, Bytes, HttpBody, to_bytes};
use axum::extract::Request;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use serde::Serialize;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::http::problem::{ProblemDocument, ProblemKind};
use crate::service::Service;
use crate::service::error::ServiceError;
use crate::service::process::memory::{Large, UNIT};

/// Divisor of the memory limit that gives the budget for bodies: half of the process's own part.
const PART: usize = 16;

/// The memory budget for request bodies.
#[derive(Clone)]
pub struct Bodies {
    room: Arc<Semaphore>,
    bytes: usize,
}

impl Bodies {
    /// Creates a budget of a sixteenth of the memory limit, but at least one body of the largest size.
    pub fn new(memory_limit: usize, largest: usize) -> Self {
        let bytes = (memory_limit / PART).max(largest);
        let units = bytes.div_ceil(UNIT).min(u32::MAX as usize);
        Bodies { room: Arc::new(Semaphore::new(units)), bytes }
    }

    /// Reserves budget for the body of `request`, which may have `limit` bytes. Returns `None` for a body that is
    /// small, or so large that it is refused for its size.
    ///
    /// # Errors
    /// The bodies under way leave too little.
    pub fn admit(&self, request: &Request, limit: usize) -> Result<Option<OwnedSemaphorePermit>, ProblemDocument> {
        let header = |name| request.headers().get(name).and_then(|value| value.to_str().ok());
        let declared = header(header::CONTENT_LENGTH.as_str()).and_then(|length| length.parse::<usize>().ok());
        let is_stream = header(header::TRANSFER_ENCODING.as_str()).is_some();
        let bytes = declared.unwrap_or(if is_stream { limit } else { 0 });
        if bytes <= UNIT || bytes > limit {
            return Ok(None);
        }
        let units = bytes.div_ceil(UNIT).min(u32::MAX as usize) as u32;
        self.room.clone().try_acquire_many_owned(units).map(Some).map_err(|_| {
            let detail = format!("the bodies of other calls leave no memory for {bytes} more bytes");
            let rule = format!(
                "must fit into {} bytes together with the bodies of other calls; send it again later",
                self.bytes
            );
            ProblemDocument::new(ProblemKind::Overloaded, detail).naming("body", bytes, rule)
        })
    }
}

/// Sends a value as the answer, in JSON. A large answer reserves memory: by its actual length if there was no estimate
/// before. It is serialised on a thread that may block, and is sent in parts.
///
/// # Errors
/// Other large answers leave too little memory, or the value cannot be written as JSON.
pub async fn written<T: Serialize + Send + 'static>(
    service: &Service,
    Large { value, room }: Large<T>,
) -> Result<Response, ProblemDocument> {
    let room = match room {
        Some(room) => room,
        None => {
            let mut start = CountingWriter { bytes: Vec::new(), length: 0 };
            serde_json::to_writer(&mut start, &value).map_err(ServiceError::internal)?;
            match service.room_for(start.length).await? {
                Some(room) => room,
                None => return Ok(as_json(start.bytes)),
            }
        }
    };
    let writing = tokio::task::spawn_blocking(move || serde_json::to_vec(&value));
    let bytes = writing.await.map_err(ServiceError::internal)?.map_err(ServiceError::internal)?;
    Ok(sent(Large { value: bytes, room: Some(room) }))
}

/// Sends the recorded answer to a call. The same call gets the same answer again, so a call refused for lack of memory
/// can be retried.
///
/// # Errors
/// Other large answers leave too little memory.
pub async fn recorded(service: &Service, json: String) -> Result<Response, ProblemDocument> {
    Ok(match service.room_for(json.len()).await? {
        Some(room) => sent(Large { value: json.into_bytes(), room: Some(room) }),
        None => as_json(json.into_bytes()),
    })
}

fn as_json(bytes: Vec<u8>) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], bytes).into_response()
}

/// A writer that keeps the bytes as long as they are few, and counts all of them.
struct CountingWriter {
    bytes: Vec<u8>,
    length: usize,
}

impl io::Write for CountingWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.length += bytes.len();
        if self.length <= UNIT {
            self.bytes.extend_from_slice(bytes);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Marks an answer whose bytes are part of the program, so that it needs no memory.
#[derive(Clone)]
pub struct Embedded;

/// Returns `response`, if large with its memory reserved by [`written`] or [`sent`]. A large answer without a
/// reservation is a bug in its operation: it panics in a development build, and reserves memory late in a release
/// build.
///
/// Checked by: `tests/operation/answers.rs` requests the largest answer of every operation.
pub async fn budgeted(service: &Service, response: Response) -> Response {
    let bytes = response.body().size_hint().exact().map_or(0, |bytes| bytes as usize);
    if bytes <= UNIT || response.extensions().get::<Embedded>().is_some() {
        return response;
    }
    debug_assert!(false, "an answer of {bytes} bytes reserved no memory");
    let (head, body) = response.into_parts();
    let made = async {
        let room = service.room_for(bytes).await?;
        let value = to_bytes(body, bytes).await.map_err(ServiceError::internal)?.to_vec();
        Ok::<_, ProblemDocument>(sent(Large { value, room }))
    };
    match made.await {
        Ok(late) => Response::from_parts(head, late.into_body()),
        Err(problem) => problem.into_response(),
    }
}

/// Sends a document in parts. Its memory stays reserved until the last part is sent, however slowly a client reads.
/// Memory reserved beyond its length is released.
pub fn sent(Large { value: bytes, room }: Large<Vec<u8>>) -> Response {
    let room = room.and_then(|room| room.only(bytes.len()));
    let headers =
        [(header::CONTENT_TYPE, "application/json".to_owned()), (header::CONTENT_LENGTH, bytes.len().to_string())];
    let parts = stream::unfold((Bytes::from(bytes), room), async |(mut left, room)| {
        let part = left.split_to(left.len().min(UNIT));
        // A copy: the connection keeps unsent bytes, and a slice would keep the whole document alive.
        (!part.is_empty()).then(|| (Ok::<_, Infallible>(Bytes::copy_from_slice(&part)), (left, room)))
    });
    (headers, Body::from_stream(parts)).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(headers: &[(&str, &str)]) -> Request {
        headers
            .iter()
            .fold(Request::builder(), |builder, (name, value)| builder.header(*name, *value))
            .body(Body::empty())
            .unwrap()
    }

    fn of_length(bytes: usize) -> Request {
        request(&[("content-length", &bytes.to_string())])
    }

    #[test]
    fn large_bodies_share_one_budget_and_small_ones_need_none() {
        let largest = 10 * UNIT;
        let bodies = Bodies::new(PART * 12 * UNIT, largest);
        let first = bodies.admit(&of_length(7 * UNIT), largest).unwrap();
        assert!(first.is_some());
        assert!(bodies.admit(&of_length(7 * UNIT), largest).is_err());
        // A body of unknown length counts as the longest allowed.
        assert!(bodies.admit(&request(&[("transfer-encoding", "chunked")]), largest).is_err());
        assert!(bodies.admit(&of_length(4 * UNIT + 1), largest).unwrap().is_some());
        for uncounted in [of_length(UNIT), of_length(largest + 1), request(&[])] {
            assert!(bodies.admit(&uncounted, largest).unwrap().is_none());
        }
        drop(first);
        assert!(bodies.admit(&of_length(7 * UNIT), largest).unwrap().is_some());
    }

    #[test]
    fn the_largest_body_fits_however_small_the_limit_is() {
        let bodies = Bodies::new(1 << 20, 64 << 20);
        assert!(bodies.admit(&of_length(64 << 20), 64 << 20).unwrap().is_some());
    }
}
