//! `ballast check`: checks that a store holds what was written.

use std::path::PathBuf;

use ballast::service::process::config::StoreLocation;
use ballast::store::Inspection;
use clap::Args;

use super::store_location::StoreArgs;

#[derive(Debug, Args)]
pub struct Check {
    #[command(flatten)]
    store: StoreArgs,
    /// A file made by `ballast backup`, instead of a store.
    #[arg(long, conflicts_with_all = ["data", "store"])]
    backup: Option<PathBuf>,
}

/// Checks the store or the backup.
///
/// # Errors
/// The number of damaged objects, or what prevented the check.
pub async fn run(arguments: Check) -> Result<(), Box<dyn std::error::Error>> {
    let inspection = match (arguments.backup, arguments.store.location()?) {
        (Some(file), _) => Inspection::of_backup(&file).await?,
        (None, StoreLocation::Folder(folder)) => Inspection::of_folder(&folder).await?,
        (None, StoreLocation::Postgres(url)) => Inspection::of_database(&url).await?,
    };
    inspection.run(&mut |sound| println!("{sound}")).await?;
    println!("sound");
    Ok(())
}
