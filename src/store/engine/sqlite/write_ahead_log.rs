//! Checks the write-ahead log before SQLite reads it, for damage that hides commits.
//!
//! SQLite treats the first frame whose checksum fails as the end of the log. This is right after a crash, because the
//! last commit may be torn. It is wrong if the disk changed a byte: every later commit would vanish silently, and a
//! session would be advised from a state it has long left. What follows the frame distinguishes the two. Each commit is
//! on the disk before the next begins, so a crash leaves at most one commit after a failing frame, and more mean
//! damage. Damage to the last two commits is not detected.
//!
//! The format is SQLite's, <https://www.sqlite.org/fileformat2.html#walformat>; a log is read in one pass.

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read};
use std::path::Path;

use thiserror::Error;

const HEAD_BYTES: usize = 32;
const FRAME_HEAD_BYTES: usize = 24;
const MAGIC: u32 = 0x377f_0682;
/// The page sizes that SQLite allows.
const PAGE_BYTES: std::ops::RangeInclusive<usize> = 512..=65_536;

/// The damaged part of a log.
#[derive(Debug, PartialEq, Eq, Error)]
pub(super) enum LogDamage {
    /// The head, which is written and fsynced before the first frame.
    #[error("the head of the write-ahead log")]
    Head,
    /// A frame, counted from 0, that is followed by commits.
    #[error("frame {0} of the write-ahead log")]
    Frame(usize),
}

/// Returns the damage of a log, if there is any.
///
/// # Errors
/// Fails if the file cannot be read.
pub(super) fn damage(path: &Path) -> std::io::Result<Option<LogDamage>> {
    match File::open(path) {
        Ok(file) => damage_in(BufReader::new(file)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

fn damage_in(mut log: impl Read) -> std::io::Result<Option<LogDamage>> {
    let mut head = [0; HEAD_BYTES];
    if !filled(&mut log, &mut head)? {
        return Ok(None);
    }
    let Some(mut chain) = ChecksumChain::start(&head) else {
        // Nothing follows the head, so it was still being written.
        return Ok(filled(&mut log, &mut [0])?.then_some(LogDamage::Head));
    };
    let mut frame = vec![0; FRAME_HEAD_BYTES + chain.page_bytes];
    let (mut failed, mut commits, mut number) = (None, 0, 0);
    while filled(&mut log, &mut frame)? {
        if failed.is_none() && !chain.continues_with(&frame) {
            failed = Some(number);
        }
        commits += usize::from(failed.is_some() && chain.is_commit(&frame));
        number += 1;
    }
    Ok(failed.filter(|_| commits > 1).map(LogDamage::Frame))
}

/// Fills `bytes` from the log; returns false if there are too few.
fn filled(log: &mut impl Read, bytes: &mut [u8]) -> std::io::Result<bool> {
    match log.read_exact(bytes) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// The running checksum of a log: each frame's checksum continues the one before.
struct ChecksumChain {
    /// The byte order of the checksum's words.
    word: fn([u8; 4]) -> u32,
    page_bytes: usize,
    /// The salt in the head and in every frame; a log that was restarted has another.
    salt: [u8; 8],
    sum: [u32; 2],
}

impl ChecksumChain {
    /// Reads the head; returns `None` if it is invalid.
    fn start(head: &[u8; HEAD_BYTES]) -> Option<ChecksumChain> {
        let magic = big_endian(head, 0);
        let word = if magic & 1 == 0 { u32::from_le_bytes } else { u32::from_be_bytes };
        let page_bytes = usize::try_from(big_endian(head, 8)).ok().filter(|bytes| PAGE_BYTES.contains(bytes))?;
        let mut salt = [0; 8];
        salt.copy_from_slice(&head[16..24]);
        let mut chain = ChecksumChain { word, page_bytes, salt, sum: [0; 2] };
        chain.add(&head[..24]);
        (magic & !1 == MAGIC && chain.sum == [big_endian(head, 24), big_endian(head, 28)]).then_some(chain)
    }

    fn add(&mut self, bytes: &[u8]) {
        let [mut first, mut second] = self.sum;
        let (words, _) = bytes.as_chunks::<4>();
        for pair in words.chunks_exact(2) {
            first = first.wrapping_add((self.word)(pair[0])).wrapping_add(second);
            second = second.wrapping_add((self.word)(pair[1])).wrapping_add(first);
        }
        self.sum = [first, second];
    }

    fn continues_with(&mut self, frame: &[u8]) -> bool {
        self.add(&frame[..8]);
        self.add(&frame[FRAME_HEAD_BYTES..]);
        frame[8..16] == self.salt && self.sum == [big_endian(frame, 16), big_endian(frame, 20)]
    }

    /// Returns whether the frame claims to end a commit of this log.
    fn is_commit(&self, frame: &[u8]) -> bool {
        frame[8..16] == self.salt && big_endian(frame, 4) > 0
    }
}

fn big_endian(bytes: &[u8], at: usize) -> u32 {
    u32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

#[cfg(test)]
mod tests {
    use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode};
    use sqlx::{ConnectOptions, Connection};

    use super::*;

    /// A log that SQLite wrote: a table, then five commits of one row.
    async fn log() -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("database");
        let options = SqliteConnectOptions::new().filename(&file).create_if_missing(true);
        let mut connection = options.journal_mode(SqliteJournalMode::Wal).connect().await.unwrap();
        sqlx::query("CREATE TABLE rows (number INTEGER)").execute(&mut connection).await.unwrap();
        for _ in 0..5 {
            sqlx::query("INSERT INTO rows VALUES (1)").execute(&mut connection).await.unwrap();
        }
        let log = std::fs::read(folder.path().join("database-wal")).unwrap();
        connection.close().await.unwrap();
        log
    }

    fn damage_of(log: &[u8]) -> Option<LogDamage> {
        damage_in(log).unwrap()
    }

    #[tokio::test]
    async fn a_changed_byte_is_found_wherever_it_hides_two_commits_and_a_torn_end_is_none() {
        let log = log().await;
        let frame = FRAME_HEAD_BYTES + usize::try_from(big_endian(&log, 8)).unwrap();
        let frames = (log.len() - HEAD_BYTES) / frame;
        assert!(frames >= 7 && damage_of(&log).is_none());
        for at in 0..HEAD_BYTES {
            let mut changed = log.clone();
            changed[at] ^= 1;
            // The number of the format (bytes 4 to 8) is summed like the rest.
            assert_eq!(damage_of(&changed), Some(LogDamage::Head), "byte {at}");
        }
        for number in 0..frames {
            for at in [0, 4, 8, 16, FRAME_HEAD_BYTES, frame - 1] {
                let mut changed = log.clone();
                changed[HEAD_BYTES + number * frame + at] ^= 1;
                let found = damage_of(&changed);
                let hidden = frames - 1 - number;
                assert!(hidden < 2 || found == Some(LogDamage::Frame(number)), "frame {number}, byte {at}: {found:?}");
                assert!(hidden > 0 || found.is_none(), "the last commit may be torn");
            }
        }
        for end in 0..log.len() {
            assert_eq!(damage_of(&log[..end]), None, "cut after {end} bytes");
        }
    }
}
