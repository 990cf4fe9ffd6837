//! Limits of the machine itself, independent of the service.

use std::error::Error;
use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use std::process::Command;

use super::stored;

/// A page of SQLite.
const PAGE: [u8; 4096] = [7; 4096];
/// Number of pages after which the file is written from its start again, as a checkpointed log is.
const PAGES: usize = 1000;

/// Returns how many pages per second can be written and synced, one after the other, to a file in `folder`.
///
/// # Errors
/// The file cannot be made, written or synced.
pub fn syncs_per_second(folder: &Path, time: Duration) -> io::Result<f64> {
    let path = folder.join("syncs");
    let mut file = File::create(&path)?;
    let started = Instant::now();
    let mut syncs = 0;
    while started.elapsed() < time {
        if syncs % PAGES == 0 {
            file.rewind()?;
        }
        file.write_all(&PAGE)?;
        file.sync_data()?;
        syncs += 1;
    }
    let rate = syncs as f64 / started.elapsed().as_secs_f64();
    std::fs::remove_file(path)?;
    Ok(rate)
}

/// Connections of one replica to its database, and of `pgbench` instead.
pub const CONNECTIONS: usize = 10;
/// Table with rows of the size of an observation's, under keys as random as a session's name.
const TABLE: &str =
    "CREATE TABLE ballast_loadtest (session TEXT, period BIGINT, row TEXT, PRIMARY KEY (session, period))";
const INSERT: &str = "INSERT INTO ballast_loadtest VALUES (md5(random()::text), 1, repeat('x', 560));\n";
const DROP: &str = "DROP TABLE IF EXISTS ballast_loadtest";

/// Returns how many rows per second `pgbench` inserts, each in its own transaction; `None` if it is not installed.
///
/// # Errors
/// The database cannot be reached, or `pgbench` fails.
pub async fn inserts_per_second(folder: &Path, store: &str, time: Duration) -> Result<Option<f64>, Box<dyn Error>> {
    let Some(pgbench) = pgbench() else { return Ok(None) };
    let script = folder.join("pgbench.sql");
    std::fs::write(&script, INSERT)?;
    stored::execute(store, DROP).await?;
    stored::execute(store, TABLE).await?;
    let (connections, seconds) = (CONNECTIONS.to_string(), time.as_secs().max(1).to_string());
    let mut command = Command::new(pgbench);
    command.args(["--no-vacuum", "--protocol=prepared", "--client", &connections, "--time", &seconds, "--file"]);
    let output = command.arg(&script).arg(store).output()?;
    stored::execute(store, DROP).await?;
    let output_text = String::from_utf8_lossy(&output.stdout);
    let rate =
        output_text.lines().find_map(|line| line.strip_prefix("tps = ")?.split_whitespace().next()?.parse().ok());
    match rate {
        Some(rate) => Ok(Some(rate)),
        None => Err(format!("pgbench: {output_text}{}", String::from_utf8_lossy(&output.stderr)).into()),
    }
}

/// Finds `pgbench` in the newest of Debian's versions, or else on the path.
fn pgbench() -> Option<PathBuf> {
    let versions = std::fs::read_dir("/usr/lib/postgresql").into_iter().flatten();
    let mut folders: Vec<PathBuf> = versions.filter_map(|entry| Some(entry.ok()?.path().join("bin"))).collect();
    folders.sort();
    folders.reverse();
    folders.extend(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()));
    folders.into_iter().map(|folder| folder.join("pgbench")).find(|program| program.exists())
}
