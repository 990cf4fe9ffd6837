//! `ballast healthcheck`: checks that a running service is ready; for containers without a shell.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use rustls::pki_types::ServerName;
use rustls::{ClientConnection, StreamOwned};

use super::tls_client;

/// Below the image's limit of 3 s for the check: a killed check could not report the reason.
const TIMEOUT: Duration = Duration::from_secs(2);

#[derive(Debug, Args)]
pub struct Healthcheck {
    /// Address the service listens on.
    #[arg(long, env = "BALLAST_LISTEN", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Address it keeps for its operator, used instead if given: clients cannot use up its connections.
    #[arg(long, env = "BALLAST_OPERATIONS_LISTEN")]
    operations_listen: Option<SocketAddr>,
    /// Its certificate, if it has one: the check uses TLS. It sends no secret and verifies no certificate.
    #[arg(long, env = "BALLAST_TLS_CERT")]
    tls_cert: Option<PathBuf>,
    /// Its address as `http://host:port` or `https://host:port`, instead of all of these.
    #[arg(long)]
    url: Option<String>,
}

/// How to reach the service.
struct Target {
    host: String,
    encrypted: bool,
}

impl Healthcheck {
    fn target(&self) -> Target {
        let Some(url) = &self.url else {
            let address = reachable(self.operations_listen.unwrap_or(self.listen));
            return Target { host: address.to_string(), encrypted: self.tls_cert.is_some() };
        };
        let (encrypted, rest) = match url.strip_prefix("https://") {
            Some(rest) => (true, rest),
            None => (false, url.trim_start_matches("http://")),
        };
        Target { host: rest.split('/').next().unwrap_or_default().to_owned(), encrypted }
    }
}

/// Checks that the service is ready.
///
/// # Errors
/// The service is not reached or not ready.
pub fn run(arguments: &Healthcheck) -> Result<(), Box<dyn std::error::Error>> {
    let target = arguments.target();
    let host = &target.host;
    let answer = ask(&target).map_err(|error| match error.kind() {
        // The error kind of a socket's time-out on Unix.
        ErrorKind::WouldBlock => format!("{host} did not answer within {} s", TIMEOUT.as_secs()),
        _ => format!("cannot ask {host}: {error}"),
    })?;
    let status = answer.lines().next().unwrap_or("no answer");
    if status.split(' ').nth(1) == Some("200") { Ok(()) } else { Err(format!("{host} is not ready: {status}").into()) }
}

fn ask(target: &Target) -> io::Result<String> {
    let stream = TcpStream::connect(&target.host)?;
    stream.set_read_timeout(Some(TIMEOUT))?;
    stream.set_write_timeout(Some(TIMEOUT))?;
    if !target.encrypted {
        return exchange(stream, &target.host);
    }
    let bare = target.host.rsplit_once(':').map_or(target.host.as_str(), |(bare, _)| bare);
    let name = ServerName::try_from(bare.trim_matches(['[', ']']).to_owned()).map_err(io::Error::other)?;
    let config = tls_client::unjudging().map_err(io::Error::other)?;
    let session = ClientConnection::new(config, name).map_err(io::Error::other)?;
    exchange(StreamOwned::new(session, stream), &target.host)
}

fn exchange(mut stream: impl Read + Write, host: &str) -> io::Result<String> {
    write!(stream, "GET /readyz HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n")?;
    stream.flush()?;
    let mut answer = Vec::new();
    match stream.read_to_end(&mut answer) {
        // A peer that ends TLS without a closing message has answered all the same.
        Err(error) if error.kind() == ErrorKind::UnexpectedEof && !answer.is_empty() => {}
        read => drop(read?),
    }
    Ok(String::from_utf8_lossy(&answer).into_owned())
}

/// Returns the loopback address for a service bound to every address.
fn reachable(listen: SocketAddr) -> SocketAddr {
    match listen {
        SocketAddr::V4(address) if address.ip().is_unspecified() => ([127, 0, 0, 1], address.port()).into(),
        SocketAddr::V6(address) if address.ip().is_unspecified() => {
            (std::net::Ipv6Addr::LOCALHOST, address.port()).into()
        }
        other => other,
    }
}
