//! The settings of an operator.

use std::fmt;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

use crate::service::callers::allowance::Limits;
use crate::service::callers::fair_queue::LONG_WAITING;
use crate::service::process::memory::MemoryLimit;
use crate::service::subscriptions::mail_server::MailServer;
use crate::store::{PostgresUrl, Quotas};

/// The location of the store.
#[derive(Debug, Clone)]
pub enum StoreLocation {
    /// SQLite in a folder, created if absent, for this process alone.
    Folder(PathBuf),
    /// A database that replicas share.
    Postgres(PostgresUrl),
}

impl fmt::Display for StoreLocation {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StoreLocation::Folder(folder) => write!(formatter, "{}", folder.display()),
            StoreLocation::Postgres(url) => write!(formatter, "{url}"),
        }
    }
}

/// The work of one replica.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Answers requests and runs jobs.
    All,
    /// Answers requests.
    Api,
    /// Runs jobs; answers the operator's requests only.
    Worker,
}

impl Role {
    pub fn answers(self) -> bool {
        self != Role::Worker
    }

    pub fn runs_jobs(self) -> bool {
        self != Role::Api
    }
}

/// A certificate chain and its private key, in PEM.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TlsFiles {
    pub certificate: PathBuf,
    pub key: PathBuf,
}

/// How events are sent: as webhooks, and by e-mail.
#[derive(Debug, Clone)]
pub struct WebhookSettings {
    /// Hosts that may have private addresses, and may be reached without encryption.
    pub allowed: Vec<String>,
    /// Sends e-mails; without it nobody can subscribe by e-mail.
    pub mail: Option<MailServer>,
    /// The time after the first attempt; it grows fourfold with each further one.
    pub first_delay: Duration,
    /// Attempts after which a delivery is given up.
    pub attempts: usize,
    /// The time between two looks for reports that are missing.
    pub look: Duration,
}

impl Default for WebhookSettings {
    /// Returns ten attempts within 20 hours.
    fn default() -> Self {
        let (first_delay, look) = (Duration::from_secs(5), Duration::from_secs(600));
        WebhookSettings { allowed: Vec::new(), mail: None, first_delay, attempts: 10, look }
    }
}

/// The configuration of one process.
#[derive(Debug, Clone)]
pub struct Config {
    /// Port 0 picks a free one.
    pub listen: SocketAddr,
    /// A separate address for the operator's requests, so that no client can lock operators out.
    pub operations_listen: Option<SocketAddr>,
    /// The certificate that encrypts connections, if any.
    pub tls: Option<TlsFiles>,
    /// If true, addresses that other machines can reach may be served without encryption.
    pub allow_plaintext: bool,
    /// Host names that the service accepts besides its own while it needs no key.
    pub hosts: Vec<String>,
    /// If true, addresses that other machines can reach may be served while the store holds no key.
    pub allow_anonymous: bool,
    /// If true, a store without a key is not served at all.
    pub require_keys: bool,
    pub limits: Limits,
    /// How long entries of the audit are kept.
    pub retain_audit: Duration,
    /// The quotas of every tenant.
    pub quotas: Quotas,
    /// Ended jobs are deleted after this time; never if it is `None`.
    pub retain_jobs: Option<Duration>,
    pub webhooks: WebhookSettings,
    pub store: StoreLocation,
    pub role: Role,
    /// The most memory the process should take; work that cannot fit is rejected.
    pub memory_limit: MemoryLimit,
    /// Threads of the training pool.
    pub training_threads: usize,
    /// Connections held at a time, as far as there are descriptors. Above that, connections that wait for their client
    /// are closed.
    pub connection_limit: usize,
    /// Connections of one address held at a time; a quarter of all by default.
    pub connections_of_address: Option<usize>,
    /// Largest request body, in bytes: an exported policy of a few thousand design points fits.
    pub body_limit_bytes: usize,
    pub request_timeout: Duration,
    /// Robust steps begun at a time for `mode=resolve` and `explain`; further ones queue.
    pub resolve_limit: usize,
    /// Allocations and observations begun at a time; further ones queue.
    pub advice_limit: usize,
    /// Large bodies decoded at a time; further ones queue.
    pub decode_limit: usize,
    /// Long-running work of each of these kinds at a time.
    pub long_limit: usize,
    /// How long a request may wait for a permit before its caller is told to retry later.
    pub turn_wait: Duration,
    /// Time for open requests to finish once shutdown begins.
    pub drain: Duration,
    /// A job may be claimed by another worker once its worker has been silent this long.
    pub lease: Duration,
}

/// A day of 24 hours.
pub const DAY: Duration = Duration::from_secs(24 * 60 * 60);

/// Threads that block outside the fair queues: two that read policies, those for files, host names and the trainer.
const OTHER_BLOCKING_THREADS: usize = 8;

impl Config {
    /// Returns the most threads that work may block: one for each permit of each stage, one for each piece that waits
    /// after its first stage, and a few more. So work whose turn it is never waits for a thread. Decoding never reaches
    /// the second stage. A thread keeps some megabytes of what its work allocated.
    pub fn blocking_threads(&self) -> usize {
        let begun = self.advice_limit + self.resolve_limit + self.decode_limit;
        begun + 2 * (self.long_limit + LONG_WAITING) + OTHER_BLOCKING_THREADS
    }

    /// Returns the defaults for a folder: loopback, and every core for training.
    pub fn new(data: impl Into<PathBuf>) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Config {
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, 8080)),
            operations_listen: None,
            tls: None,
            allow_plaintext: false,
            hosts: Vec::new(),
            allow_anonymous: false,
            require_keys: false,
            limits: Limits::default(),
            retain_audit: 400 * DAY,
            quotas: Quotas::default(),
            retain_jobs: Some(30 * DAY),
            webhooks: WebhookSettings::default(),
            store: StoreLocation::Folder(data.into()),
            role: Role::All,
            memory_limit: MemoryLimit::of_the_system(),
            training_threads: cores,
            connection_limit: 4096,
            connections_of_address: None,
            body_limit_bytes: 64 << 20,
            request_timeout: Duration::from_secs(30),
            resolve_limit: 2 * cores,
            advice_limit: 2 * cores,
            decode_limit: cores.div_ceil(2),
            // The other processors are for new work.
            long_limit: cores.div_ceil(2),
            turn_wait: Duration::from_secs(2),
            drain: Duration::from_secs(25),
            lease: Duration::from_secs(30),
        }
    }
}
