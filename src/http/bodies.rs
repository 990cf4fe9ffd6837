//! The bytes that the bodies of requests under way may take together, and how a large answer leaves.
//!
//! A large body takes its part of one budget before its first byte is read, and gives it back when the call is answered:
//! many callers who send large bodies at a time are told to come again, and the process never holds more of them than the
//! budget. Small bodies are not counted; the connections bound them.

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

use super::problem::{Problem, ProblemKind};
use crate::service::Service;
use crate::service::error::ServiceError;
use crate::service::memory::{Large, UNIT};

/// Part of the memory limit that bodies may take: half of what the process has for itself.
const PART: usize = 16;

/// The budget.
#[derive(Clone)]
pub struct Bodies {
    room: Arc<Semaphore>,
    bytes: usize,
}

impl Bodies {
    /// A sixteenth of the memory limit, and one body of the largest size at least.
    pub fn new(memory_limit: usize, largest: usize) -> Self {
        let bytes = (memory_limit / PART).max(largest);
        let units = bytes.div_ceil(UNIT).min(u32::MAX as usize);
        Bodies { room: Arc::new(Semaphore::new(units)), bytes }
    }

    /// The part of the budget that the body of `request` takes, which may have `limit` bytes; `None` for one that is small,
    /// or so large that it is refused for that.
    ///
    /// # Errors
    /// The bodies under way leave too little.
    pub fn admit(&self, request: &Request, limit: usize) -> Result<Option<OwnedSemaphorePermit>, Problem> {
        let header = |name| request.headers().get(name).and_then(|value| value.to_str().ok());
        let declared = header(header::CONTENT_LENGTH.as_str()).and_then(|length| length.parse::<usize>().ok());
        let is_stream = header(header::TRANSFER_ENCODING.as_str()).is_some();
        let bytes = declared.unwrap_or(if is_stream { limit } else { 0 });
        if bytes <= UNIT || bytes > limit {
            return Ok(None);
        }
        let units = bytes.div_ceil(UNIT).min(u32::MAX as usize) as u32;
        self.room.clone().try_acquire_many_owned(units).map(Some).map_err(|_| {
            let detail = format!("bodies under way leave no room for {bytes} more bytes");
            let rule = format!("must fit, with those of other calls under way, into {} bytes", self.bytes);
            Problem::new(ProblemKind::Overloaded, detail).naming("body", bytes, rule)
        })
    }
}

/// A value as the answer. What is large has its part of the budget, by its length where nobody could estimate it before, is written
/// where nobody waits for the thread, and leaves in parts.
///
/// # Errors
/// Other large answers leave no room for it; it cannot be written as JSON.
pub async fn written<T: Serialize + Send + 'static>(
    service: &Service,
    Large { value, room }: Large<T>,
) -> Result<Response, Problem> {
    let room = match room {
        Some(room) => room,
        None => {
            let mut start = Start { bytes: Vec::new(), length: 0 };
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

/// What was recorded as the answer to a call, which the same call gets again: so one that finds no room may come again.
///
/// # Errors
/// Other large answers leave no room for it.
pub async fn recorded(service: &Service, json: String) -> Result<Response, Problem> {
    Ok(match service.room_for(json.len()).await? {
        Some(room) => sent(Large { value: json.into_bytes(), room: Some(room) }),
        None => as_json(json.into_bytes()),
    })
}

fn as_json(bytes: Vec<u8>) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], bytes).into_response()
}

/// Keeps what is written as long as it is small, and counts it all.
struct Start {
    bytes: Vec<u8>,
    length: usize,
}

impl io::Write for Start {
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

/// Marks an answer whose bytes are part of the program, so that it takes no memory.
#[derive(Clone)]
pub struct Embedded;

/// `response` as it leaves: a large one has its part of the budget, by [`written`] or [`sent`]. One that has none is a fault of its
/// operation, which stops a development build; in a release build it is given its part late.
///
/// Test: `tests/operation/answers.rs` asks every operation for its largest answer.
pub async fn budgeted(service: &Service, response: Response) -> Response {
    let bytes = response.body().size_hint().exact().map_or(0, |bytes| bytes as usize);
    if bytes <= UNIT || response.extensions().get::<Embedded>().is_some() {
        return response;
    }
    debug_assert!(false, "an answer of {bytes} bytes took no part of the budget");
    let (head, body) = response.into_parts();
    let made = async {
        let room = service.room_for(bytes).await?;
        let value = to_bytes(body, bytes).await.map_err(ServiceError::internal)?.to_vec();
        Ok::<_, Problem>(sent(Large { value, room }))
    };
    match made.await {
        Ok(late) => Response::from_parts(head, late.into_body()),
        Err(problem) => problem.into_response(),
    }
}

/// A document as the answer, in parts: its memory is held until the last of them is taken from it, however slowly a client reads.
/// What was reserved beyond its length is given back.
pub fn sent(Large { value: bytes, room }: Large<Vec<u8>>) -> Response {
    let room = room.and_then(|room| room.only(bytes.len()));
    let headers =
        [(header::CONTENT_TYPE, "application/json".to_owned()), (header::CONTENT_LENGTH, bytes.len().to_string())];
    let parts = stream::unfold((Bytes::from(bytes), room), async |(mut left, room)| {
        let part = left.split_to(left.len().min(UNIT));
        // A copy: the connection keeps what it has not sent yet, and would keep the whole document for a part of it.
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
        // A body of unknown length may be as long as it may be.
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
