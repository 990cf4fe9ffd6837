//! `ballast healthcheck`: asks a running service whether it is ready; for containers without a shell.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use clap::Args;

/// Below the 3 s that the image gives the check: killed by then, it could not say why.
const TIMEOUT: Duration = Duration::from_secs(2);

#[derive(Debug, Args)]
pub struct Healthcheck {
    /// Address the service listens on.
    #[arg(long, env = "BALLAST_LISTEN", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Its address as `http://host:port`, instead of `--listen`.
    #[arg(long)]
    url: Option<String>,
}

/// # Errors
/// The service is not reached or not ready.
pub fn run(arguments: &Healthcheck) -> Result<(), Box<dyn std::error::Error>> {
    let host = match &arguments.url {
        Some(url) => url.trim_start_matches("http://").split('/').next().unwrap_or_default().to_owned(),
        None => reachable(arguments.listen).to_string(),
    };
    let answer = ask(&host).map_err(|error| match error.kind() {
        // What Unix calls a socket's time-out.
        ErrorKind::WouldBlock => format!("{host} did not answer within {} s", TIMEOUT.as_secs()),
        _ => format!("cannot ask {host}: {error}"),
    })?;
    let status = answer.lines().next().unwrap_or("no answer");
    if status.split(' ').nth(1) == Some("200") { Ok(()) } else { Err(format!("{host} is not ready: {status}").into()) }
}

fn ask(host: &str) -> io::Result<String> {
    let mut stream = TcpStream::connect(host)?;
    stream.set_read_timeout(Some(TIMEOUT))?;
    stream.set_write_timeout(Some(TIMEOUT))?;
    write!(stream, "GET /readyz HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n")?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer)?;
    Ok(answer)
}

/// A service bound to every address is asked on loopback.
fn reachable(listen: SocketAddr) -> SocketAddr {
    match listen {
        SocketAddr::V4(address) if address.ip().is_unspecified() => ([127, 0, 0, 1], address.port()).into(),
        SocketAddr::V6(address) if address.ip().is_unspecified() => {
            (std::net::Ipv6Addr::LOCALHOST, address.port()).into()
        }
        other => other,
    }
}
