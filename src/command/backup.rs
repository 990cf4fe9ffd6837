//! `ballast backup` and `ballast restore`: a folder's database as one verified file, and back.

use std::path::PathBuf;

use ballast::service::config::StoreLocation;
use ballast::store;
use clap::Args;

use super::store_location::StoreArgs;

#[derive(Debug, Args)]
pub struct Backup {
    #[command(flatten)]
    store: StoreArgs,
    /// The file to write; it may not exist.
    #[arg(long)]
    out: PathBuf,
}

#[derive(Debug, Args)]
pub struct Restore {
    /// A file made by `ballast backup`.
    #[arg(long)]
    from: PathBuf,
    /// `--data` names the folder to make; it may not hold a database.
    #[command(flatten)]
    store: StoreArgs,
}

/// # Errors
/// The store is PostgreSQL, the file exists, or the database, its copy or the disk is damaged.
pub async fn run(arguments: Backup) -> Result<(), Box<dyn std::error::Error>> {
    let StoreLocation::Folder(folder) = arguments.store.location()? else {
        return Err("PostgreSQL is backed up by its own pg_dump --format=custom (docs/operating.md)".into());
    };
    store::backup(&folder, &arguments.out, &mut |sound| println!("{sound}")).await?;
    println!("sound, and on the disk as {}", arguments.out.display());
    Ok(())
}

/// # Errors
/// The store is PostgreSQL, the folder holds a database, or the backup or the disk is damaged.
pub async fn restore(arguments: Restore) -> Result<(), Box<dyn std::error::Error>> {
    let StoreLocation::Folder(folder) = arguments.store.location()? else {
        return Err("PostgreSQL is restored by its own pg_restore (docs/operating.md)".into());
    };
    store::restore(&arguments.from, &folder, &mut |sound| println!("{sound}")).await?;
    println!("sound, and on the disk in {}", folder.display());
    Ok(())
}
