//! `ballast serve`: the service, until SIGTERM or SIGINT.

use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use ballast::http;
use ballast::service::callers::allowance::Limits;
use ballast::service::process::config::{Config, DAY, Role, TlsFiles};
use ballast::service::process::memory::{ByteSize, MemoryLimit};
use ballast::service::process::shutdown::Shutdown;
use ballast::service::subscriptions::mail_server::MailServer;
use ballast::store::Quotas;
use clap::builder::FalseyValueParser;
use clap::{Args, ValueEnum};
use tokio::signal::unix::{SignalKind, signal};

use super::store_location::{Password, StoreArgs};
use super::traces;

#[derive(Debug, Args)]
pub struct Serve {
    /// Address to listen on; port 0 picks a free one.
    #[arg(long, env = "BALLAST_LISTEN", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Another address for only /livez, /readyz, /health, /metrics, /audit and the description; clients of the first
    /// address cannot use up its connections.
    #[arg(long, env = "BALLAST_OPERATIONS_LISTEN")]
    operations_listen: Option<SocketAddr>,
    #[command(flatten)]
    tls: TlsArgs,
    /// Host names the service answers to besides its own while it needs no key, separated by commas.
    #[arg(long = "host", env = "BALLAST_HOSTS", value_delimiter = ',')]
    hosts: Vec<String>,
    /// Hosts that webhooks may reach at private addresses and without encryption, separated by commas; others must be
    /// public and encrypted.
    #[arg(long = "webhook-allow", env = "BALLAST_WEBHOOK_ALLOW", value_delimiter = ',')]
    webhook_allow: Vec<String>,
    #[command(flatten)]
    mail: MailArgs,
    #[command(flatten)]
    store: StoreArgs,
    /// Listen on an address that others reach even while the store holds no key.
    #[arg(long, env = "BALLAST_ALLOW_ANONYMOUS", value_parser = FalseyValueParser::new())]
    allow_anonymous: bool,
    /// Do not start while the store holds no key, as if its folder were lost or its database rolled back. A folder that
    /// ever had keys always needs them.
    #[arg(long, env = "BALLAST_REQUIRE_KEYS", value_parser = FalseyValueParser::new())]
    require_keys: bool,
    /// Role of this replica.
    #[arg(long, env = "BALLAST_ROLE", value_enum, default_value_t = ProcessRoleName::All)]
    role: ProcessRoleName,
    /// Lease of a job: one whose worker has been silent this long is taken over by another.
    #[arg(long, env = "BALLAST_LEASE_SECONDS", default_value_t = 30, value_parser = clap::value_parser!(u16).range(1..=3600))]
    lease_seconds: u16,
    /// Seconds between a stop signal and the end of accepting. Meanwhile the service is not ready but still answers,
    /// until load balancers have noticed.
    #[arg(long, env = "BALLAST_DRAIN_DELAY", default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=600))]
    drain_delay: u16,
    /// Training threads, at the lowest priority. Default: every core.
    #[arg(long, env = "BALLAST_TRAINING_THREADS", value_parser = clap::value_parser!(u16).range(1..=1024))]
    training_threads: Option<u16>,
    /// The most memory to use, as in 4GB or 512MiB. Default: 80 % of the container's limit, of the address space's or
    /// of the machine's memory, whichever is least.
    #[arg(long, env = "BALLAST_MEMORY_LIMIT", value_parser = str::parse::<ByteSize>)]
    memory_limit: Option<ByteSize>,
    #[command(flatten)]
    limits: LimitArgs,
    #[command(flatten)]
    audit: AuditArgs,
    #[command(flatten)]
    quotas: QuotaArgs,
}

/// Retention of the audit.
#[derive(Debug, Args)]
struct AuditArgs {
    /// Days that an entry of the audit is kept.
    #[arg(long, env = "BALLAST_AUDIT_DAYS", default_value_t = 400, value_parser = clap::value_parser!(u16).range(1..))]
    audit_days: u16,
    /// Changes that one key may make within these days; 0: any number. Their entries are kept, so further changes are
    /// refused.
    #[arg(long, env = "BALLAST_AUDIT_ENTRIES", default_value_t = Quotas::default().audit_entries)]
    audit_entries: u32,
}

/// Quotas and retention of one tenant.
#[derive(Debug, Args)]
struct QuotaArgs {
    /// Queued jobs of one tenant; 0: any number.
    #[arg(long, env = "BALLAST_QUOTA_QUEUED_JOBS", default_value_t = Quotas::default().queued_jobs)]
    quota_queued_jobs: u32,
    /// Sessions of one tenant; 0: any number.
    #[arg(long, env = "BALLAST_QUOTA_SESSIONS", default_value_t = Quotas::default().sessions)]
    quota_sessions: u32,
    /// Bytes of one tenant's requests, reports, policies and sessions; 0: any number.
    #[arg(long, env = "BALLAST_QUOTA_BYTES", default_value_t = Quotas::default().bytes)]
    quota_bytes: u64,
    /// Days after which ended jobs are deleted, with their reports and idempotency keys; 0: never.
    #[arg(long, env = "BALLAST_RETAIN_JOBS_DAYS", default_value_t = 30)]
    retain_jobs_days: u16,
}

/// Encryption of connections.
#[derive(Debug, Args)]
struct TlsArgs {
    /// Certificate chain in PEM: connections are encrypted by TLS 1.2 or 1.3. Read again when it changes.
    #[arg(long, env = "BALLAST_TLS_CERT", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Its private key, in PEM.
    #[arg(long, env = "BALLAST_TLS_KEY", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Listen on an address that others reach without encryption: a proxy in front encrypts.
    #[arg(long, env = "BALLAST_ALLOW_PLAINTEXT", value_parser = FalseyValueParser::new())]
    allow_plaintext: bool,
}

/// E-mails about events.
#[derive(Debug, Args)]
struct MailArgs {
    /// Mail server by which people are told of events: smtps://user:password@host:465, or
    /// smtp://user:password@host:587?tls=required for STARTTLS. smtp://host:25 is not encrypted.
    #[arg(long, env = "BALLAST_SMTP", hide_env_values = true, requires = "mail_from")]
    smtp: Option<Password>,
    /// Address that these e-mails come from.
    #[arg(long, env = "BALLAST_MAIL_FROM", requires = "smtp")]
    mail_from: Option<String>,
}

/// Rate limits of one tenant.
#[derive(Debug, Args)]
struct LimitArgs {
    /// Advice, observations, and sessions opened or deleted, per second and tenant; 0: any number.
    #[arg(long, env = "BALLAST_RATE_LIVE", default_value_t = 50_000)]
    rate_live: u32,
    /// Robust steps solved on request, jobs queued, and policies imported or drawn, per second and tenant; 0: any number.
    #[arg(long, env = "BALLAST_RATE_HEAVY", default_value_t = 500)]
    rate_heavy: u32,
    /// Other calls, per second and tenant; 0: any number.
    #[arg(long, env = "BALLAST_RATE_READ", default_value_t = 10_000)]
    rate_read: u32,
    /// Concurrent calls of the heavy class; a tenant gets half.
    #[arg(long, env = "BALLAST_HEAVY_CALLS", default_value_t = 64, value_parser = clap::value_parser!(u16).range(1..))]
    heavy_calls: u16,
    /// Open event streams of one tenant.
    #[arg(long, env = "BALLAST_STREAMS", default_value_t = 256, value_parser = clap::value_parser!(u16).range(1..))]
    streams: u16,
    /// Open connections, as far as the process may open files.
    #[arg(long, env = "BALLAST_CONNECTIONS", default_value_t = 4096, value_parser = clap::value_parser!(u32).range(1..))]
    connections: u32,
    /// Open connections of one address; a quarter of all unless given. Set it to all of them behind a proxy.
    #[arg(long, env = "BALLAST_CONNECTIONS_PER_ADDRESS", value_parser = clap::value_parser!(u32).range(1..))]
    connections_per_address: Option<u32>,
}

/// [`Role`] as the command line names it.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum ProcessRoleName {
    /// Answer requests and run jobs.
    All,
    /// Answer requests.
    Api,
    /// Run jobs.
    Worker,
}

impl From<ProcessRoleName> for Role {
    fn from(name: ProcessRoleName) -> Self {
        match name {
            ProcessRoleName::All => Role::All,
            ProcessRoleName::Api => Role::Api,
            ProcessRoleName::Worker => Role::Worker,
        }
    }
}

/// Exit code if the store failed: an input or output error, by `sysexits.h`.
const STORE_FAILED: i32 = 74;
/// Exit code if a second signal cuts the drain short: that of a process ended by SIGTERM.
const ASKED_TWICE: i32 = 143;

pub async fn run(arguments: Serve) -> Result<(), Box<dyn std::error::Error>> {
    let traces = traces::start()?;
    let mut config = Config { listen: arguments.listen, ..Config::new("") };
    config.store = arguments.store.location()?;
    (config.allow_anonymous, config.require_keys) = (arguments.allow_anonymous, arguments.require_keys);
    let limits = arguments.limits;
    config.limits = Limits::new([limits.rate_live, limits.rate_heavy, limits.rate_read], limits.heavy_calls.into());
    config.retain_audit = DAY * arguments.audit.audit_days.into();
    let quotas = arguments.quotas;
    config.quotas = Quotas {
        queued_jobs: quotas.quota_queued_jobs,
        sessions: quotas.quota_sessions,
        bytes: quotas.quota_bytes,
        audit_entries: arguments.audit.audit_entries,
    };
    config.retain_jobs = (quotas.retain_jobs_days > 0).then(|| DAY * quotas.retain_jobs_days.into());
    config.limits.streams_of_one = limits.streams.into();
    config.connection_limit = limits.connections as usize;
    config.connections_of_address = limits.connections_per_address.map(|most| most as usize);
    config.operations_listen = arguments.operations_listen;
    let TlsArgs { tls_cert, tls_key, allow_plaintext } = arguments.tls;
    config.tls = tls_cert.zip(tls_key).map(|(certificate, key)| TlsFiles { certificate, key });
    (config.allow_plaintext, config.hosts) = (allow_plaintext, arguments.hosts);
    config.webhooks.allowed = arguments.webhook_allow;
    let MailArgs { smtp, mail_from } = arguments.mail;
    config.webhooks.mail = smtp.zip(mail_from).map(|(Password(url), from)| MailServer::new(&url, &from)).transpose()?;
    config.role = arguments.role.into();
    config.lease = Duration::from_secs(arguments.lease_seconds.into());
    config.training_threads = arguments.training_threads.map_or(config.training_threads, usize::from);
    config.memory_limit =
        arguments.memory_limit.map_or(config.memory_limit, |ByteSize(bytes)| MemoryLimit::chosen(bytes));
    let shutdown = Shutdown::new();
    let (mut terminate, mut interrupt) = (signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?);
    let (delay, signalled) = (Duration::from_secs(arguments.drain_delay.into()), shutdown.clone());
    tokio::spawn(async move {
        let mut stop_signal = async || {
            tokio::select! {
                _ = terminate.recv() => {}
                _ = interrupt.recv() => {}
            }
        };
        stop_signal().await;
        signalled.announce();
        let drained = async {
            tokio::time::sleep(delay).await;
            signalled.begin();
            std::future::pending::<()>().await;
        };
        // A second signal ends the process at once.
        tokio::select! {
            () = drained => {}
            () = stop_signal() => std::process::exit(ASKED_TWICE),
        }
    });
    let running = http::serve(config, shutdown).await?;
    let mut addresses = format!("listening on {}://{}\n", running.scheme, running.address);
    if let Some(address) = running.operations {
        addresses += &format!("for operators on {}://{address}\n", running.scheme);
    }
    // An error is ignored: nobody has to read this line, and the log has it also.
    let _ = std::io::stdout().write_all(addresses.as_bytes());
    if let Err(error) = running.ended().await {
        tracing::error!(error = &error as &dyn std::error::Error, "the store failed; exiting");
        std::process::exit(STORE_FAILED);
    }
    traces.end().await;
    Ok(())
}
