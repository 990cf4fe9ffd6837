//! One memory budget for the process in bytes, and the part that each use may take.
//!
//! The limit is divided once, at the start: jobs, what is cached, what is being prepared for the cache, live sessions,
//! and the process itself with its connections. No part takes from another. So a training never evicts what sessions
//! need, and sessions never end a training.

use std::fmt;
use std::fs;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use metrics::gauge;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::control::cache::{Cache, CachePart};
use crate::control::error::FieldError;
use crate::control::estimate::Footprint;
use crate::service::error::ServiceError;
use crate::service::metrics as names;

/// Parts of the limit, in eighths. Preparation for the cache has half as much as the cache, as in [`Cache`].
const EIGHTHS_FOR_JOBS: usize = 3;
const EIGHTHS_KEPT: usize = 2;
const EIGHTHS_FOR_SESSIONS: usize = 1;
/// Share of the system's memory to take by default: the rest is for the kernel and for others.
const PERCENT_TAKEN: u64 = 80;
/// Divisor of the limit for large answers together: half of the process's own part, because bodies have the other half.
const PART_FOR_ANSWERS: usize = 16;
/// An answer is held twice while it is read: by the store's engine and by the service.
const COPIES_OF_AN_ANSWER: usize = 2;
/// How long a large answer waits for others before its caller is told to retry later.
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// Bytes of one permit of a semaphore, because permits are counted in 32 bits. Answers up to this size are not counted;
/// the connection limit bounds them.
pub const UNIT: usize = 1 << 16;

/// The origin of a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    Chosen,
    /// The limit of the process's control group.
    Container,
    /// The limit of its address space.
    AddressSpace,
    Machine,
    /// The system gives no limit.
    Unknown,
}

/// The most memory the process should take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryLimit {
    pub bytes: usize,
    pub origin: Origin,
}

/// Assumed if the system does not say how much memory there is.
const UNKNOWN_BYTES: u64 = 2 << 30;

impl MemoryLimit {
    pub fn chosen(bytes: usize) -> Self {
        MemoryLimit { bytes, origin: Origin::Chosen }
    }

    /// Returns 80 % of the least that the container, the address space or the machine gives.
    pub fn of_the_system() -> Self {
        let found = [
            (Origin::Container, container_limit()),
            (Origin::AddressSpace, address_space_limit()),
            (Origin::Machine, machine_memory()),
        ];
        let known = found.into_iter().filter_map(|(origin, bytes)| Some((origin, bytes?)));
        let (origin, bytes) = known.min_by_key(|(_, bytes)| *bytes).unwrap_or((Origin::Unknown, UNKNOWN_BYTES));
        let share = bytes / 100 * PERCENT_TAKEN;
        MemoryLimit { bytes: usize::try_from(share).unwrap_or(usize::MAX), origin }
    }
}

impl fmt::Display for MemoryLimit {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = |of: &str| format!("{PERCENT_TAKEN} % of {of}");
        let origin = match self.origin {
            Origin::Chosen => "as chosen".into(),
            Origin::Container => share("the container's limit"),
            Origin::AddressSpace => share("the limit of the address space"),
            Origin::Machine => share("the machine's memory"),
            Origin::Unknown => share("2 GB, because the system reports no limit"),
        };
        write!(formatter, "{}, {origin}", ByteSize(self.bytes))
    }
}

/// A number of bytes, as people write it: `900MB`, `1.5GiB`, `4g`, or bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ByteSize(pub usize);

impl fmt::Display for ByteSize {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 as f64 {
            bytes if bytes < 1e9 => write!(formatter, "{:.1} MB", bytes / 1e6),
            bytes => write!(formatter, "{:.2} GB", bytes / 1e9),
        }
    }
}

impl FromStr for ByteSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let rule = || format!("'{text}' is not a size: write a number with B, kB, MB, GB, KiB, MiB or GiB");
        let text_of_unit = text.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
        let number: f64 = text[..text.len() - text_of_unit.len()].parse().map_err(|_| rule())?;
        let unit = match text_of_unit.trim().to_ascii_lowercase().as_str() {
            "" | "b" => 1.0,
            "k" | "kb" => 1e3,
            "m" | "mb" => 1e6,
            "g" | "gb" => 1e9,
            "kib" => 1024.0,
            "mib" => 1024.0 * 1024.0,
            "gib" => 1024.0 * 1024.0 * 1024.0,
            _ => return Err(rule()),
        };
        Ok(ByteSize((number * unit) as usize))
    }
}

/// The budget; clones share it.
#[derive(Clone)]
pub struct Memory {
    limit: MemoryLimit,
    kept: Cache,
    jobs: Arc<Semaphore>,
    /// Permits of that semaphore when no job runs.
    permits: usize,
    answers: Arc<Semaphore>,
    /// Permits of that semaphore when no large answer is sent.
    answer_permits: usize,
}

/// Bytes reserved by a job or an answer, released on drop.
pub struct Reserved(OwnedSemaphorePermit);

impl Reserved {
    /// Keeps only what `bytes` take, once they are known; `None` if they are too few to be counted.
    pub fn only(self, bytes: usize) -> Option<Self> {
        let Reserved(mut permits) = self;
        let needed = if bytes <= UNIT { 0 } else { bytes.div_ceil(UNIT) };
        match permits.num_permits().saturating_sub(needed) {
            0 => Some(Reserved(permits)),
            _ => permits.split(needed).filter(|_| needed > 0).map(Reserved),
        }
    }
}

impl Memory {
    pub fn new(limit: MemoryLimit) -> Self {
        let permits = (eighths(limit, EIGHTHS_FOR_JOBS) / UNIT).min(Semaphore::MAX_PERMITS);
        let kept = Cache::new(eighths(limit, EIGHTHS_KEPT));
        let answer_permits = (limit.bytes / PART_FOR_ANSWERS / UNIT).clamp(1, u32::MAX as usize);
        let [jobs, answers] = [permits, answer_permits].map(|permits| Arc::new(Semaphore::new(permits)));
        Memory { limit, kept, jobs, permits, answers, answer_permits }
    }

    /// Returns the cache of what is kept ready for requests.
    pub fn kept(&self) -> Cache {
        self.kept.clone()
    }

    /// Returns the bytes for running jobs.
    pub fn for_jobs(&self) -> usize {
        eighths(self.limit, EIGHTHS_FOR_JOBS)
    }

    /// Returns the bytes for sessions in memory.
    pub fn for_sessions(&self) -> usize {
        eighths(self.limit, EIGHTHS_FOR_SESSIONS)
    }

    /// Checks that a job of this estimate can ever run here.
    ///
    /// # Errors
    /// The field that needs most memory, with the estimate and the limit.
    pub fn admits(&self, estimate: &Footprint) -> Result<(), FieldError> {
        refuse_above(self.for_jobs(), "the job", estimate)
    }

    /// Checks that each of these can be kept ready for requests.
    ///
    /// # Errors
    /// The field that needs most memory, with the estimate and the limit.
    pub fn keeps(&self, things: &[Footprint]) -> Result<(), FieldError> {
        things.iter().try_for_each(|thing| refuse_above(self.kept.heaviest(), "one of its parts", thing))
    }

    /// Waits until the other jobs of this process leave room for a job.
    pub(in crate::service) async fn reserve(&self, estimate: &Footprint) -> Result<Reserved, ServiceError> {
        self.admits(estimate)?;
        let permits = u32::try_from(estimate.bytes() / UNIT).unwrap_or(u32::MAX);
        let permits = self.jobs.clone().acquire_many_owned(permits).await.map_err(ServiceError::internal)?;
        Ok(Reserved(permits))
    }

    /// Waits until the other large answers leave room for so many bytes. An answer larger than all the room gets it
    /// alone.
    ///
    /// # Errors
    /// There is no room within [`LONGEST_WAIT`].
    pub(in crate::service) async fn answers(&self, bytes: usize) -> Result<Option<Reserved>, ServiceError> {
        if bytes <= UNIT {
            return Ok(None);
        }
        let permits = (COPIES_OF_AN_ANSWER * bytes).div_ceil(UNIT).min(self.answer_permits) as u32;
        let room = tokio::time::timeout(LONGEST_WAIT, self.answers.clone().acquire_many_owned(permits)).await;
        room.map_err(|_| ServiceError::Busy)?.map(Reserved).map(Some).map_err(ServiceError::internal)
    }

    /// Records how much memory each part takes now; `live_sessions` are the bytes of the sessions.
    pub(in crate::service) fn record(&self, live_sessions: usize) {
        gauge!(names::MEMORY, "part" => "live_sessions").set(live_sessions as f64);
        gauge!(names::MEMORY_LIMIT).set(self.limit.bytes as f64);
        let reserved = self.permits.saturating_sub(self.jobs.available_permits()) * UNIT;
        gauge!(names::MEMORY, "part" => "jobs_reserved").set(reserved as f64);
        let sent = self.answer_permits.saturating_sub(self.answers.available_permits()) * UNIT;
        gauge!(names::MEMORY, "part" => "large_answers").set(sent as f64);
        for (part, bytes) in self.kept.bytes() {
            let part = match part {
                CachePart::Bridges => "bridges",
                CachePart::Factors => "factors",
                CachePart::Levels => "levels",
                CachePart::Policies => "prepared_policies",
            };
            gauge!(names::MEMORY, "part" => part).set(bytes as f64);
        }
    }
}

/// A value that takes much memory, with the room reserved until it is dropped or sent.
pub struct Large<T> {
    pub value: T,
    pub room: Option<Reserved>,
}

impl<T> From<T> for Large<T> {
    /// Wraps a small value without a reservation.
    fn from(value: T) -> Self {
        Large { value, room: None }
    }
}

impl<T> Large<T> {
    /// Converts the value to another one that takes as much memory.
    pub fn map<U>(self, make: impl FnOnce(T) -> U) -> Large<U> {
        Large { value: make(self.value), room: self.room }
    }
}

impl fmt::Display for Memory {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (jobs, kept) = (ByteSize(self.for_jobs()), ByteSize(eighths(self.limit, EIGHTHS_KEPT)));
        write!(formatter, "{}: {jobs} for jobs, {kept} kept ready, ", self.limit)?;
        write!(formatter, "{} for live sessions", ByteSize(self.for_sessions()))
    }
}

fn eighths(limit: MemoryLimit, count: usize) -> usize {
    limit.bytes / 8 * count
}

fn refuse_above(limit: usize, what: &str, estimate: &Footprint) -> Result<(), FieldError> {
    if estimate.bytes() <= limit {
        return Ok(());
    }
    let (estimated, limit) = (ByteSize(estimate.bytes()), ByteSize(limit));
    let rule = format!("must be less: {what} would take about {estimated} of memory, and the limit here is {limit}");
    Err(FieldError::new(estimate.field(), estimate.value(), rule))
}

/// Returns the least limit of the control groups above the process, of version 2 or 1.
fn container_limit() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    let limits = groups.lines().filter_map(|line| {
        let mut fields = line.splitn(3, ':').skip(1);
        let (controllers, path) = (fields.next()?, fields.next()?);
        let (root, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            _ if controllers.split(',').any(|name| name == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => return None,
        };
        // Within a container the path may be the host's and absent here; the root is then the container's own.
        let group = Path::new(root).join(path.trim_start_matches('/'));
        group.ancestors().take_while(|above| above.starts_with(root)).filter_map(|at| number(&at.join(file))).min()
    });
    limits.min()
}

/// Returns `None` if there is no limit: the file then reads `max`, which is not a number.
fn number(file: &Path) -> Option<u64> {
    fs::read_to_string(file).ok()?.trim().parse().ok()
}

/// Returns the soft limit of `ulimit -v`.
fn address_space_limit() -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

fn machine_memory() -> Option<u64> {
    let memory = fs::read_to_string("/proc/meminfo").ok()?;
    let line = memory.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kibibytes| kibibytes.saturating_mul(1024))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_as_people_write_them() {
        for (text, bytes) in [
            ("1024", 1024),
            ("900MB", 900_000_000),
            ("1.5 GiB", 3 << 29),
            ("4g", 4_000_000_000),
            ("512MiB", 512 << 20),
            ("64kb", 64_000),
        ] {
            assert_eq!(text.parse(), Ok(ByteSize(bytes)), "{text}");
        }
        for text in ["", "GB", "1 elephant", "-1", "1..2MB", "NaN"] {
            assert!(text.parse::<ByteSize>().unwrap_err().contains("is not a size"), "{text}");
        }
    }

    #[test]
    fn the_system_tells_how_much_there_is() {
        let limit = MemoryLimit::of_the_system();
        assert!(limit.origin != Origin::Unknown && limit.bytes > 16 << 20, "{limit}");
    }

    #[test]
    fn the_parts_leave_the_process_an_eighth() {
        let limit = MemoryLimit::chosen(8 << 30);
        let memory = Memory::new(limit);
        let gigabyte = 1 << 30;
        assert_eq!((memory.for_jobs(), memory.for_sessions()), (3 * gigabyte, gigabyte));
        // The cache has two eighths, no part of it more than half of them, and preparation has one eighth.
        assert_eq!(memory.kept.heaviest(), gigabyte);
        assert_eq!(EIGHTHS_FOR_JOBS + EIGHTHS_KEPT + EIGHTHS_KEPT / 2 + EIGHTHS_FOR_SESSIONS, 7);
    }

    #[tokio::test]
    async fn what_cannot_fit_is_refused_by_name_and_what_fits_waits() {
        let memory = Memory::new(MemoryLimit::chosen(8 << 30));
        let job = |gigabytes: usize| Footprint::of("design.count", 7, gigabytes << 30);
        let refused = memory.reserve(&job(4)).await.err().unwrap().to_string();
        assert!(refused.starts_with("design.count is 7: must be less") && refused.contains("4.29 GB"), "{refused}");
        let first = memory.reserve(&job(2)).await.unwrap();
        let second = job(2);
        let mut waiting = Box::pin(memory.reserve(&second));
        assert!(futures_util::poll!(&mut waiting).is_pending());
        drop(first);
        assert!(futures_util::poll!(&mut waiting).is_ready());
    }
}
