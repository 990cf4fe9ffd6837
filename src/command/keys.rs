//! `ballast keys`: the keys that may call a service, kept in its store, whether or not it runs.

use std::io::Write;
use std::time::Duration;

use ballast::control::error::FieldError;
use ballast::service::callers::keys::{REFRESH, Secret, issue, rotate};
use ballast::service::process::clock::Clock;
use ballast::service::process::config::StoreLocation;
use ballast::store::{KeyRing, KeyRole, KeyRoles, KeyRow, StoredKeys, Tenant};
use clap::{Args, Subcommand, ValueEnum};

use super::moments;
use super::store_location::StoreArgs;

#[derive(Debug, Subcommand)]
pub enum KeysCommand {
    /// Make a key and print it, once.
    Create(Create),
    /// Make a key that replaces another, which stays valid for a while, and print it, once.
    Rotate(RotateCommand),
    /// List keys: name, tenant, roles, creation, expiry, and whether revoked.
    List(List),
    /// Revoke a key for good, by its name.
    Revoke(Revoke),
}

#[derive(Debug, Args)]
pub struct Create {
    /// Tenant whose jobs, policies and sessions the key's holder sees and makes.
    #[arg(long, default_value_t)]
    tenant: Tenant,
    /// Roles of the key; may be given several times.
    #[arg(long = "role", value_enum, required = true)]
    roles: Vec<KeyRoleName>,
    #[command(flatten)]
    expiry: Expiry,
    #[command(flatten)]
    store: StoreArgs,
    /// Make the folder's database also, before the first start of its service.
    #[arg(long)]
    new: bool,
}

/// Expiry of a new key.
#[derive(Debug, Args)]
#[group(multiple = false)]
struct Expiry {
    /// Length of validity, as 90d or 12h.
    #[arg(long, value_name = "TIME", value_parser = moments::length)]
    expires_in: Option<Duration>,
    /// Valid until the start of this day (UTC), as 2027-01-31, or until this moment, as 2027-01-31T12:00:00Z.
    #[arg(long, value_name = "DAY", value_parser = moments::moment)]
    expires_on: Option<i64>,
}

impl Expiry {
    fn milliseconds(&self, now_ms: i64) -> Result<Option<i64>, FieldError> {
        let after = |time: Duration| now_ms.saturating_add(i64::try_from(time.as_millis()).unwrap_or(i64::MAX));
        let expires_ms = self.expires_on.or(self.expires_in.map(after));
        match expires_ms.filter(|expires_ms| *expires_ms <= now_ms) {
            Some(past) => Err(FieldError::new("--expires-on", moments::shown(Some(past)), "must lie ahead")),
            None => Ok(expires_ms),
        }
    }
}

#[derive(Debug, Args)]
pub struct RotateCommand {
    /// Name of the key, as `list` shows it: key_...
    key: String,
    /// The old key expires after this time.
    #[arg(long, value_name = "TIME", default_value = "1d", value_parser = moments::length)]
    overlap: Duration,
    /// Expiry of the new key; unless given, it is valid for as long as the old one was made for.
    #[command(flatten)]
    expiry: Expiry,
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
    /// Name of the key, as `list` shows it: key_...
    key: String,
    #[command(flatten)]
    store: StoreArgs,
}

/// [`KeyRole`] as the command line names it.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum KeyRoleName {
    /// Everything that changes nothing.
    Read,
    /// Open, advance and delete sessions.
    Operate,
    /// Queue and cancel jobs, import and delete policies.
    Train,
    /// All of these, and /health and /metrics.
    Admin,
}

impl From<KeyRoleName> for KeyRole {
    fn from(name: KeyRoleName) -> Self {
        match name {
            KeyRoleName::Read => KeyRole::Read,
            KeyRoleName::Operate => KeyRole::Operate,
            KeyRoleName::Train => KeyRole::Train,
            KeyRoleName::Admin => KeyRole::Admin,
        }
    }
}

/// Runs the subcommand.
///
/// # Errors
/// The store is not reached, or there is no such key.
pub async fn run(keys: KeysCommand) -> Result<(), Box<dyn std::error::Error>> {
    match keys {
        KeysCommand::Create(arguments) => create(arguments).await,
        KeysCommand::Rotate(arguments) => replace(arguments).await,
        KeysCommand::List(arguments) => list(arguments).await,
        KeysCommand::Revoke(arguments) => revoke(arguments).await,
    }
}

/// Opens the keys of an existing store: a wrong folder is reported, and nothing is made in it.
pub(super) async fn open(store: StoreArgs) -> Result<KeyRing, Box<dyn std::error::Error>> {
    Ok(match store.location()? {
        StoreLocation::Folder(folder) => KeyRing::open_existing(&folder).await?,
        StoreLocation::Postgres(url) => KeyRing::connect(&url).await?,
    })
}

/// Opens the keys of a store, which is made if there is none.
async fn open_new(store: StoreArgs) -> Result<KeyRing, Box<dyn std::error::Error>> {
    match store.location()? {
        StoreLocation::Folder(folder) => Ok(KeyRing::open(&folder).await?),
        StoreLocation::Postgres(url) => Ok(KeyRing::connect(&url).await?),
    }
}

async fn create(arguments: Create) -> Result<(), Box<dyn std::error::Error>> {
    let roles = KeyRoles::new(arguments.roles.into_iter().map(KeyRole::from).collect())?;
    let ring = if arguments.new { open_new(arguments.store).await? } else { open(arguments.store).await? };
    let clock = Clock::system();
    let expires_ms = arguments.expiry.milliseconds(clock.now_milliseconds())?;
    let (key, secret) = issue(&ring, arguments.tenant.clone(), roles.clone(), expires_ms, &clock).await?;
    ring.close().await;
    eprintln!("{key}, tenant {}, roles {roles}{}", arguments.tenant, until(expires_ms));
    reveal(&secret)
}

async fn replace(arguments: RotateCommand) -> Result<(), Box<dyn std::error::Error>> {
    let (ring, clock) = (open(arguments.store).await?, Clock::system());
    let expires_ms = arguments.expiry.milliseconds(clock.now_milliseconds())?;
    let rotated = rotate(&ring, &arguments.key, arguments.overlap, expires_ms, &clock).await?;
    ring.close().await;
    let (old, new, secret) = (&rotated.old, &rotated.new, &rotated.secret);
    eprintln!("{}, tenant {}, roles {}{}", new.key, new.tenant, new.roles, until(new.expires_ms));
    eprintln!("{}{}", old.key, until(old.expires_ms));
    reveal(secret)
}

fn until(expires_ms: Option<i64>) -> String {
    expires_ms.map_or(String::new(), |_| format!(", in force until {}", moments::shown(expires_ms)))
}

/// Prints the secret alone on standard output, so that a program can read it.
fn reveal(secret: &Secret) -> Result<(), Box<dyn std::error::Error>> {
    eprintln!("this is the only time its text is shown:");
    writeln!(std::io::stdout(), "{}", secret.reveal())?;
    Ok(())
}

async fn list(arguments: List) -> Result<(), Box<dyn std::error::Error>> {
    let ring = open(arguments.store).await?;
    let StoredKeys { sound, damaged } = ring.list().await?;
    ring.close().await;
    let mut out = std::io::stdout().lock();
    writeln!(out, "key\ttenant\troles\tcreated\texpires\trevoked")?;
    for KeyRow { key, tenant, roles, created_ms, expires_ms, revoked_ms, .. } in sound {
        let [created, expires, revoked] = [Some(created_ms), expires_ms, revoked_ms].map(moments::shown);
        writeln!(out, "{key}\t{tenant}\t{roles}\t{created}\t{expires}\t{revoked}")?;
    }
    for what in damaged {
        writeln!(out, "{what} is damaged and gives no access; ballast repair restores it")?;
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
    eprintln!("revoked; a running service rejects it within {} ms", REFRESH.as_millis());
    Ok(())
}
