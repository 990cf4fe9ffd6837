//! One keep-alive connection that costs its machine as little as HTTP/1.1 allows: it sends prepared bytes and only
//! searches the answer for its end.

use std::io::{self, ErrorKind};
use std::net::SocketAddr;

use thiserror::Error;
use tokio::net::TcpStream;

#[derive(Debug, Error)]
pub enum ConnectionError {
    #[error("{doing}")]
    Socket { doing: &'static str, source: io::Error },
    #[error("an answer that is not HTTP/1.1 with a content-length: {head}")]
    Unreadable { head: String },
    #[error("the service answered {status} to {request}: {body}")]
    Refused { status: u16, request: String, body: String },
}

pub struct LoadConnection {
    stream: TcpStream,
    received: Vec<u8>,
}

/// The position of an answer's body in the received bytes.
struct BodyExtent {
    status: u16,
    head: usize,
    end: usize,
}

pub fn get(path: &str) -> Vec<u8> {
    format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n").into_bytes()
}

pub fn post(path: &str, body: &str) -> Vec<u8> {
    let head = format!("POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\n");
    format!("{head}content-length: {}\r\n\r\n{body}", body.len()).into_bytes()
}

impl LoadConnection {
    pub async fn open(address: SocketAddr) -> Result<Self, ConnectionError> {
        let stream = TcpStream::connect(address).await;
        let stream = stream.map_err(|source| ConnectionError::Socket { doing: "connecting", source })?;
        let set = stream.set_nodelay(true);
        set.map_err(|source| ConnectionError::Socket { doing: "setting TCP_NODELAY", source })?;
        Ok(LoadConnection { stream, received: Vec::with_capacity(4096) })
    }

    /// Sends a request and reads the body of its answer.
    ///
    /// # Errors
    /// The connection breaks, or the answer is not a success.
    pub async fn exchange(&mut self, request: &[u8]) -> Result<&[u8], ConnectionError> {
        self.send(request).await.map_err(|source| ConnectionError::Socket { doing: "sending", source })?;
        self.received.clear();
        let extent = loop {
            self.receive().await.map_err(|source| ConnectionError::Socket { doing: "receiving", source })?;
            if let Some(extent) = extent(&self.received)?
                && self.received.len() >= extent.end
            {
                break extent;
            }
        };
        let body = &self.received[extent.head..extent.end];
        if (200..300).contains(&extent.status) {
            return Ok(body);
        }
        let line = request.split(|&byte| byte == b'\r').next().unwrap_or_default();
        let [request, body] = [line, body].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
        Err(ConnectionError::Refused { status: extent.status, request, body })
    }

    async fn send(&self, mut rest: &[u8]) -> io::Result<()> {
        while !rest.is_empty() {
            match self.stream.try_write(rest) {
                Ok(count) => rest = &rest[count..],
                Err(error) if error.kind() == ErrorKind::WouldBlock => self.stream.writable().await?,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    async fn receive(&mut self) -> io::Result<()> {
        let mut bytes = [0; 4096];
        loop {
            self.stream.readable().await?;
            match self.stream.try_read(&mut bytes) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(count) => {
                    self.received.extend_from_slice(&bytes[..count]);
                    return Ok(());
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
            }
        }
    }
}

/// Locates the body; `None` until the head has arrived.
fn extent(received: &[u8]) -> Result<Option<BodyExtent>, ConnectionError> {
    let Some(end) = received.windows(4).position(|four| four == b"\r\n\r\n") else { return Ok(None) };
    let head = String::from_utf8_lossy(&received[..end]);
    let mut lines = head.split("\r\n");
    let status = lines.next().and_then(|line| line.strip_prefix("HTTP/1.1 ")?.get(..3)?.parse().ok());
    let length = lines.find_map(|line| {
        let (name, value) = line.split_once(':')?;
        name.eq_ignore_ascii_case("content-length").then(|| value.trim().parse::<usize>().ok())?
    });
    match (status, length) {
        (Some(status), Some(length)) => Ok(Some(BodyExtent { status, head: end + 4, end: end + 4 + length })),
        _ => Err(ConnectionError::Unreadable { head: head.into_owned() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_an_answer_is_found_wherever_it_is_cut() {
        let answer = b"HTTP/1.1 404 Not Found\r\nContent-Length: 3\r\nx: y\r\n\r\nabc";
        for cut in 0..answer.len() - 3 {
            assert!(extent(&answer[..cut]).expect("readable").is_none());
        }
        let found = extent(answer).expect("readable").expect("whole");
        assert_eq!((found.status, &answer[found.head..found.end]), (404, &b"abc"[..]));
        assert!(extent(b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n").is_err());
    }
}
