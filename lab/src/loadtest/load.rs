//! Load on the service, and its latency and rate.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use futures_util::future::{join_all, try_join_all};

use super::connection::{ConnectionError, LoadConnection};
use super::server::Server;

/// Milliseconds from the first byte sent to the last received, one per request.
#[derive(Debug, Default)]
pub struct Load {
    milliseconds: Vec<f64>,
    /// Number of operations: one per request, unless a request contains several.
    operations: usize,
    seconds: f64,
    /// Processor time of the service, if it is known.
    processor_seconds: Option<f64>,
}

impl Load {
    fn of(milliseconds: Vec<f64>, seconds: f64) -> Load {
        Load { operations: milliseconds.len(), milliseconds, seconds, processor_seconds: None }
    }

    /// Runs `driving`, and adds the processor time that the service takes for it.
    pub async fn on(
        server: &Server,
        driving: impl Future<Output = Result<Load, ConnectionError>>,
    ) -> Result<Load, ConnectionError> {
        let before = server.processor_seconds();
        let load = driving.await?;
        let processor_seconds = server.processor_seconds().zip(before).map(|(after, before)| after - before);
        Ok(Load { processor_seconds, ..load })
    }

    /// Sets the number of operations, if requests contained several.
    pub fn asking(self, operations: usize) -> Self {
        Load { operations, ..self }
    }

    /// Returns the microseconds of the service's processors per operation.
    pub fn processor_us(&self) -> Option<f64> {
        self.processor_seconds.map(|seconds| 1e6 * seconds / self.operations as f64)
    }

    pub fn operations(&self) -> usize {
        self.operations
    }

    /// Returns the operations answered per second.
    pub fn rate(&self) -> f64 {
        self.operations as f64 / self.seconds
    }

    /// Returns the latency quantiles at `shares` and the largest, in milliseconds.
    pub fn latency<const N: usize>(&self, shares: [f64; N]) -> [f64; N] {
        let mut sorted = self.milliseconds.clone();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1);
        shares.map(|share| sorted.get(((share * sorted.len() as f64) as usize).min(last)).copied().unwrap_or(f64::NAN))
    }

    pub fn add(&mut self, other: Load) {
        self.milliseconds.extend(other.milliseconds);
        self.operations += other.operations;
        self.seconds += other.seconds;
        self.processor_seconds = match self.processor_seconds {
            Some(seconds) => other.processor_seconds.map(|other| seconds + other),
            None => other.processor_seconds,
        };
    }
}

/// Drives `clients` connections, spread over the replicas at `addresses`. Each sends its requests one after the other,
/// the next once the last is answered.
pub async fn saturate<R: Iterator<Item = Vec<u8>>>(
    addresses: &[SocketAddr],
    clients: usize,
    requests: impl Fn(usize) -> R,
) -> Result<Load, ConnectionError> {
    let connecting = addresses.iter().cycle().take(clients).map(|&address| LoadConnection::open(address));
    let mut connections = try_join_all(connecting).await?;
    let started = Instant::now();
    let clients = connections.iter_mut().zip(0..).map(|(connection, client)| one_by_one(connection, requests(client)));
    let milliseconds = try_join_all(clients).await?.concat();
    Ok(Load::of(milliseconds, started.elapsed().as_secs_f64()))
}

async fn one_by_one(
    connection: &mut LoadConnection,
    requests: impl Iterator<Item = Vec<u8>>,
) -> Result<Vec<f64>, ConnectionError> {
    let mut milliseconds = Vec::new();
    for request in requests {
        milliseconds.push(timed(connection, &request).await?);
    }
    Ok(milliseconds)
}

async fn timed(connection: &mut LoadConnection, request: &[u8]) -> Result<f64, ConnectionError> {
    let sent = Instant::now();
    connection.exchange(request).await?;
    Ok(1e3 * sent.elapsed().as_secs_f64())
}

/// Number of connections that share a paced load: if one waits for a slow answer, the others stay on time.
const PACED: u32 = 16;

/// Sends `rate` requests per second for `time`, whether or not earlier ones are answered.
pub async fn paced(
    address: SocketAddr,
    rate: f64,
    time: Duration,
    request: impl Fn(usize) -> Vec<u8>,
) -> Result<Load, ConnectionError> {
    let mut connections = try_join_all((0..PACED).map(|_| LoadConnection::open(address))).await?;
    let between = Duration::from_secs_f64(1.0 / rate);
    let rounds = (time.as_secs_f64() * rate / f64::from(PACED)).ceil() as u32;
    let started = Instant::now();
    let request = &request;
    let clients = connections.iter_mut().zip(0..).map(|(connection, client)| async move {
        let mut milliseconds = Vec::new();
        for turn in (0..rounds).map(|round| round * PACED + client) {
            tokio::time::sleep_until((started + between * turn).into()).await;
            milliseconds.push(timed(connection, &request(turn as usize)).await?);
        }
        Ok(milliseconds)
    });
    let answered: Result<Vec<_>, ConnectionError> = join_all(clients).await.into_iter().collect();
    let seconds = started.elapsed().as_secs_f64();
    Ok(Load::of(answered?.concat(), seconds))
}

/// Returns the bodies of the answers to `requests`, in their order, from `clients` connections.
pub async fn bodies(
    address: SocketAddr,
    clients: usize,
    requests: &[Vec<u8>],
) -> Result<Vec<Vec<u8>>, ConnectionError> {
    let mut connections = try_join_all((0..clients).map(|_| LoadConnection::open(address))).await?;
    let parts = requests.chunks(requests.len().div_ceil(clients).max(1));
    let clients = connections.iter_mut().zip(parts).map(|(connection, part)| async move {
        let mut answers = Vec::with_capacity(part.len());
        for request in part {
            answers.push(connection.exchange(request).await?.to_vec());
        }
        Ok::<_, ConnectionError>(answers)
    });
    Ok(try_join_all(clients).await?.concat())
}
