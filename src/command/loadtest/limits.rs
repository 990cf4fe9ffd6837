//! What the machine itself does, whoever asks.

use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// A page of SQLite.
const PAGE: [u8; 4096] = [7; 4096];
/// The file is written from its start again after so many pages: a log that is checkpointed.
const PAGES: usize = 1000;

/// Pages written and synced a second, one after the other, to a file in `folder`.
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
