//! `ballast backup` and `ballast restore`: a folder's database as one verified file, and back; `ballast move`: into
//! PostgreSQL.

use std::path::PathBuf;

use ballast::service::process::clock::Clock;
use ballast::service::process::config::StoreLocation;
use ballast::store::{self, Damage};
use clap::Args;

use super::store_location::{Password, StoreArgs};

#[derive(Debug, Args)]
pub struct Backup {
    #[command(flatten)]
    store: StoreArgs,
    /// The file to write; it must not exist.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    damage: DamageArgs,
}

/// Treatment of damaged objects.
#[derive(Debug, Args)]
struct DamageArgs {
    /// Continue past damaged objects, which are reported and copied as they are.
    #[arg(long)]
    skip_damaged: bool,
}

impl From<DamageArgs> for Damage {
    fn from(arguments: DamageArgs) -> Self {
        if arguments.skip_damaged { Damage::Skipped } else { Damage::Refused }
    }
}

#[derive(Debug, Args)]
pub struct RepairCommand {
    /// A session, a policy or a key, as `check` and the log name it; or `totals`, which are recomputed.
    thing: String,
    /// A file made by `ballast backup` while the object was sound.
    #[arg(long)]
    from: Option<PathBuf>,
    #[command(flatten)]
    store: StoreArgs,
}

#[derive(Debug, Args)]
pub struct Restore {
    /// A file made by `ballast backup`.
    #[arg(long)]
    from: PathBuf,
    /// `--data` names the folder to make; it must not hold a database.
    #[command(flatten)]
    store: StoreArgs,
    #[command(flatten)]
    damage: DamageArgs,
}

#[derive(Debug, Args)]
pub struct MoveCommand {
    /// The folder of a stopped service; it is not changed.
    #[arg(long)]
    from: PathBuf,
    /// The PostgreSQL database to move to, which has no rows: postgres://user:password@host:port/database.
    #[arg(long, env = "BALLAST_STORE", hide_env_values = true)]
    store: Password,
}

/// Moves the database of a folder to PostgreSQL.
///
/// # Errors
/// A process holds the folder, an object in it is damaged, or the database has rows or is not reached.
pub async fn relocate(arguments: MoveCommand) -> Result<(), Box<dyn std::error::Error>> {
    store::relocate(&arguments.from, &arguments.store.url()?, &mut |line| println!("{line}")).await?;
    println!("moved, and sound; from now on start the service with --store, never on {}", arguments.from.display());
    Ok(())
}

/// Writes the database of a folder to a backup file.
///
/// # Errors
/// The store is PostgreSQL, the file exists, or the database, its copy or the disk is damaged.
pub async fn run(arguments: Backup) -> Result<(), Box<dyn std::error::Error>> {
    let StoreLocation::Folder(folder) = arguments.store.location()? else {
        return Err("PostgreSQL is backed up by its own pg_dump --format=custom (docs/operating.md)".into());
    };
    let mut report = DamageReport::default();
    store::backup(&folder, &arguments.out, arguments.damage.into(), &mut |line| report.tell(&line)).await?;
    println!("{}, and on the disk as {}", report.verdict(), arguments.out.display());
    Ok(())
}

/// Restores a folder from a backup file.
///
/// # Errors
/// The store is PostgreSQL, the folder holds a database, or the backup or the disk is damaged.
pub async fn restore(arguments: Restore) -> Result<(), Box<dyn std::error::Error>> {
    let StoreLocation::Folder(folder) = arguments.store.location()? else {
        return Err("PostgreSQL is restored by its own pg_restore (docs/operating.md)".into());
    };
    let mut report = DamageReport::default();
    store::restore(&arguments.from, &folder, arguments.damage.into(), &mut |line| report.tell(&line)).await?;
    println!("{}, and on the disk in {}", report.verdict(), folder.display());
    Ok(())
}

/// Repairs one object of a folder's database.
///
/// # Errors
/// The store is PostgreSQL, a process holds the folder, or the backup lacks what would make the object sound.
pub async fn repair(arguments: RepairCommand) -> Result<(), Box<dyn std::error::Error>> {
    let StoreLocation::Folder(folder) = arguments.store.location()? else {
        return Err("PostgreSQL is repaired by its own tools (docs/operating.md)".into());
    };
    let thing = match (arguments.thing.as_str(), &arguments.from) {
        ("totals", None) => store::Repair::Totals,
        ("totals", Some(_)) => return Err("totals are recomputed and are in no backup: leave out --from".into()),
        (_, None) => return Err("--from is missing: name a backup in which the object is sound".into()),
        (name, Some(from)) => store::Repair::Thing { name, from },
    };
    let rows = store::repair(&folder, thing, Clock::system().now_milliseconds()).await?;
    println!("{} is sound: {rows} rows were repaired", arguments.thing);
    Ok(())
}

/// Prints lines, and counts the damaged objects among them.
#[derive(Default)]
struct DamageReport {
    damaged: usize,
}

impl DamageReport {
    fn tell(&mut self, line: &str) {
        self.damaged += usize::from(line.starts_with("damaged: "));
        println!("{line}");
    }

    fn verdict(&self) -> String {
        if self.damaged == 0 { "sound".to_owned() } else { format!("with {} damaged things", self.damaged) }
    }
}
