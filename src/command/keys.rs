//! `ballast keys`: who may call a service, kept in its store, whether or not it runs.

use std::io::Write;

use ballast::service::clock::Clock;
use ballast::service::config::StoreLocation;
use ballast::service::keys::{REFRESH, issue};
use ballast::store::{KeyRing, KeyRole, KeyRoles, KeyRow, Tenant};
use clap::{Args, Subcommand, ValueEnum};

use super::store_location::StoreArgs;

#[derive(Debug, Subcommand)]
pub enum Keys {
    /// Make a key and print it, once.
    Create(Create),
    /// List keys: name, tenant, roles, since when, and whether revoked.
    List(List),
    /// Revoke a key for good, by its name.
    Revoke(Revoke),
}

#[derive(Debug, Args)]
pub struct Create {
    /// Whose jobs, policies and sessions its holder sees and makes.
    #[arg(long, default_value_t)]
    tenant: Tenant,
    /// What its holder may do; may be given several times.
    #[arg(long = "role", value_enum, required = true)]
    roles: Vec<RoleName>,
    #[command(flatten)]
    store: StoreArgs,
}

#[derive(Debug, Args)]
pub struct List {
    #[command(flatten)]
    store: StoreArgs,
}

#[derive(Debug, Args)]
pub struct Revoke {
    /// As `list` shows it: key_...
    key: String,
    #[command(flatten)]
    store: StoreArgs,
}

/// [`KeyRole`] as the command line names it.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum RoleName {
    /// Everything that changes nothing.
    Read,
    /// Open, advance and delete sessions.
    Operate,
    /// Queue and cancel jobs, import and delete policies.
    Train,
    /// All of it, and /health and /metrics.
    Admin,
}

impl From<RoleName> for KeyRole {
    fn from(name: RoleName) -> Self {
        match name {
            RoleName::Read => KeyRole::Read,
            RoleName::Operate => KeyRole::Operate,
            RoleName::Train => KeyRole::Train,
            RoleName::Admin => KeyRole::Admin,
        }
    }
}

/// # Errors
/// The store is not reached, or there is no such key.
pub async fn run(keys: Keys) -> Result<(), Box<dyn std::error::Error>> {
    match keys {
        Keys::Create(arguments) => create(arguments).await,
        Keys::List(arguments) => list(arguments).await,
        Keys::Revoke(arguments) => revoke(arguments).await,
    }
}

async fn open(store: StoreArgs) -> Result<KeyRing, Box<dyn std::error::Error>> {
    Ok(match store.location()? {
        StoreLocation::Folder(folder) => KeyRing::open(&folder).await?,
        StoreLocation::Postgres(url) => KeyRing::connect(&url).await?,
    })
}

async fn create(arguments: Create) -> Result<(), Box<dyn std::error::Error>> {
    let roles = KeyRoles::new(arguments.roles.into_iter().map(KeyRole::from).collect())?;
    let ring = open(arguments.store).await?;
    let (key, secret) = issue(&ring, arguments.tenant.clone(), roles.clone(), &Clock::system()).await?;
    ring.close().await;
    eprintln!("{key}, tenant {}, roles {roles}; this is the only time its text is shown:", arguments.tenant);
    // Alone on standard output, so that a program can take it from there.
    writeln!(std::io::stdout(), "{}", secret.reveal())?;
    Ok(())
}

async fn list(arguments: List) -> Result<(), Box<dyn std::error::Error>> {
    let ring = open(arguments.store).await?;
    let rows = ring.list().await?;
    ring.close().await;
    let mut out = std::io::stdout().lock();
    writeln!(out, "key\ttenant\troles\tcreated_ms\trevoked_ms")?;
    for KeyRow { key, tenant, roles, created_ms, revoked_ms, .. } in rows {
        let revoked = revoked_ms.map_or("-".to_owned(), |revoked| revoked.to_string());
        writeln!(out, "{key}\t{tenant}\t{roles}\t{created_ms}\t{revoked}")?;
    }
    Ok(())
}

async fn revoke(arguments: Revoke) -> Result<(), Box<dyn std::error::Error>> {
    let ring = open(arguments.store).await?;
    let found = ring.revoke(&arguments.key, Clock::system().now_milliseconds()).await?;
    ring.close().await;
    if !found {
        return Err(format!("there is no key '{}'", arguments.key).into());
    }
    eprintln!("revoked; a running service turns it away within {} ms", REFRESH.as_millis());
    Ok(())
}
